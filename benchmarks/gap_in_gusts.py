"""What `cpfls gap` says in gusts: names, their numbers, and the gusts, by level of gusts and by instrument.

A vehicle of 45 g under an autopilot that knows no gust, four flights of 40 s a draw, the last one held out: of as many
paths, with the position and velocity that were asked for in the log; of one path, without; or of as many, without. The
config misses nothing, or one thing. Nothing of the package flies them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.shared.measure import count, mean_and_ends, program, progress, table
from cpfls_cli.gap.diagnose import DiagnosisRun, diagnose
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.gusty_flights import CALM, GUSTS, MEMORY_S, SMALL, STORM, Flight, Truth, gusty_flights, logged

FLIGHTS, SECONDS, REACH_HZ = 4, 40.0, 3.0
LEVELS = {"none": CALM, "nano-drone": GUSTS, "twice": STORM}
INSTRUMENTS = ("setpoints", "repeats", "none")
TRUE = SMALL._replace(drag=0.0, damping=0.0)
SIZE, MEMORY = 0.3, 2.0
"""Share by which a size may be off, and factor by which a memory may be."""


class Hidden(NamedTuple):
    """What a config misses: what flies, what the config says, the name, its numbers; commands alone may be logged."""

    truth: Truth
    vehicle: VehicleSettings
    name: str
    numbers: dict[str, float]
    commands: bool = False


def _hidden() -> Iterator[Hidden]:
    vehicle = TRUE.vehicle
    yield Hidden(TRUE, vehicle, "", {})
    offset = np.array([0.002, -0.0015, 0.0])
    moved = [replace(each, position_m=tuple(np.add(each.position_m, offset).tolist())) for each in vehicle.rotors]
    numbers = {"c_x": 0.002, "c_y": -0.0015}
    yield Hidden(TRUE, replace(vehicle, rotors=tuple(moved)), "com_offset", numbers)
    heavy = replace(vehicle, inertia_kg_m2=(1.15 * TRUE.inertia[0], *vehicle.inertia_kg_m2[1:]))
    yield Hidden(TRUE, heavy, "parameter_error", {"inertia_x": 1 / 1.15 - 1})
    damped = {"d_x": 6e-5, "d_y": 6e-5}
    yield Hidden(TRUE._replace(damping=6e-5), vehicle, "linear_damping", damped)
    yield Hidden(TRUE._replace(lag_s=0.03), vehicle, "motor_lag", {"time_constant_s": 0.03}, commands=True)


def main(draws: int = 3) -> None:
    rows, identified = [], []
    for level, gusts in LEVELS.items():
        for instrument in INSTRUMENTS:
            found: list[tuple[Hidden, list[DiagnosisRun]]] = []
            for hidden in _hidden():
                flown = [_flown(hidden, gusts, instrument, draw) for draw in range(draws)]
                runs = [_diagnosed(hidden, own, instrument) for own in flown]
                found.append((hidden, runs))
                rows.append([level, instrument, hidden.name or "nothing", *_names(hidden, runs)])
                progress(rows[-1])
            identified.append([level, instrument, *_gusts(found, gusts)])
    table("gap_in_gusts", "gusts | instrument | hidden | right | wrong name | verdicts | holds the truth", rows)
    print()
    header = f"gusts | instrument | identified | size over true | within {SIZE:.0%} | memory over true | within 2"
    table("gusts_in_gap", header, identified)


def _flown(hidden: Hidden, gusts: tuple[float, float, float], instrument: str, draw: int) -> list[PlaybackFlight]:
    paths = [FLIGHTS * draw + (0 if instrument == "repeats" else run) for run in range(FLIGHTS)]
    asked = [
        Flight(hidden.truth, gusts, path, FLIGHTS * draw + run, reach=REACH_HZ, commands=hidden.commands)
        for run, path in enumerate(paths)
    ]
    return list(gusty_flights(asked, SECONDS))


def _diagnosed(hidden: Hidden, flown: Sequence[PlaybackFlight], instrument: str) -> DiagnosisRun:
    kept = flown if instrument == "setpoints" else [replace(flight, setpoints={}) for flight in flown]
    recordings = [logged(flight, hidden.vehicle, commanded=hidden.commands).parts[0] for flight in kept]
    return diagnose(recordings[:-1], recordings[-1:], GapSettings(), np.random.default_rng(1))


def _names(hidden: Hidden, runs: Sequence[DiagnosisRun]) -> Iterator[str]:
    named = [{effect.name for effect in run.diagnosis.effects} for run in runs]
    right = {hidden.name} - {""}
    yield count([names == right for names in named])
    yield f"{sum(bool(names - right) for names in named)}"
    verdicts = [str(run.diagnosis.verdict) for run in runs]
    yield ", ".join(f"{verdict} {verdicts.count(verdict)}" for verdict in sorted(set(verdicts)))
    numbers = [
        number.low <= hidden.numbers[number.name] <= number.high
        for run in runs
        for effect in run.diagnosis.effects
        if effect.name == hidden.name
        for number in effect.numbers
        if number.name in hidden.numbers
    ]
    yield count(numbers) if numbers else "—"


def _gusts(found: Sequence[tuple[Hidden, Sequence[DiagnosisRun]]], gusts: tuple[float, float, float]) -> Iterator[str]:
    """Hold what is identified of gusts about the axes against the truth."""
    every = [run.air for _, runs in found for run in runs]
    airs = [air for air in every if air is not None]
    identified = np.array([air.gusts_only[:3] for air in airs]).reshape(-1, 3)
    yield f"{int(identified.sum())} of {3 * len(every)}"
    if gusts == CALM or not identified.any():
        yield from ["—"] * 4
        return
    sizes = np.array([air.found.size[:3] for air in airs]) / (np.array(TRUE.inertia) * gusts)
    memories = np.array([air.found.memory[:3] for air in airs]) / MEMORY_S
    for values, near in ((sizes, np.abs(sizes - 1) <= SIZE), (memories, np.abs(np.log(memories)) <= np.log(MEMORY))):
        yield mean_and_ends(values[identified], 2)
        yield count(near[identified])


if __name__ == "__main__":
    program(main)
