"""Where should chromosomes be judged: on the selected samples, or on the whole training part?

Run `cpfls trajectory`, `simulate` and `reduce` on configs/paper.yaml first, then

    python benchmarks/judging.py configs/paper.yaml data/paper/flight.h5 data/paper/selection.h5
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from cpfls_cli.config.load import load_study
from cpfls_cli.identification.chromosome import decode
from cpfls_cli.identification.evaluator import Evaluator, Judge
from cpfls_cli.identification.identify import coefficient_solver, search
from cpfls_cli.regressor.regressor import Regressor, data_ranges
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.stages.job import generator
from cpfls_cli.stages.training import read_training


def main(config: Path, flight: Path, selection: Path) -> None:
    study = load_study(config)
    settings = study.identification
    data = read_training(flight, selection, study)
    training, learned = data.flight[data.split.training], data.flight[data.learned]
    structure = model_structure(settings)
    ranges = data_ranges(structure, training.motion.attitude)
    regressors = {name: Regressor(structure, part.motion, ranges) for name, part in parts(training, learned).items()}
    judges = {name: Judge.of(part, regressors[name]) for name, part in parts(training, learned).items()}
    print("| judged on | members of the front | with relative error above 100 % | relative error of the chosen one |")
    print("|---|---|---|---|")
    for name, judge in judges.items():
        solver = coefficient_solver(learned, settings)
        evaluator = Evaluator(regressors["selected samples"], solver, judge, settings.local_search, False)
        front, _ = search(evaluator, settings, generator(study, "identify"), None)
        errors = np.array([relative_error(evaluator, judges["whole training part"], c) for c in front.chromosomes])
        print(f"| {name} | {len(errors)} | {np.sum(errors > 1)} | {errors[front.chosen]:.2%} |", flush=True)


def parts(training, learned):
    return {"selected samples": learned, "whole training part": training}


def relative_error(evaluator: Evaluator, judge: Judge, chromosome) -> float:
    """Largest error over largest torque on the whole training part, worst axis."""
    fit = evaluator.fit(chromosome)
    assert fit is not None
    error = judge.error(decode(evaluator.regressor.structure, chromosome.astype(float)), fit)
    return float(np.max(np.max(np.abs(error), axis=0) / np.max(np.abs(judge.torque), axis=0)))


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:4]))
