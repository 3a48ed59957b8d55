"""What `identify` finds of a body in gusts, by instruments and by least squares, with the intervals of the first.

A vehicle of 45 g, sets of four flights of 40 s of one path, whose other runs are the instrument, or with --setpoints of
four paths and their position setpoints; six sets of each of 0.8, 3 and 5 Hz at most, in two levels of gusts, behind
loops of 6, 8 and 12 rad/s. Torque and motion are behind a low-pass of 12 Hz. A row is a level of gusts and a loop: in
how many of its 18 sets the instruments decide, errors of the moments there as root mean squares of their logarithms,
and how often 95 % intervals hold the truth, around either estimate. The last row is of all.

With --past: vehicles of 45 g and 1.5 kg, sets of three flights of three paths without setpoints, eight of each, behind
a loop of 6 rad/s; a row is a vehicle, a level of gusts (or none) and the fastest motion of its paths.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice, product
from typing import NamedTuple

import numpy as np

from benchmarks.shared.gusty_sets import LEVELS, words
from benchmarks.shared.measure import program, progress, table
from cpfls_cli.arrays import Array
from cpfls_cli.identification.closed_loop import freed_torque
from cpfls_cli.identification.data import TorqueSource, axis_scale, joined
from cpfls_cli.identification.findings import fit_baselines
from tests.builders.gusty_flights import GUSTS, LARGE, SMALL, STORM, Flight, Truth, gusty_flights, torque_samples

RUNS, PATHS, SECONDS = 4, 6, 40.0
LOOPS, REACHES_HZ = (6.0, 8.0, 12.0), (0.0, 3.0, 5.0)
DRAWS, FLIGHTS, LOOP = 8, 3, 6.0
"""By what was before."""


class Found(NamedTuple):
    """Logarithms of moments over the true ones, by instruments and by least squares, shape (3,)."""

    again: Array
    least: Array
    half: Array
    identified: bool


def main(*, setpoints: bool = False, past: bool = False) -> None:
    _past() if past else _instruments(setpoints)


def _instruments(once: bool) -> None:
    kinds = [(gusts, loop) for gusts in (GUSTS, STORM) for loop in LOOPS]
    asked = [
        Flight(SMALL, gusts, RUNS * path + run if once else path, run, bandwidth=loop, reach=reach)
        for gusts, loop in kinds
        for reach in REACHES_HZ
        for path in range(PATHS)
        for run in range(RUNS)
    ]
    flown = (torque_samples(each, SMALL, asked=once) for each in gusty_flights(asked, SECONDS))
    rows, every = [], []
    for gusts, loop in kinds:
        own = [_found(SMALL, joined(list(islice(flown, RUNS)))) for _ in range(len(REACHES_HZ) * PATHS)]
        rows.append([words(gusts), f"{loop:g}", *_cells(own)])
        every += own
    rows.append(["all", "", *_cells(every)])
    _table("identify_in_gusts_asked" if once else "identify_in_gusts", "gusts, rad/s² | loop, rad/s", rows)


def _past() -> None:
    rows, every = [], []
    for truth, gusts, reach in product((SMALL, LARGE), LEVELS, (0.0, 5.0)):
        numbers = range(FLIGHTS * DRAWS)
        asked = [Flight(truth, gusts, number, number, bandwidth=LOOP, reach=reach) for number in numbers]
        flown = (torque_samples(each, truth) for each in gusty_flights(asked, SECONDS))
        own = [_found(truth, joined(list(islice(flown, FLIGHTS))), past=True) for _ in range(DRAWS)]
        rows.append([f"{1000 * truth.mass:g} g", words(gusts), f"{reach or 0.8:g}", *_cells(own)])
        progress(rows[-1])
        every += own
    rows.append(["all", "", "", *_cells(every)])
    _table("identify_in_gusts_past", "vehicle | gusts, rad/s² | path up to, Hz", rows)


def _table(name: str, of: str, rows: list[list[str]]) -> None:
    columns = " | ".join(f"{{0}} {by}" for by in ("by instruments", "by least squares"))
    moments, hold, yaw = (columns.replace("{0}", what) for what in ("Ixx, Iyy, %,", "95 % hold,", "Izz, %,"))
    table(name, f"{of} | identified | {moments} | {hold} | Izz identified | {yaw}", rows)


def _found(truth: Truth, source: TorqueSource, *, past: bool = False) -> Found | None:
    freed = freed_torque(source, source)
    if freed is None or (freed.instrument_kind == "past") != past:
        return None
    again, least = (
        np.log(fit_baselines(data, 1 / axis_scale(data), 3e-7)[0].parameters[:3] / truth.inertia)
        for data in (freed.learned, source)
    )
    return Found(again, least, freed.half, bool(freed.identified[2]))


def _cells(sets: Sequence[Found | None]) -> list[str]:
    known = [each for each in sets if each is not None]
    yaw = [each for each in known if each.identified]
    cells = [f"{len(known)} of {len(sets)}"]
    if not known:
        return [*cells, *["—"] * 4, "0", "—", "—"]
    half = np.array([each.half for each in known])[:, :2]
    of = [np.array([getattr(each, name) for each in known])[:, :2] for name in ("again", "least")]
    cells += [", ".join(f"{100 * value:.1f}" for value in np.sqrt(np.mean(each**2, axis=0))) for each in of]
    cells += [", ".join(f"{100 * value:.0f}" for value in (np.abs(each) <= half).mean(axis=0)) for each in of]
    cells.append(str(len(yaw)))
    for name in ("again", "least"):
        values = np.array([getattr(each, name)[2] for each in yaw])
        cells.append(f"{100 * np.sqrt(np.mean(values**2)):.0f}" if len(yaw) else "—")
    return cells


if __name__ == "__main__":
    program(main)
