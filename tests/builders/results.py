"""A result with everything that a result may hold."""

from typing import ClassVar, Literal

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.result import Estimate, about, part, result


@result
class Peak:
    """A peak of a spectrum."""

    frequency: float = about("of the peak", unit="Hz", least=0.0)
    kinds: tuple[str, ...] = about("what it may be", "kind")


@result
class Rotor:
    """A rotor: a row of a table, with a table of its own."""

    name: str = about("of the rotor")
    share: Estimate = part()
    lag: Estimate | None = part(default=None)
    worn: bool | None = about("whether it is worn", default=None)
    place: Array = about("forward and right", "2", unit="m")
    peaks: tuple[Peak, ...] = part()


@result
class Curve:
    """A curve."""

    frequency: Array = about("of each value", "frequency", unit="Hz")
    gain: Array = about("by axis", "frequency", "axis", gaps=True, brief=False)


@result
class Craft:
    """Everything that a result may hold."""

    FORMAT: ClassVar = "cpfls/craft"
    SHOWN: ClassVar = ("heavy",)

    name: str = about("of the craft")
    kind: Literal["plus", "cross"] = about("of its frame", default="cross")
    mass: float = about("as it flew", unit="kg", least=0.0)
    flights: int = about("number of flights", least=1)
    steady: bool = about("whether it hovers")
    notes: tuple[str, ...] = about("on it", "note")
    order: IntArray = about("of the rotors", "rotor")
    marked: BoolArray = about("rotors", "rotor")
    battery: str | None = about("its battery", default=None)
    hover: Estimate | None = part(default=None)
    rotors: tuple[Rotor, ...] = part()
    curves: dict[str, Curve] = part()

    @property
    def heavy(self) -> bool:
        """Whether it is heavy."""
        return self.mass > 2.0


def estimate(value, half=1.0):
    """A number with its interval."""
    return Estimate(value=value, low=value - half, high=value + half)


def craft(**changed):
    """A craft, with other values for some of its fields."""
    rotors = (
        Rotor(name="M1", share=estimate(0.2), place=np.array([1.0, -1.0]), peaks=(), worn=True),
        Rotor(
            name="M2 ±|*x*",
            share=estimate(0.3),
            lag=estimate(0.02),
            place=np.array([1.0, 1.0]),
            peaks=(Peak(frequency=90.0, kinds=("motor", "propeller")), Peak(frequency=180.0, kinds=())),
        ),
    )
    curves = {
        axis: Curve(frequency=np.arange(n) + 1.0, gain=np.full((n, 3), np.nan))
        for axis, n in {"yaw": 2, "roll": 4}.items()
    }
    given = {
        "name": "quad",
        "mass": 1.5,
        "flights": 2,
        "steady": True,
        "notes": ("a", "grün"),
        "order": np.array([1, 0]),
        "marked": np.array([True, False]),
        "hover": estimate(np.nan),
        "rotors": rotors,
        "curves": curves,
    }
    return Craft(**{**given, **changed})
