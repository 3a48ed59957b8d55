"""How strong each hidden effect is: drawn log-uniformly between bounds for the 6 kg craft, scaled to the vehicle.

Torques scale with the moments of inertia, so that every craft feels about the same angular acceleration; where a
coefficient also makes a force or is a fixed share of the thrust, the scale leans a little to the physical one.
"""

from __future__ import annotations

import numpy as np

from .vehicles import SIXKG


class Scale:
    """Ratios of a vehicle to the 6 kg craft."""

    def __init__(self, vehicle):
        self.vehicle = vehicle
        self.roll = vehicle.inertia[0] / SIXKG.inertia[0]
        self.yaw = vehicle.inertia[2] / SIXKG.inertia[2]
        self.speed = vehicle.hover_speed / SIXKG.hover_speed
        self.arm = vehicle.arm / SIXKG.arm
        self.mass = vehicle.mass / SIXKG.mass
        # Share of thrust that turns this craft nearly as much as the whole thrust turns the 6 kg craft.
        self.share = float((self.roll / (self.mass * self.arm)) ** 0.9)
        # Small craft need smaller differences of rotor speed to yaw; their rotors are heavier for it.
        reaction = vehicle.torque_factor / SIXKG.torque_factor * self.speed**2
        self.spin_difference = float(np.sqrt(self.yaw / reaction))
        self.axes = np.array([self.roll, self.roll, self.yaw])


def between(rng, low, high, level):
    """Draw log-uniformly, or take the given level between 0 and 1."""
    share = rng.random() if level is None else level
    return low * (high / low) ** share


def direction(rng, size=2):
    """Draw a unit vector."""
    vector = rng.standard_normal(size)
    return vector / np.linalg.norm(vector)


def signs(rng, size):
    """Draw signs with magnitudes around one."""
    return rng.choice([-1.0, 1.0], size) * rng.uniform(0.5, 1.0, size)


def _damping(low, high):
    def draw(rng, s, level):
        return {"damping": between(rng, low, high, level) * s.axes * [1, rng.uniform(0.8, 1.2), rng.uniform(0.3, 0.7)]}

    return draw


def _torque(low, high, **more):
    def draw(rng, s, level):
        torque = between(rng, low, high, level) * s.axes * signs(rng, 3) * [1, 1, 0.4]
        return {"torque": torque} | {key: rng.uniform(*span) for key, span in more.items()}

    return draw


def _one(name, low, high, scale=lambda _: 1.0):
    """Draw a single number."""
    return lambda rng, s, level: {name: between(rng, low, high, level) * scale(s)}


def _none(_rng, _scale, _level):
    return {}


def _rotor_drag(rng, s, level):
    # Lever times force should turn small craft nearly like the big one.
    height = s.vehicle.height
    rate = between(rng, 0.19, 0.55, level) * ((s.roll / (s.mass * height / 0.05)) ** 0.9 if height else 1.0)
    return {"drag": rate * s.vehicle.mass / (s.vehicle.count * s.vehicle.hover_speed)}


def _flapping_moment(rng, s, level):
    return {"moment": rng.choice([-1, 1]) * between(rng, 1.5e-5, 2e-4, level) * s.roll / s.speed}


def _translational_lift(rng, s, level):
    lift = between(rng, 0.01, 0.08, level) * s.roll / s.arm
    return {"gain": lift * 4 * s.vehicle.induced_speed / s.vehicle.hover_speed}


def _parasitic(power):
    def draw(rng, s, level):
        drag = between(rng, 0.015, 0.08, level) * s.roll ** (2 / 3) * (8.0 ** (2 - power))
        centre = np.append(rng.uniform(-0.02, 0.02, 2), -0.06) * s.roll ** (1 / 3)
        return {"drag": drag, "centre": centre, "power": power}

    return draw


def _vertical_descent(rng, s, level):
    return {"mean": 1.0, "jitter": between(rng, 0.02, 0.15, level) * s.share}


def _wind(rng, _scale, level):
    return {"velocity": np.append(between(rng, 2.0, 8.0, level) * direction(rng), 0.0)}


def _battery_sag(rng, _scale, level):
    exponent = rng.uniform(0.6, 1.0)
    loss = between(rng, 0.05, 0.2, level) / (2 * exponent)
    return {"depth": loss / 1.5, "exponent": exponent, "start": 0.0, "load": 0.2 * loss}


def _com_offset(rng, s, level):
    size = between(rng, 0.003, 0.03, level) * s.arm * s.share
    return {"offset": size * np.append(direction(rng), rng.uniform(-0.3, 0.3))}


def _products_of_inertia(rng, s, level):
    size = between(rng, 0.012, 0.1, level) * s.roll
    return dict(zip(("xy", "xz", "yz"), size * rng.uniform(-1, 1, 3), strict=True))


def _rotor_mismatch(rng, s, level):
    size = between(rng, 0.02, 0.15, level) * s.share
    gain = 0.15 * size * rng.uniform(-1, 1, s.vehicle.count)
    gain[rng.integers(s.vehicle.count)] = -size
    return {"gain": gain}


def _payload(rng, s, level):
    mass = between(rng, 0.2, 1.5, level) * s.mass * s.share
    point = np.append(rng.uniform(-0.01, 0.01, 2), -rng.uniform(0.06, 0.16)) * s.arm
    return {"mass": mass, "point": point, "length": rng.uniform(0.7, 2.5), "damping": rng.uniform(0.05, 0.25)}


def _parameter_error(rng, _scale, level):
    size = between(rng, 0.5, 1.5, level)
    wrong = size * signs(rng, 7) * [0.06, 0.12, 0.12, 0.12, 0.04, 0.06, 0.12]
    return dict(zip(("mass", "arm", "thrust", "torque"), wrong[[0, 4, 5, 6]], strict=True)) | {"inertia": wrong[1:4]}


def _channel_delay(rng, _scale, level):
    delay = between(rng, 0.005, 0.04, level)
    return {"gyro": delay, "rotor": 0.0} if rng.random() < 0.7 else {"gyro": 0.0, "rotor": delay}


_ROTOR_INERTIA = _one("inertia", 0.0002, 0.001, lambda s: s.yaw / s.speed / s.spin_difference)
CATALOGUE = {
    "linear_damping": _damping(0.03, 0.4),
    "quadratic_damping": _damping(0.01, 0.1),
    "rotor_plane_damping": lambda rng, _, level: {"lock_number": 1 / between(rng, 0.25, 1.0, level)},
    "rotor_drag": _rotor_drag,
    "flapping_moment": _flapping_moment,
    "rolling_moment": _one("moment", 1e-5, 1e-4, lambda s: s.roll / s.speed / s.spin_difference),
    "inflow": _one("gain", 0.0008, 0.004, lambda s: s.roll / (s.arm**2 * s.speed)),
    "translational_lift": _translational_lift,
    "parasitic_drag": _parasitic(2.0),
    "ground_effect": _one("gain", 1.0, 11.0),
    "vertical_descent": _vertical_descent,
    "wind": _wind,
    "rotor_gyroscopic": _ROTOR_INERTIA,
    "rotor_acceleration": _ROTOR_INERTIA,
    "motor_lag": _one("time_constant", 0.02, 0.1),
    "command_delay": _one("delay", 0.01, 0.05),
    "battery_sag": _battery_sag,
    "com_offset": _com_offset,
    "products_of_inertia": _products_of_inertia,
    "rotor_mismatch": _rotor_mismatch,
    "torque_bias": _torque(0.05, 0.5),
    "payload": _payload,
    "euler_axis_torque": _none,
    "gyro_bias": lambda rng, _, level: {"bias": between(rng, 0.005, 0.1, level) * direction(rng, 3)},
    "gyro_scale": lambda rng, _, level: {"scale": between(rng, 0.005, 0.05, level) * signs(rng, 3)},
    "imu_misalignment": lambda rng, _, level: {"rotation": between(rng, 0.01, 0.09, level) * direction(rng, 3)},
    "channel_delay": _channel_delay,
    "parameter_error": _parameter_error,
}
"""Effects with the form that the literature gives."""


def _loose_arm(rng, s, level):
    drive, rotor = between(rng, 0.02, 0.08, level) * s.share, int(rng.integers(s.vehicle.count))
    return {"rotor": rotor, "drive": drive, "frequency": rng.uniform(0.8, 2.5), "damping": rng.uniform(0.05, 0.15)}


def _fuel_slosh(rng, s, level):
    mass, height = between(rng, 0.5, 1.5, level) * s.mass * s.share**2, -rng.uniform(0.2, 0.3) * s.arm
    return {"mass": mass, "height": height, "frequency": rng.uniform(0.8, 1.6), "damping": rng.uniform(0.05, 0.15)}


def _flexible_arm(rng, _scale, level):
    share = between(rng, 0.2, 0.5, level)
    return {"share": share, "frequency": rng.uniform(2.0, 5.0), "damping": rng.uniform(0.03, 0.1)}


def _propeller_change(rng, s, level):
    loss = between(rng, 0.03, 0.15, level) * s.share
    return {"loss": loss, "rotor": int(rng.integers(s.vehicle.count)), "when": rng.uniform(8.0, 22.0)}


def _notch_filter(rng, _scale, level):
    return {"frequency": between(rng, 7.0, 3.0, level), "width": rng.uniform(0.5, 0.9)}


OUTSIDE = {
    "magnetic_torque": _torque(0.15, 0.5, length=(3.0, 8.0)),
    "fuel_slosh": _fuel_slosh,
    "loose_arm": _loose_arm,
    "yaw_cogging": _torque(0.1, 0.4),
    "gust_turbulence": _torque(0.1, 0.4),
    "stick_slip_gimbal": lambda rng, s, level: {"friction": between(rng, 0.05, 0.2, level) * s.axes * [1, 1, 0.5]},
    "thermal_drift": _torque(0.2, 0.6),
    "rotor_interference": _one("loss", 0.03, 0.2, lambda s: s.share),
    "attitude_product": _torque(0.1, 0.4),
    "wall_effect": _torque(0.2, 0.8, place=(0.0, 12.0)),
    "sliding_battery": _torque(0.1, 0.4),
    "cyclic_swirl": _torque(0.3, 1.2),
    "wake_on_body": _one("loss", 0.03, 0.15, lambda s: s.share),
    "flexible_arm": _flexible_arm,
    "drag_over_height": _rotor_drag,
    "gust_field": lambda rng, s, level: _rotor_drag(rng, s, 0.5) | {"gust": between(rng, 1.0, 3.0, level)},
    "propeller_change": _propeller_change,
    "notch_filter": _notch_filter,
}
"""Effects that no catalogue lists."""


def _thrust_tilt(rng, s, level):
    lean = np.zeros((2, s.vehicle.count))
    for rotor in rng.choice(s.vehicle.count, 2, replace=False):
        lean[:, rotor] = between(rng, 0.005, 0.05, level) * s.share * direction(rng)
    return {"lean": lean}


def _lag_uneven(rng, _scale, level):
    up = between(rng, 0.02, 0.06, level)
    return {"up": up, "down": up * rng.uniform(1.8, 2.8)}


def _lag_second_order(rng, _scale, level):
    return {"frequency": between(rng, 40.0, 15.0, level), "damping": rng.uniform(0.5, 0.8)}


FORMS = {
    "stribeck_damping": (_damping(0.05, 0.3), "linear_damping"),
    "cubic_damping": (_damping(0.03, 0.2), "quadratic_damping"),
    "ground_exponential": (CATALOGUE["ground_effect"], "ground_effect"),
    "parasitic_power": (_parasitic(1.5), "parasitic_drag"),
    "inflow_momentum": (CATALOGUE["inflow"], "inflow"),
    "lag_second_order": (_lag_second_order, "low_pass_filter"),
    "lag_uneven": (_lag_uneven, "motor_lag"),
    "thrust_tilt": (_thrust_tilt, "rotor_tilt"),
}
"""Effects close to one of the catalogue, in another form: draw, and the nearest effect of the catalogue."""


def _bullet_downwash(rng, _scale, _level):
    return {"above": rng.uniform(1.4, 1.8), "sway": 0.15, "phase": rng.uniform(0, 2 * np.pi)}


OTHERS = {
    "drag_factor": lambda rng, _, level: {"error": rng.choice([-1, 1]) * between(rng, 0.15, 0.3, level)},
    "thrust_curve": lambda rng, _, level: {"share": rng.choice([-0.4, 1, 1, 1]) * between(rng, 0.2, 0.9, level)},
    "quick_rotors": _none,
    "bullet_damping": lambda *_: {"damping": 0.04},
    # Per rad/s: the simulator turns revolutions into radians before it multiplies.
    "bullet_drag": lambda *_: {"across": 9.1785e-7, "along": 10.311e-7},
    "bullet_ground": lambda *_: {"gain": 11.36859},
    "bullet_downwash": _bullet_downwash,
}
"""The least known number of a vehicle, thrust that is no square, and the physics of another simulator."""

_DRAWS = CATALOGUE | OUTSIDE | OTHERS | {name: draw for name, (draw, _) in FORMS.items()}


def strength(name, vehicle, rng, level=None):
    """Draw the parameters of an effect as plain numbers and lists.

    ``level`` between 0 and 1 fixes the place between the weakest and the strongest; below 0 is weaker still.
    """
    drawn = _DRAWS[name](rng, Scale(vehicle), level)
    return {key: np.asarray(value).tolist() for key, value in drawn.items()}
