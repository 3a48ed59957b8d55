"""Logs of a vehicle that hovers and turns gently, and of the same one with something about it changed."""

import sys
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from tests.builders.shifted_flights import ALLOCATION, INERTIA, motion, save
from tests.builders.studies import VEHICLE

HEADER = "t,wx,wy,wz,fx,fy,fz,c1,c2,c3,c4,volts"
CONFIG = """
import:
  signals:
    body_rate: {columns: [wx, wy, wz], unit: rad/s}
    acceleration: {columns: [fx, fy, fz], unit: m/s^2, required: false}
    rotor_command: {columns: [c1, c2, c3, c4], unit: rad/s, required: false}
    rotor_speed: {columns: [om1, om2, om3, om4], unit: rad/s, required: false}
    voltage: {columns: [volts], unit: V, required: false}
  acceleration_frame: body-specific-force
  torque_source: null
"""
WEAK = (1.0, 1.0, 0.8, 1.0)
"""Thrust and drag of each rotor, M3 of which lost a fifth."""


def flight_table(seed, does=(1.0, 1.0, 1.0, 1.0), heavier=0.0, volts=15.0, duration=20.0, rate_hz=100.0):
    """Give a log, shape (time, 12): what rotors are told that do so much of what they should; each day a bit else."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(duration * rate_hz)) / rate_hz
    rate, slope, thrust = motion(time, rng)
    torque = INERTIA * slope + np.cross(rate, INERTIA * rate)
    # Gusts turn it too, and each day needs a bit more or less thrust and another trim.
    gusts = lfilter([0.1], [1, -0.9], rng.normal(0, [1.0, 1.0, 0.2], rate.shape), axis=0)
    carried = thrust * (1 + heavier + rng.normal(0, 0.01))
    balance = np.column_stack([carried, torque - gusts + rng.normal(0, [0.05, 0.05, 0.02])])
    squared = np.linalg.solve(ALLOCATION * np.array(does), balance.T).T
    assert squared.min() > 0
    force = np.column_stack([0 * time, 0 * time, thrust / 6])
    noisy = np.hstack([rate, force]) + rng.normal(0, [0.002] * 3 + [0.05] * 3, (len(time), 6))
    return np.column_stack([time, noisy, np.sqrt(squared), volts - 0.01 * time])


def write_flights(folder):
    """Write a study, five flights from before, one of today as before, and two with a weak rotor."""
    (folder / "study.yaml").write_text(CONFIG + VEHICLE)
    for number in range(1, 6):
        save(folder / f"before{number}.csv", flight_table(number), HEADER)
    save(folder / "same.csv", flight_table(11), HEADER)
    for number in (1, 2):
        save(folder / f"weak{number}.csv", flight_table(20 + number, WEAK), HEADER)
    return folder


if __name__ == "__main__":
    Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
    write_flights(Path(sys.argv[1]))
