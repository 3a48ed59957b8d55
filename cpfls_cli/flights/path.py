"""A planned path as its file holds it: all derivatives, the attitude that flies it, its moves, runs and test signal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.gap.settings import RARE
from cpfls_cli.result import BODY, EULER, WORLD, about, part, result

if TYPE_CHECKING:
    from cpfls_cli.excitation import Excitation
    from cpfls_cli.simulation.inverse import Flyability, RoomLeft
    from cpfls_cli.trajectory.legs import Leg
    from cpfls_cli.trajectory.planning import PlannedRotation
    from cpfls_cli.trajectory.settings import ExciteSettings, TrajectorySettings

DERIVATIVES = ("pop", "crackle", "snap", "jerk", "acceleration", "velocity", "displacement")
"""Derivatives of the displacement, from the sixth down to itself."""


def _in_time(text: str, unit: str, frame: str = WORLD, **more: Any) -> Any:
    """Describe a signal of three axes along a path."""
    return about(text, "time", "axis", unit=unit, frame=frame, brief=False, **more)


@result
class Move:
    """A move of the path from rest to rest."""

    begin_s: float = about("when it leaves its rest", unit="s")
    duration_s: float = about("time until it is at rest again", unit="s")
    displacement_m: Array = about("displacement", "axis", unit="m", frame=WORLD)
    limited_by: tuple[str, ...] = about("derivatives that reach their limit; none without limits", "limit")
    jerk_integral_m_s2: float = about("integral of the absolute jerk of the axis that has most of it", unit="m/s^2")

    @classmethod
    def of(cls, leg: Leg) -> Move:
        """Describe a move of a plan."""
        return cls(
            begin_s=leg.begin,
            duration_s=leg.duration,
            displacement_m=leg.vector,
            limited_by=tuple(leg.limited_by),
            jerk_integral_m_s2=max(profile.integral_of_absolute_jerk for profile in leg.profiles),
        )

    @property
    def end_s(self) -> float:
        """When it is at rest again, s."""
        return self.begin_s + self.duration_s


@result
class PathRun:
    """A run of a path that is repeated: what is planned is the same in all, but for whole turns of yaw."""

    begin: float = about("when it leaves its rest", unit="s")
    end: float = about("when it is at rest again", unit="s")


@result
class Excited:
    """The test signal in a path: attitude and acceleration that the setpoints have on its account."""

    SHOWN: ClassVar = ("max_displacement_m",)

    axes: tuple[str, ...] = about("roll, pitch, yaw or vertical", "excited")
    size_rad: Array = about("largest angle, as planned", "excited", unit="rad")
    limit: tuple[str, ...] = about(
        "limit of the vehicle that made it smaller than asked for; empty where none did", "excited"
    )
    crest_factor: Array = about("peak over root mean square of the signal of each", "excited")
    signal: str = about("multisine, sweep-linear or sweep-logarithmic")
    band_hz: Array = about("lowest and highest frequency", "2", unit="Hz")
    attitude: Array = _in_time("roll, pitch, yaw that it adds", "rad", EULER)
    position: Array = _in_time("position that it adds", "m")
    acceleration: Array = _in_time("acceleration that it adds", "m/s^2")

    @classmethod
    def of(cls, asked: ExciteSettings, flown: PlannedRotation, without: PlannedRotation, room: RoomLeft) -> Excited:
        """Describe what an excitation adds to a path."""
        added = {name: vars(flown)[name] - vars(without)[name] for name in ("attitude", "position", "acceleration")}
        return cls(
            axes=tuple(asked.axes),
            crest_factor=np.array(room.added.crest),
            signal=asked.signal,
            band_hz=np.array(asked.band_hz),
            size_rad=room.added.sizes,
            limit=tuple(room.limits),
            **added,
        )

    @property
    def max_displacement_m(self) -> float:
        """How far it moves the vehicle, m."""
        return float(np.linalg.norm(self.position, axis=1).max())


@result
class PathQuestion:
    """What a flight is to decide, and how sure it will be."""

    true: str = about("effect that is taken to be there")
    rival: str = about("effect that it is separated from; empty: from no effect at all")
    size: str = about("numbers of the effect that is there")
    likely: float = about("how likely the rival is expected to be after this flight, if the effect is there")
    likely_flown: float = about(
        "the same along the path that the autopilot of `simulation.closed_loop` flies", gaps=True
    )
    sure: float = about("probability that the flight settles it: that the rival is rare against the effect")
    flown: float = about("`sure` along the path that the autopilot flies", gaps=True)
    again: float = about("`sure` where the known flights are flown again instead", gaps=True)
    random: float = about("`sure` of a middling one of random paths within the same limits")
    least: float = about("share of the size from which on it is settled; nan where no size is", gaps=True)
    smallest: str = about("the numbers at that share; empty where there is none, or shapes alone size the effect")
    advice: str = about("the flight that the catalogue advises")


@result
class Peak:
    """The largest magnitude of a derivative along the path."""

    name: str = about("pop to displacement")
    unit: str = about("its unit")
    largest: float = about("at the samples")
    planned: float = about("bound of the plan, between samples too", gaps=True)
    limit: float = about("limit that it was planned under", gaps=True)


@result
class RandomPaths:
    """Condition numbers of the regressor along random paths."""

    best: float = about("the lowest")
    median: float = about("the median")
    count: int = about("how many were drawn")


@result
class PlannedPath:
    """A planned path; without a position the vehicle is held at its centre of mass and only turns."""

    FORMAT: ClassVar = "cpfls/trajectory"
    SHOWN: ClassVar = (
        *("samples", "dt_s", "max_rate_rad_s", "max_body_rate_rad_s", "max_acceleration_rad_s2", "max", "expected"),
    )

    time: Array = about("time from the first sample", "time", unit="s", ascends=True, brief=False)
    position: Array | None = _in_time("position", "m", default=None)
    velocity: Array | None = _in_time("velocity", "m/s", default=None)
    acceleration: Array | None = _in_time("acceleration", "m/s^2", default=None)
    jerk: Array | None = _in_time("third derivative of position", "m/s^3", default=None)
    snap: Array | None = _in_time("fourth derivative of position", "m/s^4", default=None)
    crackle: Array | None = _in_time("fifth derivative of position", "m/s^5", default=None)
    pop: Array | None = _in_time("sixth derivative of position", "m/s^6", default=None)
    yaw: Array = about("planned yaw", "time", unit="rad", frame=EULER, brief=False)
    yaw_rate: Array = about("derivative of yaw", "time", unit="rad/s", frame=EULER, brief=False)
    yaw_acceleration: Array = about("second derivative of yaw", "time", unit="rad/s^2", frame=EULER, brief=False)
    attitude: Array = _in_time("roll, pitch, yaw q", "rad", EULER)
    attitude_rate: Array = _in_time("Euler rates qd", "rad/s", EULER)
    attitude_acceleration: Array = _in_time("Euler accelerations qdd", "rad/s^2", EULER)
    body_rate: Array = _in_time("body rates p, q, r", "rad/s", BODY)
    duration_s: float = about("duration of all runs", unit="s")
    max_thrust_n: float = about("largest thrust that it asks for, between samples too", unit="N")
    max_tilt_rad: float | None = about("largest tilt that it asks for", unit="rad", default=None)
    peaks: tuple[Peak, ...] = part()
    legs: tuple[Move, ...] = part()
    runs: tuple[PathRun, ...] = part()
    excited: Excited | None = part(default=None)
    questions: tuple[PathQuestion, ...] = part()
    condition_number: float | None = about("of the regressor along an optimised path, uniform partitions", default=None)
    random: RandomPaths | None = part(default=None)
    evaluations: int | None = about("paths that the optimisation evaluated", default=None)

    @classmethod
    def of(
        cls,
        planned: PlannedRotation,
        demand: Flyability,
        settings: TrajectorySettings,
        *,
        excitation: Excitation | None = None,
        excited: Excited | None = None,
        questions: Sequence[PathQuestion] = (),
    ) -> PlannedPath:
        """Describe a plan, with what it asks of the vehicle, what it is to decide, and what excites it."""
        sampled = vars(planned)
        signals = {
            name: sampled[name] for name in cls.__dataclass_fields__ if isinstance(sampled.get(name), np.ndarray)
        }
        in_space = "position" in signals
        return cls(
            **signals,
            duration_s=planned.duration,
            max_thrust_n=float(demand.thrust.max()),
            max_tilt_rad=float(demand.tilt.max()) if in_space else None,
            peaks=_peaks(signals, sampled.get("maxima", {}), settings) if in_space else (),
            legs=tuple(map(Move.of, sampled.get("legs", ()))),
            runs=tuple(PathRun(begin=begin, end=end) for begin, end in sampled.get("runs", ())),
            excited=excited,
            questions=tuple(questions),
            condition_number=None if excitation is None else excitation.condition_number,
            random=None
            if excitation is None
            else RandomPaths(
                best=float(excitation.random.min()),
                median=float(np.median(excitation.random)),
                count=len(excitation.random),
            ),
            evaluations=None if excitation is None else excitation.evaluations,
        )

    @property
    def held(self) -> bool:
        """Whether the vehicle is held at its centre of mass and only turns."""
        return self.position is None

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.time)

    @property
    def dt_s(self) -> float:
        """Time between samples, s."""
        return float(self.time[1])

    @property
    def max_rate_rad_s(self) -> list[float]:
        """Largest Euler rates, rad/s."""
        return _largest(self.attitude_rate)

    @property
    def max_body_rate_rad_s(self) -> list[float]:
        """Largest body rates, rad/s."""
        return _largest(self.body_rate)

    @property
    def max_acceleration_rad_s2(self) -> list[float]:
        """Largest Euler accelerations, rad/s^2."""
        return _largest(self.attitude_acceleration)

    @property
    def max(self) -> dict[str, float]:
        """Bounds of the plan by derivative, in units of m and s."""
        bounds = {peak.name: peak.planned for peak in self.peaks}
        return bounds | ({"position": bounds["displacement"]} if bounds else {})

    @property
    def expected(self) -> list[dict[str, Any]]:
        """The probabilities that are expected after the flight, in the form of those of a diagnosis."""
        return [
            {
                "if": true,
                "sets": [
                    {"effects": [name] if name else [], "likely": each} for name, each in ({true: own} | rivals).items()
                ],
            }
            for true, (own, rivals) in self.after("likely").items()
        ]

    def after(self, likely: str) -> dict[str, tuple[float, dict[str, float]]]:
        """By the effect that is there, how likely it and each of its rivals are; "" is no effect, what is unknown is 0.

        Parameters
        ----------
        likely : {"likely", "likely_flown"}
        """
        tables: dict[str, dict[str, float]] = {}
        for each in self.questions:
            tables.setdefault(each.true, {})[each.rival] = float(np.nan_to_num(getattr(each, likely)))
        return {true: (1 - sum(rivals.values()), rivals) for true, rivals in tables.items()}

    @property
    def settled(self) -> bool:
        """Whether each effect, if it is there, is expected to be sure to the rate of errors of names."""
        tables = (self.after("likely"), self.after("likely_flown"))
        return all(max(sets.values()) <= RARE * own for table in tables for own, sets in table.values())

    def first_leg(self) -> tuple[Array, dict[str, Array]]:
        """Give time and motion along the first move, by derivative, signed; the whole path where there are no moves."""
        away = {name: self._derivative(name) for name in DERIVATIVES}
        if self.legs:
            first, last = np.searchsorted(self.time, [self.legs[0].begin_s, self.legs[0].end_s])
            # Divided by the largest component first: the square of a tiny one is zero.
            along = self.legs[0].displacement_m / np.abs(self.legs[0].displacement_m).max()
            move, direction = slice(int(first), int(last) + 1), along / np.linalg.norm(along)
        else:
            farthest = away["displacement"][np.argmax(np.linalg.norm(away["displacement"], axis=1))]
            move, direction = slice(None), farthest / (np.linalg.norm(farthest) or 1.0)
        return self.time[move], {name: values[move] @ direction for name, values in away.items()}

    def _derivative(self, name: str) -> Array:
        values: Array | None = self.position if name == "displacement" else getattr(self, name)
        assert values is not None, "a held vehicle has no displacement"
        return values - values[0] if name == "displacement" else values


def _largest(values: Array) -> list[float]:
    return [float(value) for value in np.abs(values).max(axis=0)]


_UNITS = ("m/s⁶", "m/s⁵", "m/s⁴", "m/s³", "m/s²", "m/s", "m")


def _peaks(signals: Mapping[str, Array], bounds: Mapping[str, float], settings: TrajectorySettings) -> tuple[Peak, ...]:
    along = {**signals, "displacement": signals["position"] - signals["position"][0]}
    stated = vars(settings.limits)
    straight = settings.coordination == "straight-line" and settings.displacement_measure == "along-path"
    limits = {key.split("_")[0]: value for key, value in stated.items() if straight and isinstance(value, float)}
    return tuple(
        Peak(
            name=name,
            unit=unit,
            largest=float(np.linalg.norm(along[name], axis=1).max()),
            planned=float(bounds.get(name, np.nan)),
            limit=limits.get(name, np.nan),
        )
        for name, unit in zip(DERIVATIVES, _UNITS, strict=True)
    )
