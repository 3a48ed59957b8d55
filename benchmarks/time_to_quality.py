"""Best mean squared error against time: our genetic algorithm beside other searches, on the paper's study.

    STUDY=data/paper-gentle
    python benchmarks/time_to_quality.py configs/paper-gentle.yaml $STUDY/flight.h5 $STUDY/selection.h5 [SEEDS]

It needs the ``bench`` extra, and the study's files (``make data/paper-gentle/selection.h5``). All searches use the
same evaluator with the same local search inside, in one thread. Time is CPU time of the process, so that other work on
the machine counts little.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np
from pymoo.indicators.hv import HV

from benchmarks.shared.quality_plot import draw
from benchmarks.shared.searches import Search, searches, spent
from cpfls_cli.arrays import Array
from cpfls_cli.config.load import load_study
from cpfls_cli.evolution.ranking import pareto_front
from cpfls_cli.flights.training import read_training
from cpfls_cli.identification.evaluator import Evaluator, uniform_chromosome
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.search import choose
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.reduction.selection import Selection
from cpfls_cli.store import read

DEFAULT = IdentificationSettings()
PLOT = Path(__file__).resolve().parents[1] / "docs" / "time-to-quality.svg"
EVALUATIONS = 1200
SECONDS = (1.0, 2.0, 5.0, 10.0)
# Mean squared error, largest error, condition number that a front is measured from, in N^2 m^2, N m and 1.
REFERENCE = np.array([1e-7, 1e-2, 1e8])


@dataclass(frozen=True)
class Run:
    """One search with one seed.

    Parameters
    ----------
    seconds : array, shape (evaluations,)
        CPU time when each evaluation ended.
    objectives : array, shape (evaluations, 3)
    outside : float
        Share of the time that the search itself took, beside the evaluations.
    """

    seconds: Array
    objectives: Array
    outside: float

    @property
    def best(self) -> Array:
        """Best mean squared error so far, after each evaluation."""
        return np.minimum.accumulate(self.objectives[:, 0])

    def after(self, seconds: float) -> float:
        """Best mean squared error after so much time; the worst there is before the first evaluation."""
        done = int(np.searchsorted(self.seconds, seconds, side="right"))
        return float(self.best[done - 1]) if done else np.inf

    @property
    def front(self) -> Array:
        """Objectives of the non-dominated chromosomes."""
        finite = self.objectives[np.isfinite(self.objectives).all(axis=1)]
        return finite[pareto_front(finite)]

    def below(self, condition_number: float) -> float:
        """Best mean squared error among models of no larger condition number."""
        well = self.front[self.front[:, 2] <= condition_number]
        return float(well[:, 0].min()) if len(well) else np.inf

    @property
    def chosen(self) -> Array:
        """Objectives of the model that would be chosen."""
        return self.front[choose(self.front, DEFAULT.choice)]

    @property
    def hypervolume(self) -> float:
        """Decades cubed that the front covers below the reference."""
        decades = np.log10(self.front / REFERENCE)
        return float(HV(ref_point=np.zeros(3))(decades))


def main(config: Path, flight: Path, selection: Path, seeds: int = 10) -> None:
    study = load_study(config)
    data = read_training([flight], selection, study)
    evaluator = model_evaluator(data.training, data.learned, study.identification)
    evaluator(np.full((2, evaluator.structure.genes), 30000))
    print_start(evaluator, selection)
    compared = searches(study.identification, DEFAULT)
    found: dict[str, list[Run]] = {name: [] for name in compared}
    # Seed by seed, so that every search has its share of whatever else the machine does.
    for seed in range(1, seeds + 1):
        for name, search in compared.items():
            found[name].append(run(search, evaluator, seed))
            print(f"{name}, seed {seed}: {found[name][-1].best[-1]:.3g}", file=sys.stderr, flush=True)
    show(found)
    draw({name: [(run.seconds, run.best) for run in runs] for name, runs in found.items()}, PLOT)


def print_start(evaluator: Evaluator, selection: Path) -> None:
    """Print what the equidistant partitions have before and after their local search: it is that of the samples."""
    uniform = uniform_chromosome(evaluator.structure)
    before = evaluator.objectives(uniform, evaluator.fit(uniform))[0]
    after = evaluator(uniform[None]).objectives[0, 0]
    chosen, _ = read(selection, Selection)
    print(
        f"Equidistant partitions, {len(chosen.indices)} samples by {chosen.criterion}: mean squared error "
        f"{before:.4g} N^2 m^2, {after:.4g} after local search"
    )


def run(search: Search, evaluator: Evaluator, seed: int) -> Run:
    course = spent(search, evaluator, seed, EVALUATIONS)
    seconds = np.array(course.seconds)
    return Run(seconds, np.array(course.objectives), 1.0 - course.inside / seconds[-1])


def show(found: Mapping[str, list[Run]]) -> None:
    """Print both tables; the JSON of the first holds every course."""
    courses = {
        name: [{"cpu_seconds": run.seconds.tolist(), "objectives": run.objectives.tolist()} for run in runs]
        for name, runs in found.items()
    }
    columns = ("search", *(f"{seconds:g} s" for seconds in SECONDS), f"{EVALUATIONS} evaluations", "its s")
    rows = [
        (name, *(spread([run.after(seconds) for run in runs]) for seconds in SECONDS), *at_end(runs))
        for name, runs in found.items()
    ]
    print("Best mean squared error, 1e-9 N^2 m^2: median (range) over seeds\n")
    table("time_to_quality", columns, rows, courses=courses)
    cap = float(np.median([np.median(run.front[:, 2]) for run in found["ours, preset paper"]]))
    columns = ("search", f"condition number below {cap:.2g}", "chosen", "its condition number", "front", "itself")
    rows = [(name, *front_columns(runs, cap)) for name, runs in found.items()]
    print(
        "\nMean squared error as above; hypervolume of the front in decades cubed; share of time beside evaluations\n"
    )
    table("time_to_quality_fronts", columns, rows)


def at_end(runs: list[Run]) -> tuple[str, str]:
    return spread([run.best[-1] for run in runs]), f"{np.median([run.seconds[-1] for run in runs]):.1f}"


def front_columns(runs: list[Run], cap: float) -> tuple[str, ...]:
    return (
        spread([run.below(cap) for run in runs]),
        spread([run.chosen[0] for run in runs]),
        f"{np.median([run.chosen[2] for run in runs]):.2g}",
        spread([run.hypervolume for run in runs], 1.0),
        f"{np.median([run.outside for run in runs]):.1%}",
    )


def spread(values: list[float], unit: float = 1e-9) -> str:
    """Write median and range."""
    middle, low, high = (value / unit for value in (np.median(values), min(values), max(values)))
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"


if __name__ == "__main__":
    if len(sys.argv) not in (4, 5):
        sys.exit(__doc__)
    main(*(Path(argument) for argument in sys.argv[1:4]), *(int(argument) for argument in sys.argv[4:]))
