"""Gains for autopilots: margins, overshoot and rise as predicted, and as flown by the true vehicle in gusts.

Three vehicles of 35 g, 1.2 kg and 4.5 kg, each flown by the control laws of the autopilots: with their defaults, which
is the baseline, and with gains for 45 degrees over intervals of 10 % of inertia and 20 % of the rotors' lag. Flown are
steps of 0.1 rad in roll there and back (the mean of four), and sines that are added to the command, by which the loop
is measured. Gusts of 2 rad/s^2 (0.3 s), gyroscope noise of 0.01 rad/s at each step of the law. Predictions know the
vehicle and not the gusts. Gain margins are those upward, below 60 Hz: where a gain that falls makes the loop unstable,
gusts are larger than what is added. A dash: predicted unstable, no such crossing, or lost in flight.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.shared.measure import program, table
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.errors import ComputationError
from cpfls_cli.playback.gusts import Gusts
from cpfls_cli.tuning.gains import AskedMargins, with_filters
from cpfls_cli.tuning.margins import evaluate
from cpfls_cli.tuning.plant import Spread, hover_plant
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.autopilots import CROSS, crossed, flown_margins, flown_step, upward_gain_db

VEHICLES = {
    "35 g": (crossed(0.035, 0.033, (1.6e-5, 1.7e-5, 2.9e-5), 1.8e-8, 1.1e-10, 3300.0), 0.03),
    "1.2 kg": (CROSS, 0.04),
    "4.5 kg": (crossed(4.5, 0.33, (0.12, 0.13, 0.21), 9.0e-5, 2.2e-6, 620.0), 0.06),
}
"""Vehicles, and the lag of their rotors in s."""
SPREAD = Spread((0.9, 1.1), (0.8, 1.2))
GUST, MEMORY_S, NOISE = 2.0, 0.3, 0.01
MEASURES = ("gain margin up, dB", "phase margin, °", "overshoot, %", "rise, ms")


def main(autopilots: list[str] | None = None) -> None:
    columns = ["autopilot", "vehicle", "gains"]
    columns += [word for each in MEASURES for word in (each, "flown")]
    table(
        "tune", columns, [row for name in autopilots or AUTOPILOTS for label in VEHICLES for row in flown(name, label)]
    )


def flown(name: str, label: str) -> Iterator[list[str]]:
    (vehicle, lag), autopilot = VEHICLES[label], AUTOPILOTS[name]
    gusts = gusts_of(vehicle)
    hover = replace(hover_plant(autopilot.law(), vehicle, None, lag), spreads=(SPREAD,) * 3)
    found = with_filters(autopilot, autopilot.defaults(), hover, AskedMargins()).proposals
    own = autopilot.defaults() | {each.parameter.name: each.value for each in found}
    for gains, values in (("default", autopilot.defaults()), ("tuned", own)):
        evaluation = evaluate(autopilot.law(values), hover)
        roll, command = evaluation.roll, evaluation.roll.command
        gain = upward_gain_db(evaluation.frequency, roll.loop)
        predicted = gain, command.phase_deg, 100 * roll.overshoot, 1e3 * roll.rise_s
        seen = _seen(name, values, vehicle, lag, gusts, command.crossover_hz)
        pairs = zip(predicted if command.stable else [np.nan] * 4, seen, strict=True)
        yield [name, label, gains, *(f"{each:.1f}" if np.isfinite(each) else "—" for pair in pairs for each in pair)]


def gusts_of(vehicle: VehicleSettings) -> Gusts:
    size = GUST * np.array(vehicle.inertia_kg_m2[:3]) * [1.0, 1.0, 0.1]
    return Gusts(np.concatenate([size, np.zeros(3)]), MEMORY_S * np.ones(6))


def _seen(
    name: str, values: dict[str, float], vehicle: VehicleSettings, lag: float, gusts: Gusts, crossover: float
) -> tuple[float, float, float, float]:
    lowest = max(0.5 * crossover, 1.0) if np.isfinite(crossover) else 1.0
    same = {"gusts": gusts, "noise": NOISE}
    try:
        gain, phase = flown_margins(name, values, vehicle, lag, 0, lowest_hz=lowest, **same)
        step = flown_step(name, values, vehicle, lag, 0, **same)
    except ComputationError:
        return np.nan, np.nan, np.nan, np.nan
    return gain, phase, 100 * float(step.overshoot[0]), 1e3 * float(step.rise_s[0])


if __name__ == "__main__":
    program(main)
