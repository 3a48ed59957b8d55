"""A search that leaves checkpoints, goes on from them, and stops when asked to."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

from cpfls_cli.artifacts.job import Interrupted, Job, check_outputs, origin_before, take_inputs
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.errors import InputError, about
from cpfls_cli.evolution.archive import Evaluate
from cpfls_cli.identification.search import SearchRun, SearchStep, Stop, StopReason, is_end
from cpfls_cli.search.checkpoint import Checkpoint, StoppedSearch
from cpfls_cli.store import Origin
from cpfls_cli.workers.employ import employ, require_address
from cpfls_cli.workers.workforce import WorkerError, Workforce

_OF_A_PROCESSOR = 8
"""Processes that a processor may get, of which more than one only share it."""


@dataclass(frozen=True)
class SearchOptions:
    """How a command runs its search; nothing of it changes what a search that comes to its end finds.

    Attributes
    ----------
    resume : bool
        Go on from the checkpoint.
    time_limit_s : float or None
        Stop the search after so much time, and keep what it has.
    workers : int
        Processes that evaluate.
    scheduler : str or None
        Address of a Dask scheduler whose workers evaluate.
    """

    resume: bool = False
    time_limit_s: float | None = None
    workers: int = 1
    scheduler: str | None = None

    @property
    def workers_option(self) -> str:
        """The option that names the workers, as it is typed."""
        return f"--workers {self.workers}" if self.scheduler is None else f"--scheduler {self.scheduler}"

    def employed(self, evaluate: Evaluate) -> AbstractContextManager[Workforce]:
        """Employ the workers that evaluate."""
        return employ(evaluate, count=self.workers, scheduler=self.scheduler)

    def require_workers(self) -> None:
        """Refuse more processes than this machine can run, and a scheduler beside them or without an address."""
        if self.scheduler is not None and self.workers > 1:
            raise InputError("--scheduler: brings its own workers; leave out --workers")
        if self.scheduler is not None:
            require_address(self.scheduler)
        processors = os.cpu_count() or 1
        if self.workers > _OF_A_PROCESSOR * processors:
            raise InputError(f"--workers {self.workers}: this machine has {processors} processors; give that many")


class Watch:
    """Decides when a search has to stop: at an interrupt, or at its time limit.

    Parameters
    ----------
    time_limit_s : float or None
        From now on.
    """

    def __init__(self, job: Job, time_limit_s: float | None) -> None:
        self._job = job
        self._end = None if time_limit_s is None else time.monotonic() + time_limit_s
        self._interrupted: Interrupted = lambda: None

    @property
    def signal(self) -> int | None:
        """Number of the signal that asked to stop, or None."""
        return self._interrupted()

    @contextmanager
    def deferring(self) -> Iterator[None]:
        """Turn an interrupt into a request to stop, for work inside that asks this watch."""
        with self._job.deferred_interrupts() as self._interrupted:
            yield

    def should_stop(self) -> Stop | None:
        """Give the reason to stop now, or None."""
        if self.signal is not None:
            return "interrupted"
        return "time-limit" if self._end is not None and time.monotonic() >= self._end else None


@dataclass(frozen=True)
class Resumable:
    """One search, its checkpoint, and where to go on; None to start."""

    checkpoint: Checkpoint
    stopped: StoppedSearch | None

    def run(self, options: SearchOptions, watch: Watch, progress: Callable[[SearchStep], None]) -> SearchRun:
        """Arrange how the search is run; from here on a checkpoint that is not resumed is given up.

        Interrupts are deferred as long as its workers are employed, which is as long as it searches.
        """
        if self.stopped is None:
            self.checkpoint.remove()

        @contextmanager
        def workers(evaluate: Evaluate) -> Iterator[Workforce]:
            with about(options.workers_option, WorkerError), watch.deferring(), options.employed(evaluate) as workforce:
                yield workforce

        return SearchRun(
            resumed=self.stopped.state if self.stopped else None,
            unfinished=self.stopped.unfinished if self.stopped else None,
            workers=workers,
            progress=progress,
            on_generation=self.checkpoint.write,
            on_stop=self.checkpoint.add,
            should_stop=watch.should_stop,
        )

    def kept(self) -> AbstractContextManager[None]:
        """Add to whatever fails inside that the search can go on nevertheless."""
        return self.checkpoint.kept()

    def end(self, reason: StopReason) -> None:
        """Remove the checkpoint of a search that came to its end, after what it found is written."""
        if is_end(reason):
            self.checkpoint.remove()


def begin_search(
    job: Job, inputs: Mapping[str, Path], options: SearchOptions
) -> tuple[dict[str, InputFile], Resumable]:
    """Check inputs, checkpoint and output of a search before anything is computed."""
    options.require_workers()
    files = take_inputs(job, inputs)
    header = origin_before(job.study, files)
    search = resumable(job.output, header, resume=options.resume, force=job.force)
    check_outputs(job, job.output, replaceable=options.resume and search.checkpoint.output_may_be_replaced())
    return files, search


def resumable(output: Path, header: Origin, *, resume: bool, force: bool) -> Resumable:
    """Find the checkpoint beside the output of a search, and read it where the search is to go on.

    `force` allows a checkpoint to be given up.
    """
    checkpoint = Checkpoint.beside(output, header)
    if resume:
        return Resumable(checkpoint, checkpoint.read())
    checkpoint.require_permission(force=force)
    return Resumable(checkpoint, None)
