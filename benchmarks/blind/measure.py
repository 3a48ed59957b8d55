"""From true motion to a log: faults of sensors, noise, quantisation, CSV columns."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from .missions import STEP
from .turning import euler
from .vehicles import SIXKG

COLUMNS = (
    "t", "phi", "theta", "psi", "wx", "wy", "wz", "x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az",
    "om1", "om2", "om3", "om4", "omcmd1", "omcmd2", "omcmd3", "omcmd4", "volt",
)  # fmt: skip
GROUPS = {
    "attitude": slice(1, 4),
    "gyro": slice(4, 7),
    "position": slice(7, 10),
    "velocity": slice(10, 13),
    "acceleration": slice(13, 16),
    "rotor": slice(16, 20),
    "volt": slice(24, 25),
}
_DEGREE = np.pi / 180
NOISE = {
    "none": dict.fromkeys(GROUPS, 0.0),
    "low": {
        "gyro": 0.001, "attitude": 0.05 * _DEGREE, "velocity": 0.01, "position": 0.005, "acceleration": 0.02,
        "rotor": 0.3, "volt": 0.0005,
    },
    "mid": {
        "gyro": 0.005, "attitude": 0.2 * _DEGREE, "velocity": 0.05, "position": 0.02, "acceleration": 0.05,
        "rotor": 1.0, "volt": 0.001,
    },
    "high": {
        "gyro": 0.02, "attitude": 0.6 * _DEGREE, "velocity": 0.15, "position": 0.05, "acceleration": 0.2,
        "rotor": 3.0, "volt": 0.003,
    },
}  # fmt: skip
"""Standard deviations in SI units; rotor speed for the 6 kg craft."""
KINDS = ("white", "coloured")
_STEPS = {"gyro": 0.001, "rotor": 1.0, "attitude": 1e-4, "volt": 0.0005}


def delayed(values, delay):
    """Shift columns later by a time that need not be a whole sample."""
    if delay == 0.0:
        return values
    time = np.arange(len(values)) * STEP
    return CubicSpline(time, values)(np.maximum(time - delay, 0.0))


def gyro(rate, hidden):
    """Let the gyro see the body rate (time, 3) with its faults."""
    if "imu_misalignment" in hidden:
        rate = Rotation.from_rotvec(hidden["imu_misalignment"]["rotation"]).inv().apply(rate)
    if "gyro_scale" in hidden:
        rate = rate * (1 + np.array(hidden["gyro_scale"]["scale"]))
    if "gyro_bias" in hidden:
        rate = rate + np.array(hidden["gyro_bias"]["bias"])
    return delayed(rate, hidden.get("channel_delay", {}).get("gyro", 0.0))


def rotor_speed(record, case):
    """Let the log see the rotor speeds (time, 4)."""
    speed = record["speed"]
    if case.esc_speed:
        speed = speed / record["volt"] ** case.hidden["battery_sag"]["exponent"]
    return delayed(speed, case.hidden.get("channel_delay", {}).get("rotor", 0.0))


def observe(record, case):
    """Give the noiseless log of one flight, shape (time, 25), columns as in ``COLUMNS``."""
    time = np.arange(len(record["x"]))[:, None] * STEP
    command = record["speed"] if case.ideal_command else record["command"]
    return np.hstack(
        (
            time, euler(record["q"].T).T, gyro(record["w"], case.hidden), record["x"], record["v"], record["a"],
            rotor_speed(record, case), command, record["volt"],
        )
    )  # fmt: skip


def disturb(table, vehicle, level, kind, rng):
    """Add noise to a noiseless log: white, or coloured (AR(1), 0.5 to 0.9, same deviation) and quantised."""
    out = table.copy()
    scale = vehicle.hover_speed / SIXKG.hover_speed
    for group, columns in GROUPS.items():
        unit = scale if group == "rotor" else 1.0
        noise = rng.standard_normal(out[:, columns].shape)
        if kind == "coloured":
            keep = rng.uniform(0.5, 0.9)
            start = noise[:1] * keep
            noise = lfilter([np.sqrt(1 - keep**2)], [1, -keep], noise, axis=0, zi=start)[0]
        out[:, columns] += NOISE[level][group] * unit * noise
        if kind == "coloured" and group in _STEPS:
            step = _STEPS[group] * unit
            out[:, columns] = np.round(out[:, columns] / step) * step
    return out


def save(table, left_out, path):
    """Write a log as CSV without the columns left out."""
    kept = [i for i, name in enumerate(COLUMNS) if name not in left_out]
    form = ",".join(["%.2f" if i == 0 else "%.8g" for i in kept])
    lines = "\n".join(form % tuple(row) for row in table[:, kept].tolist())
    path.write_text(",".join(COLUMNS[i] for i in kept) + "\n" + lines + "\n", encoding="ascii")
