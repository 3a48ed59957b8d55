"""Processes that are killed at any moment, interrupted twice, or find the disk full."""

import itertools
import multiprocessing
import os
import random
import resource
import shutil
import signal
import sys
import time

import pytest

from cpfls_cli import store
from cpfls_cli.evolution import engine
from tests.builders.dask_cluster import dask_cluster
from tests.builders.forked import Forked


@pytest.fixture
def program(words, tmp_path_factory):
    """Start the search in a process."""

    def start(output, *options, patch=lambda: None):
        printed = tmp_path_factory.mktemp("printed")
        return Forked([*words, "-o", output, *options], printed / "stdout", printed / "stderr", patch=patch)

    return start


def at_call(number, owner, name, action):
    """Do something to itself at the n-th call of a function: the same moment every time, whatever the machine."""

    def patch():
        calls, function = itertools.count(1), getattr(owner, name)

        def counting(*args, **kwargs):
            if next(calls) == number:
                action()
            return function(*args, **kwargs)

        setattr(owner, name, counting)

    return patch


def kill_itself():
    os.kill(os.getpid(), signal.SIGKILL)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def wait_for_change(process, path):
    """Wait until a file is replaced, or the process has ended; whether it is still running."""

    def identity():
        return (path.stat().st_ino, path.stat().st_mtime_ns) if path.exists() else None

    before = identity()
    while process.poll() is None:
        if identity() not in (before, None):
            return True
        time.sleep(0.001)
    return False


def kill_at_random(start, output, moments, most):
    """Start, kill and resume a search until it comes to its end; how often it was killed."""
    checkpoint, options = output.with_name(f"{output.name}.checkpoint"), ()
    kills, missed, ended = 0, 0, None
    while ended != 0:
        process = start(output, *options)
        if kills < most and wait_for_change(process, checkpoint):
            time.sleep(moments.uniform(0.0, 0.05))
            process.kill()
        process.wait()
        ended = process.poll()
        assert ended in (0, -signal.SIGKILL)
        kills += ended != 0
        options = ("--resume",)
        if not kills and missed < 5:
            # On a busy machine a search may end before this process looks again: another one is killed then.
            output.unlink()
            ended, options, missed = None, (), missed + 1
    return kills


def test_killed_at_random_moments_it_ends_the_same(program, whole, tmp_path):
    output = tmp_path / "model.h5"
    assert kill_at_random(program, output, random.Random(0), 100) > 0
    assert output.read_bytes() == whole.read_bytes()
    assert names(tmp_path) == ["model.h5"]


# The initial population and six generations leave a checkpoint each; the eighth file is the model.
@pytest.mark.parametrize(("call", "owner", "name"), [(1, os, "fsync"), (8, os, "replace")])
def test_killed_while_writing_it_ends_the_same(program, whole, tmp_path, call, owner, name):
    output = tmp_path / "model.h5"
    assert program(output, patch=at_call(call, owner, name, kill_itself)).wait().returncode == -signal.SIGKILL
    assert any(name.endswith(".part") for name in names(tmp_path))
    options = ["--resume"] if call > 1 else []
    assert ("model.h5.checkpoint" in names(tmp_path)) == (call > 1)
    ended = program(output, *options).wait()
    assert ended.returncode == 0, ended.stderr
    assert output.read_bytes() == whole.read_bytes()
    assert names(tmp_path) == ["model.h5"]


def test_first_signal_stops_the_search_and_a_second_one_the_program(program, whole, tmp_path):
    def signals(count):
        return at_call(3, engine, "reinsert", lambda: [os.kill(os.getpid(), signal.SIGTERM) for _ in range(count)])

    once = program(tmp_path / "one.h5", "-v", patch=signals(1)).wait()
    assert once.returncode == 143, once.stderr
    assert "113 parameters from 60 samples" in once.stdout
    assert names(tmp_path) == ["one.h5", "one.h5.checkpoint"]
    twice = program(tmp_path / "two.h5", patch=signals(2)).wait()
    assert (twice.returncode, twice.stdout) == (143, "")
    assert twice.stderr == (
        f"cpfls: note: {tmp_path / 'two.h5'}.checkpoint: is intact; the same command with --resume goes on\n"
        "cpfls: error: interrupted: no half-written file is left\n"
    )
    assert names(tmp_path) == ["one.h5", "one.h5.checkpoint", "two.h5.checkpoint"]
    for output in (tmp_path / "one.h5", tmp_path / "two.h5"):
        assert program(output, "--resume").wait().returncode == 0
        assert output.read_bytes() == whole.read_bytes()


@pytest.mark.parametrize(
    ("call", "file", "size"),
    [(1, "model.h5.checkpoint", 0), (4, "model.h5.checkpoint", 20_000), (8, "model.h5", 20_000)],
)
def test_full_disk_leaves_the_checkpoint_before(program, whole, tmp_path, call, file, size):
    """The system refuses what goes beyond a size, in the first or a later block."""

    def fill():
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        # The limit is for all files: of a module compiled now Python would keep a part; what is printed goes to files.
        sys.dont_write_bytecode = True
        sys.stdout, sys.stderr = (os.fdopen(os.dup(pipe), "w", buffering=1) for pipe in printed)

    reading, writing_end = os.pipe()
    printed = (writing_end, writing_end)
    output = tmp_path / "model.h5"
    result = program(output, patch=at_call(call, store, "sealed_output", fill)).wait()
    os.close(writing_end)
    with open(reading) as messages:
        message = messages.read()
    assert result.returncode == 1
    error, *notes = message.splitlines()
    assert error == f"cpfls: error: {tmp_path / file}: cannot be written: File too large"
    said = f"cpfls: note: {output}.checkpoint: is intact; the same command with --resume goes on"
    assert notes == ([said] if call > 1 else [])
    assert names(tmp_path) == ([] if call == 1 else ["model.h5.checkpoint"])
    if call > 1:
        assert program(output, "--resume").wait().returncode == 0
        assert output.read_bytes() == whole.read_bytes()


def test_folder_that_vanishes(program, tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    result = program(
        folder / "model.h5", patch=at_call(3, store, "sealed_output", lambda: shutil.rmtree(folder))
    ).wait()
    assert (result.returncode, result.stdout) == (1, "")
    assert result.stderr == (
        f"cpfls: error: {folder / 'model.h5.checkpoint'}: cannot write into the folder {folder}: "
        "No such file or directory\n"
    )


LEARNED = ("base=rigid-body", "local_search.enabled=true", "population=10", "generations=1")


def test_two_processes_and_a_cluster_give_the_same_bytes(cpfls, words, tmp_path, request):
    pytest.importorskip("distributed", reason="Dask is not installed: pip install 'cpfls[dask]'")
    address = request.getfixturevalue("address")
    options = [word for key in LEARNED for word in ("--set", f"identification.{key}")]
    for name, who in {"one": (), "two": ("--workers", 2), "dask": ("--scheduler", address)}.items():
        cpfls.done(*words, "-o", tmp_path / name, *options, *who)
    one, two, dask = ((tmp_path / name).read_bytes() for name in ("one", "two", "dask"))
    assert one == two
    assert one == dask


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with dask_cluster(tmp_path_factory.mktemp("dask"), workers=2) as (address, _, _):
        yield address


def test_search_goes_on_with_other_workers_after_one_was_lost(cpfls, words, whole, tmp_path, monkeypatch):
    output, reinsert, bred = tmp_path / "model.h5", engine.reinsert, []

    def lose_one(*args):
        bred.append(None)
        if len(bred) == 3:
            multiprocessing.active_children()[0].kill()
        return reinsert(*args)

    monkeypatch.setattr(engine, "reinsert", lose_one)
    result = cpfls(*words, "-o", output, "--workers", 2)
    monkeypatch.undo()
    assert (result.exit_code, result.stdout) == (1, "")
    error, note = result.stderr.splitlines()
    assert error.startswith("cpfls: error: --workers 2: a worker process ended unexpectedly")
    assert "killed" in error
    assert note == f"cpfls: note: {output}.checkpoint: is intact; the same command with --resume goes on"
    assert [path.name for path in tmp_path.iterdir()] == ["model.h5.checkpoint"]
    cpfls.done(*words, "-o", output, "--resume")
    assert output.read_bytes() == whole.read_bytes()


def test_what_is_wrong_with_the_workers_is_not_said_of_the_flight(refuse, words, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "cpfls_cli.workers.cluster", None)
    address = "tcp://127.0.0.1:8786"
    (line,) = refuse(*words, "-o", tmp_path / "model.h5", "--scheduler", address, code=1)
    assert line.startswith(f"--scheduler {address}: a scheduler needs Dask")


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (("--workers", 100_000), "--workers 100000: this machine has "),
        (("--scheduler", "nonsense"), "scheduler = nonsense: not an address"),
    ],
)
def test_workers_that_cannot_be_are_refused_before_the_search(refuse, words, tmp_path, option, message):
    (line,) = refuse(*words, "-o", tmp_path / "model.h5", *option, "--dry-run")
    assert line.startswith(message)
