"""What a log is taken for: signals, keys that hold for all of it, and the reason and the rivals of each guess."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.airframe import MovedBy
from cpfls_cli.flightlog.flown import Flown
from cpfls_cli.flightlog.settings import SignalMap, SignalName

Sure = Literal["data", "named", "guess"]
"""Whether the data decided, a name or the kind of log says so, or neither does."""


@dataclass(frozen=True)
class Rival:
    """Another guess that the data cannot part from the one that is taken.

    Attributes
    ----------
    text : str
        As it would stand in the config, such as ``unit: deg``.
    reason : str
        Why it is not ruled out.
    """

    text: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class Guess:
    """A signal of the log.

    Attributes
    ----------
    sure : {"data", "named", "guess"}
    """

    signal: SignalName
    columns: SignalMap
    reason: str
    sure: Sure
    rivals: tuple[Rival, ...] = ()


@dataclass(frozen=True)
class Choice:
    """A key of the section `import` that holds for the whole log.

    Attributes
    ----------
    sure : {"data", "named", "guess"}
    """

    key: str
    value: str
    reason: str
    sure: Sure
    rivals: tuple[Rival, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Recognition:
    """What a log is taken for.

    Attributes
    ----------
    time_column, time_unit : str
        As the section `import` takes them.
    signals : tuple of Guess
    choices : tuple of Choice
        Frames, the order of a quaternion, what a command is.
    left_out : tuple of str
        Sentences on columns that look like a signal and are not mapped.
    flown : Flown
    rate_hz : float
        Of the clock.
    slowest_s, slowest_but_voltage_s : float
        Longest median step of a topic that is mapped, s; and without that of the voltage.
    kind : str
        Kind of log that is known for such columns of rotors; empty where none is.
    moved : MovedBy or None
        The rotors as the motion tells them.
    speeds : array, shape (time, rotor), or None
        Rotor speeds in flight in rad/s, or commands as shares of the largest speed.
    warnings : tuple of str
    """

    time_column: str
    time_unit: str
    signals: tuple[Guess, ...]
    choices: tuple[Choice, ...]
    left_out: tuple[str, ...]
    flown: Flown
    rate_hz: float
    slowest_s: float
    slowest_but_voltage_s: float
    kind: str
    moved: MovedBy | None
    speeds: Array | None = field(repr=False)
    warnings: tuple[str, ...] = ()

    def signal(self, name: SignalName) -> Guess | None:
        """Give the guess for a signal; None where it is not recognised."""
        return next((guess for guess in self.signals if guess.signal == name), None)

    def choice(self, key: str) -> str | None:
        """Give the value of a choice; None where there was none to make."""
        return next((choice.value for choice in self.choices if choice.key == key), None)

    @property
    def rotors(self) -> int:
        """Number of rotors that the columns name; 0 where none do."""
        names: tuple[SignalName, ...] = ("rotor_speed", "rotor_command")
        return max((len(guess.columns.columns) for name in names if (guess := self.signal(name))), default=0)
