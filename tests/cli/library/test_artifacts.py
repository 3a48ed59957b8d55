"""The library: artifacts and models read, and models evaluated."""

import json
import shutil
import sys
from dataclasses import asdict, replace
from itertools import pairwise

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

import cpfls_cli
from cpfls_cli import store
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.errors import InputError
from cpfls_cli.playback.model import ModelEffect
from cpfls_cli.stages.info import formats
from cpfls_cli.store import read
from tests.builders import vehicle_models
from tests.builders.artifacts import edited
from tests.builders.exported_vehicles import flat, on_numpy
from tests.builders.identified_models import write_changed
from tests.builders.playback_flights import STATED
from tests.builders.results import craft, drawn
from tests.builders.studies import put_file

PERIOD = 0.01
HOVER = np.sqrt(vehicle_models.QUAD.mass_kg * 9.81 / sum(r.thrust_factor_n_s2 for r in vehicle_models.QUAD.rotors))


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
    report = cpfls("report", study, pipeline.flight, pipeline.model, "-o", tmp_path / "r.md", "--json")
    figures = flight.figures(model)
    assert list(figures) == json.loads(report.stdout)["figures"]
    with matplotlib.rc_context({"font.size": 30}):
        drawn = figures["simulate-1-torque"]
    assert isinstance(drawn, Figure)
    assert [axes.get_title(loc) for axes in drawn.axes for loc in ("left", "right") if axes.get_title(loc)]
    assert drawn.axes[0].yaxis.label.get_size() == 9.5
    assert len(drawn.axes[0].lines[0].get_xdata()) == len(flight["time"])


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A vehicle with every part that a model can have."""
    path = tmp_path_factory.mktemp("library") / "vehicle.h5"
    vehicle_models.write_vehicle(path, vehicle_models.vehicle_of(vehicle_models.whole()))
    return cpfls_cli.load_model(path)


@pytest.fixture
def speeds():
    return HOVER * np.random.default_rng(4).uniform(0.8, 1.2, (60, 4))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_prediction_is_that_of_the_model_and_is_held_against_the_flight(pipeline):
    model, flight = cpfls_cli.load_model(pipeline.model), cpfls_cli.read(pipeline.flight)
    found = model.predict(flight)
    judged = read(pipeline.model, IdentifiedModel)[0].judged
    np.testing.assert_allclose(found.score.mse, judged.of_axes("mse", "model", "training"))
    assert found.score.worst_relative_error == pytest.approx(judged.worst("model", "training")[0])
    np.testing.assert_allclose(found.error, flight["torque"] - found.torque)
    np.testing.assert_allclose(found.inertia, found.inertia.swapaxes(1, 2))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_replay_is_what_the_command_writes(cpfls, pipeline, study, tmp_path):
    model, flight = cpfls_cli.load_model(pipeline.model), cpfls_cli.read(pipeline.flight)
    options = ("--horizon", "0.3", "--every", "40", "--hold", "previous")
    cpfls("replay", study, pipeline.model, pipeline.flight, "-o", tmp_path / "command.h5", *options)
    model.replay(flight, horizon_s=0.3, every=40, hold="previous").write(tmp_path / "replay.h5")
    assert (tmp_path / "replay.h5").read_bytes() == (tmp_path / "command.h5").read_bytes()


def test_what_a_command_notes_is_a_warning_of_the_caller(pipeline, tmp_path):
    unjudged = tmp_path / "unjudged.h5"
    write_changed(pipeline.model, unjudged, verdict=None)
    model = cpfls_cli.load_model(unjudged)
    with pytest.warns(UserWarning, match="has no verdict") as warned:
        model.predict(pipeline.flight)
    with pytest.warns(UserWarning, match="holds no verdict") as exported:
        model.to_c(tmp_path / "m.c")
    assert {each.filename for each in (*warned, *exported)} == {__file__}


@pytest.mark.parametrize("hold", ["linear", "previous"])
def test_a_vehicle_flies_as_its_export_does(whole, speeds, tmp_path, hold):
    (file,) = whole.to_jax(tmp_path / "uav.py")
    uav = on_numpy(file.read_text())
    begin = whole.state((0, 0, 1), (1, -2, 0.5), (0.2, -0.3, 1.0), (0.5, 0.1, -0.4))
    flown = whole.fly(begin, speeds, PERIOD, hold)
    memory, state = uav["rotors_begin"](speeds[0], PERIOD), flat(begin)[0]
    for now, following in pairwise(speeds):
        memory, terms = uav["rotors_step"](memory, now, following, PERIOD, hold == "previous")
        state = uav["step"](state, terms, PERIOD)
    assert len(flown.rate) == len(speeds)
    np.testing.assert_allclose(flat(flown)[-1], state, rtol=1e-10, atol=1e-10)
    after = uav["step"](flat(begin)[0], uav["steady"](speeds[0]), PERIOD)
    np.testing.assert_allclose(flat(whole.step(begin, speeds[0], PERIOD))[0], after, rtol=1e-12, atol=1e-12)


def test_commands_of_a_log_are_not_late_twice(whole, speeds, tmp_path):
    """Held from sample to sample they are half a sample late, which those of an autopilot are not."""
    own = replace(vehicle_models.whole(), commanded=True, held_s=PERIOD, full_voltage=1.0)
    vehicle_models.write_vehicle(tmp_path / "commands.h5", vehicle_models.vehicle_of(own))
    model, begin = cpfls_cli.load_model(tmp_path / "commands.h5"), whole.state((0, 0, 1))
    as_fitted = whole.fly(begin, speeds, PERIOD)
    np.testing.assert_array_equal(model.fly(begin, speeds, PERIOD, logged=True).rate, as_fitted.rate)
    assert np.abs(model.fly(begin, speeds, PERIOD).rate - as_fitted.rate).max() > 1e-3


def test_many_vehicles_step_side_by_side(whole, speeds):
    rolls = np.linspace(-0.5, 0.5, 7)[:, None] * [1.0, 0.0, 0.0]
    together = whole.step(whole.state(attitude=rolls), speeds[:7], PERIOD)
    for index, roll in enumerate(rolls):
        for one, all_ in zip(whole.step(whole.state(attitude=roll), speeds[index], PERIOD), together, strict=True):
            np.testing.assert_allclose(one[0], all_[index], rtol=1e-12, atol=1e-12)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_an_identified_model_flies_as_it_is_played_back(pipeline):
    """The errors of its windows are those of a free run from the same sample."""
    model, flight = cpfls_cli.load_model(pipeline.model), cpfls_cli.read(pipeline.flight)
    replay = model.replay(flight, horizon_s=0.5, every=100)
    time, rates = flight["time"], replay["drawn/model"][0]
    first = int(np.argmin(np.abs(time - replay["drawn/start_s"][0])))
    rows = slice(first, first + len(rates))
    begin = model.state(*(flight[name][first] for name in ("position", "velocity", "attitude", "body_rate")))
    flown = model.fly(begin, flight["rotor_speed"][rows], time[1] - time[0], hold="linear")
    np.testing.assert_allclose(flown.rate, rates, atol=1e-9)


def test_a_stated_vehicle_falls_and_hovers(tmp_path):
    vehicle = cpfls_cli.stated_vehicle(put_file(tmp_path / "study.yaml", json.dumps({"vehicle": asdict(STATED)})))
    fallen = vehicle.fly(vehicle.state(), np.zeros((11, 4)), 0.1)
    np.testing.assert_allclose(fallen.position[-1], [0, 0, -9.81 / 2], atol=1e-12)
    hover = np.sqrt(STATED.mass_kg * 9.81 / sum(r.thrust_factor_n_s2 for r in STATED.rotors))
    still = vehicle.fly(vehicle.state(), np.full((11, 4), hover), 0.1)
    np.testing.assert_allclose(still.position[-1], 0, atol=1e-12)
    for task in (lambda: vehicle.predict("flight.h5"), lambda: vehicle.to_c(tmp_path / "v.c")):
        with pytest.raises(InputError, match="a stated vehicle takes replay, step and fly"):
            task()


def test_every_form_of_an_export_is_a_method(cpfls, whole, tmp_path):
    assert {f"to_{form}" for form in whole.formats} <= set(dir(whole))
    assert "c" in whole.formats
    cpfls("export", whole.artifact.path, "-o", tmp_path / "uav.c")
    expected = [(tmp_path / name).read_bytes() for name in ("uav.h", "uav.c")]
    with pytest.raises(InputError, match="exists already"):
        whole.to_c(tmp_path / "uav.c")
    files = whole.to_c(tmp_path / "uav.c", force=True)
    assert [file.read_bytes() for file in files] == expected
    with pytest.raises(AttributeError, match="to_fortran"):
        whole.to_fortran("uav.f90")


def test_what_cannot_be_done_is_said(whole, pipeline, tmp_path):
    with pytest.raises(InputError, match=r"is a cpfls/flight, not a model; models are made by `cpfls identify`"):
        cpfls_cli.load_model(pipeline.flight)
    with pytest.raises(InputError, match="the last axis is 4 rotors"):
        whole.step(whole.state(), [HOVER] * 6, PERIOD)
    with pytest.raises(InputError, match="fly takes one vehicle, the state holds 3"):
        whole.fly(whole.state(position=np.zeros((3, 3))), [[HOVER] * 4], PERIOD)
    with pytest.raises(InputError, match="at least one flight"):
        whole.replay()
    partial = tmp_path / "partial.h5"
    vehicle_models.write_vehicle(
        partial, vehicle_models.vehicle_of(vehicle_models.whole(effects=(ModelEffect("wind", {}, np.ones(3)),)))
    )
    with pytest.raises(InputError, match="holds wind, which depends on more than the state"):
        cpfls_cli.load_model(partial).step(whole.state(), [HOVER] * 4, PERIOD)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_what_is_in_memory_has_no_file_before_it_is_written(pipeline):
    replay = cpfls_cli.load_model(pipeline.model).replay(pipeline.flight, every=100)
    with pytest.raises(InputError, match="write it first"):
        replay.path  # noqa: B018


def test_commands_run_in_this_process_and_say_what_is_wrong(capsys, pipeline, tmp_path):
    cpfls_cli.run("info", pipeline.model)
    assert ": model.h5: an identified model" in capsys.readouterr().out
    with pytest.raises(cpfls_cli.CpflsError, match=r"cpfls info .*none\.h5: exit code 2"):
        cpfls_cli.run("info", tmp_path / "none.h5")
    assert "none.h5: no such file" in capsys.readouterr().err
