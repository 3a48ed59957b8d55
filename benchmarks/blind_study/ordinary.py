"""Logs of a study by the sensors of an autopilot: an accelerometer, and an estimator of attitude and motion."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

GRAVITY_M_S2 = 9.81
LEVELLED_S = 10.0
"""Within which the attitude follows what the accelerometer takes for the vertical."""
WANDERS = {"tilt": (0.009, 20.0), "heading": (0.05, 30.0), "velocity": (0.1, 3.0), "position": (0.5, 10.0)}
"""Size, rad, m/s and m, and memory, s, of the errors of the estimator."""
SMOOTH_S = 1.0
"""Within which an estimator follows what it measures, so that its errors have no steps."""
GYROSCOPE_RAD_S, ACCELEROMETER_M_S2, HEADING_RAD = 0.005, 0.1, 0.08
"""Standard deviation of what is constant in a flight."""
SHAKES = {"w": (0.01, 0.01, 0.004), "a": (0.2, 0.2, 0.14)}
"""Most that an unbalanced rotor at hover shakes gyroscope and accelerometer by, rad/s and m/s^2; nothing filters it."""
JITTER_S = 0.001
ASKEW_RAD = (0.03, 0.03, 0.01)
"""Standard deviation of the angles by which the autopilot is mounted askew."""
_RATES, _FELT, _ANGLES = ("wx", "wy", "wz"), ("ax", "ay", "az"), ("phi", "theta", "psi")


def ordinary(folder, askew=False):
    """Copy the flights and keys of a study to a folder next to it, logged so; gives that folder.

    `askew`: whether the autopilot is mounted askew too, which is then hidden as well.
    """
    folder = Path(folder)
    out = folder.with_name(f"{folder.name}-{'askew' if askew else 'ordinary'}")
    shutil.copytree(folder / "keys", out / "keys", dirs_exist_ok=True)
    for logs in sorted((folder / "flights").iterdir()):
        own = shutil.copytree(logs, out / "flights" / logs.name, dirs_exist_ok=True)
        turn = np.random.default_rng(int(logs.name, 16)).normal(size=3) * ASKEW_RAD if askew else np.zeros(3)
        for number, path in enumerate(sorted(own.glob("*.csv"))):
            _log(path, Rotation.from_rotvec(turn), np.random.default_rng([int(logs.name, 16), number]))
        study = json.loads((own / "study.yaml").read_text(encoding="utf-8"))
        study["import"] |= {"acceleration_frame": "body-specific-force", "rate_hz": 100.0}
        (own / "study.yaml").write_text(json.dumps(study, indent=1), encoding="utf-8")
        _say(turn, out / "keys" / logs.name / "key.json")
    return out


def _say(turn, path):
    key = json.loads(path.read_text(encoding="ascii"))
    # What is there in all of them, and no miss where it is not named.
    key["nearest"].append("gyro_bias")
    if turn.any():
        key["hidden"]["mounting"] = {"turn": turn.tolist()}
        key["truth"].append("mounting")
        key["group"] = "single" if key["group"] == "none" else "pair"
    path.write_text(json.dumps(key, indent=1) + "\n", encoding="ascii")


def _log(path, mounted, rng):
    names = path.read_text(encoding="ascii").partition("\n")[0].split(",")
    table = dict(zip(names, np.genfromtxt(path, delimiter=",", skip_header=1).T, strict=True))
    period, rows = table["t"][1] - table["t"][0], len(table["t"])

    def wander(name):
        size, memory = WANDERS[name]
        values = rng.standard_normal(2 * rows)
        for lasting in (memory, SMOOTH_S):
            kept = np.exp(-period / lasting)
            values = lfilter([1 - kept], [1, -kept], values)
        return size * np.sqrt((memory + SMOOTH_S) / (0.5 * period)) * values[rows:]

    turned = Rotation.from_euler("ZYX", np.stack([table[name] for name in reversed(_ANGLES)], axis=1))
    acceleration = np.stack([table[name] for name in _FELT], axis=1)
    felt = mounted.apply(turned.inv().apply(acceleration + np.array([0, 0, GRAVITY_M_S2])))
    rates = mounted.apply(np.stack([table[name] for name in _RATES], axis=1))
    angles = np.unwrap((turned * mounted.inv()).as_euler("ZYX")[:, ::-1], axis=0)
    # Along and across the heading: what feels like the vertical leans as the vehicle accelerates.
    velocity = np.stack([table["vx"], table["vy"]], axis=1)
    cosine, sine = np.cos(angles[:, 2]), np.sin(angles[:, 2])
    east, north = np.gradient(velocity, period, axis=0).T / GRAVITY_M_S2
    gain = period / LEVELLED_S
    along, left = (
        lfilter([gain], [1, gain - 1], own) for own in (cosine * east + sine * north, cosine * north - sine * east)
    )
    angles += np.stack([left + wander("tilt"), wander("tilt") - along, wander("heading")], axis=1)
    angles[:, 2] += HEADING_RAD * rng.standard_normal()
    for name in ("vx", "vy", "vz", "x", "y", "z"):
        table[name] = table[name] + wander("velocity" if name.startswith("v") else "position")
    rates += GYROSCOPE_RAD_S * rng.standard_normal(3) + _shaken(table, SHAKES["w"], period, rng)
    felt += ACCELEROMETER_M_S2 * rng.standard_normal(3) + _shaken(table, SHAKES["a"], period, rng)
    table |= dict(zip((*_RATES, *_FELT, *_ANGLES), np.hstack([rates, felt, angles]).T, strict=True))
    table["t"] = np.maximum.accumulate(table["t"] + rng.exponential(JITTER_S, rows)) + 1e-7 * np.arange(rows)
    np.savetxt(path, np.stack([table[name] for name in names], axis=1), delimiter=",", header=",".join(names),
               comments="", fmt="%.9g")  # fmt: skip


def _shaken(table, sizes, period, rng):
    speeds = [table[name] for name in table if name.startswith("om") and not name.startswith("omcmd")]
    hover = np.sqrt(np.mean(np.square(speeds)))
    shaken = np.zeros((len(table["t"]), 3))
    for speed in speeds:
        turned = np.cumsum(speed) * period
        for axis, size in enumerate(sizes):
            phase, share = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 1.0)
            shaken[:, axis] += size * share * (speed / hover) ** 2 * np.cos(turned + phase)
    return shaken
