"""Sizes and memories of gusts, found over true, and how often their intervals hold the truth.

    python benchmarks/gusts.py [DRAWS]

Two vehicles of 45 g and 1.5 kg in three levels of gusts, on a path with sines of up to 5 Hz, 20 s long: flown four
times without setpoints in the log, or three paths once with the position that was asked for, or without it. The body is
the true one, but for damping and drag, which no model here has. Nothing of the package flies them.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.playback.disturbance import FoundGusts, find_gusts
from cpfls_cli.playback.gusts import RANGES
from cpfls_cli.playback.instruments import Instruments, Repeats, instruments
from cpfls_cli.playback.model import VehicleModel
from tests.builders.gusty_flights import CALM, GUSTS, LARGE, MEMORY_S, SMALL, STORM, Flight, Truth, gusty_flights

DRAWS = 2
VEHICLES = {"45 g": SMALL, "1.5 kg": LARGE}
RUNS, PATHS, REACH_HZ, SECONDS = 4, 3, 5.0, 20.0
SHOVE, SHOVE_MEMORY_S = 0.06, 1.0
"""Of these flights: acceleration by the largest gust, and its memory."""
PARTS = {"roll, pitch": slice(0, 2), "yaw": slice(2, 3), "force": slice(3, 6)}


def main(draws: int) -> None:
    rows = []
    for name, truth in VEHICLES.items():
        for gusts in (CALM, GUSTS, STORM):
            for kind in ("repeats", "setpoints", "past"):
                model = VehicleModel(vehicle=truth.vehicle)
                drawn = [find_gusts(model, _flown(truth, gusts, kind, draw)) for draw in range(draws)]
                rows += [_row(name, truth, gusts, kind, part, [each for each in drawn if each]) for part in PARTS]
    header = ["vehicle", "gusts", "instrument", "axes", "size", "holds", "memory", "holds", "told", "bound"]
    table("gusts", header, rows)


def _row(
    name: str, truth: Truth, gusts: tuple[float, float, float], kind: str, part: str, drawn: list[FoundGusts]
) -> list[str]:
    """Compare what was found on some axes with the truth."""
    axes, words = PARTS[part], [name, ", ".join(f"{gust:g}" for gust in gusts), kind, part]
    if not drawn:
        # Too few runs are like each other.
        return [*words, *["—"] * 6]
    bodies = np.array([*truth.inertia, *[truth.mass] * 3])[axes]
    sizes = bodies * np.array([*gusts, *[SHOVE * max(gusts)] * 3])[axes]
    memories = np.array([*MEMORY_S, *[SHOVE_MEMORY_S] * 3])[axes]
    values = {key: np.array([getattr(each, key)[axes] for each in drawn]) for key in RANGES}
    told = np.isfinite(values["size"])
    open_ = (~told & np.isfinite(values["high"])).nonzero()
    bounds = (values["high"] / bodies)[open_]
    if told.any() and gusts != CALM:
        words += _over(values["size"], values["low"], values["high"], sizes, told)
        words += _over(values["memory"], values["memory_low"], values["memory_high"], memories, told)
    else:
        words += ["—"] * 4
    return [*words, f"{told.sum()} of {told.size}", f"{bounds.max():.2g}" if len(bounds) else "—"]


def _over(value: Array, low: Array, high: Array, true: Array, told: Array) -> list[str]:
    """Give the mean and the ends of what was found over the truth, and how often intervals hold it."""
    ratio, inside = (value / true)[told], ((low <= true) & (true <= high))[told]
    return [f"{ratio.mean():.2f} ({ratio.min():.2f} to {ratio.max():.2f})", f"{inside.sum()} of {inside.size}"]


def _flown(truth: Truth, gusts: tuple[float, float, float], kind: str, draw: int) -> Instruments:
    """Fly one path again and again, or several once; nothing but what is named tells what was asked."""
    if kind == "repeats":
        asked = [Flight(truth, gusts, draw, RUNS * draw + run, reach=REACH_HZ) for run in range(RUNS)]
        return instruments([replace(flight, setpoints={}) for flight in gusty_flights(asked, SECONDS)])
    asked = [Flight(truth, gusts, PATHS * draw + path, draw, reach=REACH_HZ) for path in range(PATHS)]
    given = instruments(list(gusty_flights(asked, SECONDS)))
    alone = replace(given, repeats=Repeats(tuple({} for _ in given.runs), {}))
    return alone if kind == "setpoints" else replace(alone, setpoints=tuple(None for _ in given.runs), names=())


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else DRAWS)
