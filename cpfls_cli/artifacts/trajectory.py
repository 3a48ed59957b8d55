"""The artifact of a planned path."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.spec import BODY, EULER, WORLD, Format, Record, columns_of, dataset, group, record, rows_of
from cpfls_cli.gap.settings import RARE

if TYPE_CHECKING:
    from cpfls_cli.simulation.room_left import RoomLeft
    from cpfls_cli.trajectory.legs import Leg
    from cpfls_cli.trajectory.planning import PlannedRotation
    from cpfls_cli.trajectory.settings import ExciteSettings

DERIVATIVES = ("pop", "crackle", "snap", "jerk", "acceleration", "velocity", "displacement")
"""Derivatives of the displacement, from the sixth down to itself."""


@record
class LegGroup:
    """Moves of the path."""

    begin: Array = dataset("when each move leaves its rest", "leg", units="s")
    end: Array = dataset("when each move is at rest again", "leg", units="s")
    displacement: Array = dataset("displacement of each move", "leg", "axis", units="m", frame=WORLD)
    limited_by: tuple[str, ...] = dataset(
        "derivatives that reach their limit; empty where a move was not planned under limits", "leg"
    )

    @classmethod
    def of(cls, legs: Sequence[Leg]) -> Self:
        """Arrange the moves of a plan."""
        return columns_of(
            cls,
            legs,
            displacement=np.array([leg.vector for leg in legs]),
            limited_by=tuple(" ".join(leg.limited_by) for leg in legs),
        )


@record
class RunsGroup:
    """Runs of a path that is repeated: what is planned is the same in all, but for whole turns of yaw."""

    begin: Array = dataset("when each run leaves its rest", "run", units="s")
    end: Array = dataset("when each run is at rest again", "run", units="s")


@record
class ExcitedGroup:
    """The test signal in a path: attitude and acceleration that the setpoints have on its account."""

    axis: tuple[str, ...] = dataset("roll, pitch, yaw or vertical", "excited")
    crest: Array = dataset("crest factor of the signal of each, peak over root mean square", "excited")
    size: Array = dataset("largest angle, as planned", "excited", units="rad")
    limit: tuple[str, ...] = dataset(
        "limit of the vehicle that made it smaller than asked for; empty where none did", "excited"
    )
    signal: str = dataset("multisine, sweep-linear or sweep-logarithmic")
    band: Array = dataset("lowest and highest frequency", "2", units="Hz")
    attitude: Array = dataset("roll, pitch, yaw that it adds", "time", "axis", units="rad", frame=EULER)
    position: Array = dataset("position that it adds", "time", "axis", units="m", frame=WORLD)
    acceleration: Array = dataset("acceleration that it adds", "time", "axis", units="m/s^2", frame=WORLD)

    @classmethod
    def of(
        cls,
        asked: ExciteSettings,
        flown: PlannedRotation,
        without: PlannedRotation,
        room: RoomLeft,
    ) -> Self:
        """Arrange what an excitation adds to a path."""
        added = {name: vars(flown)[name] - vars(without)[name] for name in ("attitude", "position", "acceleration")}
        return cls(
            axis=asked.axes,
            crest=np.array(room.added.crest),
            signal=asked.signal,
            band=np.array(asked.band_hz),
            size=room.added.sizes,
            limit=room.limits,
            **added,
        )

    @property
    def summary(self) -> dict[str, Any]:
        """What is excited, for machines."""
        return {
            "axes": list(self.axis),
            "size_rad": self.size.tolist(),
            "limit": list(self.limit),
            "crest_factor": self.crest.tolist(),
            "signal": self.signal,
            "band_hz": self.band.tolist(),
            "max_displacement_m": float(np.linalg.norm(self.position, axis=1).max()),
        }


@record
class QuestionGroup:
    """What the flight is to tell, and how sure it will be."""

    true: tuple[str, ...] = dataset("effect that is taken to be there", "question")
    rival: tuple[str, ...] = dataset("effect that it is told from; empty: from no effect at all", "question")
    size: tuple[str, ...] = dataset("numbers of the effect that is there", "question")
    likely: Array = dataset(
        "how likely the rival is expected to be after this flight, if the effect is there", "question"
    )
    likely_flown: Array = dataset(
        "the same along the path that the autopilot of `simulation.closed_loop` flies", "question", gaps=True
    )
    sure: Array = dataset(
        "probability that the flight settles it: that the rival is rare beside the effect", "question"
    )
    flown: Array = dataset("`sure` along the path that the autopilot flies", "question", gaps=True)
    again: Array = dataset("`sure` where the known flights are flown again instead", "question", gaps=True)
    random: Array = dataset("`sure` of a middling one of random paths within the same limits", "question")
    least: Array = dataset("share of the size from which on it is settled; nan where no size is", "question", gaps=True)
    smallest: tuple[str, ...] = dataset(
        "the numbers at that share; empty where there is none, or shapes alone size the effect", "question"
    )
    advice: tuple[str, ...] = dataset("the flight that the catalogue advises", "question")

    @property
    def settled(self) -> bool:
        """Whether each effect, if it is there, is expected to be sure to the rate of errors of names."""
        tables = (self.expected(each) for each in (self.likely, np.nan_to_num(self.likely_flown)))
        return all(max(sets.values()) <= RARE * own for table in tables for own, sets in table.values())

    def expected(self, likely: Array) -> dict[str, tuple[float, dict[str, float]]]:
        """By the effect that is there, how likely it and each of its rivals are; "" stands for no effect at all.

        Parameters
        ----------
        likely : array, shape (question,)
            `likely`, or `likely_flown`.
        """
        tables: dict[str, dict[str, float]] = {}
        for true, rival, each in zip(self.true, self.rival, likely.tolist(), strict=True):
            tables.setdefault(true, {})[rival] = each
        return {true: (1 - sum(rivals.values()), rivals) for true, rivals in tables.items()}

    @property
    def expected_summary(self) -> list[dict[str, Any]]:
        """The expected tables for machines, in the form of that of a diagnosis."""
        return [
            {
                "if": true,
                "sets": [
                    {"effects": [name] if name else [], "likely": each} for name, each in ({true: own} | rivals).items()
                ],
            }
            for true, (own, rivals) in self.expected(self.likely).items()
        ]

    @property
    def summary(self) -> list[dict[str, Any]]:
        """The questions for machines; null where nothing is known."""
        return rows_of(self)


@dataclass(frozen=True)
class FirstLeg:
    """Motion along the line of the first move.

    Attributes
    ----------
    time : array, shape (samples,), s
    curves : dict of str to array, shape (samples,)
        By name of the derivative, signed along the move.
    """

    time: Array
    curves: dict[str, Array]


@record
class TrajectoryRecord(Record):
    """The artifact `cpfls/trajectory`."""

    FORMAT: ClassVar = Format(
        "cpfls/trajectory",
        "a planned path with all its derivatives and the attitude that flies it; "
        "without a position the vehicle is held at its centre of mass and only turns",
        "trajectory",
        ("waypoints", "diagnosis"),
    )

    time: Array = dataset("time from the first sample", "time", units="s")
    position: Array | None = dataset("position", "time", "axis", units="m", frame=WORLD, default=None)
    velocity: Array | None = dataset("velocity", "time", "axis", units="m/s", frame=WORLD, default=None)
    acceleration: Array | None = dataset("acceleration", "time", "axis", units="m/s^2", frame=WORLD, default=None)
    jerk: Array | None = dataset(
        "third derivative of position", "time", "axis", units="m/s^3", frame=WORLD, default=None
    )
    snap: Array | None = dataset(
        "fourth derivative of position", "time", "axis", units="m/s^4", frame=WORLD, default=None
    )
    crackle: Array | None = dataset(
        "fifth derivative of position", "time", "axis", units="m/s^5", frame=WORLD, default=None
    )
    pop: Array | None = dataset(
        "sixth derivative of position", "time", "axis", units="m/s^6", frame=WORLD, default=None
    )
    yaw: Array = dataset("planned yaw", "time", units="rad", frame=EULER)
    yaw_rate: Array = dataset("derivative of yaw", "time", units="rad/s", frame=EULER)
    yaw_acceleration: Array = dataset("second derivative of yaw", "time", units="rad/s^2", frame=EULER)
    attitude: Array = dataset("roll, pitch, yaw q", "time", "axis", units="rad", frame=EULER)
    attitude_rate: Array = dataset("Euler rates qd", "time", "axis", units="rad/s", frame=EULER)
    attitude_acceleration: Array = dataset("Euler accelerations qdd", "time", "axis", units="rad/s^2", frame=EULER)
    body_rate: Array = dataset("body rates p, q, r", "time", "axis", units="rad/s", frame=BODY)
    leg: LegGroup | None = group(default=None)
    run: RunsGroup | None = group(default=None)
    excited: ExcitedGroup | None = group(default=None)
    question: QuestionGroup | None = group(default=None)

    @classmethod
    def of(
        cls, planned: PlannedRotation, question: QuestionGroup | None = None, excited: ExcitedGroup | None = None
    ) -> Self:
        """Arrange a plan, with what it is to tell, or what excites it."""
        sampled = vars(planned)
        signals = {name: sampled[name] for name in cls.__dataclass_fields__ if name in sampled}
        runs = np.array(sampled.get("runs", ()))
        return cls(
            **signals,
            leg=LegGroup.of(sampled["legs"]) if sampled.get("legs") else None,
            run=RunsGroup(begin=runs[:, 0], end=runs[:, 1]) if len(runs) else None,
            question=question,
            excited=excited,
        )

    @classmethod
    def lacking(cls, present: Container[str]) -> list[str]:
        """List the datasets that an artifact lacks which holds these: a path is there with all its derivatives."""
        path = [cls.path("position" if name == "displacement" else name) for name in DERIVATIVES]
        partly = any(name in present for name in path)
        return [*super().lacking(present), *(name for name in path if partly and name not in present)]

    @property
    def held(self) -> bool:
        """Whether the vehicle is held at its centre of mass and only turns."""
        return self.position is None

    @property
    def summary(self) -> dict[str, Any]:
        """The samples of the path for machines."""
        return {
            "samples": len(self.time),
            "dt_s": float(self.time[1]),
            "max_rate_rad_s": _largest(self.attitude_rate),
            "max_body_rate_rad_s": _largest(self.body_rate),
            "max_acceleration_rad_s2": _largest(self.attitude_acceleration),
            **({"runs": rows_of(self.run)} if self.run else {}),
            **({"excited": self.excited.summary} if self.excited else {}),
            **(
                {"expected": self.question.expected_summary, "questions": self.question.summary}
                if self.question
                else {}
            ),
        }

    def derivative(self, name: str) -> Array:
        """Get a derivative of the displacement from the start, shape (time, 3), m and s, world frame."""
        values: Array | None = self.position if name == "displacement" else getattr(self, name)
        assert values is not None, "a held vehicle has no displacement"
        return values - values[0] if name == "displacement" else values

    def first_leg(self) -> FirstLeg:
        """Take the first move, from rest to rest; the whole path where the file does not tell its moves."""
        part, direction = self._first_move()
        return FirstLeg(self.time[part], {name: self.derivative(name)[part] @ direction for name in DERIVATIVES})

    def _first_move(self) -> tuple[slice, Array]:
        """Find its samples and its direction."""
        if self.leg is not None:
            first, last = np.searchsorted(self.time, [self.leg.begin[0], self.leg.end[0]])
            # Divided by the largest component first: the square of a tiny one is zero.
            along = self.leg.displacement[0] / np.abs(self.leg.displacement[0]).max()
            return slice(int(first), int(last) + 1), along / np.linalg.norm(along)
        away = self.derivative("displacement")
        farthest = away[np.argmax(np.linalg.norm(away, axis=1))]
        return slice(None), farthest / (np.linalg.norm(farthest) or 1.0)

    def peaks(self) -> dict[str, float]:
        """Find the largest length of every derivative at the samples of the whole path."""
        return {name: float(np.linalg.norm(self.derivative(name), axis=1).max()) for name in DERIVATIVES}


def _largest(values: Array) -> list[float]:
    return [float(value) for value in np.abs(values).max(axis=0)]
