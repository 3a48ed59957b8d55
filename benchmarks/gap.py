"""Time a diagnosis: how it grows with flight time, and what leaving out the heavier parts would save."""

from __future__ import annotations

from dataclasses import replace
from time import process_time

import numpy as np

from benchmarks.blind.cases import make
from benchmarks.blind.generator import simulate_many
from benchmarks.blind.measure import columns, disturb
from benchmarks.shared.measure import program, table
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.diagnose import diagnose
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings

EFFECTS = ("com_offset", "rotor_drag")


def main() -> None:
    rng = np.random.default_rng(1)
    case = make("timing", "pair", "sixkg", EFFECTS, rng)
    rows, first = [], None
    for seconds in (30.0, 60.0, 120.0):
        recordings = fly(case, seconds, rng)
        if first is None:
            # What a first diagnosis loads and compiles is none of its time; a shorter one leaves a part of it.
            time(recordings, GapSettings())
        spent = time(recordings, GapSettings())
        first = first or spent
        rows.append((f"6 of {seconds:.0f} s at 100 Hz, {len(EFFECTS)} effects hidden", spent, spent / first))
    recordings = fly(case, 30.0, rng)
    whole = time(recordings, GapSettings())
    for what, settings in (
        ("39 shifts instead of 199", GapSettings(shifts=39)),
        ("no load on a cable", GapSettings(ignore=("payload",))),
        ("torque alone", GapSettings(force=False)),
    ):
        spent = time(recordings, settings)
        rows.append((f"6 of 30 s, {what}", spent, spent / whole))
    table("gap", "flights | seconds | ratio to the first", rows)


def time(recordings: list[Signals], settings: GapSettings) -> float:
    """Time one diagnosis by its own processor time, half of the flights held out."""
    # A flight keeps what was made of it; a copy has to make it all.
    copies = [replace(each) for each in recordings]
    start = process_time()
    diagnose(copies[:3], copies[3:], settings, np.random.default_rng(1))
    return process_time() - start


def fly(case, seconds: float, rng: np.random.Generator) -> list[Signals]:
    """Fly a case and log it with middling noise."""
    flown = simulate_many([case], 1, seconds)[0]
    logs = (disturb(flight.table, flown.vehicle, "mid", "white", rng) for flight in flown.flights)
    return [replace(signals(log, vehicle_of(flown.vehicle)), name=f"flight {n}") for n, log in enumerate(logs)]


def signals(log: np.ndarray, vehicle: VehicleSettings) -> Signals:
    """Arrange the columns of a log."""
    named = dict(zip(columns(len(vehicle.rotors)), log.T, strict=True))
    names = {
        "body_rate": "wx wy wz", "attitude": "phi theta psi", "velocity": "vx vy vz", "position": "x y z",
        "acceleration": "ax ay az", "rotor_speed": "om1 om2 om3 om4",
    }  # fmt: skip
    picked = {signal: np.column_stack([named[name] for name in own.split()]) for signal, own in names.items()}
    return Signals(time=named["t"], vehicle=vehicle, voltage=named["volt"], **picked)


def vehicle_of(craft) -> VehicleSettings:
    """Describe the craft of the generator as a config does."""
    factors = {"thrust_factor_n_s2": craft.thrust_factor, "drag_factor_n_m_s2": craft.torque_factor}
    rotors = tuple(
        RotorSettings(position_m=tuple(place), spin=spin, radius_m=craft.rotor_radius, **factors)
        for place, spin in zip(craft.rotors, craft.spin, strict=True)
    )
    return VehicleSettings(mass_kg=craft.mass, inertia_kg_m2=craft.inertia, rotors=rotors)


if __name__ == "__main__":
    program(main)
