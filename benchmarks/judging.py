"""Compare judging chromosomes on the selected samples with judging them on the whole training part.

Run `make data/paper-gentle/selection.h5` first, then

    python benchmarks/judging.py configs/paper-gentle.yaml data/paper-gentle/flight.h5 data/paper-gentle/selection.h5
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np

from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import generator
from cpfls_cli.dynamics.inertia_functions import InertiaFunctions
from cpfls_cli.flights.training import read_training
from cpfls_cli.identification.evaluator import Evaluator, decode
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.judge import score_of
from cpfls_cli.identification.samples import Ready, Samples
from cpfls_cli.identification.search import search


def main(config: Path, flight: Path, selection: Path) -> None:
    study = load_study(config)
    data = read_training([flight], selection, study)
    whole = model_evaluator(data.training, data.learned, study.identification)
    judge = whole.judge
    selected = Samples.of(Ready(data.learned, judge.ready.rigid), judge.structure, judge.ranges)
    evaluators = {"selected samples": replace(whole, judge=selected), "whole training part": whole}
    rows = []
    for name, evaluator in evaluators.items():
        front = search(evaluator, study.identification, generator(study, "identify")).front
        errors = np.array([relative_error(whole, chromosome) for chromosome in front.chromosomes])
        rows.append((name, len(errors), int(np.sum(errors > 1)), f"{errors[front.chosen]:.2%}"))
    worst, chosen = "with relative error above 100 %", "relative error of the chosen one"
    table("judging", ("judged on", "members of the front", worst, chosen), rows)


def relative_error(evaluator: Evaluator, chromosome) -> float:
    """Largest error over largest torque on the whole training part, worst axis."""
    fit = evaluator.fit(chromosome)
    assert fit is not None
    judge, nowhere = evaluator.judge, np.zeros((0, 0), dtype=bool)
    partitions = decode(judge.structure, chromosome.astype(float))
    model = InertiaFunctions(judge.structure, judge.ranges, partitions, fit.coefficients, fit.rigid_body, nowhere)
    return score_of(judge.ready.source, model.torque).worst_relative_error


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*(Path(argument) for argument in sys.argv[1:]))
