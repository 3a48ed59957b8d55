"""Sizes and memories of gusts, found over true, and how often their intervals hold the truth.

Two vehicles of 45 g and 1.5 kg in three levels of gusts, on a path with sines of up to 5 Hz, 20 s long: flown four
times without setpoints in the log, or three paths once with the position setpoint, or without it. The body is the true
one, but for damping and drag, which no model here has.
"""

from __future__ import annotations

import numpy as np

from benchmarks.shared.gusty_sets import KINDS, LEVELS, VEHICLES, flown_sets, instruments_of, words
from benchmarks.shared.measure import count, mean_and_ends, program, table
from cpfls_cli.playback.disturbance import RANGES, FoundGusts, find_gusts
from cpfls_cli.playback.model import VehicleModel
from tests.builders.gusty_flights import CALM, MEMORY_S, Flight

SHOVE, SHOVE_MEMORY_S = 0.06, 1.0
"""Of these flights: acceleration by the largest gust, and its memory."""
PARTS = {"roll, pitch": slice(0, 2), "yaw": slice(2, 3), "force": slice(3, 6)}


def main(draws: int = 2) -> None:
    rows = []
    for name, truth in VEHICLES.items():
        for gusts in LEVELS:
            for kind in KINDS:
                model, flown = VehicleModel(vehicle=truth.vehicle), Flight(truth, gusts, reach=5.0)
                sets = flown_sets(flown, kind, draws, 20.0, repeated=1)
                drawn = [each for own in sets if (each := find_gusts(model, instruments_of(kind, own)))]
                rows += [[name, words(gusts), kind, part, *_cells(flown, axes, drawn)] for part, axes in PARTS.items()]
    table("gusts", "vehicle | gusts | instrument | axes | size | holds | memory | holds | identified | bound", rows)


def _cells(flown: Flight, axes: slice, drawn: list[FoundGusts]) -> list[str]:
    """Compare what was found on some axes with the truth; nothing where too few runs are like each other."""
    if not drawn:
        return ["—"] * 6
    bodies = np.array([*flown.truth.inertia, *[flown.truth.mass] * 3])[axes]
    sizes = bodies * np.array([*flown.gusts, *[SHOVE * max(flown.gusts)] * 3])[axes]
    memories = np.array([*MEMORY_S, *[SHOVE_MEMORY_S] * 3])[axes]
    values = {key: np.array([getattr(each, key)[axes] for each in drawn]) for key in RANGES}
    identified, cells = np.isfinite(values["size"]), []
    for what, low, high, true in (("size", "low", "high", sizes), ("memory", "memory_low", "memory_high", memories)):
        inside = ((values[low] <= true) & (true <= values[high]))[identified]
        known = identified.any() and flown.gusts != CALM
        cells += [mean_and_ends((values[what] / true)[identified], 2), count(inside)] if known else ["—"] * 2
    bounds = (values["high"] / bodies)[~identified & np.isfinite(values["high"])]
    return [*cells, count(identified), f"{bounds.max():.2g}" if len(bounds) else "—"]


if __name__ == "__main__":
    program(main)
