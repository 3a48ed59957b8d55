"""Artifacts in Python: every format as named arrays with units, figures as the report draws them."""

import json
import shutil
import sys

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

import cpfls_cli
from cpfls_cli import store
from cpfls_cli.errors import InputError
from cpfls_cli.stages.info import formats
from tests.builders.artifacts import edited
from tests.builders.results import craft, drawn


@pytest.mark.parametrize("stage", formats(), ids=lambda stage: stage.name)
def test_every_dataset_of_every_format_has_its_values_dimensions_and_unit(stage, tmp_path):
    path = tmp_path / "a.h5"
    store.write(path, drawn(stage.kind, np.random.default_rng(5)), store.Origin(stage=stage.name, config="seed: 1\n"))
    artifact, held = cpfls_cli.read(path), store.flat(path)
    named = artifact.to_xarray()
    assert artifact.format == named.attrs["format"] == stage.kind.FORMAT
    assert list(artifact) == list(held)
    for name, (about, stored) in held.items():
        values = named[name]
        np.testing.assert_array_equal(values, stored)
        assert len(set(values.dims)) == values.ndim
        plain = [label.rpartition("/")[2].removesuffix("_2").removesuffix("_index") for label in values.dims]
        assert plain == list(about.dimensions)
        assert values.attrs == {"units": about.units, "frame": about.frame, "long_name": about.description}
        assert artifact.about(name) == about


def test_a_dimension_of_another_length_in_each_group_is_named_with_its_group(tmp_path):
    store.write(tmp_path / "a.h5", craft(), store.Origin(stage="look"))
    held = store.flat(tmp_path / "a.h5")
    data, specs = ({name: pair[place] for name, pair in held.items()} for place in (1, 0))
    named = cpfls_cli.Artifact(craft(), store.Origin(stage="look"), data, specs).to_xarray()
    for axis, length in {"yaw": 2, "roll": 4}.items():
        assert dict(named[f"curves/{axis}/gain"].sizes) == {f"curves/{axis}/frequency": length, "axis": 3}


def test_columns_are_named_by_axis_and_have_units(pipeline):
    flight = cpfls_cli.read(pipeline.flight)
    frame = flight.to_pandas()
    np.testing.assert_array_equal(frame.index, flight["time"])
    np.testing.assert_array_equal(frame["attitude.pitch"], flight["attitude"][:, 1])
    np.testing.assert_array_equal(frame["rotor_speed.3"], flight["rotor_speed"][:, 3])
    assert frame.attrs["units"]["body_torque.z"] == "N m"
    assert {"position.x", "torque.yaw"} <= set(frame.columns)


def test_another_dimension_counts_where_it_has_no_numbers_of_its_own(pipeline):
    model = cpfls_cli.read(pipeline.model)
    frame = model.to_pandas("rule")
    assert frame.index.name == "rule"
    assert list(frame["rules/name"]) == list(model["rules/name"])
    with pytest.raises(InputError, match=r"no dataset along 'rules'; its dimensions are .*rule"):
        model.to_pandas("rules")


def test_single_values_are_numbers_and_words(pipeline):
    model = cpfls_cli.read(pipeline.model)
    assert model["base"] == "none"
    assert isinstance(model["rank"], int)
    assert model.summary["rank"] == model["rank"] == pipeline.summaries["model"]["rank"]
    assert model.config["identification"]["membership_functions"] == 5
    with pytest.raises(KeyError, match="rang"):
        model["rang"]


def test_a_result_prints_shape_unit_and_meaning_of_every_dataset(pipeline):
    flight = cpfls_cli.read(pipeline.flight)
    lines = {line.split()[0]: " ".join(line.split()) for line in str(flight).splitlines() if line.strip()}
    for name in flight:
        about, shape = flight.about(name), "x".join(map(str, np.shape(flight[name]))) or "scalar"
        assert lines[name] == " ".join(f"{name} {shape} {about.units} {about.description}".split())


def test_it_is_written_again_byte_by_byte_and_never_over_a_file(pipeline, tmp_path):
    flight, copy = cpfls_cli.read(pipeline.flight), tmp_path / "copy.h5"
    flight.write(copy)
    assert copy.read_bytes() == pipeline.flight.read_bytes()
    assert flight.path == copy
    with pytest.raises(InputError, match="exists already"):
        flight.write(copy)
    flight.write(copy, force=True)


def test_what_is_no_good_artifact_is_refused(pipeline, tmp_path):
    path = tmp_path / "bad.h5"
    shutil.copy(pipeline.flight, path)
    with edited(path) as file:
        file["time"][7] = file["time"][6]
    with pytest.raises(InputError, match=r"bad\.h5: time: does not ascend at index 7"):
        cpfls_cli.read(path)
    with pytest.raises(InputError, match="no such file"):
        cpfls_cli.read(tmp_path / "none.h5")


@pytest.mark.parametrize("package", ["xarray", "pandas"])
def test_a_package_that_is_missing_is_named_with_the_command(pipeline, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=rf'needs the package {package}; pip install "cpfls\[notebook\]"'):
        getattr(cpfls_cli.read(pipeline.flight), f"to_{package}")()


def test_figures_are_those_of_the_report(cpfls, pipeline, study, tmp_path):
    flight, model = (cpfls_cli.read(path) for path in (pipeline.flight, pipeline.model))
    given = (pipeline.flight, pipeline.model)
    report = cpfls("report", study, *given, "-o", tmp_path / "r.md", "--json")
    figures = flight.figures(model)
    assert list(figures) == json.loads(report.stdout)["figures"]
    with matplotlib.rc_context({"font.size": 30}):
        drawn = figures["simulate-1-torque"]
    assert isinstance(drawn, Figure)
    assert [axes.get_title(loc) for axes in drawn.axes for loc in ("left", "right") if axes.get_title(loc)]
    assert drawn.axes[0].yaxis.label.get_size() == 9.5
    assert len(drawn.axes[0].lines[0].get_xdata()) == len(flight["time"])
