"""The worker's side of a pipe: load the evaluator once, then answer chromosomes with evaluations."""

from __future__ import annotations

import pickle
import signal
from functools import partial
from multiprocessing.connection import Connection

from cpfls_cli.evolution.archive import Evaluate
from cpfls_cli.workers.attempt import Failure, attempt


def work(connection: Connection) -> None:
    """Serve one pipe until it closes, which it also does when the other side is killed.

    Parameters
    ----------
    connection : Connection
        Brings the pickled evaluator first, and then chromosomes; takes None when the evaluator is loaded, then one
        Evaluation or Failure for each array of chromosomes.
    """
    # An interrupt from the keyboard reaches the whole group of processes; the parent decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        _serve(connection)
    except (EOFError, ConnectionError):
        return


def _serve(connection: Connection) -> None:
    evaluate: Evaluate | Failure = attempt(partial(pickle.loads, connection.recv_bytes()))
    if isinstance(evaluate, Failure):
        connection.send(evaluate)
        return
    connection.send(None)
    while True:
        connection.send(attempt(partial(evaluate, connection.recv())))
