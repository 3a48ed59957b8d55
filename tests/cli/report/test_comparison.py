"""Models next to each other, from artifacts with known numbers."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cpfls_cli
from cpfls_cli import store
from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.pages.comparison import differences
from cpfls_cli.report.source import unique_labels
from cpfls_cli.store import read
from tests.builders.evidence_artifacts import curves, steps, verdict
from tests.builders.identified_models import EVIDENCE_PARTS, with_parts
from tests.builders.vehicle_models import vehicle_of, whole, write_vehicle


@pytest.fixture(scope="module")
def bare(pipeline):
    """A model without evidence, and where it comes from."""
    given, origin = read(pipeline.model, IdentifiedModel)
    return with_parts(given, dict.fromkeys((*EVIDENCE_PARTS, "ridge"))), origin


@pytest.fixture
def write(bare, tmp_path):
    """Write a model whose errors are scaled, with another flight or another config where that is asked for."""

    def make(name, scale=(1.0, 1.0, 1.0), flight=None, config=None, **data):
        given, origin = bare
        mse = given.judged.mse.copy()
        mse[given.judged.models.index("model")] *= np.square(scale)
        if flight:
            inputs = {role: replace(file, sha256=flight) for role, file in origin.inputs.items() if role == "flight"}
            origin = replace(origin, inputs={**origin.inputs, **inputs})
        if config:
            assert config[0] in origin.config
            origin = replace(origin, config=origin.config.replace(*config))
        store.write(tmp_path / name, with_parts(given, {"judged/mse": mse, **data}), origin)
        return tmp_path / name

    return make


@pytest.fixture
def compared(cpfls, study, tmp_path):
    def call(*models):
        output = cpfls.made("report", study, *models, "--force", at=tmp_path / "report.json")
        page = json.loads(output.read_text(encoding="utf-8"))
        names = [section["name"] for section in page["sections"]]
        return names, next((part["blocks"] for part in page["sections"] if part["name"] == "comparison"), [])

    return call


def parsed(cell):
    """Read the number before the bracket, as it is written for people."""
    return float(cell.split(" (")[0].replace(" × 10", "e").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")))


def unfolded(blocks):
    return [inner for block in blocks for inner in (unfolded(block["blocks"]) if "blocks" in block else [block])]


def table(blocks, first, place=0):
    """Find a table by the name of its first column, the first or a later one of that name."""
    tables = [block for block in blocks if block["kind"] == "table" and block["header"][0] == first]
    return tables[place]


def test_one_model_is_compared_with_nothing(compared, write):
    names, _ = compared(write("one.h5"))
    assert "comparison" not in names


def test_two_models_stand_right_after_the_summary_and_the_best_of_each_column_is_marked(compared, write):
    names, blocks = compared(write("one.h5"), write("two.h5", (0.5, 2.0, 1.0)))
    assert names[:2] == ["summary", "comparison"]
    by_axis = table(blocks, "Model", 1)
    for place in (0, 1):
        assert [row[0] for row in table(blocks, "Model", place)["rows"]] == ["one.h5", "two.h5", "rigid body"]
    column = {title.split(",")[0]: place for place, title in enumerate(by_axis["header"])}
    shown = {axis: [row[column[axis]] for row in by_axis["rows"]] for axis in ("roll", "pitch", "yaw")}
    rigid_wins = all("◂" in cells[2] for cells in shown.values())
    assert rigid_wins, "the flight is simulated without noise by a rigid body"
    one, two = (parsed(shown["roll"][row]) for row in (0, 1))
    assert two == pytest.approx(one / 2, rel=1e-2)
    marked = {(mark["row"], mark["column"]) for mark in by_axis["marked"]}
    assert marked == {
        (row, place) for row, cells in enumerate(by_axis["rows"]) for place, cell in enumerate(cells) if "◂" in cell
    }


def test_among_models_the_smaller_error_is_marked(compared, write, bare):
    mse = bare[0].judged.mse.copy()
    mse[bare[0].judged.models.index("rigid-body")] = 1.0
    paths = []
    for name, scale in (("one.h5", (1.0, 4.0, 1.0)), ("two.h5", (4.0, 1.0, 1.0))):
        own = mse.copy()
        own[bare[0].judged.models.index("model")] *= np.square(scale)
        paths.append(write(name, **{"judged/mse": own}))
    rows = table(compared(*paths)[1], "Model", 1)["rows"]
    places = range(1, 4)
    assert [["◂" in row[place] for place in places] for row in rows] == [
        [True, False, True],
        [False, True, True],
        [False, False, False],
    ]


def test_models_of_different_flights_are_not_ranked(compared, write):
    _, blocks = compared(write("one.h5"), write("two.h5", flight="f" * 64))
    texts = " ".join(block["text"] for block in blocks if block["kind"] == "text")
    assert texts.startswith("Judged on different flights, so the errors cannot be ranked: ")
    assert "one.h5 on training" in texts
    assert "two.h5 on training (sha256 ffffffffffff)" in texts
    assert "Model" not in [block["header"][0] for block in blocks if block["kind"] == "table"]
    assert not [block for block in blocks if block["kind"] == "figure"]


def test_a_flight_of_another_name_with_equal_content_is_the_same_flight(compared, write):
    path = write("two.h5")
    given, origin = read(path, IdentifiedModel)
    flight = origin.inputs["flight"]
    renamed = {**origin.inputs, "flight": InputFile("other.h5", flight.sha256, flight.format)}
    store.write(path, given, replace(origin, inputs=renamed))
    _, blocks = compared(write("one.h5"), path)
    assert len(table(blocks, "Model")["rows"]) == 3


def test_another_split_of_one_flight_is_other_data(compared, write):
    _, blocks = compared(write("one.h5"), write("two.h5", config=("training_share: 1.0", "training_share: 0.9")))
    assert any("cannot be ranked" in block.get("text", "") for block in blocks)
    assert table(blocks, "Key")["rows"] == [["identification.training_share", "1.0", "0.9"]]


def test_rigid_bodies_that_differ_are_distinguished_by_their_models(compared, write, bare):
    mse = bare[0].judged.mse.copy()
    mse[bare[0].judged.models.index("rigid-body")] = 1.0
    _, blocks = compared(write("one.h5"), write("two.h5", **{"judged/mse": mse}))
    names = ["one.h5", "two.h5", "rigid body of one.h5", "rigid body of two.h5"]
    assert [row[0] for row in table(blocks, "Model")["rows"]] == names


def test_what_only_rounding_separates_is_marked_alike(compared, write):
    _, blocks = compared(write("one.h5", (1e-14, 1e-14, 1e-14)), write("two.h5", (3e-14, 3e-14, 3e-14)))
    assert all("◂" in cell for row in table(blocks, "Model", 1)["rows"] for cell in row[1:])


def figure_of(name, *paths):
    first, *others = map(cpfls_cli.read, paths)
    return first.figures(*others)[name]


def test_an_error_of_rounding_is_drawn_at_zero_and_leaves_the_others_their_scale(write, bare):
    mse = bare[0].judged.mse.copy()
    mse[bare[0].judged.models.index("rigid-body")] = 1e-32
    two = mse.copy()
    two[bare[0].judged.models.index("model")] *= 1.21
    paths = write("one.h5", **{"judged/mse": mse}), write("two.h5", **{"judged/mse": two})
    curves = figure_of("comparison-errors", *paths).axes[0].lines
    assert [own.get_label() for own in curves] == ["one.h5", "two.h5", "rigid body of one.h5", "rigid body of two.h5"]
    one, other, *rigid = (own.get_xdata() for own in curves)
    assert other[0] == pytest.approx(1.1 * one[0], rel=1e-3)
    assert list(map(list, rigid)) == [[0.0], [0.0]]


def test_each_model_is_summarised_after_the_comparison(compared, write):
    names, _ = compared(write("one.h5"), write("two.h5"))
    assert "comparison" not in names, "equal files count once"
    names, _ = compared(write("one.h5"), write("two.h5", (2.0, 1.0, 1.0)))
    assert names[:4] == ["summary", "comparison", "identify", "identify-2"]


def test_equal_configs_are_called_equal(compared, write):
    _, blocks = compared(write("one.h5"), write("two.h5", (2.0, 1.0, 1.0)))
    assert any("Nothing: the same config" in block.get("text", "") for block in blocks)


def test_inertia_curves_and_verdicts_stand_side_by_side(compared, write):
    own = {path: values for path, values in curves().items() if path.startswith("curves/")}
    models = [write(name, **own, **verdict(label)) for name, label in (("one.h5", "do-not-use"), ("two.h5", "new"))]
    _, blocks = compared(*models, write("bare.h5", (3.0, 1.0, 1.0)))
    assert [block["name"] for block in blocks if block["kind"] == "figure"] == [
        "comparison-errors",
        "comparison-curves-1",
        "comparison-curves-2",
    ]
    labels = figure_of("comparison-curves-1", *models).axes[0].get_legend_handles_labels()[1]
    assert {"one.h5", "two.h5", "rigid body", "95 % band of one.h5", "95 % band of two.h5"} == set(labels)
    assert [row[1] for row in table(blocks, "Model")["rows"]] == ["do not use", "new", "not judged", ""]


def test_differences_are_found_at_every_depth_and_long_values_are_cut():
    first = {"a": {"b": 1, "c": {"d": None}}, "report": {"title": "x"}, "same": [1]}
    second = {"a": {"b": True, "c": {"d": "y" * 99}}, "report": {"title": "z"}, "same": [1], "new": 2}
    found = dict(differences([first, second]))
    assert (set(found), found["a.b"], found["a.c.d"][0]) == ({"a.b", "a.c.d", "new"}, ["1", "true"], "null")
    assert (len(found["a.c.d"][1]), found["new"]) == (60, ["not there", "2"])


@pytest.mark.parametrize(("above", "marks"), [(1.0 + 1e-9, [True, True, False]), (1.01, [True, False, False])])
def test_predictors_that_are_equal_are_both_the_least(cpfls, study, write, tmp_path, above, marks):
    own = steps()
    own["steps/attitude"][1] = above * own["steps/attitude"][0]
    path, output = write("one.h5", **own), tmp_path / "steps.json"
    cpfls.done("report", study, path, "-o", output)
    page = json.loads(output.read_text(encoding="utf-8"))
    blocks = unfolded(next(part["blocks"] for part in page["sections"] if part["name"] == "identify"))
    assert ["◂" in row[3] for row in table(blocks, "Horizon")["rows"][:3]] == marks


@pytest.mark.parametrize("same", [True, False])
def test_a_model_that_is_the_rigid_body_hides_its_line_and_the_caption_says_so(cpfls, study, write, tmp_path, same):
    own = {path: values for path, values in curves().items() if path.startswith("curves/")}
    own["curves/inertia"] = own["curves/rigid_body"] * (1.0 + 1e-12) if same else own["curves/inertia"]
    output = cpfls.made("report", study, write("one.h5", **own), at=tmp_path / "curves.json")
    page = json.loads(output.read_text(encoding="utf-8"))
    blocks = unfolded(next(part["blocks"] for part in page["sections"] if part["name"] == "identify"))
    caption = next(block for block in blocks if block.get("name") == "identify-1-inertia-curves-1")["caption"]
    assert ("the grey line lies under its own" in caption) == same
    assert "what the structure does, not what the vehicle does" in caption
    assert "a band need not hold the truth" in caption


def test_vehicles_of_equal_file_names_are_called_by_their_folders(cpfls, study, tmp_path):
    vehicle = vehicle_of(whole())
    paths = [tmp_path / folder / "vehicle.h5" for folder in ("still", "gusty")]
    for path, factor in zip(paths, (1.0, 2.0), strict=True):
        path.parent.mkdir()
        numbers = (
            each._replace(**{name: factor * getattr(each, name) for name in ("value", "low", "high")})
            for each in vehicle.numbers
        )
        write_vehicle(path, replace(vehicle, numbers=tuple(numbers)))
    output = tmp_path / "report.html"
    *_, one, two, differ = cpfls.done("report", study, *paths, "-o", output).stdout.splitlines()
    assert [line.split()[0] for line in (one, two)] == ["still/vehicle.h5", "gusty/vehicle.h5"]
    assert differ == "differ beyond both intervals: Ixx"
    page = output.read_text(encoding="utf-8")
    assert re.search(r"<th[^>]*>Differ</th>", page)
    assert "still/vehicle.h5" in page
    same = cpfls("report", study, paths[0], "-o", tmp_path / "one.html").stdout.splitlines()
    assert same[-1].startswith("vehicle.h5 ")


def test_labels_take_as_many_folders_as_tell_files_apart():
    paths = [Path(name) for name in ("/a/x/v.h5", "/b/x/v.h5", "/b/x/../m.h5", "n.h5")]
    assert unique_labels(paths) == ["a/x/v.h5", "b/x/v.h5", "m.h5", "n.h5"]
