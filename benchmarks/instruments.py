"""Constants in gusts by instruments: moments of inertia over the true ones, and how often their intervals hold them.

Two vehicles of 45 g and 1.5 kg in three levels of gusts, 40 s a flight: two paths flown four times each without
setpoints in the log, or three paths once, with the position setpoint or without; paths of 0.8 Hz at most, and with
sines of up to 5 Hz. Gusts have one memory, three of 0.15, 1 and 5 times that (mixed), or a rate (smooth).
"""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.shared.gusty_sets import KINDS, LEVELS, MOMENTS, VEHICLES, cells_of_moments, flown_sets, words
from benchmarks.shared.measure import program, progress, table
from tests.builders.gusty_flights import GUSTS, MIXED, Flight, Truth

REACHES_HZ = (0.0, 5.0)
SMOOTH_S = 0.1
"""Time constant that takes the edge off gusts, so that they have a rate."""


def main(draws: int = 20) -> None:
    rows = []
    for name, truth in VEHICLES.items():
        for flown, process in _flights(truth):
            for kind in KINDS:
                cells = cells_of_moments(truth.vehicle, kind, list(flown_sets(flown, kind, draws, 40.0)))
                rows.append([name, words(flown.gusts) + process, f"{flown.reach or 0.8:g}", kind, *cells])
                progress(rows[-1])
    table("instruments", f"vehicle | gusts, rad/s² | path up to, Hz | instrument | {MOMENTS}", rows)


def _flights(truth: Truth) -> Iterator[tuple[Flight, str]]:
    """List the gusts and paths of a vehicle; gusts of several memories, and smooth ones, in one size."""
    for gusts in LEVELS:
        yield from ((Flight(truth, gusts, reach=reach), "") for reach in REACHES_HZ)
    for reach in REACHES_HZ:
        yield Flight(truth, GUSTS, reach=reach, memories=MIXED), ", mixed"
        yield Flight(truth, GUSTS, reach=reach, smooth_s=SMOOTH_S), ", smooth"


if __name__ == "__main__":
    program(main)
