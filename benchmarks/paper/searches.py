"""Searches of several settings with several seeds each, as Table 5 and the readings of the paper compare them.

Finished runs are kept in OUTPUT.partial, and a long search in progress in OUTPUT.checkpoint: stopped and started again
with the same words it goes on from both. With another study or flight it begins anew.
"""

from __future__ import annotations

import hashlib
import json
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks.paper.replicates import ALL_SAMPLES, Setting, Sweep, replicate
from benchmarks.shared.measure import program
from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.artifacts.job import Job, check_outputs, origin_before, take_inputs
from cpfls_cli.cli.interrupts import deferred_interrupts
from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.errors import InputError
from cpfls_cli.flights.training import SplitFlights, flight_roles, split_training, uniform_regressor
from cpfls_cli.identification.data import TRAINING, TorqueSource, gathered
from cpfls_cli.identification.identify import FoundModel, find_model
from cpfls_cli.identification.search import NothingFoundError, SearchRun, StopReason, is_end
from cpfls_cli.reduction.survey import Survey, survey
from cpfls_cli.reduction.training_set import Selection, reduce_streamed
from cpfls_cli.search import Checkpoint, Resumable, StoppedSearch, Watch
from cpfls_cli.store import Origin, read, write
from tests.builders.reductions import beginning

_AT_ONCE = 1000
"""Chromosomes of a search that is not worth a checkpoint of its own: it takes seconds, and begins anew."""

_KEPT_EVERY_S = 10.0
"""Between two looks at finished runs that are kept: writing all of them takes as long as some runs."""


class Compared(StrEnum):
    """What is compared: the columns of Table 5, a larger search with the paper's smaller one, or readings."""

    TABLE_5 = "table-5"
    LARGER = "larger"
    READINGS = "readings"


@dataclass(frozen=True)
class Wanted:
    """A setting by its name: keys that differ, with their values, and whether it learns from a reduced set."""

    name: str
    keys: Mapping[str, Any] = field(default_factory=dict)
    reduced: bool = True

    @property
    def overrides(self) -> tuple[str, ...]:
        """The keys as options of --set."""
        return tuple(f"{key}={json.dumps(value)}" for key, value in self.keys.items())


_FLS, _ALL = (
    Wanted("FLS, all samples", {"identification.structure": "fls"}, False),
    Wanted("cpFLS, all samples", {}, False),
)
_SMALLER = {"identification.population": 75, "identification.generations": 25}


def settings(what: Compared, samples: Sequence[int]) -> Iterator[Wanted]:
    """List the settings of a comparison, largest sets first; readings differ in how they choose and what they judge."""
    if what is not Compared.LARGER:
        yield from (_FLS, _ALL)
    if what is Compared.READINGS:
        for size in samples:
            for criterion in ("paper-literal", "sigma_min", "even", "KD-exchange"):
                for judged in ("training", "learned"):
                    keys = {
                        "reduction.size": size,
                        "reduction.criterion": criterion,
                        "identification.judged_on": judged,
                    }
                    yield Wanted(f"cpFLS, {size} samples by {criterion}, judged on {judged}", keys)
        return
    for size in samples:
        yield Wanted(f"cpFLS, {size} samples", {"reduction.size": size})
    smaller = {"reduction.size": samples[-1], **_SMALLER}
    yield Wanted(f"cpFLS, {samples[-1]} samples, 75 x 25", smaller)
    if what is Compared.TABLE_5:
        # Section 6 ranks by quantity; this is the classical ranking that it is compared with.
        yield Wanted("the same, Pareto fronts", {**smaller, "identification.ranking": "pareto-fronts"})


@dataclass(frozen=True)
class Prepared:
    """A setting with the samples that it learns from."""

    study: Study
    learned: TorqueSource
    without_runs: Setting


class Samples:
    """Training data by setting; what two settings have in common is made once."""

    def __init__(self, split: SplitFlights, known: Sequence[Selection] = ()) -> None:
        self._split = split
        self._surveys: dict[str, Survey] = {}
        self._selections: dict[Any, Selection] = {("cpfls", each.criterion): each for each in known}

    def prepared(self, wanted: Wanted, study: Study) -> Prepared:
        """Choose the samples of a setting as `cpfls reduce` would."""
        training, learning = self._split.training, study.identification
        key = learning.structure
        if key not in self._surveys:
            self._surveys[key] = survey(uniform_regressor(training, study), study.reduction.rank_tolerance)
        learned, criterion, condition = training, ALL_SAMPLES, self._surveys[key].condition_number
        indices = self._split.training_indices
        if wanted.reduced:
            rule = study.reduction
            with settings_of("reduction", study):
                selection = self._selection(key, study)
            chosen = np.sort(selection.indices)
            learned, criterion, indices = gathered(training, chosen), rule.criterion, indices[chosen]
            condition = selection.condition_number if np.isfinite(selection.condition_number) else float("nan")
        without = Setting(
            name=wanted.name,
            overrides=wanted.overrides,
            structure=learning.structure,
            samples=len(learned),
            criterion=criterion,
            selection=hashlib.sha256(indices.astype("<i8").tobytes()).hexdigest(),
            population=learning.population,
            generations=learning.generations,
            judged_on=learning.judged_on,
            ranking=learning.ranking,
            uniform_condition_number=condition,
            largest_torque=max(float(np.max(np.abs(data.torque))) for data in training.chunks()),
            replicates=(),
        )
        return Prepared(study, learned, without)

    def _selection(self, key: str, study: Study) -> Selection:
        """Choose samples; a smaller size is the beginning of a larger one: Table 5 takes three of one rule."""
        settings = study.reduction
        known = self._selections.get((key, settings.criterion))
        selection = beginning(known, settings.size) if known and settings.size else None
        if selection is None:
            print(f"choosing {settings.size} samples by {settings.criterion}", file=sys.stderr)
            selection = reduce_streamed(self._surveys[key], settings, generator(study, "reduce"), lambda *_: None)
            self._selections[key, settings.criterion] = selection
        return selection


def main(
    config: Path,
    flight: Path,
    what: Compared,
    output: Annotated[Path, typer.Option("--output", "-o")],
    seed: int = 1,
    seeds: int = 10,
    population: int = 500,
    generations: int = 200,
    samples: Annotated[list[int] | None, typer.Option()] = None,
    overrides: Annotated[list[str] | None, typer.Option("--set")] = None,
    selections: Annotated[list[Path] | None, typer.Option("--selection")] = None,
    force: bool = False,
) -> None:
    size = (f"identification.population={population}", f"identification.generations={generations}")
    common = (*(overrides or ()), *size)
    study = load_study(config, common, seed)
    job = Job(study, output, force, False, lambda *_: None, lambda _: None, deferred_interrupts)
    check_outputs(job, output)
    inputs = take_inputs(job, flight_roles([flight]))
    split = split_training([flight], study, inputs)
    # Of the same motion, whatever its noise: `cpfls reduce` chooses as is chosen here.
    chosen = Samples(split, [read(path, Selection)[0] for path in selections or ()])
    wanted = list(settings(what, samples or ((2743, 1170, 685) if what is Compared.TABLE_5 else (685,))))
    prepared = [chosen.prepared(each, load_study(config, (*common, *each.overrides), seed)) for each in wanted]
    partial, origin = output.with_name(f"{output.name}.partial"), origin_before(study, inputs)
    nothing = Sweep(parts=(TRAINING,), complete=False, settings=tuple(each.without_runs for each in prepared))
    runs, watch = seeds * len(prepared), Watch(job, None)
    sweep, kept = begun(partial, origin, nothing, runs), time.monotonic()
    for number in range(sweep.runs, runs):
        index, own = number % len(prepared), seed + number // len(prepared)
        print(f"run {number + 1} of {runs}: {wanted[index].name}, seed {own}", file=sys.stderr)
        search, found, reason = run(job, prepared[index], own, split.training, inputs, watch)
        last = number + 1 == runs or not is_end(reason)
        if is_end(reason):
            finished = replicate(own, split.training, prepared[index].learned, found)
            sweep = sweep.with_run(index, finished, complete=number + 1 == runs)
        if last or time.monotonic() - kept > _KEPT_EVERY_S:
            write(partial, sweep, origin)
            kept = time.monotonic()
        if not is_end(reason):
            print(f"{partial}: is intact; the same command goes on", file=sys.stderr)
            raise SystemExit(130)
        search.end(reason)
    partial.replace(output)


def begun(partial: Path, origin: Origin, nothing: Sweep, runs: int) -> Sweep:
    """Take the finished runs of the same settings, study and flight, where there are some but not more than wanted."""
    if not partial.exists():
        return nothing
    known, then = read(partial, Sweep)
    same = all(getattr(then, name) == getattr(origin, name) for name in ("version", "seed", "config", "inputs"))
    fits = known.runs < runs or (known.runs == runs and known.complete)
    return known if same and fits and not known.differing_settings(nothing) else nothing


def run(
    job: Job, setting: Prepared, seed: int, training: TorqueSource, inputs: Mapping[str, InputFile], watch: Watch
) -> tuple[Resumable, FoundModel | None, StopReason]:
    """Search with one seed, as `cpfls identify --seed` does, and judge no baselines; None for no finite model."""
    study = setting.study.model_copy(update={"seed": seed})
    selection = InputFile("selection", setting.without_runs.selection, Selection.FORMAT)
    checkpoint = Checkpoint.of_output(job.output, origin_before(study, {**inputs, "selection": selection}))
    search = Resumable(checkpoint, left(checkpoint))
    state = search.run(watch, lambda _: None)
    if setting.without_runs.chromosomes <= _AT_ONCE:
        state = SearchRun(workers=state.workers, should_stop=state.should_stop)
    try:
        with settings_of("identification", study):
            found = find_model(training, setting.learned, study.identification, generator(study, "identify"), state)
            return search, found, found.result.stop_reason
    except NothingFoundError as error:
        return search, None, error.stop_reason


def left(checkpoint: Checkpoint) -> StoppedSearch | None:
    """Read the checkpoint of a run; none of the run before, nor a damaged one: from its start a run ends the same."""
    try:
        return checkpoint.read() if checkpoint.path.exists() else None
    except InputError:
        return None


if __name__ == "__main__":
    program(main)
