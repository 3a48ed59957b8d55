"""The artifact of a sweep: one row for each run, and the runs of each setting."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.spec import Format, Record, dataset, group, record
from cpfls_cli.rounding import levelled

if TYPE_CHECKING:
    from cpfls_cli.identification.identify import Identification
    from cpfls_cli.identification.judge import Score

ALL_SAMPLES = "all"
"""The criterion of a setting that learns from all samples."""

_NO_GENE = -1
_SETTLED = 0.05
_MEASURES = ("mse", "max_error", "relative_error")


@record
class SettingGroup:
    """Settings of the sweep."""

    name: tuple[str, ...] = dataset("what the config calls it", "setting")
    overrides: tuple[str, ...] = dataset("what is different in it, as options of --set", "setting")
    structure: tuple[str, ...] = dataset("cpfls or fls", "setting")
    samples: IntArray = dataset("samples learned from", "setting")
    criterion: tuple[str, ...] = dataset("what chose them; all: all samples that train", "setting")
    selection: tuple[str, ...] = dataset("sha256 of their indices; equal ones are the same samples", "setting")
    population: IntArray = dataset("chromosomes in the population", "setting")
    generations: IntArray = dataset("generations bred at most", "setting")
    judged_on: tuple[str, ...] | None = dataset(
        "what the search took its errors from: training or learned", "setting", default=None
    )
    ranking: tuple[str, ...] | None = dataset("how the search ranked chromosomes", "setting", default=None)
    uniform_condition_number: Array | None = dataset(
        "of the samples learned from, at uniform partitions; not known below the rank of all",
        "setting",
        gaps=True,
        default=None,
    )


@record
class RunGroup:
    """One row for each run."""

    setting: IntArray = dataset(
        "index of the setting; every setting with the first seed, then the next seed", "run", into="setting"
    )
    seed: IntArray = dataset("`cpfls identify --seed` with it finds the same model", "run")
    generations: IntArray = dataset("generations bred", "run")
    evaluations: IntArray = dataset("chromosomes evaluated", "run")
    mse: Array = dataset(
        "mean squared torque error over the axes; not known: no model found", "run", "part", units="(N m)^2", gaps=True
    )
    max_error: Array = dataset("largest torque error", "run", "part", units="N m", gaps=True)
    relative_error: Array = dataset("largest error over largest torque, worst axis", "run", "part", gaps=True)
    condition_number: Array = dataset("over the kept singular values", "run", gaps=True)
    chromosome: npt.NDArray[np.int32] = dataset("chosen 16-bit weights; -1 beyond those of the setting", "run", "gene")
    learned_mse: Array | None = dataset(
        "mean squared torque error over the samples learned from", "run", units="(N m)^2", gaps=True, default=None
    )
    learned_max_error: Array | None = dataset(
        "largest torque error of them", "run", units="N m", gaps=True, default=None
    )
    learned_relative_error: Array | None = dataset(
        "largest error over largest torque of them, worst axis", "run", gaps=True, default=None
    )
    settled: IntArray | None = dataset(
        "generation from which on the smallest first objective is within 5 % of the last one", "run", default=None
    )

    def __len__(self) -> int:
        """Count the finished runs."""
        return len(self.seed)

    @classmethod
    def none(cls, parts: Sequence[str], genes: int) -> Self:
        """Begin a sweep of which no run is finished, for parts of data and so many genes of its longest chromosome."""
        run = cls.of_run(0, 0, parts, genes, None)
        nothing: dict[str, Any] = {f.name: getattr(run, f.name)[:0] for f in fields(cls)}
        return cls(**nothing)

    def followed_by(self, other: Self) -> Self:
        """Add runs after these."""
        pairs = {f.name: (getattr(self, f.name), getattr(other, f.name)) for f in fields(self)}
        # What one of them lacks, an older sweep, is lacking in both together.
        joined: dict[str, Any] = {
            name: None if one is None or two is None else np.concatenate([one, two])
            for name, (one, two) in pairs.items()
        }
        return type(self)(**joined)

    def with_run(self, setting: int, seed: int, parts: Sequence[str], result: Identification | None) -> Self:
        """Add a run, without a result where no chromosome gave a finite model."""
        return self.followed_by(self.of_run(setting, seed, parts, self.chromosome.shape[1], result))

    @classmethod
    def of_run(cls, setting: int, seed: int, parts: Sequence[str], genes: int, result: Identification | None) -> Self:
        """Arrange one run."""
        chromosome = np.full(genes, _NO_GENE, dtype=np.int32)
        condition_number, generations, evaluations, settled = np.nan, 0, 0, 0
        if result is not None:
            chosen = result.front.chromosomes[result.front.chosen]
            chromosome[: len(chosen)] = chosen
            condition_number = result.system.condition_number
            generations, evaluations = len(result.history.evaluations) - 1, int(result.history.evaluations[-1])
            settled = int(np.argmax(result.history.best[:, 0] <= (1.0 + _SETTLED) * result.history.best[-1, 0]))
        learned = _errors(None if result is None else result.learned)
        mse, max_error, relative_error = np.array([_scores(result, part) for part in parts]).T
        return cls(
            setting=np.array([setting]),
            seed=np.array([seed]),
            generations=np.array([generations]),
            evaluations=np.array([evaluations]),
            mse=mse[None],
            max_error=max_error[None],
            relative_error=relative_error[None],
            condition_number=np.array([condition_number]),
            chromosome=chromosome[None],
            learned_mse=np.array(learned[:1]),
            learned_max_error=np.array(learned[1:2]),
            learned_relative_error=np.array(learned[2:]),
            settled=np.array([settled]),
        )


def _scores(result: Identification | None, part: str) -> tuple[float, float, float]:
    """Mean squared, largest and relative error of a model on a part; NaN where it was not judged."""
    return _errors(None if result is None or part not in result.scores else result.scores[part]["model"])


def _errors(score: Score | None) -> tuple[float, float, float]:
    if score is None:
        return np.nan, np.nan, np.nan
    return float(np.mean(score.mse)), float(np.max(score.max_error)), score.worst_relative_error


@dataclass(frozen=True)
class Spread:
    """A measure over replicates.

    Attributes
    ----------
    count : int
        Replicates that have a value.
    mean : float
        NaN without any.
    variance : float
        Unbiased; NaN for fewer than two.
    """

    count: int
    mean: float
    variance: float

    @property
    def deviation(self) -> float:
        """Standard deviation."""
        return float(np.sqrt(self.variance))


def spread(values: Array) -> Spread:
    """Measure how far finite replicates lie apart: ``s^2 = sum (x - mean x)^2 / (n - 1)``."""
    known = values[np.isfinite(values)]
    mean = float(np.mean(known)) if len(known) else float("nan")
    variance = float(np.var(known, ddof=1)) if len(known) > 1 else float("nan")
    return Spread(len(known), mean, variance)


@dataclass(frozen=True)
class SettingRuns:
    """One setting of a sweep with its finished runs; other fields are described at `SettingGroup`.

    Attributes
    ----------
    seeds, evaluations : array of int, shape (runs,)
    mse, max_error, relative_error : array, shape (runs, parts)
        Not finite where a run found no model.
    condition_number : array, shape (runs,)
    uniform_condition_number : float
        Of the samples learned from, at uniform partitions; NaN where it is not known.
    learned : array, shape (runs, 3), or None
        Mean squared, largest and relative error over the samples learned from.
    settled : array of int, shape (runs,), or None
        Generation from which on the smallest first objective is within 5 % of the last one.
    largest_torque : float, N m
        Of the training part; NaN where it is not known.
    """

    name: str
    structure: str
    criterion: str
    samples: int
    population: int
    generations: int
    seeds: IntArray
    evaluations: IntArray
    mse: Array
    max_error: Array
    relative_error: Array
    condition_number: Array
    judged_on: str = "training"
    ranking: str = "quantity-dominance"
    uniform_condition_number: float = float("nan")
    learned: Array | None = None
    settled: IntArray | None = None
    largest_torque: float = float("nan")

    @property
    def errors(self) -> Array:
        """Mean squared, largest and relative error of each run, over what its search judged on; shape (runs, 3)."""
        if self.judged_on == "learned" and self.learned is not None:
            return self.learned
        return np.stack([self.mse[:, 0], self.max_error[:, 0], self.relative_error[:, 0]], axis=1)

    @property
    def runs(self) -> int:
        """Number of finished runs."""
        return len(self.condition_number)

    @property
    def size(self) -> tuple[int, int]:
        """Population and generations."""
        return self.population, self.generations

    @property
    def chromosomes(self) -> int:
        """Chromosomes of a search, counted as the paper does."""
        return self.population * self.generations

    @property
    def best(self) -> int | None:
        """The run with the smallest mean squared error; None where no run found a model."""
        return int(np.nanargmin(levelled(self.mse[:, 0]))) if np.isfinite(self.mse[:, 0]).any() else None

    def best_of(self, values: Array) -> float:
        """Pick the value of the best run."""
        return float("nan") if self.best is None else float(values[self.best])

    def spreads(self, part: int) -> dict[str, dict[str, float]]:
        """Mean, variance and smallest value of each error over the runs, on a part by its index."""
        return {name: _spread(getattr(self, name)[:, part]) for name in _MEASURES}


def _same(one: Any, two: Any) -> bool:
    """Tell whether two columns hold the same, also where both hold no number."""
    floats = isinstance(one, np.ndarray) and one.dtype.kind == "f" and two is not None
    return bool(np.array_equal(one, two, equal_nan=floats))


def _known(values: Array | None, index: int) -> float:
    return float("nan") if values is None else float(values[index])


def _spread(values: Array) -> dict[str, float]:
    over_runs = spread(values)
    return {
        "mean": over_runs.mean,
        "variance": over_runs.variance,
        "standard_deviation": over_runs.deviation,
        "smallest": float(np.nanmin(values)) if over_runs.count else float("nan"),
    }


@record
class SweepRecord(Record):
    """The artifact `cpfls/sweep`."""

    FORMAT: ClassVar = Format(
        "cpfls/sweep",
        "replicates of a search, by setting and seed",
        "sweep",
        ("flight", "validate", "choose-on"),
    )

    setting: SettingGroup = group()
    part: tuple[str, ...] = dataset("what models are judged on: training, held-out rests, other flights", "part")
    run: RunGroup = group()
    complete: bool = dataset("1 where every run is finished, 0 where `--resume` goes on")
    largest_torque: Array | None = dataset(
        "largest torque of the axis that has most", "part", units="N m", default=None
    )

    @property
    def without_model(self) -> int:
        """Runs that found no finite model."""
        return int(np.sum(np.isnan(self.run.mse[:, 0])))

    @cached_property
    def settings(self) -> list[SettingRuns]:
        """The settings with their runs, in the order of the config."""
        return [self._setting(index) for index in range(len(self.setting.name))]

    def _setting(self, index: int) -> SettingRuns:
        setting, run = self.setting, self.run
        chosen = run.setting == index
        learned = (run.learned_mse, run.learned_max_error, run.learned_relative_error)
        known = [values[chosen] for values in learned if values is not None]
        return SettingRuns(
            setting.name[index],
            setting.structure[index],
            setting.criterion[index],
            int(setting.samples[index]),
            int(setting.population[index]),
            int(setting.generations[index]),
            run.seed[chosen],
            run.evaluations[chosen],
            run.mse[chosen],
            run.max_error[chosen],
            run.relative_error[chosen],
            run.condition_number[chosen],
            judged_on="training" if setting.judged_on is None else setting.judged_on[index],
            ranking="quantity-dominance" if setting.ranking is None else setting.ranking[index],
            uniform_condition_number=_known(setting.uniform_condition_number, index),
            learned=np.stack(known, axis=1) if len(known) == len(learned) else None,
            settled=None if run.settled is None else run.settled[chosen],
            largest_torque=_known(self.largest_torque, 0),
        )

    def differing_settings(self, other: SweepRecord) -> list[str]:
        """List the datasets in which its settings are not those of another sweep."""
        names = [f.name for f in fields(SettingGroup)]
        one, two = self.setting, other.setting
        return [f"setting/{name}" for name in names if not _same(getattr(one, name), getattr(two, name))]

    def joins(self, other: SweepRecord) -> bool:
        """Tell whether another sweep does the same from the same inputs, with none of these seeds."""
        inputs, others = (
            sorted((role, file.sha256) for role, file in sweep.origin.inputs.items()) for sweep in (self, other)
        )
        same = inputs == others and self.part == other.part and not self.differing_settings(other)
        return same and not np.isin(self.run.seed, other.run.seed).any()

    def joined(self, other: SweepRecord) -> SweepRecord:
        """Take the runs of both sweeps as those of one, which begins at the smaller of their seeds."""
        header = replace(self.origin, seed=min(self.origin.seed, other.origin.seed))
        complete = self.complete and other.complete
        return replace(self, run=self.run.followed_by(other.run), complete=complete, header=header)

    @property
    def summary(self) -> dict[str, Any]:
        """The sweep for machines."""
        settings = [self._summary(index, setting) for index, setting in enumerate(self.settings)]
        return {"runs": len(self.run), "complete": self.complete, "settings": settings}

    def _summary(self, index: int, setting: SettingRuns) -> dict[str, Any]:
        return {
            "name": setting.name,
            "overrides": json.loads(self.setting.overrides[index]),
            "structure": setting.structure,
            "samples": setting.samples,
            "population": setting.population,
            "generations": setting.generations,
            "runs": setting.runs,
            "seeds": setting.seeds.tolist(),
            **setting.spreads(0),
            "condition_number": _spread(setting.condition_number),
            "held_out": {part: setting.spreads(number) for number, part in enumerate(self.part) if number},
        }
