"""Gusts in flights, as an artifact of a vehicle holds them: sizes and memories by body axis, with intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.artifacts.spec import dataset, group, group_of, record
from cpfls_cli.playback.gusts import GUST_AXES, GustAxis, Gusts, gust_axes

if TYPE_CHECKING:
    from cpfls_cli.playback.disturbance import FoundGusts


@record
class LackGroup:
    """What comes again and a model lacks: a process as large as shares of what the model's parts give at an instant."""

    part: tuple[str, ...] = dataset("parts of the model", "formula")
    share: Array = dataset("share of each part that its size has", "gust", "formula", gaps=True)
    rest: Array = dataset("size where no part gives anything, N m or N", "gust", units="SI", gaps=True)
    memory: Array = dataset("time in which it falls to 37 %", "gust", units="s", gaps=True)


@record
class DisturbanceGroup:
    """Gusts in the flights that a model was found in or held against, torque about body axes and force along them."""

    told_by: str = dataset("what told gusts from what a model lacks: repeats, setpoints, past (what was before), none")
    name: tuple[str, ...] = dataset("roll, pitch, yaw, x, y, z", "gust")
    size: Array = dataset("standard deviation, N m or N", "gust", units="SI", gaps=True)
    low: Array = dataset("lower end of the 95 % interval; 0 where it is not known", "gust", units="SI", gaps=True)
    high: Array = dataset("upper end; no gusts above it where no size is known", "gust", units="SI", gaps=True)
    memory: Array = dataset("time in which a gust falls to 37 %", "gust", units="s", gaps=True)
    memory_low: Array = dataset("lower end of the 95 % interval", "gust", units="s", gaps=True)
    memory_high: Array = dataset("upper end of the 95 % interval", "gust", units="s", gaps=True)
    foretold: Array | None = dataset(
        "share of what is left that repeats or setpoints foretell; by the past, of what is new in it",
        "gust",
        gaps=True,
        default=None,
    )
    alone: BoolArray | None = dataset("whether all that is left of a gap is gusts and noise", "gust", default=None)
    white: Array | None = dataset(
        "white noise beside it, as of a step of 1 s, N m s^0.5 or N s^0.5", "gust", units="SI", gaps=True, default=None
    )
    lack: LackGroup | None = group(default=None)

    @classmethod
    def of(cls, found: FoundGusts, alone: BoolArray | None = None) -> Self:
        """Arrange what was found, and of a gap where it is all that is left."""
        lack = None if found.lack is None else group_of(LackGroup, found.lack)
        return group_of(cls, found, name=GUST_AXES[: len(found.size)], alone=alone, lack=lack)

    @property
    def gusts(self) -> Gusts:
        """The gusts that are known; none on other axes."""
        return Gusts.known(self.size, self.memory, self.white)

    def axes(self, inertia: Array, mass: float) -> tuple[GustAxis, ...]:
        """Give each axis as the acceleration of a body of these inertia parameters, kg m^2, and this mass, kg."""
        return gust_axes(self, inertia, mass)

    def summary(self, inertia: Array, mass: float) -> dict[str, Any]:
        """Tell the gusts to machines; arguments are those of `axes`."""
        columns = ("size", "low", "high", "memory", "memory_low", "memory_high")
        return {
            "told_by": self.told_by,
            "axes": {
                axis.name: {
                    "unit": "N m" if axis.turns else "N",
                    "alone": None if self.alone is None else bool(self.alone[number]),
                    "foretold": None if self.foretold is None else float(self.foretold[number]),
                    **{
                        name if place < 3 else f"{name}_s": float(getattr(self, name)[number])
                        for place, name in enumerate(columns)
                    },
                    "acceleration": {
                        "unit": "rad/s^2" if axis.turns else "m/s^2",
                        **{name: getattr(axis, name) for name in columns[:3]},
                    },
                }
                for number, axis in enumerate(self.axes(inertia, mass))
            },
        }
