"""Flights as the results of the gap workflow hold them, so that later stages need no logs."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self

from cpfls_cli.arrays import Array
from cpfls_cli.effects.signals import Signals
from cpfls_cli.result import about, described_fields, result
from cpfls_cli.vehicle.settings import VehicleSettings

GIVEN, TRAINING, HELD_OUT = "given", "training", "held-out"  # Roles of flights: of a comparison, and of a diagnosis.
_BODY, _WORLD = "body (FLU)", "world (z up)"


@result
class RecordedFlight:
    """The signals of a flight."""

    name: str = about("file name, with the part of it where one flight was split")
    role: str = about("given, training or held-out")
    commanded: bool = about("whether actuation is commanded, not measured")
    begins: float = about(
        "stamp of the log's own clock at time 0 of the flight; not finite where there is none", unit="s", gaps=True
    )
    slow_rotors: str = about("what rotors that are logged rarely do not show, and the remedy", default="")
    time: Array = about("time on the clock of the flight", "sample", unit="s")
    body_rate: Array = about("body rates p, q, r, as logged", "sample", "axis", unit="rad/s", frame=_BODY)
    attitude: Array | None = about(
        "roll, pitch, yaw", "sample", "axis", unit="rad", frame="Euler angles (intrinsic ZYX)", default=None
    )
    velocity: Array | None = about("velocity", "sample", "axis", unit="m/s", frame=_WORLD, default=None)
    position: Array | None = about("position", "sample", "axis", unit="m", frame=_WORLD, default=None)
    acceleration: Array | None = about("acceleration", "sample", "axis", unit="m/s^2", frame=_WORLD, default=None)
    specific_force: Array | None = about(
        "what an accelerometer senses", "sample", "axis", unit="m/s^2", frame=_BODY, default=None
    )
    rotor_speed: Array | None = about(
        "rotor speeds, measured or commanded", "sample", "rotor", unit="rad/s", frame=_BODY, default=None
    )
    stated_torque: Array | None = about(
        "torque of a log without rotor speeds", "sample", "axis", unit="N m", frame=_BODY, default=None
    )
    stated_thrust: Array | None = about(
        "thrust of such a log, along body z", "sample", unit="N", frame=_BODY, default=None
    )
    voltage: Array | None = about("of the battery, as a share of the full one", "sample", default=None)
    setpoint_position: Array | None = about(
        "position setpoint, by which runs in one flight are found",
        "sample",
        "axis",
        unit="m",
        frame=_WORLD,
        default=None,
    )

    @classmethod
    def of(cls, flight: Signals, role: str) -> Self:
        """Take the signals of a flight."""
        held: dict[str, Any] = {each.name: getattr(flight, each.name, None) for each in described_fields(cls)}
        return cls(**held | {"role": role, "setpoint_position": flight.setpoints.get("position")})

    @property
    def signals(self) -> dict[str, Array]:
        """Known signals but the time, by name."""
        held = {name: getattr(self, name) for name in SIGNALS if name != "time"}
        return {name: values for name, values in held.items() if values is not None}

    def flight(self, vehicle: VehicleSettings, ground_height_m: float) -> Signals:
        """Rebuild the flight, with its vehicle and the height of the ground."""
        held = dict(vars(self))
        del held["role"]
        position = held.pop("setpoint_position")
        asked = {} if position is None else {"position": position}
        return Signals(**held, vehicle=vehicle, ground_height_m=ground_height_m, setpoints=asked)


SIGNALS = tuple(each.name for each in described_fields(RecordedFlight) if each.about and each.about.axes)
"""Names of the signals that are held."""


def recorded(flights: Iterable[Signals], roles: Iterable[str]) -> dict[str, RecordedFlight]:
    """Hold flights by number."""
    pairs = enumerate(zip(flights, roles, strict=True), start=1)
    return {f"flight-{number}": RecordedFlight.of(*pair) for number, pair in pairs}


def in_roles(flights: Mapping[str, RecordedFlight], *roles: str) -> Sequence[RecordedFlight]:
    """List the flights in these roles; all if none is named."""
    return [each for each in flights.values() if not roles or each.role in roles]


def names_of(flights: Mapping[str, RecordedFlight], *roles: str) -> list[str]:
    """List the names of the flights in these roles; of all if none is named."""
    return [each.name for each in in_roles(flights, *roles)]
