"""Inputs that differ in their last bits, as those of another processor do, give the same words and choices."""

import json
import re
import shutil

import h5py
import numpy as np
import pytest

from tests.builders.artifacts import edited

pytestmark = pytest.mark.decides

# Of what is computed in a row, rounding leaves some bits: these are a few thousand times the last one.
LAST_BITS = 1e-12
NUMBER = re.compile(r"[-−]?\d[\d.,]*(?: × 10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+|e[-+]\d+)?|\b(?:NaN|nan|inf|null|Infinity)\b")

FASTER = ("--set", "identification.training_share=0.2")
REDUCTIONS = [
    ("--set", "reduction.size=null", "--set", "reduction.criterion=D", "--set", "reduction.condition_number=2.0"),
    ("--set", "reduction.size=109", "--set", "reduction.criterion=even"),
    *(("--set", f"reduction.criterion={name}") for name in ("even", "sigma_min", "A", "D", "KD-exchange")),
]


@pytest.fixture(scope="module")
def shaken(pipeline, tmp_path_factory):
    """The flight of the tiny study, every torque of it off by rounding."""
    rng = np.random.default_rng(9)
    copy = tmp_path_factory.mktemp("shaken") / pipeline.flight.name
    shutil.copy(pipeline.flight, copy)
    with edited(copy) as file:
        for name in ("torque", "body_torque"):
            if name in file:
                file[name][...] *= 1 + LAST_BITS * rng.standard_normal(file[name].shape)
    return copy


def said(cpfls, *words):
    """Run a command; give its words without numbers, and its numbers."""
    result = cpfls.done(*words, "--force")
    text = result.stdout + result.stderr
    for word in words:
        # The same flight stands in two folders, and what comes next is said with its place.
        text = text.replace(str(word), str(word).rsplit("/", 1)[-1])
    return NUMBER.sub("#", text), text


@pytest.mark.parametrize("options", REDUCTIONS, ids=lambda options: " ".join(options[1::2]))
def test_a_reduction_chooses_and_says_the_same(cpfls, pipeline, shaken, study, tmp_path, options):
    summary, chosen = [], []
    for flight in (pipeline.flight, shaken):
        summary.append(said(cpfls, "reduce", study, flight, "-o", tmp_path / "s.h5", *FASTER, *options))
        with h5py.File(tmp_path / "s.h5") as file:
            chosen.append(file["indices"][()])
    assert summary[0] == summary[1]
    np.testing.assert_array_equal(*chosen)


@pytest.mark.parametrize("choice", ["mse-below-median-condition", "max-error"])
def test_an_identification_chooses_and_says_the_same(cpfls, pipeline, shaken, study, tmp_path, choice):
    summaries = []
    for flight in (pipeline.flight, shaken):
        words = ("identify", study, flight, "-o", tmp_path / "m.h5", "--set", f"identification.choice={choice}")
        result = cpfls.done(*words, *FASTER, "--force", "--json")
        with h5py.File(tmp_path / "m.h5") as file:
            chosen = file["weights"][()].tolist()
        verdict = json.loads(result.stdout)["verdict"]
        summaries.append((chosen, verdict["label"], NUMBER.sub("#", json.dumps(verdict["reasons"])), result.stderr))
    assert summaries[0] == summaries[1]
