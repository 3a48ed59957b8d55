"""The report of the gap workflow, from artifacts with known numbers."""

import json
import re
from dataclasses import replace
from html import unescape
from types import SimpleNamespace

import pytest

from cpfls_cli import store
from cpfls_cli.artifacts.diagnosis import Diagnosis, Disagreement, Extended
from cpfls_cli.artifacts.job import input_file
from cpfls_cli.store import Origin
from tests.builders import gap_artifacts as made
from tests.builders.command_line import drawn, run
from tests.builders.studies import VEHICLE

FIGURES = [
    "diagnose-1-free-runs", "diagnose-1-gap-picture", "diagnose-1-gap-sizes", "diagnose-1-playback",
    "diagnose-1-intervals", "compare-1-gap-over-time", "compare-1-dependence",
    "compare-1-heat-map", "compare-1-playback",
]  # fmt: skip

STAGES = {Diagnosis: "diagnose", Disagreement: "compare", Extended: "extend"}


def written(path, given):
    """Write a result that is sound; an extended model as if it came of the diagnosis beside it."""
    assert store.findings(given) == []
    source = path.with_name("diagnosis.h5")
    inputs = {"diagnosis": input_file(source)} if isinstance(given, Extended) and source.exists() else {}
    store.write(path, given, Origin(stage=STAGES[type(given)], seed=1, config="seed: 1\n", inputs=inputs))
    return path


def shown(folder, *artifacts, options=()):
    """Write artifacts and a report about them; give its summary, its HTML and its text."""
    config, output = folder / "study.yaml", folder / "report.html"
    config.write_text("seed: 1\n" + VEHICLE)
    paths = [written(folder / f"{number}.h5", each) for number, each in enumerate(artifacts)]
    result = run("report", config, *paths, "-o", output, "--json", "--force", *options)
    assert result.exit_code == 0, result.output
    html = output.read_text(encoding="utf-8")
    body = re.sub(r"<style>.*?</style>|<svg.*?</svg>", "", html, flags=re.DOTALL)
    text = re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", body)))
    return SimpleNamespace(summary=json.loads(result.stdout), html=html, text=text, paths=paths)


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gap")
    diagnosis = made.diagnosis()
    written(folder / "diagnosis.h5", diagnosis)
    with drawn():
        return shown(folder, made.disagreement(), diagnosis, made.extended())


def test_the_answer_comes_first_and_every_figure_once(full):
    assert full.summary["sections"] == [
        "summary", "diagnose", "extend", "compare", "stated-vehicle", "provenance",
    ]  # fmt: skip
    assert full.summary["figures"] == FIGURES
    assert full.summary["missing"] == []
    first = full.text[: full.text.index("measured and simulated")]
    for words in ("NAMED", "What the model misses is offset of the centre of mass.", made.SENTENCE, "97 % is gone",
                  "Held out : two.csv", "Fitted to : one.csv"):  # fmt: skip
        assert words in first, words
    assert "Where simulation and flight disagree" in full.text
    assert "No model was given" not in full.text


def test_numbers_of_the_artifacts_stand_in_the_tables(full):
    for words in ("0.494", "0.0136", "0.0123", "40 1.1", "70 1.2"):
        assert words in full.text, words
    assert "0.0100 0.0090 … 0.0111 m −0.0600 … 0.0600" in full.text
    assert "< 10⁻⁶" in full.text
    assert "moment of inertia about x 2.1 1.0 … 3.0 %" in full.text
    assert "1.0123" in full.text
    assert "two.csv roll torque 1.0 … 2.0 33.3" in full.text
    for words in ("one.csv: rotor 2 looks saturated", "A note that readers need."):
        assert full.text.count(words) == 1, words
    # The comparison and the diagnosis say both of their own flights.
    for words in ("Fly near the ground.", "12 ms"):
        assert full.text.count(words) == 2, words


def test_the_model_that_runs_away_does_not_flatten_the_picture(full):
    assert "the model as given leaves the figure" in full.text


def test_what_is_lacking_is_left_out_and_said(tmp_path):
    bare = replace(made.diagnosis(force=False), run=None, picture=None, playback=None)
    page = shown(tmp_path, bare)
    assert page.summary["figures"] == ["diagnose-1-gap-sizes", "diagnose-1-intervals"]
    assert page.summary["missing"] == ["disagreement", "extended"]
    assert "too short to simulate" in page.text
    assert "cpfls compare CONFIG FLIGHT" in page.text
    assert "force along" not in page.text[: page.text.index("effects and their coefficients")]


def test_a_disagreement_alone_says_where_and_how_to_go_on(tmp_path):
    page = shown(tmp_path, replace(made.disagreement(force=False), heat_map=None, playback=None))
    assert page.summary["figures"] == ["compare-1-gap-over-time", "compare-1-dependence"]
    assert "The gap is largest in the torque about x (roll): 12.0 noise floors." in page.text
    assert "It follows thrust most." in page.text
    assert "cpfls diagnose" in page.text


def test_an_extended_model_alone_brings_its_figures(tmp_path):
    page = shown(tmp_path, made.extended())
    assert page.summary["figures"] == [
        "extend-1-gap-sizes", "extend-1-playback", "extend-1-intervals",
    ]  # fmt: skip
    assert "the model with offset of the centre of mass" in page.text
    assert "its largest gap is 1.2 noise floors; it was 70" in page.text


def test_a_fault_of_a_sensor_stands_under_sensors(tmp_path):
    finding = ("gyro_bias", 1, 1e-9, "The gyroscope shows 0.01 rad/s at rest.")
    page = shown(tmp_path, made.diagnosis(named=({"name": "gyro_bias", "kind": "sensor"},), **made.audit([finding])))
    assert "SENSOR FAULT" in page.text
    assert "The gyroscope shows 0.01 rad/s at rest. The diagnosis repairs it" in page.text
    assert "Not tested for gyro scale and misaligned IMU: no attitude." in page.text
    assert "without the faults of the sensors" in page.text
