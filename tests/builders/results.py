"""A result with everything that a result may hold."""

from collections import ChainMap
from typing import ClassVar, Literal

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.result import AXES, Estimate, about, described_fields, maps, part, result
from cpfls_cli.vehicle.settings import VehicleSettings


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


def drawn(kind, rng, lengths=None):
    """Draw a result of any class that its description allows; of vehicles the usual one."""
    if kind is VehicleModel:
        return VehicleModel(vehicle=VehicleSettings())
    lengths, given = {} if lengths is None else lengths, {}
    # Axes have their lengths in parts too.
    for own in sorted(described_fields(kind), key=lambda each: each.about is None):
        if own.about and own.about.axes[:1] == (getattr(kind, "STREAMED", None),):
            lengths.setdefault(own.about.axes[0], 3)
        given[own.name] = None if own.optional and rng.random() < 0.3 else _field(own, rng, lengths)
    return kind(**given)


def _field(own, rng, lengths):
    few = range(rng.integers(0, 4))
    if own.rows:
        by_name = {f"{number}": _value(own, rng) for number in few}
        return by_name if maps(own.kind) else tuple(rng.normal(size=rng.integers(0, 4)) for _ in few)
    if own.table:
        inner = ChainMap({}, lengths)
        return tuple(drawn(own.inner, rng, inner) for _ in few)
    if own.named:
        return {f"part {number}": drawn(own.inner, rng, dict(lengths)) for number in few}
    if not own.about:
        return drawn(own.inner, rng, dict(lengths))
    axes = own.about.axes
    shape = [
        int(axis) if axis.isdigit() else AXES.get(axis) or lengths.setdefault(axis, int(rng.integers(2, 5)))
        for axis in axes
    ]
    if own.about.ragged:
        shape[0] = int(rng.integers(0, 4))
    values = np.array(
        [_value(own, rng) for _ in range(int(np.prod(shape)))], object if own.scalar is str else own.scalar
    )
    values = np.cumsum(np.abs(values) + 0.1) if own.about.ascends else values.reshape(shape)
    return tuple(values.tolist()) if own.many else values if axes else own.scalar(values.item())


def _value(own, rng):
    least = max(0.0, own.about.least) if own.about else 0.0
    if own.scalar is str:
        # HDF5 pads text of fixed length with zero bytes, so text cannot end in one; files hold no control characters.
        return "".join(rng.choice([*"ab.-_ |*<&", "\u00b5", "\u2192", "\U0001f681"], rng.integers(0, 6)))
    if own.scalar is float and own.about and own.about.gaps and rng.random() < 0.3:
        return np.nan
    drawn_of = {
        bool: lambda: rng.integers(2),
        int: lambda: least + rng.integers(5),
        float: lambda: least + rng.exponential(),
    }
    return own.scalar(drawn_of.get(own.scalar, lambda: complex(*rng.normal(size=2)))())
