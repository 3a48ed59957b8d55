"""Searches that go on: what a stopped one leaves next to its output, and whether a command may go on from it."""

from __future__ import annotations

import json
import os
import textwrap
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.artifacts.job import Interrupted, Job, check_outputs, origin_before, take_inputs
from cpfls_cli.artifacts.vehicle_model import Vehicle
from cpfls_cli.config.load import flat_keys, parse_config
from cpfls_cli.errors import ComputationError, InputError, OutputError
from cpfls_cli.errors import about as about_option
from cpfls_cli.evolution.archive import Archive, Evaluate, Evaluation
from cpfls_cli.evolution.engine import EvolutionState, History
from cpfls_cli.files import is_hdf5
from cpfls_cli.identification.search import SearchRun, SearchStep, Stop, StopReason, Unfinished, is_end
from cpfls_cli.playback.parameters import Rules
from cpfls_cli.playback.structure import Judged, Kept, Solution, Structure
from cpfls_cli.result import about, part, result
from cpfls_cli.store import Origin, format_name, read, write
from cpfls_cli.workers.workforce import WorkerError, Workforce, employ, require_address

T = TypeVar("T")
Genes = np.ndarray[Any, np.dtype[np.uint16]]

_SECTION = "identification"
_GENERATIONS = f"{_SECTION}.generations"
_LONGEST = 120
_START_AGAIN = "--force without --resume starts again"


_OBJECTIVES = "MSE (rigid-body base: cross-validated, scaled by axis), largest error, condition number"


@result
class Evaluated:
    """Chromosomes that were evaluated."""

    submitted: Genes = about("chromosomes as bred, 16-bit weights, in order of evaluation", "evaluation", "gene")
    genes: Genes = about("what local search made of them", "evaluation", "gene")
    objectives: Array = about(_OBJECTIVES, "evaluation", "3", unit="SI", gaps=True)

    @classmethod
    def of(cls, submitted: IntArray, evaluation: Evaluation) -> Evaluated:
        """Take what an evaluation gave."""
        genes = evaluation.genes.astype(np.uint16)
        return cls(submitted=submitted.astype(np.uint16), genes=genes, objectives=evaluation.objectives)

    @property
    def pair(self) -> tuple[IntArray, Evaluation]:
        """The chromosomes, and what they were evaluated to."""
        submitted, genes = (each.astype(np.int64) for each in (self.submitted, self.genes))
        return submitted, Evaluation(genes, self.objectives)


@result
class Population:
    """The current population."""

    genes: Genes = about("chromosomes, 16-bit weights", "individual", "gene")
    objectives: Array = about(_OBJECTIVES, "individual", "3", unit="SI", gaps=True)
    subpopulation: IntArray = about("label of the subpopulation", "individual")


@result
class SearchState:
    """An unfinished search: everything that its next generation depends on."""

    FORMAT: ClassVar = "cpfls/checkpoint"
    MADE_BY: ClassVar = "identify"

    generation: int = about("generations bred; 0: initial population, -1: not even that")
    generator: str = about("state of the random generator, one for all subpopulations, as JSON; null at -1")
    population: Population = part(brief=False)
    archive: Evaluated = part(brief=False)
    history: History = part(brief=False)
    unfinished: Evaluated = part(brief=False)
    """What was evaluated of the next generation, where the search was stopped within it."""

    @classmethod
    def of(cls, state: EvolutionState) -> SearchState:
        """Take the state of a search after a generation."""
        genes = state.genes.astype(np.uint16)
        return cls(
            generation=state.index,
            generator=json.dumps(state.rng.bit_generator.state),
            population=Population(genes=genes, objectives=state.objectives, subpopulation=state.subpopulations),
            archive=Evaluated.of(state.archive.submitted, state.archive.results),
            history=state.history,
            unfinished=_nothing(state.genes, state.objectives),
        )

    @classmethod
    def before_all(cls, genes: IntArray, objectives: Array) -> SearchState:
        """Take a search that has not evaluated its whole initial population, of such chromosomes."""
        none = _nothing(genes, objectives)
        return cls(
            generation=_BEFORE_ALL,
            generator="null",
            population=Population(genes=none.genes, objectives=none.objectives, subpopulation=np.arange(0)),
            archive=none,
            history=History.empty(objectives.shape[1]),
            unfinished=none,
        )

    @property
    def stopped(self) -> StoppedSearch:
        """What the search goes on from, equal to what was stored down to the last bit."""
        unfinished = Unfinished(*self.unfinished.pair)
        if self.generation == _BEFORE_ALL:
            return StoppedSearch(None, unfinished)
        rng, own = np.random.default_rng(), self.population
        rng.bit_generator.state = json.loads(self.generator)
        genes, archive = own.genes.astype(np.int64), Archive.of(*self.archive.pair)
        state = EvolutionState(self.generation, genes, own.objectives, own.subpopulation, archive, self.history, rng)
        return StoppedSearch(state, unfinished)


_BEFORE_ALL = -1


def _nothing(genes: IntArray, objectives: Array) -> Evaluated:
    return Evaluated.of(genes[:0], Evaluation(genes[:0], objectives[:0]))


@dataclass(frozen=True)
class StoppedSearch:
    """What a stopped search leaves behind.

    `state`: after its last generation, None if not even the initial population was evaluated; `unfinished`: what was
    evaluated of the generation after it.
    """

    state: EvolutionState | None
    unfinished: Unfinished


@dataclass(frozen=True)
class KeptFile:
    """A file next to the output from which a stopped command can go on; `origin` is of the command run now."""

    path: Path
    header: Origin
    OUTPUT: ClassVar[type[IdentifiedModel | Vehicle]]

    @classmethod
    def of_output(cls, output: Path, header: Origin) -> Self:
        """Name what is left of an output, such as ``model.h5.checkpoint`` of ``model.h5``."""
        return cls(output.with_name(f"{output.name}.checkpoint"), header)

    @classmethod
    def begun(cls, job: Job, header: Origin, *, resume: bool) -> tuple[Self, Any]:
        """Check what is left and the output of a search before anything is computed; give what it goes on from."""
        own = cls.of_output(job.output, header)
        left = own.read() if resume else None
        if not resume:
            own.require_permission(force=job.force)
        check_outputs(job, job.output, replaceable=resume and own.output_may_be_replaced())
        return own, left

    def read(self) -> Any:
        """Take up what was left."""
        raise NotImplementedError

    @property
    def output(self) -> Path:
        """What the command is for."""
        return self.path.with_suffix("")

    def require_permission(self, *, force: bool) -> None:
        """Refuse to give up what is left, unless that is allowed, and what is not left by this program in any case."""
        if not self.path.exists():
            return
        if not (self.path.is_file() and is_hdf5(self.path)):
            raise InputError(
                f"{self.path}: has the name of what a stopped search leaves, but is none; move it away, or name "
                "another output"
            )
        if not force:
            raise InputError(
                f"{self.path}: a search for {self.output} was stopped here; --resume continues it, --force starts again"
            )

    def output_may_be_replaced(self) -> bool:
        """Tell whether the output is what the stopped command left: incomplete, or complete and not tidied up."""
        complete, origin = self._written() or (True, None)
        return origin is not None and (not complete or replace(origin, stage=self.header.stage) == self.header)

    def remove(self) -> None:
        """Remove what is left, if there is anything."""
        self.path.unlink(missing_ok=True)

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Add to whatever fails inside that the command can go on nevertheless."""
        try:
            yield
        except (ComputationError, OutputError, KeyboardInterrupt) as error:
            if self.path.exists():
                error.add_note(f"{self.path}: is intact; the same command with --resume goes on")
            raise

    def _read(self, wanted: type[T]) -> tuple[T, Origin]:
        """Read what is left."""
        if not self.path.exists():
            if (self._written() or (False,))[0]:
                raise InputError(f"{self.output}: is complete; nothing to resume")
            raise InputError(f"{self.path}: no such file, so nothing to resume; start without --resume")
        try:
            return read(self.path, wanted)
        except InputError as error:
            raise InputError(f"{error}; {_START_AGAIN}") from None

    @contextmanager
    def _damaged(self) -> Iterator[None]:
        """Say that what was left cannot be rebuilt."""
        try:
            yield
        except (ValueError, LookupError, TypeError) as error:
            raise InputError(f"{self.path}: damaged: {error}; {_START_AGAIN}") from None

    def _written(self) -> tuple[bool, Origin] | None:
        """Tell whether the output is complete, and where it comes from; None where there is none, or another file."""
        if not self.output.is_file() or format_name(self.output) != self.OUTPUT.FORMAT:
            return None
        given, origin = read(self.output, self.OUTPUT)
        return given.complete, origin

    def _require_same(self, differing: Iterable[str]) -> None:
        """Refuse what is left of another command."""
        listed = "; ".join(differing)
        if listed:
            raise InputError(
                f"{self.path}: belongs to another search: {listed}. Repeat the original command with --resume, or "
                "start again with --force alone"
            )


@dataclass(frozen=True)
class Checkpoint(KeptFile):
    """Where a search leaves its state after every generation."""

    OUTPUT: ClassVar = IdentifiedModel

    def write(self, state: EvolutionState) -> None:
        """Replace what was there by this state, or leave it as it was."""
        write(self.path, SearchState.of(state), self.header)

    def add(self, unfinished: Unfinished) -> None:
        """Add what was evaluated of the next generation, so that it need not be done again."""
        evaluated = Evaluated.of(unfinished.submitted, unfinished.evaluation)
        before = SearchState.before_all(unfinished.submitted, unfinished.evaluation.objectives)
        known = read(self.path, SearchState)[0] if self.path.exists() else before
        write(self.path, replace(known, unfinished=evaluated), self.header)

    def read(self) -> StoppedSearch:
        """Take up what was left."""
        state, origin = self._read(SearchState)
        with self._damaged():
            stopped = state.stopped
        self._require_same_search(origin, 0 if stopped.state is None else stopped.state.index)
        return stopped

    def _require_same_search(self, then: Origin, generation: int) -> None:
        old, new = (
            {key: value for key, value in keys_of(h).items() if key != _GENERATIONS} for h in (then, self.header)
        )
        differing = [*differences(then, self.header, old, new, unimportant="validate")]
        generations = keys_of(self.header)[_GENERATIONS]
        if generation > generations:
            differing.append(f"{_GENERATIONS} = {generations}, but it has reached generation {generation}")
        self._require_same(differing)


def keys_of(header: Origin, sections: Sequence[str] = (_SECTION,)) -> dict[str, Any]:
    """List the keys that a search depends on, with dots."""
    config = parse_config(header.config, "/config")
    return {"seed": header.seed, **dict(flat_keys({section: config[section] for section in sections}))}


def differences(
    then: Origin, now: Origin, old: Mapping[str, Any], new: Mapping[str, Any], unimportant: str | None = None
) -> Iterator[str]:
    """List the keys and inputs that differ between a command that was stopped and the one that is to go on from it.

    Keys, with dots, are those that the result depends on; inputs whose roles begin with `unimportant` are left out.
    """
    if then.version != now.version:
        yield f"written by cpfls {then.version}, this is {now.version}"
    for key in sorted(old.keys() | new.keys()):
        if old.get(key) != new.get(key):
            yield f"{key} = {_short(old.get(key))} there, {_short(new.get(key))} here"
    for role in sorted(then.inputs.keys() | now.inputs.keys()):
        files = [header.inputs.get(role) for header in (then, now)]
        first, second = (file.sha256 if file else None for file in files)
        if first != second and not (unimportant and role.startswith(unimportant)):
            names = [f"{file.name} ({file.sha256[:12]})" if file else "none" for file in files]
            yield f"{role} = {names[0]} there, {names[1]} here"


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False) if isinstance(value, Mapping | list) else str(value)
    return textwrap.shorten(text, _LONGEST, placeholder=" ...")


_OF_A_PROCESSOR = 8
"""Processes that a processor may get, of which more than one only share it."""


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

    def run(
        self, watch: Watch, progress: Callable[[SearchStep], None], *, count: int = 1, scheduler: str | None = None
    ) -> SearchRun:
        """Arrange how the search is run; from here on a checkpoint that is not resumed is given up.

        Interrupts are deferred as long as its workers are employed, which is as long as it searches: so many processes,
        or those of a Dask scheduler at an address.
        """
        if self.stopped is None:
            self.checkpoint.remove()

        @contextmanager
        def workers(evaluate: Evaluate) -> Iterator[Workforce]:
            asked = f"--workers {count}" if scheduler is None else f"--scheduler {scheduler}"
            with (
                about_option(asked, WorkerError),
                watch.deferring(),
                employ(evaluate, count=count, scheduler=scheduler) as workforce,
            ):
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

    def end(self, reason: StopReason) -> None:
        """Remove the checkpoint of a search that came to its end, after what it found is written."""
        if is_end(reason):
            self.checkpoint.remove()


def begin_search(
    job: Job, inputs: Mapping[str, Path], *, resume: bool, workers: int, scheduler: str | None
) -> tuple[dict[str, InputFile], Resumable]:
    """Check workers, inputs, checkpoint and output of a search before anything is computed.

    Refused are more processes than this machine can run, and a scheduler with them or without an address.
    """
    if scheduler is not None and workers > 1:
        raise InputError("--scheduler: brings its own workers; leave out --workers")
    if scheduler is not None:
        require_address(scheduler)
    processors = os.cpu_count() or 1
    if workers > _OF_A_PROCESSOR * processors:
        raise InputError(f"--workers {workers}: this machine has {processors} processors; give that many")
    files = take_inputs(job, inputs)
    return files, Resumable(*Checkpoint.begun(job, origin_before(job.study, files), resume=resume))


_OF_VEHICLE = ("vehicle", "import", "playback")
"""Sections of the config that the search depends on."""


@result
class KeptStructure:
    """A structure that was judged: its fits to all parts of the flights first, then without each of them."""

    blocks: tuple[str, ...] = about("its blocks", "block")
    rules: int = about("rules of its remainder")
    order: int = about("order of the harmonics of its remainder")
    loss: Array = about("of each fit", "fit")
    values: Array = about("numbers of all fits, one fit after another", "value", unit="SI", ragged=True)
    hessian: Array = about("curvatures of the fit to all parts by rows", "curvature", ragged=True)

    @classmethod
    def of(cls, judged: Judged) -> KeptStructure:
        """Take the fits of a structure."""
        fits, rules = (judged.fit, *judged.without), judged.structure.rules
        return cls(
            blocks=judged.structure.blocks,
            rules=rules[0],
            order=rules[1],
            loss=np.array([each.loss for each in fits]),
            values=np.concatenate([each.values for each in fits]),
            hessian=judged.fit.hessian.ravel(),
        )

    @property
    def pair(self) -> tuple[Structure, Solution]:
        """The structure and its fits, equal to what was stored down to the last bit."""
        values = self.values.reshape(len(self.loss), -1)
        hessian = self.hessian.reshape(2 * values.shape[1:])
        return Structure(self.blocks, Rules(self.rules, self.order)), Solution(
            tuple(values), tuple(self.loss.tolist()), hessian
        )


@result
class KeptStructures:
    """An unfinished search for the structure of a vehicle: what was fitted so far, in the order of the search."""

    FORMAT: ClassVar = "cpfls/vehicle-checkpoint"
    MADE_BY: ClassVar = "vehicle"

    structures: tuple[KeptStructure, ...] = part(brief=False)


@dataclass(frozen=True)
class VehicleCheckpoint(KeptFile):
    """Where a search for the structure of a vehicle leaves what it has judged."""

    OUTPUT: ClassVar = Vehicle

    def write(self, judged: Sequence[Judged]) -> None:
        """Replace what was there by these structures, or leave it as it was."""
        write(self.path, KeptStructures(structures=tuple(map(KeptStructure.of, judged))), self.header)

    def read(self) -> Kept:
        """Take up what was left."""
        left, origin = self._read(KeptStructures)
        with self._damaged():
            kept = dict(each.pair for each in left.structures)
        old, new = (keys_of(header, _OF_VEHICLE) for header in (origin, self.header))
        self._require_same(differences(origin, self.header, old, new, unimportant="held-out"))
        return kept
