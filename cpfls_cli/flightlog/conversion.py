"""Signals in the frames and coordinates of a log, converted to those of the program."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.frames import (
    acceleration_from_specific_force,
    attitude_from_quaternion,
    attitude_to_enu_flu,
    body_to_flu,
    world_to_enu,
)
from cpfls_cli.flightlog.settings import ImportSettings

_WORLD_SIGNALS = ("position", "velocity", "acceleration")
_BODY_SIGNALS = ("body_rate", "body_torque")
_ROTOR_SIGNALS = ("rotor_speed", "rotor_command")
_SCALAR_SIGNALS = ("thrust", "voltage")


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
    """Replace what is written in Euler coordinates, while they are still the log's own."""
    in_body = {name: signals[name] for name in ("attitude", *_BODY_SIGNALS) if name in signals}
    if "quaternion" in signals:
        in_body["attitude"] = attitude_from_quaternion(signals["quaternion"], settings.quaternion_order)
    if "attitude_rate" in signals:
        in_body["body_rate"] = rotations.body_rate(in_body["attitude"], signals["attitude_rate"])
    if "torque" in signals:
        in_body["body_torque"] = rotations.body_torque(in_body["attitude"], signals["torque"])
    return in_body
