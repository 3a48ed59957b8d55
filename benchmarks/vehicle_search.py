"""The search for a vehicle's structure, beside the same search that fits whatever it looks at; three flights of 40 s.

python benchmarks/vehicle_search.py [PAIRS]

Both run in this process in turn, on compiled loops, with the default settings and the same seed; in the reference
nothing is foretold (tests/builders/vehicle_search.py). Flights are simulated (tests/builders/playback_flights.py).
"""

from __future__ import annotations

import sys
from pathlib import Path
from time import perf_counter, process_time
from typing import NamedTuple
from unittest.mock import patch

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, ratio_of, table

pin_threads()

import numpy as np

from cpfls_cli.playback import structure
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.structure import Choice, choose
from tests.builders.playback_flights import KINDS, MIDDLING, STATED, flown, truth
from tests.builders.vehicle_search import WITHOUT_FORESIGHT

FLIGHTS = flown(truth(), KINDS, duration_s=40.0, noise=MIDDLING, seed=1)


class Timed(NamedTuple):
    """A search, and the seconds that it took by the clock and of the processor."""

    choice: Choice
    wall_s: float
    processor_s: float


def main() -> None:
    pairs = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    timed(PlaybackSettings(search_windows=20, generations=0, leave_out=("remainder", "remainder_force")))
    searches = [both() for _ in range(pairs)]
    processor = ratio_of([(whole.processor_s, quick.processor_s) for whole, quick in searches])
    wall = ratio_of([(whole.wall_s, quick.wall_s) for whole, quick in searches])
    whole, quick = (each.choice for each in searches[0])
    same = "yes" if whole.chosen.structure == quick.chosen.structure else "no"
    columns = ("fitted, all", "fitted", "all, s", "s", "times faster (range)", "by the clock", "same choice")
    fitted = whole.evaluated, quick.evaluated
    table("vehicle_search", columns, [(*fitted, processor.slow_s, processor.fast_s, processor.range, wall.range, same)])


def both() -> tuple[Timed, Timed]:
    """Search without what is foretold, then with it."""
    with patch.multiple(structure, **WITHOUT_FORESIGHT):
        whole = timed(PlaybackSettings())
    return whole, timed(PlaybackSettings())


def timed(settings: PlaybackSettings) -> Timed:
    wall, processor = perf_counter(), process_time()
    found = choose(STATED, FLIGHTS, settings, np.random.default_rng(1), lambda *_: None)
    return Timed(found, perf_counter() - wall, process_time() - processor)


if __name__ == "__main__":
    main()
