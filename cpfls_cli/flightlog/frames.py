"""Frames: signals in the axes of a log, converted to body FLU and world ENU."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from scipy.constants import g as standard_gravity
from scipy.spatial.transform import Rotation

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.repair import unwrap_angles
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.rotations import multiply, rotation_matrix

_WORLD_SIGNALS = ("position", "velocity", "acceleration")
_BODY_SIGNALS = ("body_rate", "body_torque")
_ROTOR_SIGNALS = ("rotor_speed", "rotor_command")
_SCALAR_SIGNALS = ("thrust", "voltage")
BodyFrame = Literal["FLU", "FRD"]
WorldFrame = Literal["ENU", "NED"]
_BODY = {"FLU": np.eye(3), "FRD": np.diag([1.0, -1.0, -1.0])}
_WORLD = {"ENU": np.eye(3), "NED": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])}


def to_program_frames(signals: Mapping[str, Array], settings: ImportSettings) -> dict[str, Array]:
    """Convert signals to roll, pitch, yaw, body vectors in FLU and world vectors in ENU.

    Parameters
    ----------
    signals : mapping from signal name to array, shape (time, column), SI
        Without absent values, in the log's frames.
    settings : ImportSettings
        The frames and the order of a quaternion.

    Returns
    -------
    dict from str to array
        Names among those of `LogSignals`.
    """
    in_body = _as_body_vectors(signals, settings)
    converted = {name: signals[name] for name in _ROTOR_SIGNALS if name in signals}
    if "rotor_command" in signals and settings.rotor_command_is == "thrust":
        # Thrust goes with the square of the speed; a share below 0 is none.
        converted["rotor_command"] = np.sqrt(np.maximum(signals["rotor_command"], 0.0))
    converted |= {name: signals[name][:, 0] for name in _SCALAR_SIGNALS if name in signals}
    converted |= {name: body_to_flu(in_body[name], settings.body_frame) for name in _BODY_SIGNALS if name in in_body}
    world = [name for name in _WORLD_SIGNALS if name in signals and not _is_specific_force(name, settings)]
    converted |= {name: world_to_enu(signals[name], settings.world_frame) for name in world}
    if "attitude" in in_body:
        converted["attitude"] = attitude_to_enu_flu(in_body["attitude"], settings.body_frame, settings.world_frame)
    if "acceleration" in signals and _is_specific_force("acceleration", settings):
        sensed = converted["specific_force"] = body_to_flu(signals["acceleration"], settings.body_frame)
        if "attitude" in converted:
            converted["acceleration"] = acceleration_from_specific_force(converted["attitude"], sensed)
    return converted


def _is_specific_force(name: str, settings: ImportSettings) -> bool:
    return name == "acceleration" and settings.acceleration_frame == "body-specific-force"


def _as_body_vectors(signals: Mapping[str, Array], settings: ImportSettings) -> dict[str, Array]:
    """Convert quaternion, Euler rates and Euler torque to attitude and body vectors, in the log's own frames."""
    in_body = {name: signals[name] for name in ("attitude", *_BODY_SIGNALS) if name in signals}
    if "quaternion" in signals:
        in_body["attitude"] = attitude_from_quaternion(signals["quaternion"], settings.quaternion_order)
    if "attitude_rate" in signals:
        in_body["body_rate"] = rotations.body_rate(in_body["attitude"], signals["attitude_rate"])
    if "torque" in signals:
        in_body["body_torque"] = rotations.body_torque(in_body["attitude"], signals["torque"])
    return in_body


def body_to_flu(vectors: Array, frame: BodyFrame) -> Array:
    """Convert body vectors to front, left, up (FLU).

    Parameters
    ----------
    vectors : array, shape (time, 3), body frame `frame`
    frame : {"FLU", "FRD"}

    Returns
    -------
    array, shape (time, 3), body frame FLU
    """
    turned: Array = vectors @ _BODY[frame].T
    return turned


def world_to_enu(vectors: Array, frame: WorldFrame) -> Array:
    """Convert world vectors to east, north, up (ENU).

    Parameters
    ----------
    vectors : array, shape (time, 3), world frame `frame`
    frame : {"ENU", "NED"}

    Returns
    -------
    array, shape (time, 3), world frame ENU
    """
    turned: Array = vectors @ _WORLD[frame].T
    return turned


def attitude_to_enu_flu(attitude: Array, body: BodyFrame, world: WorldFrame) -> Array:
    """Convert roll, pitch, yaw between frames, ``R_enu,flu = R_enu,world R R_body,flu``.

    Parameters
    ----------
    attitude : array, shape (time, 3), rad
        Roll, pitch and yaw (intrinsic ZYX) of the log's body frame in the log's world frame.
    body : {"FLU", "FRD"}
    world : {"ENU", "NED"}

    Returns
    -------
    array, shape (time, 3), rad
        Of body FLU in world ENU, roll and yaw without jumps. A vehicle that heads north has yaw 0 in NED and
        a quarter turn in ENU.
    """
    if (body, world) == ("FLU", "ENU"):
        return attitude
    return euler_angles(_WORLD[world] @ rotation_matrix(attitude) @ _BODY[body].T)


def attitude_from_quaternion(quaternion: Array, order: Literal["wxyz", "xyzw"]) -> Array:
    """Convert quaternions to roll, pitch, yaw in the same frames.

    Parameters
    ----------
    quaternion : array, shape (time, 4)
        Rotation from body to world; its length does not matter.
    order : {"wxyz", "xyzw"}
        Whether the scalar part stands first or last.

    Returns
    -------
    array, shape (time, 3), rad
        Roll and yaw without jumps.
    """
    scalar_last = np.roll(quaternion, -1, axis=1) if order == "wxyz" else quaternion
    return euler_angles(Rotation.from_quat(scalar_last).as_matrix())


def euler_angles(rotation: Array) -> Array:
    """Extract roll, pitch, yaw (intrinsic ZYX) from rotation matrices.

    Parameters
    ----------
    rotation : array, shape (time, 3, 3)
        From body to world.

    Returns
    -------
    array, shape (time, 3), rad
        Roll and yaw without jumps; both arbitrary where the pitch is +-90 degrees.
    """
    roll = np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
    pitch = -np.arcsin(np.clip(rotation[:, 2, 0], -1.0, 1.0))
    yaw = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    return np.column_stack([unwrap_angles(roll), pitch, unwrap_angles(yaw)])


def acceleration_from_specific_force(attitude: Array, specific_force: Array) -> Array:
    """Convert specific force to acceleration, ``a = R f - g e_z``.

    Parameters
    ----------
    attitude : array, shape (time, 3), rad
        Of body FLU in world ENU.
    specific_force : array, shape (time, 3), m/s^2, body frame FLU

    Returns
    -------
    array, shape (time, 3), m/s^2, world frame ENU
    """
    acceleration: Array = multiply(rotation_matrix(attitude), specific_force)
    acceleration[:, 2] -= standard_gravity
    return acceleration
