"""Which of the mapped signals a log holds, where it may lack some, and whether they make a flight."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace

from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.flightlog.settings import ImportSettings

_ENOUGH = ("attitude", "quaternion", "body_rate", "rotor_speed", "rotor_command")


def of_present_signals(columns: Container[str], settings: ImportSettings) -> ImportSettings:
    """Leave out the signals that a log may lack and does lack.

    A signal with some of its columns stays, so that the missing ones are named like those of a signal that must be
    there.

    Parameters
    ----------
    columns : container of str
        Names of the log's columns.
    settings : ImportSettings
        The section `import`.

    Returns
    -------
    ImportSettings
        With the signals that are left.

    Raises
    ------
    InputError
        If signals are absent and what is left tells neither of the rotation nor of the rotors, or another key needs
        one that is absent.
    """
    absent = [
        name
        for name, signal in settings.signals.items()
        if not signal.required and not any(column in columns for column in signal.columns)
    ]
    if not absent:
        return settings
    left = {name: signal for name, signal in settings.signals.items() if name not in absent}
    if not any(name in left for name in _ENOUGH):
        raise InputError(
            f"import.signals: a flight needs one of {', '.join(_ENOUGH)}; the log has no columns of {', '.join(absent)}"
        )
    try:
        return replace(settings, signals=left)
    except SettingError as error:
        raise InputError(f"import.{error.key}: {error}; the log has no columns of {', '.join(absent)}") from None
