"""A log imported in memory: read, its body torque taken from the rotors where asked, and what was found in it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from cpfls_cli.arrays import Array
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.config.study import Study, settings_of
from cpfls_cli.errors import CpflsError, InputError
from cpfls_cli.flightlog.importing import import_log
from cpfls_cli.flightlog.results import ImportedFlight
from cpfls_cli.flightlog.stated_vehicle import stated_vehicle
from cpfls_cli.logs.formats import LogColumns, read_log
from cpfls_cli.units import SPEED_UNITS
from cpfls_cli.vehicle.rotors import body_wrench


def imported(log: Path, study: Study) -> ImportedFlight:
    """Import a log in memory."""
    read = read_log(log, study.import_)
    study = study.model_copy(update={"import_": read.settings})
    with _naming(log), settings_of("import", study):
        flight = import_log(
            read.columns,
            study.import_,
            rotor_torque=_rotor_torque(study),
            # The delay is a parameter too: the part of the flight that is held out must not choose it.
            delay_share=study.identification.training_share,
            stamped_hz=read.stamped_hz,
        )
    report = replace(
        flight.report,
        warnings=(*flight.report.warnings, *read.warnings),
        flown_at=read.flown_at,
        first_stamp_s=read.begins + flight.report.first_stamp_s,
        system=read.system,
        parameters=_parameters(read),
        stated=stated_vehicle(read.system, read.parameters),
    )
    return replace(flight, report=report)


def _parameters(read: LogColumns) -> dict[str, float]:
    """Take the parameters of the control law that flew, if it is a known one."""
    own = (each for each in AUTOPILOTS.values() if each.firmware.wrote(read.system))
    return next((found for each in own if (found := each.in_log(read.parameters))), {})


@contextmanager
def _naming(log: Path) -> Iterator[None]:
    try:
        yield
    except CpflsError as error:
        raise type(error)("\n".join(f"{log}: {line}" for line in str(error).splitlines())) from None


def _rotor_torque(study: Study) -> Callable[[ImportedFlight], Array]:
    """Make the body torque of the rotors from their speeds, or from commands taken for speeds."""

    def torque(signals: ImportedFlight) -> Array:
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


def commanded_speed(command: Array | None, unit: str, speed_max: float) -> Array | None:
    """Take a command in 0..1, shape (time, rotor), as a share of the largest speed, rad/s; speeds stay as they are."""
    if command is None or unit in SPEED_UNITS:
        return command
    if unit != "1":
        raise InputError(
            f"import.signals.rotor_command.unit = {unit}: torque_source rotor-command needs commands in 0..1 (unit 1, "
            "with scale and offset) or rotor speeds (rad/s, rpm)"
        )
    return command * speed_max
