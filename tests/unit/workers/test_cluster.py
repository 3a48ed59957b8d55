"""Evaluation by a real Dask scheduler and worker processes on the loopback."""

import importlib
import logging
import os
import shutil
import socket
import subprocess

import numpy as np
import pytest

from cpfls_cli.errors import ComputationError
from cpfls_cli.workers.workforce import employ
from tests.builders.dask_cluster import dask_cluster
from tests.builders.evaluators import POISON, Failing, Loading, Logging, Reporting, Uneven

pytest.importorskip("distributed", reason="Dask is not installed: pip install 'cpfls[dask]'")
pytest.importorskip("threadpoolctl", reason="threadpoolctl is not installed: pip install 'cpfls[dask]'")

_module = importlib.import_module("cpfls_cli.workers.cluster")
cluster, quiet = _module.cluster, _module.quiet

GENES = np.random.default_rng(5).integers(0, 32768, (40, 6))
EVALUATOR = Uneven(np.linspace(0, 1, 50))


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with dask_cluster(tmp_path_factory.mktemp("dask"), workers=2) as (address, _, _):
        yield address


def test_two_dask_workers_give_the_same_bytes_as_two_processes_and_one(address):
    with employ(EVALUATOR) as one, employ(EVALUATOR, count=2) as two, employ(EVALUATOR, scheduler=address) as dask:
        expected, *others = [workers(GENES) for workers in (one, two, dask)]
    for other in others:
        assert other.genes.tobytes() == expected.genes.tobytes()
        assert other.objectives.tobytes() == expected.objectives.tobytes()


def test_both_workers_work_and_take_one_thread_for_linear_algebra(address):
    with employ(Reporting(), scheduler=address) as workers:
        processes, threads, _ = workers(np.ones((400, 3), dtype=int)).objectives.T
    assert len(set(processes)) == 2
    assert os.getpid() not in processes
    assert set(threads) == {1.0}


def test_the_evaluator_is_loaded_once_by_each_worker(address, tmp_path):
    with employ(Loading(tmp_path), scheduler=address) as workers:
        for _ in range(3):
            workers(GENES)
    loaded = [path.name.split("-")[0] for path in tmp_path.iterdir()]
    assert 1 <= len(set(loaded)) == len(loaded) <= 2


def test_what_is_given_up_before_it_begins_is_never_evaluated(address, tmp_path):
    with employ(Logging(tmp_path), scheduler=address) as workers:
        stream = workers.stream(np.arange(100)[:, np.newaxis])
        rows, part = next(stream)
        stream.close()
        assert part.genes[:, 0].tolist() == rows.tolist()
        assert len(workers(np.arange(1000, 1010)[:, np.newaxis]).genes) == 10
    assert len([path for path in tmp_path.iterdir() if int(path.name) < 100]) < 80


def test_a_failing_evaluator_is_an_error_in_words(address, capfd):
    with (
        pytest.raises(ComputationError, match="SettingError: cannot be unpickled"),
        employ(Failing(), scheduler=address) as workers,
    ):
        workers(np.arange(POISON + 5)[:, np.newaxis])
    assert capfd.readouterr() == ("", "")


def test_a_vanished_worker_is_replaced_by_the_other_until_that_vanishes_too(tmp_path, capfd):
    slow = Uneven(np.linspace(0, 1, 50), longest_s=0.05)
    with (
        dask_cluster(tmp_path, workers=2) as (address, _, (first, second)),
        cluster(slow, address, patience_s=1.0) as workers,
    ):
        parts = workers.stream(GENES)
        rows = next(parts)[0].tolist()
        first.kill()
        rows += [row for part in parts for row in part[0]]
        assert sorted(rows) == list(range(len(GENES)))
        parts = workers.stream(GENES)
        next(parts)
        second.kill()
        with pytest.raises(ComputationError, match="has no workers: start some"):
            list(parts)
    assert capfd.readouterr() == ("", "")


def test_a_vanished_scheduler_is_an_error_in_words(tmp_path, capfd):
    with dask_cluster(tmp_path, workers=1) as (address, scheduler, _), cluster(EVALUATOR, address) as workers:
        parts = workers.stream(GENES)
        next(parts)
        scheduler.kill()
        with pytest.raises(ComputationError, match="Dask scheduler is gone: start it"):
            list(parts)
    assert capfd.readouterr() == ("", "")


def test_a_scheduler_without_workers_is_an_error_in_words(tmp_path, capfd):
    with (
        dask_cluster(tmp_path, workers=0) as (address, _, _),
        pytest.raises(ComputationError, match="has no workers: start some with `dask worker tcp://"),
        cluster(EVALUATOR, address, patience_s=0.2),
    ):
        pass
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl to make a certificate with")
def test_with_certificates_only_those_who_have_them_get_in(tmp_path, capfd):
    dask = pytest.importorskip("dask")
    key, own = str(tmp_path / "own-key.pem"), str(tmp_path / "own.pem")
    made = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=localhost"]
    subprocess.run([*made, "-keyout", key, "-out", own], check=True, stderr=subprocess.DEVNULL)
    known = {"ca-file": own, "client.cert": own, "client.key": key}
    given = {f"distributed.comm.tls.{name}": file for name, file in known.items()}
    options = ("--tls-ca-file", own, "--tls-cert", own, "--tls-key", key)
    with dask.config.set(given), dask_cluster(tmp_path, 1, options) as (address, _, _):
        with employ(EVALUATOR) as one, employ(EVALUATOR, scheduler=address) as safe:
            assert safe(GENES).objectives.tobytes() == one(GENES).objectives.tobytes()
        with dask.config.set(dict.fromkeys(given)):
            for reached, refused in ((address, "no connection with TLS"), (f"tcp{address[3:]}", "no Dask scheduler")):
                with pytest.raises(ComputationError, match=refused), cluster(EVALUATOR, reached, patience_s=2.0):
                    pass
    assert capfd.readouterr() == ("", "")


def test_an_address_where_nothing_answers_is_an_error_in_words(capfd):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with (
        pytest.raises(ComputationError, match=f"answers at tcp://127.0.0.1:{port} within 0.3 s"),
        cluster(EVALUATOR, f"tcp://127.0.0.1:{port}", patience_s=0.3),
    ):
        pass
    assert capfd.readouterr() == ("", "")


def test_a_client_whose_thread_does_not_start_is_an_error_in_words(monkeypatch):
    def asserts(*_given, **_options):
        raise AssertionError

    monkeypatch.setattr("cpfls_cli.workers.cluster.Client", asserts)
    with pytest.raises(ComputationError, match="no Dask scheduler"), cluster(EVALUATOR, "tcp://127.0.0.1:1"):
        pass


@pytest.mark.parametrize("name", ["distributed.core", "tornado.application"])
def test_nothing_is_logged_within_and_all_is_as_before_after(name):
    logger = logging.getLogger(name)
    before = logger.getEffectiveLevel()
    with quiet():
        assert not logger.isEnabledFor(logging.CRITICAL)
    assert logger.isEnabledFor(logging.CRITICAL)
    assert logger.getEffectiveLevel() == before
