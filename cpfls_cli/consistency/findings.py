"""What a check finds: what is wrong with a log, how much, what mends it, whether it rules out a verdict, repairs."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import ceil, inf, log10
from typing import Annotated, Any, NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.signals import Signals
from cpfls_cli.lag import delayed
from cpfls_cli.result import About, about, part
from cpfls_cli.rotations import euler_angles, rotation_matrix
from cpfls_cli.words import capitalised

_CONSTANTS = {"vehicle", "vehicle.rotor_speed_max_rad_s"}


@dataclass(frozen=True)
class Finding:
    """Something that is wrong with a log, or with what the config says of its vehicle."""

    what: str  # Who says so and what is wrong, with its numbers; begins small, to follow the name of a flight.
    remedy: str  # What would mend it: keys of the config, or a part of the log.
    channels: tuple[str, ...]  # What was held against each other.
    # Of the evidence: a correlation, a ratio, a share, s, rad or rad/s; NaN where there is no one number.
    size: float = float("nan")
    unit: str = ""  # Of the size; empty for a ratio.
    # Whether it rules out a verdict: a unit, an axis or a sign is wrong. What is delayed, noisy or a little off is
    # fitted, repaired or reported, and spoils no verdict.
    contradiction: bool = True
    repairable: bool = False  # Whether `cpfls gap` sets it right before it looks at the model.

    @property
    def of_constants(self) -> bool:
        """Whether speeds of rotors only do not suit numbers of the vehicle, which cancel between flights of it."""
        return self.channels[:1] == ("rotors",) and set(self.channels[1:]) <= _CONSTANTS

    @property
    def sentence(self) -> str:
        """What is wrong and what would mend it, to follow the name of a flight."""
        return f"{self.what}: {self.remedy}"

    def of(self, flight: str) -> Self:
        """Say of which flight it is."""
        return replace(self, what=f"{flight}: {self.what}")


class FaultNumber(NamedTuple):
    """One number of a fault."""

    name: Annotated[str, About("name of the number")]
    value: Annotated[float, About("estimate", unit="SI")]
    unit: Annotated[str, About("unit of the number")]
    low: Annotated[
        float,
        About(
            "lower end of the 95 % interval, widened by what noise of the gyroscope can have pulled",
            unit="SI",
            gaps=True,
        ),
    ]
    high: Annotated[float, About("upper end of it", unit="SI", gaps=True)]
    named: Annotated[bool, About("1 where it is significant and of practical size")]


@dataclass(frozen=True)
class AuditFinding:
    """A fault that was tested."""

    name: str = about("effect, see `cpfls effects`")
    coefficients: tuple[FaultNumber, ...] = part()
    p_value: float = about(
        "probability that chance takes the most significant coefficient past half of the size that matters, after Holm"
    )
    named: bool = about("1 where any coefficient is")
    sentence: str = about("what was found, in words")

    def named_values(self, names: Sequence[str]) -> Array:
        """Give the named values of coefficients, 0 for those that are not."""
        by_name = {each.name: each.value for each in self.coefficients if each.named}
        return np.array([by_name.get(name, 0.0) for name in names])


def contradictions(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Give the sentences of the findings that rule out a verdict."""
    return tuple(finding.sentence for finding in findings if finding.contradiction)


def as_contradiction(sentence: str) -> str:
    """Say what contradicts what: a log itself, or where keys of the vehicle are held against it, its config."""
    whom = "its config" if "vehicle." in sentence else "itself"
    return f"the log contradicts {whom}: {sentence}"


def doubts(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Give the sentences of the others."""
    return tuple(finding.sentence for finding in findings if not finding.contradiction)


def off_clock(delay_s: float, half_s: float = float("nan")) -> str:
    """Say how late or early something is, with its 95 % interval of so much to either side where that is known."""
    size = abs(delay_s)
    return f"{'late' if delay_s > 0 else 'early'} by {in_ms(size, size - half_s, size + half_s)}"


def in_ms(delay_s: float, low_s: float, high_s: float) -> str:
    """Write a delay with its interval where that is known, in whole ms or with the digits that the width needs."""
    half = 500 * (high_s - low_s)
    decimals = min(max(ceil(-log10(half) - 1e-9), 0), 3) if 0 < half < inf else 0
    value, *ends = (f"{1000 * each:z.{decimals}f}" for each in (delay_s, low_s, high_s))
    return f"{value} ms [{', '.join(ends)}]" if half < inf else f"{value} ms"


UP = np.array([0.0, 0.0, 1.0])
"""Unit vector upwards, world frame."""
_SAME = 1e-6
"""Share of an acceleration up to which it is the one made of the accelerometer: the import computes it as here."""

_LEAST_S = 1.0  # Of a part whose mean shows an offset.

_SCALED = 0.1
"""Logarithm of a change of volume from which a matrix changes the unit; axes that are turned leave it at 0."""


@dataclass(frozen=True)
class ChannelRepair:
    """How a channel becomes what it should be: ``matrix @ reading(t + delay) + gravity e_z - offset``, or nothing."""

    channel: str = about("that is corrected or left out; of rotor_speed the delay alone counts")
    dropped: bool = about("1 where it is left out, and nothing else counts", default=False)
    delay_s: float = about("delay of the channel", unit="s", default=0.0)
    in_body: bool = about("1 where world axes were logged in body axes", default=False)
    matrix: Array = field(
        default_factory=lambda: np.eye(3),
        metadata={
            "about": About(
                "unit and axes, after the turn to world axes; of the attitude, from axes of the body to those logged",
                ("axis", "axis"),
            )
        },
    )
    gravity_m_s2: float = about("added along the vertical", unit="m/s^2", default=0.0)
    offset: str = about(
        "axes along which, last, its mean over a flight becomes that of the derivative of position or velocity",
        default="",
    )
    offset_in_body: bool = about("1 where these are axes of the body", default=False)
    sentence: str = about(
        "what is wrong, what shows it, and what to correct; empty for a channel that goes with another", default=""
    )
    finding: Finding | None = None  # The same as the sentence, where nothing is done about it.

    def with_finding(self, finding: Finding, done: str) -> Self:
        """Say what is wrong, and what is done about it."""
        return replace(self, finding=finding, sentence=f"{capitalised(finding.what)}. {done}; {finding.remedy}.")

    @property
    def is_mistake(self) -> bool:
        """Whether it mends what only this channel can have wrong: its unit, gravity in it, body for world axes."""
        scaled = abs(np.log(abs(np.linalg.det(self.matrix)))) > _SCALED
        reversed_ = self.channel == "specific_force" and self.matrix[2, 2] < 0
        return self.in_body or bool(self.gravity_m_s2) or bool(scaled) or bool(reversed_)

    @property
    def needs_attitude(self) -> bool:
        """Whether it turns something between body and world."""
        return self.in_body or (self.channel == "specific_force" and bool(self.gravity_m_s2))

    def applied(self, signals: Signals) -> Signals:
        """Repair the channel of a flight; the length stays, and the end of what is shifted holds its last value."""
        reading = getattr(signals, self.channel)
        if reading is None:
            return signals
        changed: dict[str, Any] = {self.channel: None if self.dropped else self._truth(reading, signals)}
        repaired = replace(signals, **changed)
        if is_derived(signals):
            return replace(repaired, acceleration=accelerated(repaired))
        turned = self.channel == "attitude" and not self._is_square
        return replace(repaired, acceleration=_turned_along(signals, repaired)) if turned else repaired

    @property
    def _is_square(self) -> bool:
        return bool((self.matrix == np.eye(3)).all())

    def _truth(self, reading: Array, signals: Signals) -> Array:
        truth = shifted(reading, signals.time, self.delay_s)
        if self.channel == "rotor_speed":
            return truth
        if self.channel == "attitude":
            return truth if self._is_square else euler_angles(rotation_matrix(truth) @ self.matrix)
        if self.in_body:
            truth = np.einsum("tij,tj->ti", signals.rotation, truth)
        truth = truth @ self.matrix.T
        if self.gravity_m_s2:
            sensed = self.channel == "specific_force"
            truth = truth + self.gravity_m_s2 * (signals.rotation[:, 2] if sensed else UP)
        return np.asarray(truth - self._offset(truth, signals) if self.offset else truth)

    def _offset(self, values: Array, signals: Signals) -> Array:
        """Compute the mean error of a velocity or an acceleration along the axes of the offset, in those of values."""
        integral = signals.position if self.channel == "velocity" else signals.velocity
        # Of a shorter part the mean is that of noise.
        if integral is None or signals.attitude is None or len(signals) * signals.period < _LEAST_S:
            return np.zeros(3)
        derivative = np.gradient(integral, signals.period, axis=0)
        to_body = signals.rotation.swapaxes(1, 2)
        if self.channel == "specific_force":
            derivative, to_body = _turned(to_body, derivative + signals.vehicle.gravity_m_s2 * UP), np.eye(3)[None]
        apart = _turned(to_body, values - derivative) if self.offset_in_body else values - derivative
        # The mean of a derivative would be the noise of two samples at the ends.
        weight = np.hanning(len(apart))
        mean = [axis in self.offset for axis in "xyz"] * (weight @ apart) / weight.sum()
        return _turned(to_body.swapaxes(1, 2), mean) if self.offset_in_body else np.asarray(mean)


def _turned_along(before: Signals, after: Signals) -> Array | None:
    """Turn an acceleration with its attitude if it then comes nearer to the derivative of the velocity."""
    if before.acceleration is None or before.velocity is None:
        return before.acceleration
    up, rate = before.vehicle.gravity_m_s2 * UP, np.gradient(before.velocity, before.period, axis=0)
    felt = _turned(before.rotation.swapaxes(1, 2), before.acceleration + up)
    ways = before.acceleration, _turned(after.rotation, felt) - up
    off = [np.linalg.norm(_turned(after.rotation.swapaxes(1, 2), way - rate).mean(axis=0)) for way in ways]
    return ways[int(np.argmin(off))]


def _turned(rotation: Array, values: Array) -> Array:
    return np.asarray((rotation @ values[..., None])[..., 0])


def accelerated(signals: Signals) -> Array | None:
    """Turn what the accelerometer senses into acceleration, shape (time, 3), m/s^2, world frame."""
    if signals.specific_force is None or signals.attitude is None:
        return None
    turned = np.einsum("tij,tj->ti", signals.rotation, signals.specific_force)
    return np.asarray(turned - signals.vehicle.gravity_m_s2 * UP)


def is_derived(signals: Signals) -> bool:
    """Check whether the acceleration was made of what the accelerometer senses, and is no channel of its own."""
    made = accelerated(signals)
    if made is None or signals.acceleration is None:
        return False
    return bool((made - signals.acceleration).std(axis=0).max() < _SAME * max(1.0, float(np.abs(made).max())))


def shifted(reading: Array, time: Array, delay: float) -> Array:
    """Take a reading, shape (time, column), that is late by a delay in s, at the time it belongs to."""
    return reading if delay == 0 else delayed(reading, -delay / (time[1] - time[0]))
