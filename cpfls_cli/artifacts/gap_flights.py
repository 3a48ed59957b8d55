"""What a comparison of a model with flights starts from, as groups of datasets: flights, and what they lack."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.audit import by_reason
from cpfls_cli.artifacts.spec import BODY, EULER, WORLD, columns_of, dataset, group, record, rows_of
from cpfls_cli.effects.signals import Signals
from cpfls_cli.weak_form.windows import Recording

if TYPE_CHECKING:
    from cpfls_cli.config.study import Study

_ASKED = "setpoint_"
"""Before the name of a signal that was asked for."""

TRAINING, HELD_OUT = "training", "held-out"
"""Roles of the flights of a diagnosis."""

BEGINS = "stamp of the log's own clock at time 0 of the flight; not finite where there is none"


def known_begins(begins: Iterable[float]) -> Array | None:
    """Arrange where flights begin on the clocks of their logs, s; None where none has a log."""
    stamps = np.fromiter(begins, float)
    return stamps if np.isfinite(stamps).any() else None


@record
class NotExcitedGroup:
    """Effects that could be there unseen."""

    name: tuple[str, ...] = dataset("effects that could be there unseen", "unseen")
    reason: tuple[str, ...] = dataset("why: signals that are lacking, or the flight that would show it", "unseen")

    @property
    def by_reason(self) -> dict[str, list[str]]:
        """Names of the effects by the reason that they have in common."""
        return by_reason(zip(self.name, self.reason, strict=True))

    @property
    def summary(self) -> list[dict[str, Any]]:
        """The effects for machines."""
        return rows_of(self)


@record
class FlightGroup:
    """What each flight is, and where its samples begin."""

    name: tuple[str, ...] = dataset("file name, with the part of it where one flight was split", "flight")
    role: tuple[str, ...] = dataset("given, training or held-out", "flight")
    first: IntArray = dataset("index of the first sample of each flight", "flight")
    commanded: IntArray = dataset("1 where actuation is commanded, not measured", "flight")
    begins: Array | None = dataset(BEGINS, "flight", units="s", gaps=True, default=None)

    @classmethod
    def of(cls, recordings: Sequence[Recording], roles: Sequence[str]) -> Self:
        """Say what each flight is; a role is given, training or held-out."""
        lengths = [len(recording.signals) for recording in recordings]
        return columns_of(
            cls,
            recordings,
            role=tuple(roles),
            first=np.cumsum([0, *lengths[:-1]]),
            commanded=np.array([int(recording.signals.commanded) for recording in recordings]),
            begins=known_begins(recording.begins for recording in recordings),
        )


@record
class SignalsGroup:
    """Signals of all flights; not finite in a flight that lacks one."""

    time: Array = dataset("time on the clock of the flight", "sample", units="s")
    body_rate: Array = dataset("body rates p, q, r, as logged", "sample", "axis", units="rad/s", frame=BODY)
    attitude: Array | None = dataset(
        "roll, pitch, yaw", "sample", "axis", units="rad", frame=EULER, gaps=True, default=None
    )
    velocity: Array | None = dataset("velocity", "sample", "axis", units="m/s", frame=WORLD, gaps=True, default=None)
    position: Array | None = dataset("position", "sample", "axis", units="m", frame=WORLD, gaps=True, default=None)
    acceleration: Array | None = dataset(
        "acceleration", "sample", "axis", units="m/s^2", frame=WORLD, gaps=True, default=None
    )
    specific_force: Array | None = dataset(
        "what an accelerometer senses", "sample", "axis", units="m/s^2", frame=BODY, gaps=True, default=None
    )
    rotor_speed: Array | None = dataset(
        "rotor speeds, measured or commanded", "sample", "rotor", units="rad/s", frame=BODY, gaps=True, default=None
    )
    stated_torque: Array | None = dataset(
        "torque of a log without rotor speeds", "sample", "axis", units="N m", frame=BODY, gaps=True, default=None
    )
    stated_thrust: Array | None = dataset(
        "thrust of such a log, along body z", "sample", units="N", frame=BODY, gaps=True, default=None
    )
    voltage: Array | None = dataset("of the battery, as a share of the full one", "sample", gaps=True, default=None)
    setpoint_position: Array | None = dataset(
        "position setpoint, by which runs in one flight are found",
        "sample",
        "axis",
        units="m",
        frame=WORLD,
        gaps=True,
        default=None,
    )

    @classmethod
    def of(cls, recordings: Sequence[Recording]) -> Self:
        """Put the signals of flights one after another."""
        lengths = [len(recording.signals) for recording in recordings]
        joined = {
            field.name: _joined([_signal(recording.signals, field.name) for recording in recordings], lengths)
            for field in fields(cls)
        }
        return cls(**joined)  # type: ignore[arg-type]  # every flight has time and rates

    def part(self, samples: slice, commanded: bool, study: Study) -> Signals:
        """Rebuild the signals of one flight, with the vehicle and the ground of a study."""
        known = {
            field.name: values[samples] for field in fields(self) if (values := getattr(self, field.name)) is not None
        }
        # A flight that lacks a signal lacks all of it.
        whole = {name: values for name, values in known.items() if np.isfinite(values).all()}
        ground = study.gap.ground_height_m
        asked = {name: whole.pop(_ASKED + name) for name in ("position",) if _ASKED + name in whole}
        return Signals(vehicle=study.vehicle, commanded=commanded, ground_height_m=ground, setpoints=asked, **whole)


def _signal(signals: Signals, name: str) -> Array | None:
    """Give a signal, or what was asked for, by the name of its dataset."""
    asked = name.removeprefix(_ASKED)
    return getattr(signals, name) if asked == name else signals.setpoints.get(asked)


def _joined(parts: Sequence[Array | None], lengths: Sequence[int]) -> Array | None:
    shape = next((part.shape[1:] for part in parts if part is not None), None)
    if shape is None:
        return None
    filled = [
        np.full((length, *shape), np.nan) if part is None else part for part, length in zip(parts, lengths, strict=True)
    ]
    return np.concatenate(filled)


@record
class FlightsGroup:
    """Flights that later stages read, one after another along the samples."""

    each: FlightGroup = group("flight")
    signals: SignalsGroup = group()

    @classmethod
    def of(cls, recordings: Sequence[Recording], roles: Sequence[str]) -> Self:
        """Put flights one after another."""
        return cls(each=FlightGroup.of(recordings, roles), signals=SignalsGroup.of(recordings))

    def names(self, *roles: str) -> list[str]:
        """List the names of the flights in these roles; of all if none is named."""
        pairs = zip(self.each.name, self.each.role, strict=True)
        return [name for name, role in pairs if not roles or role in roles]

    def recordings(self, study: Study, *roles: str) -> list[Recording]:
        """Rebuild the flights in these roles; all if none is named."""
        each = self.each
        last = [*each.first[1:], len(self.signals.time)]
        begins = np.full(len(each.name), np.nan) if each.begins is None else each.begins
        columns = zip(each.name, each.role, each.first, last, each.commanded, begins.tolist(), strict=True)
        return [
            Recording(name, self.signals.part(slice(start, stop), bool(commanded), study), begin)
            for name, role, start, stop, commanded, begin in columns
            if not roles or role in roles
        ]
