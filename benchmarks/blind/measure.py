"""From true motion to a log: faults of sensors, noise, quantisation, CSV columns."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, filtfilt, lfilter, lfilter_zi
from scipy.spatial.transform import Rotation

from .missions import STEP
from .turning import euler
from .vehicles import GRAVITY, SIXKG

MOTION = (
    "t", "phi", "theta", "psi", "wx", "wy", "wz", "x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az",
)  # fmt: skip
ASKED = {
    "setpoint_position": (("xd", "yd", "zd"), "m"),
    "setpoint_velocity": (("vxd", "vyd", "vzd"), "m/s"),
    "sticks": (("roll", "pitch", "yaw"), "1"),
}
"""Columns and unit of what is asked of a vehicle: its path, and what it leans and turns by besides."""
GROUPS = ("attitude", "gyro", "position", "velocity", "acceleration", "rotor", "volt")


def rotor_columns(count):
    """Name the columns of measured rotor speeds."""
    return tuple(f"om{number + 1}" for number in range(count))


def columns(count):
    """Name the columns of the log of a vehicle with so many rotors."""
    commands = tuple(f"omcmd{number + 1}" for number in range(count))
    return (*MOTION, *rotor_columns(count), *commands, "volt")


def places(table):
    """Find the groups of columns in a log, dict of str to slice; commands are no measurement."""
    motion = {name: slice(3 * i + 1, 3 * i + 4) for i, name in enumerate(GROUPS[:5])}
    width = table.shape[1]
    return motion | {"rotor": slice(16, (width + 15) // 2), "volt": slice(width - 1, width)}


_DEGREE = np.pi / 180
_SIZES = ("gyro", "attitude", "velocity", "position", "acceleration", "rotor", "volt")
NOISE = {
    "none": dict.fromkeys(GROUPS, 0.0),
    "low": dict(zip(_SIZES, (0.001, 0.05 * _DEGREE, 0.01, 0.005, 0.02, 0.3, 0.0005), strict=True)),
    "mid": dict(zip(_SIZES, (0.005, 0.2 * _DEGREE, 0.05, 0.02, 0.05, 1.0, 0.001), strict=True)),
    "high": dict(zip(_SIZES, (0.02, 0.6 * _DEGREE, 0.15, 0.05, 0.2, 3.0, 0.003), strict=True)),
}
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
    """Let the log see the rotor speeds (time, rotor)."""
    speed = record["speed"]
    if case.esc_speed:
        speed = speed / record["volt"] ** case.hidden["battery_sag"]["exponent"]
    return delayed(speed, case.hidden.get("channel_delay", {}).get("rotor", 0.0))


def observe(record, case):
    """Give the noiseless log of one flight, its columns as in ``columns``."""
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
    for group, own in places(table).items():
        unit = scale if group == "rotor" else 1.0
        noise = rng.standard_normal(out[:, own].shape)
        if kind == "coloured":
            keep = rng.uniform(0.5, 0.9)
            start = noise[:1] * keep
            noise = lfilter([np.sqrt(1 - keep**2)], [1, -keep], noise, axis=0, zi=start)[0]
        out[:, own] += NOISE[level][group] * unit * noise
        if kind == "coloured" and group in _STEPS:
            step = _STEPS[group] * unit
            out[:, own] = np.round(out[:, own] / step) * step
    return out


def _in_g(table, own):
    table[:, own["acceleration"]] /= GRAVITY


def _with_gravity(table, own):
    table[:, own["acceleration"].stop - 1] += GRAVITY


def _low_passed(table, own):
    # As on board: the filter does not see what is to come, so the acceleration is late, too.
    over, under = butter(2, 5.0, fs=1 / STEP)
    values = table[:, own["acceleration"]]
    start = lfilter_zi(over, under)[:, None] * values[0]
    table[:, own["acceleration"]] = lfilter(over, under, values, axis=0, zi=start)[0]


def _late_acceleration(table, own):
    table[:, own["acceleration"]] = delayed(table[:, own["acceleration"]], 0.03)


def _late_attitude(table, own):
    table[:, own["attitude"]] = delayed(table[:, own["attitude"]], 0.03)


def _smoothed(table, own):
    over, under = butter(4, 18.0, fs=1 / STEP)
    for group in GROUPS[:6]:
        table[:, own[group]] = filtfilt(over, under, table[:, own[group]], axis=0)


ATTACKS = {
    "acceleration_in_g": _in_g,
    "acceleration_with_gravity": _with_gravity,
    "acceleration_low_passed": _low_passed,
    "acceleration_late": _late_acceleration,
    "attitude_late": _late_attitude,
    "log_smoothed": _smoothed,
}
"""What loggers do to a log, noise and all."""


def attacked(table, attack):
    """Give the log as such a logger writes it; no attack leaves it as it is."""
    out = table.copy()
    if attack:
        ATTACKS[attack](out, places(table))
    return out


def save(table, left_out, path, asked):
    """Write a log as CSV without the columns left out; last stands what was asked, by the names in ``ASKED``."""
    names = columns((table.shape[1] - len(MOTION) - 1) // 2)
    names += tuple(column for name in asked for column in ASKED[name][0])
    table = np.hstack([table, *asked.values()])
    kept = [i for i, name in enumerate(names) if name not in left_out]
    form = ",".join(["%.2f" if i == 0 else "%.8g" for i in kept])
    lines = "\n".join(form % tuple(row) for row in table[:, kept].tolist())
    path.write_text(",".join(names[i] for i in kept) + "\n" + lines + "\n", encoding="ascii")
