"""Where one signal stands in a log: its columns, their unit, and what each kind of signal asks of them."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Final, Literal

from annotated_types import MinLen
from typing_extensions import Doc

from cpfls_cli.errors import SettingError
from cpfls_cli.settings import Settings
from cpfls_cli.units import KNOWN_UNITS, UnitName

SignalName = Literal[
    "attitude",
    "quaternion",
    "body_rate",
    "attitude_rate",
    "position",
    "velocity",
    "acceleration",
    "torque",
    "body_torque",
    "thrust",
    "rotor_speed",
    "rotor_command",
    "voltage",
]

_UNITS_OF_SIGNAL: Final = MappingProxyType(
    {
        "attitude": ("rad",),
        "quaternion": ("1",),
        "body_rate": ("rad/s",),
        "attitude_rate": ("rad/s",),
        "position": ("m",),
        "velocity": ("m/s",),
        "acceleration": ("m/s^2",),
        "torque": ("N m",),
        "body_torque": ("N m",),
        "thrust": ("N",),
        "rotor_speed": ("rad/s",),
        "rotor_command": ("1", "s", "rad/s"),
        "voltage": ("V", "1"),
    }
)
_ANY_NUMBER: Final = frozenset({"rotor_speed", "rotor_command"})
_COLUMNS_OF_SIGNAL: Final = MappingProxyType({"quaternion": 4, "thrust": 1, "voltage": 1})
_COLUMNS_OF_VECTOR = 3


@dataclass(frozen=True, kw_only=True)
class SignalMap(Settings):
    """Where one signal stands in the log: ``signal = sign * (scale * column + offset)`` in `unit`."""

    columns: Annotated[tuple[str, ...], MinLen(1), Doc("names of the columns, in the order of the axes")]
    unit: Annotated[UnitName, Doc("unit of the columns after scale and offset")]
    sign: Annotated[tuple[float, ...] | None, Doc("+1 or -1 for each column; null: all +1")] = None
    scale: Annotated[float, Doc("factor on the logged numbers")] = 1.0
    offset: Annotated[float, Doc("added after the factor, in the unit above")] = 0.0
    required: Annotated[bool, Doc("false: a log may lack these columns; the flight then lacks the signal")] = True

    def __post_init__(self) -> None:
        """Check the signs against the columns."""
        if len(set(self.columns)) < len(self.columns):
            raise SettingError("columns", "a column is named twice")
        if self.scale == 0:
            raise SettingError("scale", "must not be 0")
        if self.sign is not None and (len(self.sign) != len(self.columns) or {abs(s) for s in self.sign} != {1}):
            raise SettingError("sign", f"needs {len(self.columns)} numbers, one for each column, each +1 or -1")


def check_signal(name: SignalName, signal: SignalMap) -> None:
    """Check the number of columns and the unit against the kind of signal.

    Raises
    ------
    SettingError
        Naming the key below the section `import`.
    """
    expected = _COLUMNS_OF_SIGNAL.get(name, _COLUMNS_OF_VECTOR)
    if name not in _ANY_NUMBER and len(signal.columns) != expected:
        words = f"{expected} columns" if expected > 1 else "1 column"
        raise SettingError(f"signals.{name}.columns", f"needs {words}, got {len(signal.columns)}")
    if KNOWN_UNITS[signal.unit].si not in _UNITS_OF_SIGNAL[name]:
        wanted = [unit for unit, entry in KNOWN_UNITS.items() if entry.si in _UNITS_OF_SIGNAL[name]]
        raise SettingError(f"signals.{name}.unit", f"{signal.unit!r} does not measure it; one of {', '.join(wanted)}")
