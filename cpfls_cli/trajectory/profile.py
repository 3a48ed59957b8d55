"""The base move: rest to rest along a line, whose sixth derivative is a sequence of single sine waves."""

from __future__ import annotations

import math
from dataclasses import asdict, astuple, dataclass, fields

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.trajectory.closed_form import peaks_of, sample, spans_of


@dataclass(frozen=True, kw_only=True)
class Holds:
    """Time for which each derivative stays at its peak, s.

    A move holds snap 8 times, jerk 4 times, acceleration twice, velocity once.
    """

    snap: float = 0.0
    jerk: float = 0.0
    acceleration: float = 0.0
    velocity: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Peaks:
    """Largest absolute value of every derivative of a move, in m and s."""

    displacement: float
    velocity: float
    acceleration: float
    jerk: float
    snap: float
    crackle: float
    pop: float


_DERIVATIVES = tuple(field.name for field in fields(Peaks))


@dataclass(frozen=True, kw_only=True)
class BaseProfile:
    """A rest-to-rest move with pop ``+-A (2 pi / P) sin(2 pi t / P)`` in sixteen intervals, and holds between.

    The amplitude A is in m/s^5; the crackle is ``A (1 - cos(2 pi t / P))``. It is infinite where the period P, the
    length of one interval in s, is zero, so that the snap jumps. The displacement follows from the amplitude where it
    is not given; `covering` gives both. Section 7 of the paper; method.md section 3.
    """

    amplitude: float
    period: float
    holds: Holds = Holds()
    displacement: float = math.nan

    def __post_init__(self) -> None:
        """Compute the displacement where it is not given."""
        if math.isnan(self.displacement):
            object.__setattr__(self, "displacement", self.amplitude * _product(self.spans))

    @property
    def spans(self) -> Array:
        """Durations T1 to T5, shape (5,), s: snap, jerk, ..., displacement is the one before times its span."""
        return spans_of(self.period, np.array(astuple(self.holds)))

    @property
    def duration(self) -> float:
        """Duration of the move in s, ``16 P + 8 Ts + 4 Tj + 2 Ta + Tv``."""
        return float(self.spans.sum())

    @property
    def peaks(self) -> Peaks:
        """Largest absolute values in closed form; they nest, so a limit on each is one inequality."""
        values = peaks_of(self.displacement, self.spans).tolist()
        return Peaks(**dict(zip(_DERIVATIVES, values, strict=True)))

    @property
    def integral_of_absolute_jerk(self) -> float:
        """The paper's measure of energy, m/s^2: four times the peak of the acceleration, with or without holds."""
        return 4 * self.peaks.acceleration

    def sample(self, time: Array) -> Array:
        """Evaluate the move in closed form, every derivative to rounding error of its own peak.

        Parameters
        ----------
        time : array, shape (time,), s
            Any order, fastest when it ascends; at rest before 0 and from `duration` on.

        Returns
        -------
        array, shape (time, 7), m and s
            Displacement, velocity, acceleration, jerk, snap, crackle, pop. A derivative without bound is zero
            but at the instants at which the one below jumps.
        """
        return sample(self.displacement, self.spans, time)

    def stretched(self, duration: float) -> BaseProfile:
        """Cover the same displacement in another time, with the same shape.

        Derivative n is smaller by the ratio of the durations to the power of n.
        """
        factor = duration / self.duration
        holds = Holds(**{name: factor * hold for name, hold in asdict(self.holds).items()})
        return covering(self.displacement, factor * self.period, holds)


def covering(displacement: float, period: float, holds: Holds) -> BaseProfile:
    """Choose the amplitude that covers a displacement exactly; infinite where the period is too short for any number.

    A negative displacement moves backwards; the period may be zero, if a hold is not.
    """
    reached = _product(spans_of(period, np.array(astuple(holds))))
    unbounded = math.copysign(math.inf, displacement) if displacement else 0.0
    amplitude = displacement / reached if reached else unbounded
    return BaseProfile(amplitude=amplitude, period=period, holds=holds, displacement=displacement)


def _product(spans: Array) -> float:
    # A product that overflows is infinite, and refused by the caller.
    with np.errstate(over="ignore", under="ignore"):
        return float(np.prod(spans))
