"""What records that are no results yet keep of flights."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.spec import dataset, record

BEGINS = "stamp of the log's own clock at time 0 of the flight; not finite where there is none"


def known_begins(begins: Iterable[float]) -> Array | None:
    """Arrange where flights begin on the clocks of their logs, s; None where none has a log."""
    stamps = np.fromiter(begins, float)
    return stamps if np.isfinite(stamps).any() else None


@record
class ClockGroup:
    """The log's own clock."""

    begins: float = dataset("stamp of the log at time 0", units="s")

    @classmethod
    def of(cls, begins: float) -> Self | None:
        """Keep the stamp, s; None where there is none."""
        return cls(begins=begins) if np.isfinite(begins) else None


@record
class StatedGroup:
    """What the log says of its vehicle, by which flights of two vehicles are told apart."""

    name: tuple[str, ...] = dataset("parameter of the frame and the rotors, or `written by`", "stated")
    value: tuple[str, ...] = dataset("as the log has it", "stated")

    @classmethod
    def of(cls, facts: Mapping[str, str]) -> Self | None:
        """Keep facts; None where there are none."""
        return cls(name=tuple(facts), value=tuple(facts.values())) if facts else None

    @property
    def facts(self) -> dict[str, str]:
        """Values by name."""
        return dict(zip(self.name, self.value, strict=True))
