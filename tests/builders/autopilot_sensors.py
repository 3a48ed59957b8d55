"""What the sensors of an autopilot make of a flight: none of it is a fault, and none of it an effect."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

UP = np.array([0.0, 0.0, 1.0])


def felt(signals, offset=(0.0, 0.0, 0.0)):
    """Log an accelerometer, with an offset in m/s^2, in place of the acceleration."""
    turned = Rotation.from_euler("ZYX", signals.attitude[:, ::-1])
    return replace(signals, specific_force=turned.inv().apply(signals.acceleration + 9.81 * UP) + offset)


def levelled(signals, gain):
    """Estimate the attitude by body rates and by what the accelerometer feels, by the filter of Mahony.

    `signals`: without noise of the body rates.
    """
    turned = Rotation.from_euler("ZYX", signals.attitude[0, ::-1])
    seen = [signals.attitude[0]]
    down = signals.specific_force / np.linalg.norm(signals.specific_force, axis=1, keepdims=True)
    middle = 0.5 * (signals.body_rate[1:] + signals.body_rate[:-1])
    for rate, along in zip(middle, down, strict=False):
        correction = gain * np.cross(along, turned.inv().apply(UP))
        turned = turned * Rotation.from_rotvec(signals.period * (rate + correction))
        seen.append(turned.as_euler("ZYX")[::-1])
    return replace(signals, attitude=np.unwrap(np.array(seen), axis=0))


def askew(signals, turn):
    """Log a flight by sensors of which the airframe is turned by a rotation vector, rad."""
    mounted = Rotation.from_rotvec(turn)
    attitude = (Rotation.from_euler("ZYX", signals.attitude[:, ::-1]) * mounted.inv()).as_euler("ZYX")[:, ::-1]
    return replace(
        signals,
        attitude=np.unwrap(attitude, axis=0),
        body_rate=mounted.apply(signals.body_rate),
        specific_force=mounted.apply(signals.specific_force),
    )


def noisy(signals, rng):
    """Add white noise to attitude, body rates, accelerometer, velocity and rotor speeds."""
    size = {"attitude": 0.002, "body_rate": 0.005, "specific_force": 0.1, "velocity": 0.05, "rotor_speed": 1.0}
    return replace(
        signals,
        acceleration=None,
        **{
            name: getattr(signals, name) + own * rng.standard_normal(getattr(signals, name).shape)
            for name, own in size.items()
        },
    )
