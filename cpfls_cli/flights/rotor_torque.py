"""The body torque of an import that takes it from the rotors of the vehicle."""

from __future__ import annotations

from collections.abc import Callable

from cpfls_cli.arrays import Array
from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.results import LogSignals
from cpfls_cli.vehicle.rotors import body_wrench

_SPEED_UNITS = {"rad/s", "rpm"}


def rotor_torque(study: Study) -> Callable[[LogSignals], Array]:
    """Make the body torque of the rotors from their speeds, or from commands taken for speeds.

    Returns
    -------
    callable
        Gives the body torque, array of shape (time, 3), N m, from the signals of a log.
    """

    def torque(signals: LogSignals) -> Array:
        if study.import_.torque_source == "rotor-speed":
            speed = signals.rotor_speed
        else:
            unit = study.import_.signals["rotor_command"].unit
            speed = commanded_speed(signals.rotor_command, unit, study.vehicle.rotor_speed_max_rad_s)
        rotors = len(study.vehicle.rotors)
        if speed is None or speed.shape[1] != rotors:
            raise InputError(
                f"import.signals names {0 if speed is None else speed.shape[1]} rotors, vehicle.rotors has {rotors}"
            )
        return body_wrench(study.vehicle, speed).body_torque

    return torque


def rotor_torque_words(study: Study) -> list[str]:
    """Say how the torque was computed, where it comes from the rotors.

    Returns
    -------
    list of str
        Empty where a column holds the torque.
    """
    source = study.import_.torque_source
    if source == "rotor-speed":
        return ["body torque: of vehicle.rotors at their measured speeds"]
    if source != "rotor-command":
        return []
    if study.import_.signals["rotor_command"].unit in _SPEED_UNITS:
        return ["body torque: of vehicle.rotors, commanded speeds taken for speeds"]
    largest = study.vehicle.rotor_speed_max_rad_s
    return [f"body torque: of vehicle.rotors, speed = command * vehicle.rotor_speed_max_rad_s ({largest:g} rad/s)"]


def commanded_speed(command: Array | None, unit: str, speed_max: float) -> Array | None:
    """Take a command in 0..1 as a share of the largest rotor speed; speeds are taken as they are.

    Parameters
    ----------
    command : array, shape (time, rotor), or None
        In the SI unit of `unit`, as a flight holds it.
    unit : str
        `import.signals.rotor_command.unit` of the study; a flight carries it in `/config`.
    speed_max : float
        `vehicle.rotor_speed_max_rad_s`, rad/s.

    Returns
    -------
    array, shape (time, rotor), rad/s, or None
        None where there is no command.

    Raises
    ------
    InputError
        If the unit is neither a share nor a speed.
    """
    if command is None or unit in _SPEED_UNITS:
        return command
    if unit != "1":
        raise InputError(
            f"import.signals.rotor_command.unit = {unit}: torque_source rotor-command needs commands in 0..1 (unit 1, "
            "with scale and offset) or rotor speeds (rad/s, rpm)"
        )
    return command * speed_max
