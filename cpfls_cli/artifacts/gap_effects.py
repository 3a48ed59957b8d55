"""What a diagnosis says of a gap, as groups of datasets: effects with their numbers, the gap before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.artifacts.playback import PlaybackGroup
from cpfls_cli.artifacts.spec import BODY, columns_of, dataset, group, paired, record, rows_of
from cpfls_cli.effects.registry import CATALOGUE, VEHICLE_NUMBERS, effect
from cpfls_cli.gap.balance.weak_flight import CHANNELS, Candidate
from cpfls_cli.gap.naming.results import Estimate, NamedEffect
from cpfls_cli.gap.settings import CLEAR, OFF
from cpfls_cli.playback.errors import AFTER, BEFORE, FADING, MODEL, NOTHING_MOVES, STATED

if TYPE_CHECKING:
    from cpfls_cli.gap.naming.results import GapSize
    from cpfls_cli.playback.replay import Played, Replay

_GROWN = 1.05
"""Ratio of the gaps after and before from which on a channel is marked; two digits show no less."""

_EVALUATED = ("wrench", "actuator")
"""Kinds of effects that are part of a model; faults of sensors are repaired, numbers of the vehicle refitted."""


def above_noise(floors: Array) -> BoolArray:
    """Tell which gaps, in noise floors, shape (channel,), are above noise; NaN, where unknown, is not."""
    return np.asarray(floors > CLEAR)


def worse_axes(before: Array, after: Array) -> list[int]:
    """List the axes about which a clear gap grows by more than formulas are off by; both, shape (6,), are in floors."""
    return [int(c) for c in np.flatnonzero((before[:3] > CLEAR) & (after[:3] > (1 + OFF) * before[:3]))]


def gap_summary(value: Array, floors: Array) -> dict[str, Any]:
    """Describe the gap of each channel, shape (6,), for machines: lists over x, y, z; not finite where unknown."""
    return {
        "torque_n_m": [float(v) for v in value[:3]],
        "floors": [float(v) for v in floors[:3]],
        "force_n": [float(v) for v in value[3:]],
        "force_floors": [float(v) for v in floors[3:]],
    }


def effect_summary(effect: NamedEffect) -> dict[str, Any]:
    """Describe an effect for machines."""
    return {
        "name": effect.name,
        "coefficients": {number.name: estimate_summary(number) for number in effect.coefficients},
        "p_value": effect.p_value,
        "share": effect.share,
        "selection_frequency": effect.selection_frequency,
        "sentence": effect.sentence,
    }


def estimate_summary(number: Estimate) -> dict[str, Any]:
    """Describe a coefficient for machines."""
    return {
        "value": number.value,
        "unit": number.unit,
        "low": number.low,
        "high": number.high,
        "plausible": list(number.plausible),
    }


@record
class EffectGroup:
    """Effects, largest share first."""

    name: tuple[str, ...] = dataset(
        "identifier, see `cpfls effects`; largest share first, faults of sensors before", "effect"
    )
    kind: tuple[str, ...] = dataset("wrench, actuator, sensor or parameter", "effect")
    named: Array = dataset("1 if the verdict names it, 0 if it is only the closest", "effect")
    p_value: Array = dataset("probability that chance explains as much, over the whole catalogue", "effect")
    share: Array = dataset("part of the gap above the floor that comes back without it", "effect")
    selection_frequency: Array = dataset("share of the blocks without which it is still the first choice", "effect")
    sentence: tuple[str, ...] = dataset("what it means, in plain words", "effect")

    @classmethod
    def of(cls, effects: Sequence[NamedEffect], named: bool) -> Self:
        """Arrange effects that a verdict names, or that are only the closest."""
        kinds = tuple(CATALOGUE[effect.name].kind for effect in effects)
        return columns_of(cls, effects, kind=kinds, named=np.full(len(effects), float(named)))


@record
class CoefficientGroup:
    """Coefficients and shapes of the effects with their intervals."""

    effect: tuple[str, ...] = dataset("effect that each coefficient belongs to", "coefficient")
    name: tuple[str, ...] = dataset("name of the coefficient or shape", "coefficient")
    unit: tuple[str, ...] = dataset("unit of the coefficient", "coefficient")
    value: Array = dataset("estimate", "coefficient", units="SI")
    low: Array = dataset("lower end of the 95 % interval", "coefficient", units="SI", gaps=True)
    high: Array = dataset("upper end of the 95 % interval", "coefficient", units="SI", gaps=True)
    plausible_low: Array = dataset("least value that is physically possible", "coefficient", units="SI", gaps=True)
    plausible_high: Array = dataset("largest value that is physically possible", "coefficient", units="SI", gaps=True)

    @classmethod
    def of(cls, effects: Sequence[NamedEffect]) -> Self:
        """Arrange the numbers of effects."""
        numbers = [number for effect in effects for number in effect.coefficients]
        return columns_of(
            cls,
            numbers,
            effect=tuple(effect.name for effect in effects for _ in effect.coefficients),
            plausible_low=np.fromiter((number.plausible[0] for number in numbers), float),
            plausible_high=np.fromiter((number.plausible[1] for number in numbers), float),
        )

    def of_effect(self, effect: str) -> tuple[Estimate, ...]:
        """Rebuild the numbers of one effect."""
        rows = [row for row in rows_of(self) if row.pop("effect") == effect]
        ranges = [(row.pop("plausible_low"), row.pop("plausible_high")) for row in rows]
        return tuple(Estimate(**row, plausible=plausible) for row, plausible in zip(rows, ranges, strict=True))


@record
class LinearGroup:
    """Linear coefficients of the columns of each effect."""

    effect: tuple[str, ...] = dataset(
        "effect that each linear coefficient belongs to, in the order of its columns", "linear"
    )
    value: Array = dataset("linear coefficients of the columns of each effect", "linear", units="SI")

    @classmethod
    def of(cls, effects: Sequence[NamedEffect]) -> Self:
        """Arrange the linear coefficients of effects."""
        return cls(
            effect=tuple(effect.name for effect in effects for _ in effect.linear),
            value=np.fromiter((value for effect in effects for value in effect.linear), float),
        )

    def of_effect(self, effect: str) -> Array:
        """Give those of one effect, shape (coefficient,)."""
        chosen = np.array([name == effect for name in self.effect], dtype=bool)
        return np.asarray(self.value[chosen])


@record
class ShapeGroup:
    """Nonlinear shapes of the effects."""

    effect: tuple[str, ...] = dataset("effect that each shape belongs to", "shape")
    name: tuple[str, ...] = dataset("what the effect depends on nonlinearly", "shape")
    value: Array = dataset("value of the shape", "shape", units="SI")

    @classmethod
    def of(cls, effects: Sequence[NamedEffect]) -> Self:
        """Arrange the shapes of effects that are part of the model."""
        shapes = [
            (effect.name, name, value)
            for effect in effects
            if effect.candidate is not None
            for name, value in effect.candidate.shape.items()
        ]
        return cls(
            effect=tuple(effect for effect, _, _ in shapes),
            name=tuple(name for _, name, _ in shapes),
            value=np.fromiter((value for _, _, value in shapes), float),
        )

    def of_effect(self, effect: str) -> dict[str, float]:
        """Give those of one effect, by name."""
        return {row["name"]: row["value"] for row in rows_of(self) if row["effect"] == effect}


@record
class ParameterGroup:
    """Numbers of the vehicle, refitted with the effects."""

    name: tuple[str, ...] = dataset("numbers of the vehicle, refitted with the effects", "parameter")
    unit: tuple[str, ...] = dataset("1 for a relative error: true over that of the model, less 1", "parameter")
    value: Array = dataset("estimate", "parameter", units="SI")
    low: Array = dataset("lower end of the 95 % interval", "parameter", units="SI", gaps=True)
    high: Array = dataset("upper end of the 95 % interval", "parameter", units="SI", gaps=True)

    @classmethod
    def of(cls, known: Mapping[str, Estimate], linear: Array) -> Self:
        """Arrange the vehicle's own numbers, all in the order of the catalogue, and the intervals that are known."""
        coefficients = VEHICLE_NUMBERS.coefficients
        estimates = [known.get(coefficient.name) for coefficient in coefficients]
        return cls(
            name=tuple(coefficient.name for coefficient in coefficients),
            unit=tuple(coefficient.unit for coefficient in coefficients),
            value=np.array(linear, dtype=float),
            low=np.fromiter((np.nan if number is None else number.low for number in estimates), float),
            high=np.fromiter((np.nan if number is None else number.high for number in estimates), float),
        )

    @property
    def values(self) -> dict[str, float]:
        """Estimates by name."""
        return paired(self.name, self.value)

    @property
    def summary(self) -> dict[str, Any]:
        """The numbers for machines."""
        return {row.pop("name"): row for row in rows_of(self)}


@record
class NamedEffectsGroup:
    """Effects with all their numbers, enough to evaluate them."""

    effect: EffectGroup = group()
    coefficient: CoefficientGroup = group()
    linear: LinearGroup = group()
    shape: ShapeGroup = group()
    parameter: ParameterGroup = group()

    @classmethod
    def of(cls, effects: Sequence[NamedEffect], named: bool, known: Mapping[str, Estimate], linear: Array) -> Self:
        """Arrange effects, whether or not the verdict names them, and the vehicle's own numbers."""
        return cls(
            effect=EffectGroup.of(effects, named),
            coefficient=CoefficientGroup.of(effects),
            linear=LinearGroup.of(effects),
            shape=ShapeGroup.of(effects),
            parameter=ParameterGroup.of(known, linear),
        )

    def effects(self) -> tuple[NamedEffect, ...]:
        """Rebuild the effects, to evaluate them."""
        for name in self.effect.name:
            effect(name)
        return self.listed

    @property
    def listed(self) -> tuple[NamedEffect, ...]:
        """Effects, named or closest; what this program does not know cannot be evaluated."""
        return tuple(self._effect(index) for index in range(len(self.effect.name)))

    @property
    def named(self) -> tuple[NamedEffect, ...]:
        """Effects that the verdict names."""
        return self._chosen(named=True)

    @property
    def closest(self) -> tuple[NamedEffect, ...]:
        """Effects that come closest, where the verdict names none."""
        return self._chosen(named=False)

    def names(self, *kinds: str) -> tuple[str, ...]:
        """List the effects of these kinds that the verdict names; of all kinds if none is given."""
        columns = zip(self.effect.name, self.effect.kind, self.effect.named, strict=True)
        return tuple(name for name, kind, named in columns if named and (not kinds or kind in kinds))

    def _chosen(self, *, named: bool) -> tuple[NamedEffect, ...]:
        pairs = zip(self.listed, self.effect.named, strict=True)
        return tuple(effect for effect, flag in pairs if bool(flag) is named)

    def _effect(self, index: int) -> NamedEffect:
        rows, name = self.effect, self.effect.name[index]
        entry, shape = CATALOGUE.get(name), self.shape.of_effect(name)
        linear = self.linear.of_effect(name)
        entry = None if entry is None else entry.form(len(linear), shape)
        known = entry is not None and entry.kind in _EVALUATED and len(shape) == len(entry.shapes)
        return NamedEffect(
            name,
            Candidate(entry, shape) if entry and known else None,
            linear,
            self.coefficient.of_effect(name),
            float(rows.p_value[index]),
            float(rows.share[index]),
            float(rows.selection_frequency[index]),
            rows.sentence[index],
        )


@record
class GapChangeGroup:
    """Gap of each channel on held-out flights, before and after."""

    channel: tuple[str, ...] = dataset(
        "names of the channels: torque about (x y z, N m) and force along (x y z, N) the body axes", "channel"
    )
    before: Array = dataset(
        "root mean square on the held-out flights, model as given", "channel", units="SI", frame=BODY, gaps=True
    )
    after: Array = dataset("the same with the effects", "channel", units="SI", frame=BODY, gaps=True)
    floor: Array = dataset("noise floor of the held-out flights", "channel", units="SI", frame=BODY, gaps=True)
    before_floors: Array = dataset("gap of the model as given, in floors", "channel", frame=BODY, gaps=True)
    after_floors: Array = dataset("gap with the effects, in floors", "channel", frame=BODY, gaps=True)

    @classmethod
    def of(cls, before: GapSize, after: GapSize, floor: Array) -> Self:
        """Arrange the gap before and after; the floor has shape (6,), N m and N."""
        return cls(
            channel=CHANNELS,
            before=before.value,
            after=after.value,
            floor=np.where(np.isfinite(before.value), floor, np.nan),
            before_floors=before.floors,
            after_floors=after.floors,
        )

    @property
    def known(self) -> list[int]:
        """Indices of the channels whose gap is known."""
        return np.flatnonzero(np.isfinite(self.before_floors)).tolist()

    @property
    def has_force(self) -> bool:
        """Whether the gap of any force is known."""
        return any(self.channel[index].startswith("force") for index in self.known)

    @property
    def loud(self) -> tuple[list[int], list[int]]:
        """Indices of the channels that are above noise before or after, or the largest; and of all other known ones."""
        above = above_noise(self.before_floors) | above_noise(self.after_floors)
        loud = [index for index in self.known if above[index]]
        if not loud and self.known:
            loud = [int(np.nanargmax(self.before_floors))]
        return loud, [index for index in self.known if index not in loud]

    @property
    def grown(self) -> BoolArray:
        """Channels whose gap is above noise and larger with the effects than without, shape (channel,)."""
        return above_noise(self.after_floors) & (self.after_floors > _GROWN * self.before_floors)

    @property
    def worse_axes(self) -> list[int]:
        """Indices of the axes about which a clear gap clearly grows."""
        return worse_axes(self.before_floors, self.after_floors)

    @property
    def summary_before(self) -> dict[str, Any]:
        """The gap of the model as given, for machines."""
        return gap_summary(self.before, self.before_floors)

    @property
    def summary_after(self) -> dict[str, Any]:
        """The gap with the effects, for machines."""
        return gap_summary(self.after, self.after_floors)


@record
class StretchGroup:
    """Stretches of time with the largest gap, largest first."""

    flight: Array = dataset("index of the flight; stretches of time with the largest gap, first", "stretch")
    start_s: Array = dataset("on the clock of the flight", "stretch", path="start", units="s")
    end_s: Array = dataset("on the clock of the flight", "stretch", path="end", units="s")
    channel: tuple[str, ...] = dataset("channel of the gap", "stretch")
    rms_floors: Array = dataset("root mean square of the gap there, in floors", "stretch", path="floors")

    def first(self, most: int) -> list[tuple[int, float, float, str, float]]:
        """List the largest: flight, start and end in s, channel, floors."""
        rows = (row.values() for row in rows_of(self)[:most])
        return [(int(flight), start, end, channel, floors) for flight, start, end, channel, floors in rows]


class EndError(NamedTuple):
    """How far off a signal is at the longest horizon.

    Attributes
    ----------
    before, after : float
        Mean errors of the model as given and with the effects.
    rival : str
        What knows no model and is best over all horizons: `nothing-moves`, `rate-stays` or `rate-fades`.
    without_model : float
        Its mean error.
    """

    before: float
    after: float
    rival: str
    without_model: float

    @property
    def worse(self) -> bool:
        """Whether the model with the effects is no better than none."""
        return self.after >= self.without_model


@record
class PlaybackChangeGroup(PlaybackGroup):
    """Held-out flights played back before and after."""

    fading_s: float | None = dataset(FADING, units="s", default=None)

    @classmethod
    def of_pairs(cls, flights: Sequence[Played], replay: Replay) -> Self:
        """Arrange a replay of a model with effects and the model as given, without its windows."""
        names = {MODEL: AFTER, STATED: BEFORE}
        every = {name: names.get(name, name) for name in replay.models}
        return cls.of(flights, replay, every, fading_s=flights[0].fading_s)

    @property
    def at_end(self) -> dict[str, EndError]:
        """Errors at the longest horizon by signal, of those that move."""
        own, ends = self.by_horizon, {}
        for signal in own.signals:
            if own.of(NOTHING_MOVES, signal).sum > 0:
                rival = own.rival(signal)
                before, after, other = (float(own.of(name, signal).mae[-1]) for name in (BEFORE, own.judged, rival))
                ends[signal] = EndError(before, after, rival, other)
        return ends

    @property
    def summary(self) -> dict[str, Any]:
        """The playback for machines."""
        ends = {name: {**end._asdict(), "worse": end.worse} for name, end in self.at_end.items()}
        return {"at_end": ends, "fading_s": self.fading_s, **super().summary}
