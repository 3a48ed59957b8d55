"""What a check finds: what is wrong with a log, how much, what mends it, and whether it rules out a verdict."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import ceil, inf, log10
from typing import Annotated, NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.result import About, about, part

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
