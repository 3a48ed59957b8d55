"""The model does not depend on who evaluates, and a worker that is lost leaves the checkpoint."""

import multiprocessing
import sys

import pytest

from cpfls_cli.evolution import engine
from tests.builders.dask_cluster import dask_cluster

CONFIGS = {
    "rigid-body base, local search": ("base=rigid-body", "local_search.enabled=true", "population=10", "generations=1"),
    "paper's base": ("base=none",),
}


def options(keys):
    return [word for key in keys for word in ("--set", f"identification.{key}")]


@pytest.mark.parametrize("keys", CONFIGS.values(), ids=CONFIGS)
def test_two_processes_and_a_cluster_give_the_same_bytes(cpfls, words, tmp_path, keys, request):
    pytest.importorskip("distributed", reason="Dask is not installed: pip install 'cpfls[dask]'")
    address = request.getfixturevalue("address")
    for name, who in {"one": (), "two": ("--workers", 2), "dask": ("--scheduler", address)}.items():
        cpfls.done(*words, "-o", tmp_path / name, *options(keys), *who)
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
