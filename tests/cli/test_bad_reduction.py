"""A reduction that the flight does not allow: the key and its value, also where nothing would be computed."""

import json

import pytest

from cpfls_cli.report.content import number


@pytest.mark.parametrize("dry", [(), ("--dry-run",)], ids=["run", "dry-run"])
@pytest.mark.parametrize(
    ("size", "message"),
    [
        (550, "the training set has only 549 samples; keep fewer"),
        (37, "the training set has rank 113, which takes 38 samples or more"),
    ],
)
def test_size_that_does_not_suit_the_flight(refuse, pipeline, study, tmp_path, size, message, dry):
    words = ("-o", tmp_path / "out.h5", "--set", f"reduction.size={size}", *dry)
    assert refuse("reduce", study, pipeline.flight, *words) == [
        f"{pipeline.flight}: reduction.size = {size}: {message}"
    ]


def test_all_samples_can_be_asked_for(cpfls, pipeline, study, tmp_path):
    words = ("-o", tmp_path / "out.h5", "--set", "reduction.size=549", "--dry-run")
    cpfls.done("reduce", study, pipeline.flight, *words)


@pytest.mark.decides
@pytest.mark.parametrize(
    ("size", "target", "words"),
    [
        ("60", 2.0, "reduction.size stopped the selection; raise it or set it to null"),
        ("null", 2.0, "all samples are in"),
        ("60", 1e9, None),
    ],
)
def test_a_condition_number_that_is_not_reached_is_said(cpfls, pipeline, study, tmp_path, size, target, words):
    options = ("--set", f"reduction.size={size}", "--set", f"reduction.condition_number={target}", "--json")
    faster = ("--set", "reduction.criterion=D", "--set", "identification.training_share=0.2")
    result = cpfls("reduce", study, pipeline.flight, "-o", tmp_path / "out.h5", *options, *faster)
    reached = json.loads(result.stdout)["condition_number"]
    note = f"the target reduction.condition_number = 2 is not reached, the selection has {number(reached, 5)}: {words}"
    assert (f"cpfls: note: {note}\n" in result.stderr) is bool(words)
    assert ("reduction.condition_number" in result.stderr) is bool(words)
