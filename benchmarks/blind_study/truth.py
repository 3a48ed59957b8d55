"""The hidden numbers as coefficients of the catalogue, by the formulas of the generator and of the catalogue."""

from __future__ import annotations

import numpy as np

from benchmarks.blind.cases import NAMES
from benchmarks.blind.plant import USUAL_LAG
from benchmarks.blind.vehicles import VEHICLES

ROUGH = frozenset({"payload", "vertical_descent", "translational_lift"})
"""Effects whose hidden form is not that of the catalogue, so that no estimate can be exact."""

_AXES = ("x", "y", "z")

_HELD = 1e-3
"""A command acts for 4 ms, on average 2 ms after it was given; in the log it is 0 or 2 ms old: 1 ms is left, s."""


def coefficients(key):
    """Give the true value of each coefficient that the catalogue has for what is hidden, by effect and coefficient."""
    hidden, vehicle = key["hidden"], VEHICLES[key["vehicle"]]
    known = {NAMES.get(name, name): _OF[name](values, vehicle) for name, values in hidden.items() if name in _OF}
    # The rotors always lag; a log without their speeds shows it.
    if "motor_lag" in key["truth"]:
        lag = hidden.get("motor_lag", {}).get("time_constant", USUAL_LAG)
        # Without a delay to take them, a lag takes the milliseconds of the hold.
        known["motor_lag"] = {"time_constant_s": lag + (0.0 if "command_delay" in hidden else _HELD)}
    if "wind" in hidden:
        known["wind"] |= {"k_d": hidden["rotor_drag"]["drag"]}
    return known


def _axes(prefix, values):
    return {f"{prefix}_{axis}": float(value) for axis, value in zip(_AXES, values, strict=False)}


def _plane_damping(hidden, vehicle):
    # A disc that lags by 16 / (gamma w) leans the thrust k w^2, at the height of the hub.
    lean = 16 * vehicle.thrust_factors / hidden["lock_number"]
    return {"k_F": float(lean.mean()), "k_w": float((lean * vehicle.hubs[2]).mean())}


def _lift(hidden, vehicle):
    # Of Glauert's v_h - v_i the first term in the speed, v^2 / (4 v_h), in hover.
    return {"k_h": hidden["gain"] * vehicle.hover_speed / (4 * vehicle.induced_speed)}


def _parasitic(hidden, _vehicle):
    return _axes("c", [hidden["drag"]] * 3) | _axes("cr", hidden["drag"] * np.array(hidden["centre"]))


def _delay(hidden, _vehicle):
    # A gyro that reports late makes the rotors seem late.
    return {"delay_s": hidden["gyro"] - hidden["rotor"]}


def _mismatch(hidden, vehicle):
    gain, spin = np.array(hidden["gain"]), np.array(vehicle.spin)
    if vehicle.count != 4:
        return {f"difference_{place + 1}": value for place, value in enumerate(_grown(gain, vehicle)[:4])}
    # What a pair has in common looks like another inertia, so a difference is relative to the mean of its pair.
    pairs = [(gain[i] - gain[i + 2]) / (1 + (gain[i] + gain[i + 2]) / 2) for i in (0, 1)]
    left, right = gain[spin > 0].mean(), gain[spin < 0].mean()
    drag = (right - left) / (2 + left + right)
    # The mass is known, so a force is relative to nothing.
    lift = (left - right) / 2
    return {"difference_1": pairs[0], "difference_2": pairs[1], "drag_imbalance": drag, "lift_imbalance": lift}


def _spring(hidden, _vehicle):
    return _axes("share", [hidden["share"]] * 3) | {"frequency_hz": hidden["frequency"], "damping": hidden["damping"]}


def _payload(hidden, _vehicle):
    mass, (x, y, z) = hidden["mass"], hidden["point"]
    hook = {"mass_times_depth": -mass * z, "mass_times_right": -mass * y, "mass_times_behind": -mass * x}
    return hook | {"mass": mass, "length_m": hidden["length"], "damping_1_s": hidden["damping"], "depth_m": -z}


def _grown(of_rotors, vehicle):
    """Split what is of each rotor as others than quadrotors show it: along x and y, also with the spin, and alike.

    What all of one spin have in common looks like another inertia.
    """
    x, y = (own / np.ptp(own) for own in vehicle.hubs[:2])
    spin = np.array(vehicle.spin)
    patterns = np.stack([x, y, x * spin, y * spin, np.ones_like(x), spin])
    return np.linalg.lstsq(patterns.T, of_rotors, rcond=None)[0].tolist()


def _tilt(hidden, vehicle):
    lean, out = np.array(hidden["lean"]), vehicle.hubs[:2] / np.linalg.norm(vehicle.hubs[:2], axis=0)
    known = {}
    for kind, of_rotors in (("twist", out[0] * lean[1] - out[1] * lean[0]), ("bend", (out * lean).sum(0))):
        quadrotor = [*(of_rotors[:2] - of_rotors[2:4]), of_rotors.mean()]
        *parts, alike = quadrotor if vehicle.count == 4 else _grown(of_rotors, vehicle)[:5]
        known |= {f"{kind}_{place + 1}": float(part) for place, part in enumerate(parts)}
        known |= {"twist_all": float(alike)} if kind == "twist" else {}
    return known


def _parameters(hidden, _vehicle):
    # Motion shows inertia over rotor torque alone; thrust shows over the mass.
    lever = (1 + hidden["arm"]) * (1 + hidden["thrust"])
    torque = np.array([lever, lever, 1 + hidden["torque"]])
    own = _axes("inertia", (1 + np.array(hidden["inertia"])) / torque - 1)
    return own | {"thrust_scale": (1 + hidden["thrust"]) / (1 + hidden["mass"]) - 1}


_OF = {
    "linear_damping": lambda h, _: _axes("d", h["damping"]),
    "quadratic_damping": lambda h, _: _axes("d", h["damping"]),
    "rotor_plane_damping": _plane_damping,
    "rotor_drag": lambda h, _: {"k_d": h["drag"]},
    "flapping_moment": lambda h, _: {"k_f": h["moment"]},
    "rolling_moment": lambda h, _: {"mu": h["moment"]},
    "inflow": lambda h, _: {"k_z": h["gain"]},
    "translational_lift": _lift,
    "parasitic_drag": _parasitic,
    "ground_effect": lambda h, _: {"G": h["gain"]},
    # The published table at two knots; between knots its curve is not straight.
    "vertical_descent": lambda h, _: {"f_1": -0.08 * h["mean"], "f_1_6": -0.09 * h["mean"]},
    "wind": lambda h, _: {"W_x": h["velocity"][0], "W_y": h["velocity"][1]},
    "rotor_gyroscopic": lambda h, _: {"J_r": h["inertia"]},
    "rotor_acceleration": lambda h, _: {"J_r": h["inertia"]},
    "command_delay": lambda h, _: {"delay_s": h["delay"] + _HELD},
    "notch_filter": lambda h, _: {"frequency_hz": h["frequency"], "width": h["width"]},
    # Thrust goes with the square of the speed.
    "battery_sag": lambda h, _: {"exponent": 2 * h["exponent"]},
    "com_offset": lambda h, _: _axes("c", h["offset"][:2]),
    "products_of_inertia": lambda h, _: {f"I{pair}": h[pair] for pair in ("xy", "xz", "yz")},
    "rotor_mismatch": _mismatch,
    "thrust_tilt": _tilt,
    "thrust_curve": lambda h, _: {"linear": h["share"]},
    "torque_bias": lambda h, _: _axes("M", h["torque"]),
    "payload": _payload,
    "flexible_arm": _spring,
    "gyro_bias": lambda h, _: _axes("b", h["bias"]),
    "gyro_scale": lambda h, _: _axes("e", h["scale"]),
    "imu_misalignment": lambda h, _: _axes("delta", h["rotation"]),
    "channel_delay": _delay,
    "mounting": lambda h, _: _axes("theta", h["turn"]),
    "parameter_error": _parameters,
}
