"""What a model is judged on: flights to choose on, evidence, and flights that are too short."""

import json
import os
import signal
import warnings

import h5py
import numpy as np
import pytest

import cpfls_cli
from cpfls_cli import load_model
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.findings import swings
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.report.content import sentence
from cpfls_cli.result import datasets
from cpfls_cli.validation import validate
from tests.builders.identified_models import write_changed
from tests.builders.studies import IDENTIFICATION, LOG_STUDY, VEHICLE

EVIDENCE = ("structures", "residuals", "uncertainty", "curves", "round_trip", "steps", "physics", "verdict")
VALIDATION = [path for path, _ in datasets(IdentifiedModel) if path.split("/")[0] in EVIDENCE]
WORDS = {
    "good-for-control": "Good for control",
    "good-inside-region": "Good inside the region that training visited, and only there",
    "not-better-than-rigid-body": "Not better than the rigid body",
    "do-not-use": "Do not use it",
}
SHORT = {
    "good-for-control": "good for control",
    "good-inside-region": "good inside its region",
    "not-better-than-rigid-body": "no better than a rigid body",
    "do-not-use": "do not use",
}
SIGNS = {1: "For it", -1: "Against it", 0: "To know"}
HELD_OUT = ("--set", "identification.choice=held-out")
SEARCH = ("--set", "identification.generations=2")
BODY_RATE = "    body_rate: {columns: [p, q, r], unit: rad/s}\n"
STUDY = f"{LOG_STUDY}{BODY_RATE}{IDENTIFICATION}  validation: {{enabled: false}}\n"
INERTIA = np.array([0.6, 0.6, 1.2])


@pytest.fixture(scope="module")
def validated(cpfls, study, pipeline, tmp_path_factory):
    """A model of a flight that is judged on its own rest, and what the command printed."""
    output = tmp_path_factory.mktemp("validated") / "model.h5"
    words = ("identify", study, pipeline.flight, "--set", "identification.training_share=0.6", "-o", output)
    text, summary = cpfls(*words, "-v"), cpfls(*words, "--force", "--json")
    assert text.exit_code == summary.exit_code == 0, text.stderr
    return output, text.stdout, json.loads(summary.stdout)


def test_every_dataset_is_there_and_good(validated, cpfls):
    with h5py.File(validated[0]) as file:
        assert not [path for path in VALIDATION if path not in file]
        assert file["judged/vaf"].shape == file["judged/r2"].shape
        assert file["steps/part"][()] == file["residuals/part"][()] == b"held-out rest"
    cpfls.done("check", validated[0])


def test_the_verdict_is_printed_with_its_reasons(validated):
    _, text, summary = validated
    verdict = summary["verdict"]
    assert text.startswith(f"{SHORT[verdict['label']].upper()}: ")
    assert f"\n  {WORDS[verdict['label']]}.\n  Region: {verdict['region']}.\n" in text
    assert summary["trust"] == verdict["label"]
    for reason in verdict["reasons"]:
        assert f"{SIGNS[reason['speaks']]}: {sentence(reason['text'])}" in map(str.strip, text.splitlines())


def unfolded(blocks):
    return [inner for block in blocks for inner in (unfolded(block["blocks"]) if "blocks" in block else [block])]


def test_the_report_shows_the_same_scores_and_the_same_verdict(validated, cpfls, study, tmp_path):
    model, text, _ = validated
    page = cpfls.made("report", study, model, at=tmp_path / "report.json")
    sections = json.loads(page.read_text(encoding="utf-8"))["sections"]
    blocks = [block for section in sections for block in unfolded(section["blocks"])]
    lines = [" ".join(line.split()) for line in text.splitlines()]
    scores = [block["rows"] for block in blocks if block["kind"] == "table" and block["header"][0] == "Judged on"]
    assert len(scores) == 3
    for row in (row for rows in scores for row in rows):
        assert " ".join(" ".join(row).split()) in lines
    box = next(block for block in blocks if block["kind"] == "box")
    assert f"{box['label']}: {box['title']}" in lines
    assert all(sentence in lines for sentence in box["sentences"])


def test_bands_go_with_a_prediction_and_hold_the_model(validated, pipeline):
    found = cpfls_cli.load_model(validated[0]).predict(pipeline.flight)
    for value, (low, high) in ((found.inertia, found.inertia_band), (found.torque, found.torque_band)):
        assert np.all(low <= value)
        assert np.all(value <= high)
        assert np.any(low < high)


def test_without_evidence_a_model_and_its_prediction_are_the_same_but_for_it(
    validated, cpfls, study, pipeline, tmp_path
):
    model = tmp_path / "model.h5"
    words = ("identify", study, pipeline.flight, "--set", "identification.training_share=0.6")
    result = cpfls(*words, "--set", "identification.validation.enabled=false", "-o", model, "--json")
    assert json.loads(result.stdout)["verdict"] is None
    with h5py.File(model) as plain, h5py.File(validated[0]) as whole:
        assert not any(path in plain for path in VALIDATION)
        for name in ("model/fuzzy/coefficients", "weights", "judged/mse", "history/best"):
            np.testing.assert_array_equal(plain[name][()], whole[name][()])
    with pytest.warns(UserWarning, match="has no verdict and no bands"):
        assert cpfls_cli.load_model(model).predict(pipeline.flight).inertia_band is None


def test_an_interrupt_while_evidence_is_gathered_leaves_the_whole_model(
    validated, cpfls, study, pipeline, tmp_path, monkeypatch
):
    def interrupted(*_):
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(validate, "compare_structures", interrupted)
    output = tmp_path / "model.h5"
    words = ("identify", study, pipeline.flight, "--set", "identification.training_share=0.6", "-o", output)
    result = cpfls(*words)
    assert result.exit_code == 130
    assert f"{output}: was found but not judged" in result.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["model.h5", "model.h5.checkpoint"]
    with h5py.File(output) as plain, h5py.File(validated[0]) as whole:
        assert plain["stop_reason"][()] == b"generations"
        assert "verdict/label" not in plain
        np.testing.assert_array_equal(plain["model/fuzzy/coefficients"][()], whole["model/fuzzy/coefficients"][()])
    monkeypatch.undo()
    assert "the same command with --resume judges it\n" in result.stderr
    cpfls.done(*words, "--resume")
    assert output.read_bytes() == validated[0].read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["model.h5"]


def test_use_of_a_model_that_was_judged_unfit_is_said(validated, cpfls, study, pipeline, tmp_path):
    for number, (label, answer) in enumerate((("do-not-use", "do not use"), ("good-for-control", None))):
        model, output = tmp_path / f"{number}.h5", tmp_path / f"replay-{number}.h5"
        write_changed(validated[0], model, verdict__label=label)
        stderr = cpfls("replay", study, model, pipeline.flight, "--every", "50", "-o", output).stderr
        assert (answer in stderr) if answer else ("verdict" not in stderr)


@pytest.fixture(scope="module")
def others(cpfls, study, tmp_path_factory):
    """Two more flights of the tiny study."""
    folder, flights = tmp_path_factory.mktemp("others"), []
    for displacement in (50, 40):
        path, flight = (folder / f"{name}-{displacement}.h5" for name in ("trajectory", "flight"))
        turned = ("--set", f"trajectory.displacement_m={displacement}.0")
        for words in (("trajectory", study, *turned, "-o", path), ("simulate", study, path, "-o", flight)):
            cpfls.done(*words)
        flights.append(flight)
    return flights


def test_a_model_is_chosen_on_a_flight_and_judged_on_another(cpfls, study, pipeline, others, tmp_path):
    model, (kept, judged) = tmp_path / "model.h5", others
    words = ("--choose-on", kept, "--validate", judged, *HELD_OUT, *SEARCH)
    summary = cpfls.summary("identify", study, pipeline.flight, *words, "-o", model)
    assert list(summary["held_out"]) == [judged.name]
    again = cpfls("identify", study, pipeline.flight, "--validate", kept, *SEARCH, "-o", tmp_path / "b.h5", "--json")
    # The same search, chosen by its objectives: never better on the flight that the other was chosen on.
    assert 0 < summary["choice_error"] <= json.loads(again.stdout)["held_out"][kept.name]["mse"] * (1 + 1e-6)
    with h5py.File(model) as file:
        assert {"flight", "choose-on-1", "validate-1"} == set(file["inputs"])


def test_choice_and_flights_must_go_together(refuse, study, pipeline, others, tmp_path):
    output = ("-o", tmp_path / "out.h5")
    (message,) = refuse("identify", study, pipeline.flight, *HELD_OUT, *output)
    assert 'identification.choice = "held-out": needs a flight' in message
    assert "--choose-on FLIGHT" in message
    (message,) = refuse("identify", study, pipeline.flight, "--choose-on", others[0], *output)
    assert "--choose-on" in message
    assert "held-out" in message


def test_a_flight_that_trains_or_judges_cannot_choose(refuse, study, pipeline, others, tmp_path):
    output = ("-o", tmp_path / "out.h5")
    (message,) = refuse("identify", study, pipeline.flight, "--choose-on", pipeline.flight, *HELD_OUT, *output)
    assert "is a training flight" in message
    same = ("--validate", others[0], "--choose-on", others[0])
    (message,) = refuse("identify", study, pipeline.flight, *same, *HELD_OUT, *output)
    assert "judges (--validate)" in message
    twice = ("--choose-on", others[0], "--choose-on", others[0])
    (message,) = refuse("identify", study, pipeline.flight, *twice, *HELD_OUT, *output)
    assert "is given twice" in message


def test_what_is_no_flight_cannot_choose(refuse, study, pipeline, tmp_path):
    """Not even where the same file is an input of its own."""
    words = ("--choose-on", pipeline.selection, *HELD_OUT, "-o", tmp_path / "out.h5")
    (message,) = refuse("identify", study, pipeline.flight, "--selection", pipeline.selection, *words)
    assert f"--choose-on {pipeline.selection}: is the selection, not a flight" in message
    (message,) = refuse("identify", study, pipeline.flight, *words)
    assert str(pipeline.selection) in message
    assert "flight" in message


def test_flights_of_another_vehicle_are_named(cpfls, study, pipeline, others, tmp_path):
    """Their numbers are of that vehicle; they are used all the same."""
    heavy = tmp_path / "heavy.h5"
    path = others[0].with_name(others[0].name.replace("flight", "trajectory"))
    cpfls.done("simulate", study, path, *("--set", "vehicle.inertia_kg_m2=[0.7, 0.6, 1.2]"), "-o", heavy)
    words = ("identify", study, pipeline.flight, *HELD_OUT, *SEARCH, "--choose-on", heavy, "--validate", others[1])
    result = cpfls.done(*words, "-o", tmp_path / "out.h5")
    said = [line for line in result.stderr.splitlines() if "another vehicle" in line]
    assert len(said) == 1
    assert f"{heavy.name}: was made with another vehicle; these differ: vehicle.inertia_kg_m2" in said[0]


def test_a_model_of_another_vehicle_is_named(cpfls, study, pipeline, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text(cpfls.done("config", study, "--set", "vehicle.inertia_kg_m2=[0.7, 0.6, 1.2]").stdout)
    said = f"{pipeline.model.name}: models a vehicle other than the config's; these differ: vehicle.inertia_kg_m2"
    with warnings.catch_warnings(record=True) as noted:
        warnings.simplefilter("always")
        load_model(pipeline.model, other).predict(pipeline.flight)
    assert any(said in str(each.message) for each in noted)


@pytest.fixture
def notes(cpfls, tmp_path):
    """Identify a model in a log of some seconds; give the notes of it."""

    def call(seconds):
        time, rng = np.arange(0.0, seconds, 0.02), np.random.default_rng(3)
        pace = np.array([3.0, 2.5, 2.0])
        attitude = 0.3 * np.sin(pace * time[:, None])
        rate, change = 0.3 * pace * np.cos(pace * time[:, None]), -0.3 * pace**2 * np.sin(pace * time[:, None])
        torque = INERTIA * change + 0.01 * rng.standard_normal(change.shape)
        rows = np.column_stack([time, attitude, rate + 0.01 * rng.standard_normal(rate.shape), torque])
        log, config, flight = (tmp_path / name for name in ("log.csv", "study.yaml", "flight.h5"))
        np.savetxt(log, rows, delimiter=",", header="t,roll,pitch,yaw,p,q,r,mx,my,mz", comments="")
        config.write_text(STUDY + VEHICLE)
        for words in (("import", config, log, "-o", flight), ("identify", config, flight, "-o", tmp_path / "m.h5")):
            result = cpfls.done(*words, "--force", "-v")
        return [line for line in result.stderr.splitlines() if "swings" in line]

    return call


def test_two_seconds_are_too_short_and_it_says_how_long_would_do_and_two_minutes_are_not(notes):
    (note,) = notes(2.0)
    assert note.startswith("cpfls: note: the training flights are short: in 2 s the rates reverse 2, 2, 1 times about")
    assert "roll, pitch, yaw, 5 swings for " in note
    assert "train on about " in note
    assert notes(120.0) == []


def test_a_flight_imported_again_under_another_name_does_not_judge(cpfls, refuse, notes, tmp_path):
    notes(2.0)
    config, flight, again = (tmp_path / name for name in ("study.yaml", "flight.h5", "again.h5"))
    cpfls.done("import", config, tmp_path / "log.csv", "--set", "import.lowpass_hz=9", "-o", again)
    output = ("-o", tmp_path / "out.h5")
    (message,) = refuse("identify", config, flight, "--validate", again, *output)
    assert "again.h5: is both learned from (as flight.h5) and held out" in message
    (message,) = refuse("identify", config, flight, "--choose-on", again, *HELD_OUT, *output)
    assert f"--choose-on {again}: is a training flight" in message


def test_noise_is_no_swing():
    time = np.arange(0.0, 20.0, 0.01)
    noise = 0.05 * np.random.default_rng(1).standard_normal((2000, 3))
    rate = np.sin(np.array([1.0, 2.0, 3.0]) * time[:, None]) + noise
    still = np.zeros_like(rate)
    found = swings(TorqueData(time, Motion(still, rate, still), still))
    assert found.seconds == pytest.approx(20.0)
    np.testing.assert_allclose(found.by_axis, 20 * np.array([1, 2, 3]) / np.pi, atol=1.5)
