"""Evaluators that workers can import: pure functions of a chromosome, and some that fail."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cpfls_cli.errors import SettingError
from cpfls_cli.evolution.archive import Evaluation

POISON = 13
DEADLY_POISON = 113


@dataclass(frozen=True)
class Uneven:
    """Digits that need all bits of a float, after a time that depends on the chromosome."""

    data: np.ndarray
    longest_s: float = 0.004

    def __call__(self, genes):
        return Evaluation(genes[:, ::-1] + 1, np.array([self.one(chromosome) for chromosome in genes]))

    def one(self, chromosome):
        time.sleep(self.longest_s * (chromosome[0] % 7) / 7)
        phase = self.data[:, np.newaxis] * chromosome
        return [np.sin(phase).sum(), np.cos(phase).prod(), np.tan(chromosome.sum())]


class Failing:
    """Raise what does not survive being pickled at one poison, and be killed, as for want of memory, at another."""

    def __call__(self, genes):
        if POISON in genes[:, 0]:
            raise SettingError("size", "cannot be unpickled")
        if DEADLY_POISON in genes[:, 0]:
            os.kill(os.getpid(), signal.SIGKILL)
        return Evaluation(genes, genes.astype(float))


@dataclass(frozen=True)
class Reporting:
    """Give for objectives the process, the threads of its linear algebra, and whether interrupts cannot reach it."""

    def __call__(self, genes):
        from threadpoolctl import threadpool_info

        threads = max(library["num_threads"] for library in threadpool_info())
        blocked = {signal.SIGINT, signal.SIGTERM} <= signal.pthread_sigmask(signal.SIG_BLOCK, ())
        return Evaluation(genes, np.tile([float(os.getpid()), threads, blocked], (len(genes), 1)))


@dataclass(frozen=True)
class Logging:
    """Leave a file for each chromosome that was evaluated, and the time of an evaluation behind."""

    folder: Path

    def __call__(self, genes):
        for name in genes[:, 0]:
            (self.folder / str(name)).touch()
            time.sleep(0.02)
        return Evaluation(genes, genes.astype(float))


class Unloadable:
    """Cannot be loaded by a worker."""

    def __call__(self, genes):
        return Evaluation(genes, genes.astype(float))

    def __reduce__(self):
        return _refuse, ()


def _refuse():
    raise ModuleNotFoundError("No module named 'compiled_kernel'")


class Loading:
    """Leave a file each time that it is loaded."""

    def __init__(self, folder):
        self.folder = folder

    def __call__(self, genes):
        return Evaluation(genes, genes.astype(float))

    def __setstate__(self, state):
        self.__dict__.update(state)
        (self.folder / f"{os.getpid()}-{time.monotonic_ns()}").touch()
