"""What each structure of a full-circle model misses on full rotations that it never learned from.

The structures are those of configs/full-circle.yaml and a few that are too large to search for. All learn from one
flight of 54.86 s, the path optimised for the paper's structure, free of noise. Three random flights are kept to choose
on, eight others judge. An error is the largest error over the largest torque of the worst axis: median (and worst) of
the eight flights.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.shared.full_circle import (
    CONFIG,
    PAPER,
    judged,
    optimised_flight,
    random_flight,
    random_states,
    searched,
    uniform_model,
)
from benchmarks.shared.measure import program, seconds, table
from cpfls_cli.config.load import load_study
from cpfls_cli.config.overrides import variants
from cpfls_cli.identification.data import TorqueData, joined
from cpfls_cli.identification.judge import fit_baselines
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.structure import model_structure

COLUMNS = (
    "structure | parameters | rank | condition number | random states | uniform | genetic | held-out | "
    "rms, held-out | evaluations | s"
)
# Too many for the sweep of the study, which is to take a minute.
LARGER = {
    "seesaw, 9 functions": {"consequents": "seesaw", "products": "additive", "membership_functions": 9},
    "harmonic 1 additive, 7 functions": {"harmonic_order": 1, "products": "additive", "membership_functions": 7},
    "harmonic 1 additive, 9 functions": {"harmonic_order": 1, "products": "additive", "membership_functions": 9},
    "harmonic 1 tensor, 5 functions": {"harmonic_order": 1, "membership_functions": 5},
    "harmonic 1 tensor, 7 functions": {"harmonic_order": 1, "membership_functions": 7},
    "harmonic 2 additive, 1 function": {"products": "additive", "membership_functions": 1},
    "harmonic 2 additive, 5 functions": {"products": "additive", "membership_functions": 5},
}
# Too many to search for.
LARGEST = {
    "harmonic 1 tensor, 9 functions": {"harmonic_order": 1, "membership_functions": 9},
    "harmonic 2 additive, 7 functions": {"products": "additive", "membership_functions": 7},
    "harmonic 2 additive, 9 functions": {"products": "additive", "membership_functions": 9},
    "harmonic 2 tensor, 5 functions": {"membership_functions": 5},
    "harmonic 2 tensor, 7 functions": {"membership_functions": 7},
    "harmonic 2 tensor, 9 functions": {"membership_functions": 9},
}


def main() -> None:
    study = load_study(CONFIG)
    training, states = optimised_flight(PAPER), random_states(1)
    kept = joined([random_flight(seed) for seed in range(200, 203)])
    unseen = [random_flight(seed) for seed in range(100, 108)]
    searched_for = {variant.name: variant.study.identification for variant in variants(study)}
    searched_for |= {name: replace(study.identification, choice="held-out", **keys) for name, keys in LARGER.items()}
    uniform = {name: replace(study.identification, **keys) for name, keys in LARGEST.items()}
    rows = [
        *baselines(training, unseen),
        *(searched_row(name, settings, training, states, kept, unseen) for name, settings in searched_for.items()),
        *(uniform_row(name, settings, training, states, unseen) for name, settings in uniform.items()),
    ]
    own = optimised_flight(study.identification)
    name = "harmonic 2 tensor, 1 function, on its own path"
    rows.append(uniform_row(name, study.identification, own, states, unseen))
    table("full_circle", COLUMNS, rows)


def baselines(training: TorqueData, unseen: list[TorqueData]) -> Iterator[tuple]:
    for baseline in fit_baselines(training, np.ones(3), 1e-9):
        found = judged(baseline.torque, unseen)
        yield baseline.name, len(baseline.parameters), "", "", "", str(found), "", "", found.rms, "", ""


def searched_row(name: str, settings: IdentificationSettings, training, states, kept, unseen) -> tuple:
    found = searched(training, settings, kept)
    by_states = uniform_model(states, settings).model
    models = (found.uniform, found.by_objectives, found.held_out)
    errors = [judged(torque, unseen) for torque in (by_states.torque, *(solved.model.torque for solved in models))]
    best = found.held_out
    parameters, more = best.model.structure.parameters, (errors[-1].rms, found.evaluations, round(found.seconds))
    shown = errors[:2] if best.model.structure.genes == 0 else errors
    texts = [str(error) for error in shown] + [""] * (4 - len(shown))
    return name, parameters, best.rank, best.condition_number, *texts, *more


def uniform_row(name: str, settings: IdentificationSettings, training, states, unseen) -> tuple:
    """Equidistant partitions only."""
    fitted = []
    duration = seconds(lambda: fitted.append(uniform_model(training, settings)))
    found = fitted[0]
    error = judged(found.model.torque, unseen)
    by_states = judged(uniform_model(states, settings).model.torque, unseen)
    parameters = model_structure(settings).parameters
    texts = (str(by_states), str(error), "", "")
    return name, parameters, found.rank, found.condition_number, *texts, error.rms, 1, round(duration)


if __name__ == "__main__":
    program(main)
