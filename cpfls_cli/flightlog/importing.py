"""The import of a flight: read, align, filter, derive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.alignment import align_commands
from cpfls_cli.flightlog.deriving import derive_flight
from cpfls_cli.flightlog.following import followed
from cpfls_cli.flightlog.reading import read_signals
from cpfls_cli.flightlog.results import ImportedFlight, LogSignals
from cpfls_cli.flightlog.settings import ImportSettings


def import_log(
    columns: Mapping[str, Array],
    settings: ImportSettings,
    *,
    rotor_torque: Callable[[LogSignals], Array] | None = None,
    delay_share: float = 1.0,
) -> ImportedFlight:
    """Turn the columns of a log into a flight.

    Parameters
    ----------
    columns : mapping from str to array, shape (sample,)
        The log.
    settings : ImportSettings
        The section `import`.
    rotor_torque : callable, optional
        Body torque, array of shape (time, 3), N m, FLU, from the signals of the rotors; called where
        `torque_source` names the rotors.
    delay_share : float
        Leading share of the flight that an estimate of the delay may look at.

    Raises
    ------
    InputError
        If columns are missing, a gap is too long, or the rotors are to give the torque and no way is given.
    SettingError
        If a key of the section does not suit the log: crop, rate, cut-off or delay.
    ComputationError
        If the pitch comes within a degree of +-90 degrees, or the delay cannot be estimated.
    """
    signals = followed(read_signals(columns, settings), settings.rotor_command_lag_s)
    if settings.torque_source in ("rotor-speed", "rotor-command"):
        if rotor_torque is None:
            raise InputError(f"import.torque_source = {settings.torque_source} needs a vehicle")
        signals = replace(signals, body_torque=rotor_torque(signals))
    return derive_flight(align_commands(signals, settings, delay_share), settings)
