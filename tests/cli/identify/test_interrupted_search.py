"""Searches that are interrupted or run out of time, and go on."""

import json
import signal

import h5py
import numpy as np
import pytest

from cpfls_cli import load_model
from cpfls_cli.arguments import seconds
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.store import read

NOTE = "cpfls: note: "


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def stored(path, name):
    with h5py.File(path) as file:
        return file[name][()]


def test_search_that_comes_to_its_end_says_so(whole):
    assert stored(whole, "stop_reason") == b"generations"


def test_interrupted_search_keeps_a_model_and_goes_on_to_the_same_end(
    cpfls, words, whole, tmp_path, interrupt_at, monkeypatch
):
    output = tmp_path / "model.h5"
    interrupt_at(33)
    result = cpfls(*words, "-o", output, "--json")
    assert result.exit_code == 130
    assert names(tmp_path) == ["model.h5", "model.h5.checkpoint"]
    summary = json.loads(result.stdout)
    assert (summary["stop_reason"], summary["complete"]) == ("interrupted", False)
    assert summary["evaluations"] == 33 == stored(output, "history/evaluations")[-1]
    assert result.stderr.splitlines()[-1] == (
        f"{NOTE}{output}: is incomplete, because the search was interrupted; the same command with --resume goes on"
    )
    assert read(output, IdentifiedModel)[0].stopped == "interrupted"
    monkeypatch.undo()
    cpfls.done(*words, "-o", output, "--resume")
    assert output.read_bytes() == whole.read_bytes()
    assert names(tmp_path) == ["model.h5"]


def test_incomplete_model_predicts(cpfls, words, pipeline, tmp_path, interrupt_at):
    interrupt_at(40)
    assert cpfls(*words, "-o", tmp_path / "model.h5").exit_code == 130
    with pytest.warns(UserWarning, match="has no verdict"):
        assert np.isfinite(load_model(tmp_path / "model.h5").predict(pipeline.flight).torque).all()


def test_interrupted_again_and_again_it_evaluates_nothing_twice(cpfls, words, whole, tmp_path, interrupt_at):
    output, option, runs = tmp_path / "model.h5", (), []
    while not runs or runs[-1].exit_code == 130:
        # The first runs do not even finish the initial population.
        interrupt_at(12)
        runs.append(cpfls(*words, "-o", output, *option))
        option = ("--resume",)
        assert stored(output, "history/evaluations")[-1] == min(
            12 * len(runs), stored(whole, "history/evaluations")[-1]
        )
    assert runs[-1].exit_code == 0
    assert output.read_bytes() == whole.read_bytes()
    assert names(tmp_path) == ["model.h5"]


def test_interrupted_in_the_last_evaluation_it_is_judged_when_it_goes_on(cpfls, words, whole, tmp_path, interrupt_at):
    interrupt_at(int(stored(whole, "history/evaluations")[-1]))
    result = cpfls(*words, "-o", tmp_path / "model.h5")
    assert result.exit_code == 130
    assert f"{tmp_path / 'model.h5'}: was found but not judged, because of the interrupt" in result.stderr
    assert names(tmp_path) == ["model.h5", "model.h5.checkpoint"]
    cpfls.done(*words, "-o", tmp_path / "model.h5", "--resume")
    assert names(tmp_path) == ["model.h5"]
    assert (tmp_path / "model.h5").read_bytes() == whole.read_bytes()


def test_interrupted_without_a_finite_model(cpfls, words, tmp_path, interrupt_at, monkeypatch):
    def nothing(_, genes):
        from cpfls_cli.evolution.archive import Evaluation

        return Evaluation(genes, np.full((len(genes), 3), np.inf))

    monkeypatch.setattr("cpfls_cli.identification.evaluator.Evaluator.__call__", nothing)
    interrupt_at(20)
    result = cpfls(*words, "-o", tmp_path / "model.h5")
    assert (result.exit_code, result.stdout) == (130, "")
    assert names(tmp_path) == ["model.h5.checkpoint"]
    assert result.stderr == (
        "cpfls: error: the search was interrupted before a model was found, so none is written; "
        "the same command with --resume goes on\n"
    )


def test_search_that_found_nothing_at_its_end_leaves_nothing(cpfls, words, pipeline, tmp_path, monkeypatch):
    def nothing(_, genes):
        from cpfls_cli.evolution.archive import Evaluation

        return Evaluation(genes, np.full((len(genes), 3), np.inf))

    monkeypatch.setattr("cpfls_cli.identification.evaluator.Evaluator.__call__", nothing)
    result = cpfls(*words, "-o", tmp_path / "model.h5")
    assert result.exit_code == 1
    assert result.stderr == (
        f"cpfls: error: {pipeline.flight}: no chromosome gave a finite model; perhaps nothing moves in the data\n"
    )
    assert names(tmp_path) == []


def test_handlers_are_as_they_were(cpfls, words, tmp_path, interrupt_at):
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    interrupt_at(20)
    cpfls(*words, "-o", tmp_path / "model.h5")
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before


def test_search_out_of_time_keeps_a_model_and_goes_on(cpfls, words, whole, tmp_path, at_evaluation, monkeypatch):
    output = tmp_path / "model.h5"
    clock = [100.0]
    monkeypatch.setattr("cpfls_cli.search.time.monotonic", lambda: clock[0])
    at_evaluation(40, lambda: clock.__setitem__(0, 700.0))
    result = cpfls.done(*words, "-o", output, "--time-limit", "10m")
    assert stored(output, "stop_reason") == b"time-limit"
    assert stored(output, "history/evaluations")[-1] == 40
    assert result.stderr.splitlines()[-1] == (
        f"{NOTE}{output}: is incomplete, because --time-limit ended the search; the same command with --resume goes on"
    )
    monkeypatch.undo()
    go_on = "its search was stopped (time limit), go on with `cpfls identify ... --resume`"
    assert cpfls("check", output).stdout.startswith(f"{output}: keeps to its format (cpfls/identified), but {go_on}\n")
    assert go_on.removeprefix("its search was ") in cpfls("info", output).stdout
    cpfls.done(*words, "-o", output, "--resume", "--time-limit", "2h")
    assert cpfls("check", output).stdout.startswith(f"{output}: good (cpfls/identified)\n")
    assert output.read_bytes() == whole.read_bytes()


@pytest.mark.parametrize(
    ("text", "limit"), [("90", 90.0), ("90s", 90.0), ("1.5m", 90.0), ("2h", 7200.0), ("1e3", 1000.0)]
)
def test_time_limit_in_several_units(text, limit):
    assert seconds(text) == limit


@pytest.mark.parametrize("text", ["0", "-3s", "soon", "", "10 days", "nan", "inf", "h"])
def test_time_limit_that_is_none(cpfls, words, tmp_path, text):
    result = cpfls(*words, "-o", tmp_path / "model.h5", f"--time-limit={text}")
    assert result.exit_code == 2
    assert "--time-limit" in result.stderr
    assert "10m" in result.stderr
    assert names(tmp_path) == []


def test_stalled_search_ends_converged(cpfls, words, tmp_path):
    stall = ("--set", "identification.stall_generations=1", "--set", "identification.stall_improvement=0.9")
    summary = cpfls.told(*words, "-o", tmp_path / "model.h5", *stall)
    assert (summary["stop_reason"], summary["complete"], summary["generations"] < 6) == ("converged", True, True)
    assert names(tmp_path) == ["model.h5"]
    lines = cpfls(*words, "-o", tmp_path / "told.h5", *stall, "-v").stdout.splitlines()
    assert (
        f"converged after generation {summary['generations']}: no objective improved enough "
        "(identification.stall_generations = 1)"
    ) in lines
    assert "converged" not in cpfls(*words, "-o", tmp_path / "whole.h5", "-v").stdout
