"""What a log is taken for, and what is told of it so far: signals, keys, the reason and the rivals of each guess."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, NamedTuple

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.agreement import handed
from cpfls_cli.flightlog.airframe import MovedBy
from cpfls_cli.flightlog.conversion import as_mapped
from cpfls_cli.flightlog.flown import FlownPart
from cpfls_cli.flightlog.log_table import LogTable
from cpfls_cli.flightlog.nameless import OF_A_MATRIX
from cpfls_cli.flightlog.names import Named
from cpfls_cli.flightlog.settings import ROTORS, SignalMap, SignalName
from cpfls_cli.units import UnitName, known_unit

if TYPE_CHECKING:
    from cpfls_cli.flightlog.rebuilt import Rebuilt

# Whether the data decided, a name or the kind of log says so, or neither does.
Sure = Literal["data", "named", "guess"]


@dataclass(frozen=True)
class Rival:
    """Another guess that the data cannot part from the one that is taken."""

    text: str  # As it would stand in the config, such as ``unit: deg``.
    reason: str  # Why it is not ruled out.


@dataclass(frozen=True, kw_only=True)
class Guess:
    """A signal of the log."""

    signal: SignalName
    columns: SignalMap
    reason: str
    sure: Sure
    rivals: tuple[Rival, ...] = ()

    @property
    def other_columns(self) -> Rival | None:
        """Columns that may be its own too, so that their number is a guess."""
        return next((rival for rival in self.rivals if rival.text.startswith("columns: [")), None)


@dataclass(frozen=True)
class KeyChoice:
    """A key of the section `import` that holds for the whole log."""

    key: str
    value: str
    reason: str
    sure: Sure
    rivals: tuple[Rival, ...] = ()


class Load(NamedTuple):
    """What the rotors carry in flight."""

    # Mean square of their speeds, or of commands taken for them, over the specific force that they hold: at equal
    # propellers it is as the mass.
    size: float
    # Whether an accelerometer tells that force; else it is gravity, and a flight that leans far looks heavier.
    sensed: bool
    steady: bool  # Whether it hovers, by what its rotors give from second to second: punches and dives are no load.
    voltage: float = float("nan")  # Of the battery in flight, V; NaN where the log does not hold it.


@dataclass(frozen=True, kw_only=True)
class Recognition:
    """What a log is taken for."""

    time_column: str  # As the section `import` takes them.
    time_unit: str
    signals: tuple[Guess, ...]
    choices: tuple[KeyChoice, ...]  # Frames, the order of a quaternion, what a command is.
    left_out: tuple[str, ...]  # Sentences on columns that look like a signal and are not mapped.
    flown: FlownPart
    rate_hz: float  # Of the clock.
    slowest_s: float  # Longest median step of a topic that is mapped, s; and without that of the voltage.
    slowest_but_voltage_s: float
    kind: str  # Kind of log that is known for such columns of rotors; empty where none is.
    moved: MovedBy | None  # The rotors as the motion tells them.
    # Shape (time, rotor), or None; rotor speeds in flight in rad/s, or commands as shares of the largest speed.
    speeds: Array | None = field(repr=False)
    load: Load | None = None  # None where no columns are those of rotors.
    warnings: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()  # All columns that are mapped to nothing, stamps left out.
    winged: bool = False  # Whether it is of a VTOL and flies on the wing for a part, which is cut.
    # Where the stretches of `flown` are counted from, s from the first stamp of a flat log, or of all topics.
    counted_from_s: float = 0.0
    # Commands of the rotors that take the place of logged ones.
    rebuilt: "Rebuilt | None" = field(default=None, repr=False)

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
        return max((len(guess.columns.names) for name in names if (guess := self.signal(name))), default=0)


@dataclass
class Seen:
    """A log, the part of it that is flown, and what has been told of it so far."""

    log: LogTable
    candidates: Mapping[SignalName, Sequence[Named]]
    part: slice
    level: Array | None
    guesses: dict[SignalName, Guess] = field(default_factory=dict)
    choices: dict[str, KeyChoice] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    @property
    def rate_hz(self) -> float:
        """Of the one clock."""
        return 1 / float(self.log.grid[1] - self.log.grid[0])

    @property
    def quaternion_order(self) -> Literal["wxyz", "xyzw"]:
        """Order of the columns of quaternions."""
        choice = self.choices.get("quaternion_order")
        return "xyzw" if choice is not None and choice.value == "xyzw" else "wxyz"

    def first(self, name: SignalName) -> Named | None:
        """Give the best candidate for a signal."""
        return next(iter(self.candidates.get(name, ())), None)

    def grid(self, named: Named) -> Array:
        """Give a candidate's columns in the part that is flown, in the unit that is stated."""
        return named.scale * self.log.on_grid(named.group.columns)[self.part]

    def mapped(self, guess: Guess) -> Array:
        """Give the columns of a guess in the part that is flown, as they are mapped, in SI."""
        columns = guess.columns
        values = self.log.on_grid(columns.columns, spikes=guess.signal not in ROTORS)[self.part]
        return known_unit(columns.unit).factor * as_mapped(values, columns)

    def tell(
        self,
        named: Named,
        unit: UnitName,
        reason: str,
        sure: Sure,
        *,
        scale: float = 1.0,
        order: Sequence[int] | None = None,
        sign: Sequence[float] | None = None,
        rivals: tuple[Rival, ...] = (),
        required: bool = True,
    ) -> None:
        """Take columns for a signal, in an order and with signs."""
        columns = named.group.columns
        mapped = SignalMap(
            columns=columns if order is None else tuple(columns[index] for index in order),
            unit=unit,
            scale=named.scale * scale,
            sign=None if sign is None or min(sign) > 0 else tuple(sign),
            required=required,
        )
        guess = Guess(signal=named.signal, columns=mapped, reason=reason, sure=sure, rivals=rivals)
        self.guesses[named.signal] = guess

    def choose(self, key: str, value: str, reason: str, sure: Sure, *rivals: Rival) -> None:
        """Take a value of a key that holds for the whole log."""
        self.choices[key] = KeyChoice(key, value, reason, sure, rivals)

    def doubt(self, name: SignalName, *rivals: Rival) -> None:
        """Make a guess of what was told."""
        guess = self.guesses[name]
        self.guesses[name] = replace(guess, sure="guess", rivals=(*guess.rivals, *rivals))

    def disagree(self, named: Named, unit: str, by: str = "its size says") -> None:
        """Warn of columns that are in another unit than is said."""
        self.warnings.append(f"{named.group.pattern} is said to be in {named.unit}; {by} {unit}")

    def warn_of_mirrored(self, named: Named, order: Sequence[int], sign: Sequence[float], whose: str) -> None:
        """Warn of axes that are left-handed beside those of all others."""
        if handed(order, sign) > 0:
            return
        columns = [named.group.columns[index] for index, own in zip(order, sign, strict=True) if own < 0]
        what = f"{columns[0]} is opposite to all others" if len(columns) == 1 else "its axes are left-handed"
        self.warnings.append(f"{named.group.pattern}: {what}; taken as in {whose}")


def called(named: Named) -> str:
    """Say what a log calls columns."""
    pattern = named.group.pattern
    if named.known == OF_A_MATRIX:
        return f"{pattern} of {OF_A_MATRIX}"
    if any(letter.isalnum() for letter in pattern):
        return f"a log of {named.known} calls it {pattern}" if named.known else f"called {pattern}"
    return f"called {', '.join(named.group.columns)}"
