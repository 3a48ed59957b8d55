"""The evidence on a model in its artifact: what `identify` writes and says, and what the library makes of it."""

import json
import os
import signal

import h5py
import numpy as np
import pytest

import cpfls_cli
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.report.content import sentence
from cpfls_cli.result import datasets
from cpfls_cli.validation import validate
from tests.builders.identified_models import write_changed

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
    page = tmp_path / "report.json"
    cpfls.done("report", study, model, "-o", page)
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


def test_use_of_a_model_that_was_judged_unfit_is_told(validated, cpfls, study, pipeline, tmp_path):
    for number, (label, told) in enumerate((("do-not-use", "do not use"), ("good-for-control", None))):
        model, output = tmp_path / f"{number}.h5", tmp_path / f"replay-{number}.h5"
        write_changed(validated[0], model, verdict__label=label)
        stderr = cpfls("replay", study, model, pipeline.flight, "--every", "50", "-o", output).stderr
        assert (told in stderr) if told else ("verdict" not in stderr)
