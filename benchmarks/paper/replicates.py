"""Replicates of a search: settings with one run for each seed, what each run found, and how far runs lie apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import ClassVar

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.findings import Score, score_of
from cpfls_cli.identification.identify import FoundModel
from cpfls_cli.report.source import Source
from cpfls_cli.result import about, part, result
from cpfls_cli.rounding import levelled

ALL_SAMPLES = "all"
"""The criterion of a setting that learns from all samples."""

ERRORS = ("mse", "max_error", "relative_error")
_SETTLED = 0.05


@result
class Spread:
    """A measure over replicates, those left out in which it is not known."""

    count: int = about("replicates in which it is known")
    mean: float = about("not known without any", gaps=True)
    variance: float = about("unbiased; not known for fewer than two", gaps=True)
    smallest: float = about("least value", gaps=True)

    @property
    def standard_deviation(self) -> float:
        """Square root of the variance."""
        return float(np.sqrt(self.variance))


def spread(values: Array) -> Spread:
    """Measure how far finite replicates lie apart: ``s^2 = sum (x - mean x)^2 / (n - 1)``."""
    known = values[np.isfinite(values)]
    return Spread(
        count=len(known),
        mean=float(np.mean(known)) if len(known) else float("nan"),
        variance=float(np.var(known, ddof=1)) if len(known) > 1 else float("nan"),
        smallest=float(np.min(known)) if len(known) else float("nan"),
    )


@result
class Replicate:
    """One run of a search; its errors are not known where it found no model, or where it was not judged."""

    seed: int = about("`cpfls identify --seed` with it finds the same model")
    generations: int = about("generations bred")
    evaluations: int = about("chromosomes evaluated")
    mse: Array = about("mean squared torque error over the axes", "part", unit="(N m)^2", gaps=True)
    max_error: Array = about("largest torque error", "part", unit="N m", gaps=True)
    relative_error: Array = about("largest error over largest torque, worst axis", "part", gaps=True)
    condition_number: float = about("over the kept singular values", gaps=True)
    chromosome: tuple[int, ...] = about("chosen 16-bit weights", "gene", brief=False)
    learned_mse: float = about("mean squared torque error over the samples learned from", unit="(N m)^2", gaps=True)
    learned_max_error: float = about("largest torque error of them", unit="N m", gaps=True)
    learned_relative_error: float = about("largest error over largest torque of them, worst axis", gaps=True)
    settled: int = about("generation from which on the least first objective is within 5 % of the last one")


def replicate(seed: int, training: TorqueSource, learned: TorqueSource, found: FoundModel | None) -> Replicate:
    """Describe one run; without a model where no chromosome gave a finite one."""
    score = None if found is None else score_of(training, found.model.torque)
    of_learned = score if found is None or len(learned) == len(training) else score_of(learned, found.model.torque)
    result = None if found is None else found.result
    best = np.zeros(1) if result is None else result.history.best[:, 0]
    chosen = () if result is None else tuple(result.front.chromosomes[result.front.chosen].tolist())
    mse, max_error, relative_error = (np.array([error]) for error in _errors(score))
    learned_mse, learned_max_error, learned_relative_error = _errors(of_learned)
    return Replicate(
        seed=seed,
        generations=len(best) - 1,
        evaluations=0 if result is None else int(result.history.evaluations[-1]),
        mse=mse,
        max_error=max_error,
        relative_error=relative_error,
        condition_number=np.nan if found is None else found.system.condition_number,
        chromosome=chosen,
        learned_mse=learned_mse,
        learned_max_error=learned_max_error,
        learned_relative_error=learned_relative_error,
        settled=int(np.argmax(best <= (1.0 + _SETTLED) * best[-1])),
    )


def _errors(score: Score | None) -> tuple[float, float, float]:
    """Mean squared, largest and relative error."""
    if score is None:
        return np.nan, np.nan, np.nan
    return float(np.mean(score.mse)), float(np.max(score.max_error)), score.worst_relative_error


@result
class Setting:
    """A setting of a sweep with its finished runs, in the order of their seeds."""

    name: str = about("what the config calls it")
    overrides: tuple[str, ...] = about("what is different in it, as options of --set", "override")
    structure: str = about("cpfls or fls")
    samples: int = about("samples learned from")
    criterion: str = about("what chose them; all: all samples that train")
    selection: str = about("sha256 of their indices; equal ones are the same samples")
    population: int = about("chromosomes in the population")
    generations: int = about("generations bred at most")
    judged_on: str = about("what the search took its errors from: training or learned")
    ranking: str = about("how the search ranked chromosomes")
    uniform_condition_number: float = about(
        "of the samples learned from, at uniform partitions; not known below the rank of all", gaps=True
    )
    largest_torque: float = about("of the training part, on the axis that has most", unit="N m")
    replicates: tuple[Replicate, ...] = part()

    def of(self, name: str, part: int = 0) -> Array:
        """Give a number of each run, on a part by its index where there is one for each; shape (runs,)."""
        values = [np.atleast_1d(getattr(run, name)) for run in self.replicates]
        return np.array([each[part if len(each) > 1 else 0] for each in values], dtype=float)

    @property
    def errors(self) -> Array:
        """Mean squared, largest and relative error of each run, over what its search judged on; shape (runs, 3)."""
        learned = "learned_" if self.judged_on == "learned" else ""
        return np.stack([self.of(f"{learned}{name}") for name in ERRORS], axis=1)

    @property
    def runs(self) -> int:
        """Number of finished runs."""
        return len(self.replicates)

    @property
    def seeds(self) -> Array:
        """Seeds of the runs."""
        return np.array([run.seed for run in self.replicates], dtype=np.int64)

    @property
    def mse(self) -> Spread:
        """Mean squared error on the training part over the runs."""
        return spread(self.of("mse"))

    @property
    def max_error(self) -> Spread:
        """Largest error on the training part over the runs."""
        return spread(self.of("max_error"))

    @property
    def relative_error(self) -> Spread:
        """Relative error on the training part over the runs."""
        return spread(self.of("relative_error"))

    @property
    def condition_number(self) -> Spread:
        """Condition number over the runs."""
        return spread(self.of("condition_number"))

    @property
    def size(self) -> tuple[int, int]:
        """Population and generations."""
        return self.population, self.generations

    @property
    def chromosomes(self) -> int:
        """Chromosomes of a search, counted as the paper does."""
        return self.population * self.generations

    @property
    def best(self) -> Replicate | None:
        """The run with the smallest mean squared error; None where no run found a model."""
        mse = self.of("mse")
        return self.replicates[int(np.nanargmin(levelled(mse)))] if np.isfinite(mse).any() else None


@result
class Sweep:
    """Replicates of a search, by setting and seed."""

    FORMAT: ClassVar = "cpfls/searches"

    parts: tuple[str, ...] = about("what models are judged on: training", "part")
    complete: bool = about("1 where every run is finished")
    settings: tuple[Setting, ...] = part()

    @property
    def runs(self) -> int:
        """Number of finished runs of all settings."""
        return sum(setting.runs for setting in self.settings)

    @property
    def without_model(self) -> int:
        """Runs that found no finite model."""
        return int(sum(np.sum(np.isnan(setting.of("mse"))) for setting in self.settings))

    def with_run(self, setting: int, run: Replicate, *, complete: bool) -> Sweep:
        """Add a finished run of a setting by its index."""
        own = self.settings[setting]
        longer = replace(own, replicates=(*own.replicates, run))
        settings = (*self.settings[:setting], longer, *self.settings[setting + 1 :])
        return replace(self, settings=settings, complete=complete)

    def differing_settings(self, other: Sweep) -> list[str]:
        """Name the fields in which its settings are not those of another sweep."""
        names = [own.name for own in fields(Setting) if own.name != "replicates"]
        one, two = ([[getattr(own, name) for own in each.settings] for name in names] for each in (self, other))
        return [f"settings/{name}" for name, a, b in zip(names, one, two, strict=True) if not _same(a, b)]

    def joined(self, other: Sweep) -> Sweep | None:
        """Take the runs of both sweeps as those of one; None where settings or parts differ, or they share a seed."""
        if self.parts != other.parts or self.differing_settings(other):
            return None
        pairs = list(zip(self.settings, other.settings, strict=True))
        if any(np.isin(one.seeds, two.seeds).any() for one, two in pairs):
            return None
        settings = tuple(replace(one, replicates=(*one.replicates, *two.replicates)) for one, two in pairs)
        return replace(self, settings=settings, complete=self.complete and other.complete)


def _same(one: Sequence[object], two: Sequence[object]) -> bool:
    """Tell whether values are equal, also where both are no number."""
    return len(one) == len(two) and all(a == b or (a != a and b != b) for a, b in zip(one, two, strict=True))


def joined_sweeps(sweeps: Sequence[Source[Sweep]]) -> list[Source[Sweep]]:
    """Take sweeps of equal settings and inputs as one, in the order of the first of each, unless they share a seed."""
    joined: list[Source[Sweep]] = []
    for sweep in sweeps:
        both = ((index, _joined(other, sweep)) for index, other in enumerate(joined))
        index, one = next(((index, one) for index, one in both if one is not None), (None, None))
        if index is None or one is None:
            joined.append(sweep)
        else:
            joined[index] = one
    return joined


def _joined(first: Source[Sweep], second: Source[Sweep]) -> Source[Sweep] | None:
    one, two = (sorted((role, file.sha256) for role, file in own.header.inputs.items()) for own in (first, second))
    sweep = first.record.joined(second.record) if one == two else None
    return None if sweep is None else replace(first, label=f"{first.label} and {second.label}", record=sweep)
