"""A sweep that is stopped anywhere keeps what is finished, and goes on to the same bytes."""

import os
import random
import signal
import time

import pytest

from cpfls_cli.identification.replicates import Sweep
from cpfls_cli.store import read
from tests.builders.forked import Forked

PARTIAL, CHECKPOINT = "sweep.h5.partial", "sweep.h5.checkpoint"


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def sweep_in(path):
    return read(path, Sweep)[0]


def finished(path):
    return sweep_in(path).runs


def wait_for_change(process, path):
    """Wait until a file is replaced, or the process has ended."""

    def identity():
        return (path.stat().st_ino, path.stat().st_mtime_ns) if path.exists() else None

    before = identity()
    while process.poll() is None and identity() in (before, None):
        time.sleep(0.001)


def test_killed_in_processes_of_its_own_it_ends_the_same(words, whole, tmp_path, tmp_path_factory):
    printed = tmp_path_factory.mktemp("printed")
    output, moments, options, kills = tmp_path / "sweep.h5", random.Random(3), (), 0
    for watched in (PARTIAL, CHECKPOINT, None):
        process = Forked([*words, "-o", output, *options], printed / "stdout", printed / "stderr")
        if watched is not None:
            wait_for_change(process, tmp_path / watched)
            time.sleep(moments.uniform(0.0, 0.03))
            process.kill()
        process.wait()
        kills += process.poll() == -signal.SIGKILL
        options = ("--resume",)
    assert kills > 0
    assert process.poll() == 0
    assert output.read_bytes() == whole.read_bytes()
    assert names(tmp_path) == ["sweep.h5"]


class Killed(BaseException):
    """What a process that is killed does not live to see."""


@pytest.fixture(scope="module")
def once(words):
    """The command with one seed of two settings, both of whose runs are stopped."""
    settings = "[{name: classic, set: {identification.structure: fls, reduction.size: null}}, {name: fewer samples}]"
    return (*words, "--set", "sweep.seeds=1", "--set", f"sweep.settings={settings}")


@pytest.fixture(scope="module")
def whole_once(cpfls, once, tmp_path_factory):
    output = tmp_path_factory.mktemp("once") / "sweep.h5"
    cpfls.done(*once, "-o", output)
    return output


@pytest.mark.parametrize("call", range(1, 10))
def test_stopped_dead_at_any_file_it_writes_it_ends_the_same(cpfls, once, whole_once, tmp_path, monkeypatch, call):
    """The first writes: no run yet, three generations, the first run, the next run's generations.

    Before one is in its place is after the one before it.
    """

    output, calls, replace = tmp_path / "sweep.h5", [], os.replace

    def stopping(*paths):
        calls.append(paths)
        if len(calls) == call:
            raise Killed
        replace(*paths)

    monkeypatch.setattr("os.replace", stopping)
    with pytest.raises(Killed):
        cpfls(*once, "-o", output)
    monkeypatch.undo()
    assert not output.exists()
    cpfls.done(*once, "-o", output, *(["--resume"] if (tmp_path / PARTIAL).exists() else []))
    assert output.read_bytes() == whole_once.read_bytes()
    assert names(tmp_path) == ["sweep.h5"]


@pytest.mark.parametrize("evaluations", [1, 40, 70])
def test_interrupted_it_keeps_what_is_finished_and_goes_on(
    cpfls, words, whole, tmp_path, interrupt_at, monkeypatch, evaluations
):
    output = tmp_path / "sweep.h5"
    interrupt_at(evaluations)
    result = cpfls(*words, "-o", output)
    assert result.exit_code == 130
    assert result.stderr.splitlines()[-1] == (
        f"cpfls: note: {output}: is incomplete, because the search was interrupted; "
        "the same command with --resume goes on"
    )
    assert names(tmp_path) == ["sweep.h5", CHECKPOINT, PARTIAL]
    incomplete = sweep_in(output)
    assert not incomplete.complete
    assert finished(output) == finished(tmp_path / PARTIAL) < 6
    assert (finished(output) > 0) == (evaluations > 1)
    for own, all_runs in zip(incomplete.settings, sweep_in(whole).settings, strict=True):
        assert own.of("mse").tolist() == all_runs.of("mse")[: own.runs].tolist()
    monkeypatch.undo()
    cpfls.done(*words, "-o", output, "--resume")
    assert output.read_bytes() == whole.read_bytes()
    assert names(tmp_path) == ["sweep.h5"]


def test_what_is_finished_or_evaluated_is_not_searched_again(
    cpfls, words, whole, tmp_path, interrupt_at, at_evaluation
):
    output, evaluated = tmp_path / "sweep.h5", []
    interrupt_at(50)
    assert cpfls(*words, "-o", output).exit_code == 130
    total = int(sum(own.of("evaluations").sum() for own in sweep_in(whole).settings))
    at_evaluation(total - 50, lambda: evaluated.append("last"))
    cpfls.done(*words, "-o", output, "--resume")
    assert evaluated == ["last"]
    assert output.read_bytes() == whole.read_bytes()


def test_time_limit_is_for_all_runs_together(cpfls, words, whole, tmp_path, at_evaluation, monkeypatch):
    output, clock = tmp_path / "sweep.h5", [100.0]
    monkeypatch.setattr("cpfls_cli.search.resumable.time.monotonic", lambda: clock[0])
    at_evaluation(40, lambda: clock.__setitem__(0, 200.0))
    cpfls.done(*words, "-o", output, "--time-limit", "90s")
    assert not sweep_in(output).complete
    monkeypatch.undo()
    cpfls.done(*words, "-o", output, "--resume")
    assert output.read_bytes() == whole.read_bytes()


def test_damaged_checkpoint_costs_its_run_only(cpfls, words, whole, tmp_path, interrupt_at, monkeypatch):
    output = tmp_path / "sweep.h5"
    interrupt_at(60)
    assert cpfls(*words, "-o", output).exit_code == 130
    monkeypatch.undo()
    checkpoint = tmp_path / CHECKPOINT
    checkpoint.write_bytes(checkpoint.read_bytes()[:1000])
    cpfls.done(*words, "-o", output, "--resume")
    assert output.read_bytes() == whole.read_bytes()


def test_more_seeds_go_on_from_fewer(cpfls, words, whole, tmp_path, interrupt_at, monkeypatch):
    output = tmp_path / "sweep.h5"
    interrupt_at(40)
    assert cpfls(*words, "-o", output, "--set", "sweep.seeds=1").exit_code == 130
    monkeypatch.undo()
    cpfls.done(*words, "-o", output, "--resume")
    assert output.read_bytes() == whole.read_bytes()
