"""Print the unexplained torque of each effect: ``python -m benchmarks.blind.magnitudes [level] [vehicle]``."""

from __future__ import annotations

import sys

import numpy as np

from .cases import make
from .generator import bounds, residual, simulate_many
from .strengths import CATALOGUE, FORMS, OUTSIDE


def rms(group, missions):
    """Root mean square torque on roll, pitch, yaw over the flights of some missions, N m."""
    chosen = [flight for flight in group.flights if flight.mission in missions]
    return np.sqrt(np.mean([(residual(flight, group.case) ** 2).mean(0) for flight in chosen], axis=0))


def main(level=0.5, vehicle="sixkg"):
    """Fly every effect once and print a table."""
    names = ("none", *CATALOGUE, *OUTSIDE, *FORMS)
    rng = np.random.default_rng(5)
    study = [make(name, "table", vehicle, () if name == "none" else (name,), rng, level=level) for name in names]
    print(f"{'effect':24s} | forward: roll pitch yaw | ground | climb | tilt deg, height over R, speed m/s")
    for group in simulate_many(study, 1):
        cells = [" ".join(f"{x:9.3g}" for x in rms(group, [name])) for name in ("forward", "ground", "climb")]
        print(f"{group.case.name:24s} | {' | '.join(cells)} | {' '.join(f'{x:.1f}' for x in bounds(group))}")


if __name__ == "__main__":
    main(*(kind(text) for kind, text in zip((float, str), sys.argv[1:], strict=False)))
