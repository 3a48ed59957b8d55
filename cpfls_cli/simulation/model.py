"""What is simulated: effects with values, checked against their bounds, how a model divides, and flights of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Coefficient, Effect, Shape
from cpfls_cli.effects.registry import CATALOGUE, VEHICLE_NUMBERS
from cpfls_cli.effects.registry import effect as find
from cpfls_cli.errors import SettingError
from cpfls_cli.flightlog.results import Flight
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.result import about, part, result
from cpfls_cli.vehicle.rotors import Infeasible
from cpfls_cli.vehicle.settings import VehicleSettings

if TYPE_CHECKING:
    from cpfls_cli.playback.gusts import Gusts
    from cpfls_cli.playback.model import VehicleModel


@dataclass(frozen=True)
class SimulatedEffect:
    """An effect with a value for each of its coefficients, then shapes, in the units of the catalogue."""

    effect: Effect
    values: Mapping[str, float]


@dataclass(frozen=True)
class SimulatedEffects:
    """All effects of a flight."""

    listed: tuple[SimulatedEffect, ...] = ()

    @property
    def ordered(self) -> list[SimulatedEffect]:
        """In the order of the catalogue, which is that of the actuator chain."""
        return sorted(self.listed, key=lambda one: (one.effect.order, one.effect.name))

    def values(self, name: str) -> Mapping[str, float] | None:
        """Give the values of an effect, None where it is not flown."""
        return next((one.values for one in self.listed if one.effect.name == name), None)

    @property
    def hides_rotor_speed(self) -> bool:
        """Whether the flight logs commands in place of rotor speeds."""
        return any(one.effect.of_commands for one in self.listed)


@result
class Noise:
    """Noise that was added to a signal."""

    std: Array = about("standard deviation of each channel", "channel", unit="SI")


@result
class Tracking:
    """How far an autopilot was off its path."""

    position_rms_m: float = about("root mean square of the distance", unit="m")
    position_max_m: float = about("largest distance", unit="m")
    attitude_rms_rad: Array = about("root mean square of roll, pitch, yaw", "axis", unit="rad")

    @classmethod
    def of(cls, position_error: Array, attitude_error: Array) -> Self:
        """Take how far a simulated flight is from its plan, shapes (time, 3), m and rad."""
        away = np.linalg.norm(position_error, axis=1)
        return cls(
            position_rms_m=float(np.sqrt(np.mean(away**2))),
            position_max_m=float(away.max()),
            attitude_rms_rad=np.sqrt(np.mean(attitude_error**2, axis=0)),
        )


@result
class Simulated(Flight):
    """A simulated flight, and what is known of its truth."""

    SHOWN: ClassVar = ("samples", "max_torque", "setpoints", "noise")

    noise_std: Mapping[str, Noise] = part()
    infeasible: tuple[Infeasible, ...] = part()
    effects: Mapping[str, float] = about("true values of what was flown beyond the model, by `effect.coefficient`")
    tracking: Tracking | None = part(default=None)

    @classmethod
    def of(
        cls,
        time: Array,
        signals: Mapping[str, Array],
        noise_std: Mapping[str, Array],
        infeasible: tuple[Infeasible, ...],
        **known: Any,
    ) -> Self:
        """Describe signals, the noise that was added to each channel, and what no rotor can do."""
        given: dict[str, Any] = {"effects": {}, **signals, **known}
        return cls(
            time=time,
            noise_std={name: Noise(std=np.atleast_1d(std)) for name, std in noise_std.items()},
            infeasible=infeasible,
            **given,
        )

    @property
    def samples(self) -> int:
        """Samples of the flight."""
        return len(self.time)

    @property
    def noise(self) -> list[str]:
        """Signals with added noise."""
        return sorted(self.noise_std)


def values_of(effects: SimulatedEffects) -> dict[str, float]:
    """Give the values of effects by ``effect.coefficient``; an effect without numbers is 1."""
    return {
        name: value
        for flown in effects.listed
        for name, value in (
            {f"{flown.effect.name}.{entry}": value for entry, value in flown.values.items()} or {flown.effect.name: 1.0}
        ).items()
    }


def simulated_effects(
    asked: Mapping[str, Sequence[float] | Mapping[str, float]], vehicle: VehicleSettings
) -> SimulatedEffects:
    """Look up effects in the catalogue and check their values.

    Parameters
    ----------
    asked : mapping
        By name of the effect: values in the order of the catalogue, coefficients before shapes, or by their names;
        coefficients without a value are 0, and shapes that may be left out follow these and wrong numbers of the
        vehicle.

    Raises
    ------
    InputError
        If there is no such effect.
    SettingError
        If values are missing, too many or physically impossible, or effects do not go together.
    """
    numbers = _by_name(VEHICLE_NUMBERS, asked.get(VEHICLE_NUMBERS.name, {}), {})
    chosen = SimulatedEffects(tuple(_checked(name, given, vehicle, numbers) for name, given in asked.items()))
    _refuse_conflict(chosen)
    return chosen


def in_the_loop(model: VehicleModel) -> tuple[VehicleModel, SimulatedEffects]:
    """Divide a model into what its table of weights gives and what is simulated by itself.

    Lag and delay of a model that was found from commands stand between command and rotors, as effects do, and the
    commands are logged; of another one they stand behind the speeds that are logged.
    """
    apart = [SimulatedEffect(one.known, one.values) for one in (*model.filters, *model.along)]
    kept = tuple(one for one in model.effects if one.name not in model.unsimulated)
    response = model.response
    if model.commanded:
        late = late_effects(response)
        apart += [SimulatedEffect(effect, {effect.shapes[0].name: value}) for effect, value in late]
        response = replace(response, delay_s=0.0, lag_s=0.0)
    # What repairs the log of its flights, and the wind in them, is no part of a vehicle.
    held = replace(model, effects=kept, response=response, wind=(0.0, 0.0, 0.0), repairs=None)
    return held, SimulatedEffects(tuple(apart))


def in_table(model: VehicleModel) -> SimulatedEffects:
    """List the effects that a model simulates with the state."""
    held = (one for one in model.effects if one.name not in model.unsimulated)
    return SimulatedEffects(tuple(SimulatedEffect(one.known, one.values) for one in held))


def with_effects(model: VehicleModel | None, asked: SimulatedEffects) -> tuple[VehicleModel | None, SimulatedEffects]:
    """Add effects to those of a model.

    Parameters
    ----------
    model : VehicleModel or None
        None for the vehicle that the autopilot knows.

    Returns
    -------
    VehicleModel or None
        What its table of weights gives.
    SimulatedEffects
        All that is simulated by itself.

    Raises
    ------
    SettingError
        If the model has one of them already, or two of them do not go together.
    """
    held, own = (None, SimulatedEffects()) if model is None else in_the_loop(model)
    taken = {one.effect.name: one.values for one in (*own.listed, *(in_table(held).listed if held else ()))}
    for one in asked.listed:
        # A number that is wrong may be wrong by more.
        if one.effect.name in taken and one.effect.kind != "parameter":
            has = ", ".join(f"{name} = {value:.4g}" for name, value in taken[one.effect.name].items())
            raise SettingError(_key(one.effect.name), f"the model has it already{': ' + has if has else ''}")
    effects = SimulatedEffects((*own.listed, *asked.listed))
    _refuse_conflict(effects)
    return held, effects


def played_gusts(model: VehicleModel | None, asked: bool) -> Gusts | None:
    """Give the gusts of a model where they are asked for; SettingError if it holds none."""
    if not asked:
        return None
    if model is None or model.gusts is None:
        raise SettingError(
            "closed_loop.gusts",
            "no gusts are known; give --model a vehicle of `cpfls vehicle` whose flights showed them, or leave it out",
        )
    return model.gusts


def late_effects(response: RotorResponse) -> list[tuple[Effect, float]]:
    """List the effects of the catalogue that are the lag and the delay of a response, with their only value."""
    hooks = [(effect, effect.actuation) for effect in CATALOGUE.values() if effect.actuation is not None]
    lags = [(effect, response.lag_s) for effect, actuation in hooks if actuation.lag is not None]
    delays = [(effect, response.delay_s) for effect, actuation in hooks if actuation.delay is not None]
    return [(effect, value) for effect, value in (*lags, *delays) if value > 0]


def _refuse_conflict(chosen: SimulatedEffects) -> None:
    needing = [one.effect for one in chosen.listed if "measured_rotor_speed" in one.effect.needs]
    if not (chosen.hides_rotor_speed and needing):
        return
    *others, last = (name for name, effect in CATALOGUE.items() if effect.of_commands)
    does = needing[0].log.does if needing[0].log is not None else "needs measured rotor speeds"
    raise SettingError(_key(needing[0].name), f"{does}, which a flight with {', '.join(others)} or {last} does not log")


def _checked(
    name: str, given: Sequence[float] | Mapping[str, float], vehicle: VehicleSettings, of_vehicle: Mapping[str, float]
) -> SimulatedEffect:
    effect = find(name)
    if "rotor_radius" in effect.needs and any(rotor.radius_m is None for rotor in vehicle.rotors):
        raise SettingError(_key(name), "needs vehicle.rotors.radius_m of every rotor")
    values, flown = _by_name(effect, given, of_vehicle), effect.exact or effect
    for number in flown.numbers:
        _refuse_outside(effect, number, values[number.name], number.bounds(vehicle))
    return SimulatedEffect(flown, values)


def _by_name(
    effect: Effect, given: Sequence[float] | Mapping[str, float], of_vehicle: Mapping[str, float]
) -> dict[str, float]:
    names = [number.name for number in effect.numbers]
    # What only a chosen effect has can be given by its name.
    every = [number.name for number in (effect.exact or effect).numbers]
    if not isinstance(given, Mapping):
        if not 0 <= len(names) - len(given) <= effect.optional:
            raise SettingError(_key(effect.name), f"takes {_wanted(effect)}; {len(given)} given")
        given = dict(zip(names, given, strict=False))
    unknown = [name for name in given if name not in every]
    needed = names[: len(names) - effect.optional]
    unset = [shape.name for shape in effect.shapes if shape.name in needed and shape.name not in given]
    if unknown or unset:
        problem = f"has no {', '.join(unknown)}" if unknown else f"needs {', '.join(unset)}"
        raise SettingError(_key(effect.name), f"{problem}; takes {_wanted(effect)}")
    values = {name: given.get(name, 0.0) for name in every}
    known = {**of_vehicle, **{each.name: values[each.name] for each in effect.coefficients}}
    follow = {each.name: each.follows for each in effect.shapes if each.name not in given}
    return values | {name: says(known) for name, says in follow.items() if says is not None}


def _wanted(effect: Effect) -> str:
    numbers = effect.numbers
    if not numbers:
        return "no values"
    names = {number.name for number in numbers}
    more = [number for number in (effect.exact or effect).numbers if number.name not in names]
    by_name = f"; by name also {_listed(more)}" if more else ""
    least = f"{len(numbers) - effect.optional} to " if effect.optional else ""
    return f"{least}{len(numbers)} value{'s' if len(numbers) > 1 else ''}: {_listed(numbers)}{by_name}"


def _listed(numbers: Sequence[Coefficient | Shape]) -> str:
    return ", ".join(f"{number.name} ({number.unit})" for number in numbers)


def _refuse_outside(effect: Effect, number: Coefficient | Shape, value: float, bounds: tuple[float, float]) -> None:
    low, high = bounds
    # A bound that is printed with a few digits and typed back is inside.
    margin = 1e-3 * (high - low)
    if not low - margin <= value <= high + margin:
        unit = "" if number.unit == "1" else f" {number.unit}"
        message = f"{number.name} = {value:g} is not possible on this vehicle: {low:.4g} to {high:.4g}{unit}"
        raise SettingError(_key(effect.name), f"{message} ({number.meaning})")


def _key(name: str) -> str:
    return f"closed_loop.effects.{name}"
