"""Between what a balance is fitted with and the model of a whole vehicle: each as the other."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics import positive_definite
from cpfls_cli.effects.catalogue.parameter_error import inertia_correction
from cpfls_cli.effects.effect import Columns, Effect
from cpfls_cli.effects.hooks import VehicleParts
from cpfls_cli.effects.registry import VEHICLE_NUMBERS
from cpfls_cli.effects.signals import Signals, as_slow_as_rotors
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.extended import ExtendedModel, FittedEffect, Refit, plain
from cpfls_cli.gap.naming.causes import of_thrust
from cpfls_cli.inertia import INERTIA_ENTRIES, symmetric
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.rounding import less
from cpfls_cli.simulation.model import late_effects
from cpfls_cli.vehicle.rotors import with_factors
from cpfls_cli.vehicle.settings import VehicleSettings


def whole_vehicle(extended: ExtendedModel, vehicle: VehicleSettings) -> VehicleModel:
    """Turn a model with effects into that of a whole vehicle.

    `vehicle`: that the effects were fitted with.
    Result: with the inertia of before where the one that comes with the effects is that of no body.
    """
    given, fuzzy = symmetric(vehicle.inertia_kg_m2), extended.base
    parts, times = _parts(extended, vehicle)
    corrected = given + inertia_correction(extended.parameters, vehicle)
    effects = (*_numbers(extended.parameters, vehicle, corrected), *(ModelEffect(*each) for each in parts.effects))
    return VehicleModel(
        vehicle=_with_inertia(parts.vehicle, given + parts.inertia),
        response=RotorResponse(**times),
        effects=effects,
        fuzzy=fuzzy.corrected(parts.inertia) if fuzzy is not None and parts.inertia.any() else fuzzy,
        wind=parts.wind,
        # The lag and the delay of the catalogue are those behind a command.
        commanded=any(times.values()),
        hold="linear" if any(times.values()) else None,
        repairs=extended.audit,
    )


def _parts(extended: ExtendedModel, vehicle: VehicleSettings) -> tuple[VehicleParts, dict[str, float]]:
    """Put each effect where the model of a whole vehicle has it, and give lag and delay of the rotors, s."""
    parts = VehicleParts(vehicle, inertia_correction(extended.parameters, vehicle))
    times = {"delay_s": 0.0, "lag_s": 0.0}
    for (known, shape), linear in extended.effects:
        hooks = known.actuation
        if known.kind not in ("wrench", "actuator"):
            continue
        if known.in_vehicle is not None:
            parts = known.in_vehicle(parts, shape, linear)
        elif hooks is not None and (hooks.lag or hooks.delay):
            times |= {"lag_s": hooks.lag(shape)} if hooks.lag else {}
            times |= {"delay_s": hooks.delay(shape)} if hooks.delay else {}
        else:
            parts = parts._replace(effects=(*parts.effects, (known.name, dict(shape), linear)))
    return parts, times


def _with_inertia(vehicle: VehicleSettings, inertia: Array) -> VehicleSettings:
    if not positive_definite(inertia[None]).all():
        return vehicle
    xx, yy, zz, xy, xz, yz = (float(inertia[entry]) for entry in INERTIA_ENTRIES)
    moments = (xx, yy, zz, xy, xz, yz) if xy or xz or yz else (xx, yy, zz)
    return vehicle if moments == vehicle.inertia_kg_m2 else replace(vehicle, inertia_kg_m2=moments)


def thrust_put_in(refit: Refit, vehicle: VehicleSettings) -> VehicleSettings:
    """Give rotors the thrust that a refit names as wrong, and their torque with it: levers are where they were.

    Yaw torque follows, unless flights show that the inertia about z over it is off by another amount.

    `vehicle`: that the effects were fitted with.
    Result: the same vehicle where no thrust is named.
    """
    scale, _, yaw = _of_thrust(refit)
    return vehicle if scale == 1.0 else with_factors(vehicle, scale, scale if yaw else 1.0)


def above_thrust(refit: Refit, first: Refit, vehicle: VehicleSettings) -> tuple[Refit, VehicleSettings]:
    """Give rotors all of the thrust that a second refit found, and the thrust's error against the vehicle as given.

    Moments of inertia that only seemed wrong by the thrust are the stated ones.

    `first`: of the vehicle as given; `vehicle`: what `thrust_put_in` made of it, that the second is of.
    """
    scale, right, yaw = _of_thrust(first)
    parameters = refit.model.parameters.copy()
    names = [each.name for each in VEHICLE_NUMBERS.coefficients]
    rest = 1.0 + float(parameters[names.index("thrust_scale")])
    parameters[[names.index(name) for name in ("thrust_scale", *right)]] = 0.0
    numbers = tuple(
        replace(
            each, value=scale * (1 + each.value) - 1, low=scale * (1 + each.low) - 1, high=scale * (1 + each.high) - 1
        )
        if each.name == "thrust_scale"
        else each
        for each in refit.estimates.parameters
    )
    known = dict(zip(names, parameters.tolist(), strict=True))
    effects = tuple(
        each._replace(candidate=each.candidate.at(each.candidate.following(each.linear, known)))
        for each in refit.model.effects
    )
    model = replace(refit.model, parameters=parameters, effects=effects)
    estimates = replace(refit.estimates, parameters=numbers)
    return replace(refit, model=model, estimates=estimates), with_factors(vehicle, rest, rest if yaw else 1.0)


def _of_thrust(refit: Refit) -> tuple[float, list[str], bool]:
    """Give the named scale of the thrust, moments that are right by it, and whether yaw torque follows."""
    named = {number.name for each in refit.effects if each.name == VEHICLE_NUMBERS.name for number in each.numbers}
    numbers = {each.name: each for each in refit.estimates.parameters}
    if "thrust_scale" not in named or refit.model.base is not None:
        return 1.0, [], False
    right = of_thrust(refit.estimates.parameters)
    about_z = numbers.get("inertia_z")
    # What flights do not show has no width beyond rounding.
    yaw = about_z is None or not less(1 + about_z.low, 1 + about_z.high) or "inertia_z" in right
    return 1.0 + numbers["thrust_scale"].value, right, yaw


def require_body(extended: ExtendedModel, vehicle: VehicleSettings) -> None:
    """Refuse effects with which the inertia is that of no body.

    `vehicle`: that they were fitted with. Raises ComputationError.
    """
    inertia = symmetric(vehicle.inertia_kg_m2) + _parts(extended, vehicle)[0].inertia
    if extended.base is None and not positive_definite(inertia[None]).all():
        raise ComputationError("not extended: with the named effects, the inertia is not that of any body")


def _numbers(parameters: Array, vehicle: VehicleSettings, corrected: Array) -> tuple[ModelEffect, ...]:
    """Take the numbers that no inertia tensor holds: coupling of rates, scale of thrust, place of the sensor."""
    stated, refitted = np.array(vehicle.inertia_kg_m2[:3]), np.diag(corrected)
    kept = parameters.copy()
    kept[:3] = 0.0
    # A coupling multiplies the mean of two moments of inertia, which are now the corrected ones.
    kept[3:6] *= [stated[list(pair)].sum() / refitted[list(pair)].sum() for pair in ((1, 2), (2, 0), (0, 1))]
    return (ModelEffect(VEHICLE_NUMBERS.name, {}, kept),) if kept.any() else ()


def with_effects(model: VehicleModel) -> ExtendedModel:
    """Write a model as effects on its rigid body, for the balance of flights.

    A model with more than effects of the catalogue has a single one: all that it has beyond its rigid body.

    `model`: signals have to be those of its vehicle, see `of_vehicle`.
    """
    base = replace(plain(model.fuzzy), audit=model.repairs)
    numbers = next((one.coefficients for one in model.effects if one.name == VEHICLE_NUMBERS.name), base.parameters)
    if model.of_catalogue:
        listed = [(one.known, one.shape, one.coefficients) for one in model.effects if one.known.kind != "parameter"]
        listed += [(known, {known.shapes[0].name: value}, np.zeros(0)) for known, value in late_effects(model.response)]
        fitted = tuple(FittedEffect(Candidate(known, shape), linear) for known, shape, linear in listed)
        return replace(base, parameters=numbers, effects=fitted)
    # Where a sensor sits moves nothing, and is no part of torque and force.
    of_log = np.array([coefficient.of_log for coefficient in VEHICLE_NUMBERS.coefficients])
    whole = FittedEffect(Candidate(_beyond_rigid_body(model), {}), np.zeros(0))
    return replace(base, parameters=np.where(of_log, numbers, 0.0), effects=(whole,))


def of_vehicle(flights: Sequence[Signals], model: VehicleModel) -> list[Signals]:
    """Exchange the stated vehicle of flights for that of a model.

    Raises InputError if a flight lacks a signal that the model needs.
    """
    wind, given = np.array(model.wind) if any(model.wind) else None, []
    for flight in flights:
        missing = tuple(sorted(model.needs - flight.available))
        if missing:
            lacking = " and ".join(name.replace("_", " ") for name in missing)
            raise InputError(f"{flight.name}: lacks {lacking}, which the model of the whole vehicle needs")
        same = flight.vehicle == model.vehicle and wind is None
        given.append(flight if same else replace(flight, vehicle=model.vehicle, wind=wind))
    return given


def has_effects(model: VehicleModel) -> bool:
    """Separate a vehicle that was found from what a search begins with: a rigid body, or an inertia over attitude."""
    return not model.is_rigid_body and model.fuzzy is None


def with_known_wrench(flights: Sequence[Signals], model: VehicleModel) -> list[Signals]:
    """Give flights the vehicle of a model, and take all that it does beyond squared rotor speeds as known.

    A vehicle that was found may have no effects, and other numbers than the config.

    Raises InputError if a flight lacks a signal that the model needs.
    """
    if not has_effects(model):
        vehicle = model.vehicle
        return [each if each.vehicle == vehicle else replace(each, vehicle=vehicle) for each in flights]
    given = []
    for flight in of_vehicle(flights, model):
        # What another model knew is no part of the rotors.
        signals = replace(flight, known_wrench=None)
        seen = as_slow_as_rotors(signals)
        given.append(replace(signals, known_wrench=model.wrench_along(model.acting(seen)) - seen.wrench))
    return given


def on_top_of(base: VehicleModel, found: VehicleModel) -> VehicleModel:
    """Add to a model what a balance has found above it."""
    if not has_effects(base):
        return found
    known = {effect.name: effect for effect in base.effects}
    added = [effect for effect in found.effects if effect.name not in known]
    both = [
        effect._replace(coefficients=known[effect.name].coefficients + effect.coefficients)
        for effect in found.effects
        if effect.name in known
    ]
    changed = {effect.name: effect for effect in both}
    kept = tuple(changed.get(effect.name, effect) for effect in base.effects)
    return replace(base, vehicle=found.vehicle, effects=(*kept, *added), repairs=found.repairs)


def known_already(model: VehicleModel) -> tuple[str, ...]:
    """Name the effects that a model has: a search above it does not look for them again."""
    lags = [known.name for known, _ in late_effects(model.response)]
    return (*(effect.name for effect in model.effects if effect.known.kind != "parameter"), *lags)


def _beyond_rigid_body(model: VehicleModel) -> Effect:
    """Make an effect of what a vehicle does beyond squared rotor speeds: response, law, effects and remainder."""

    def columns(signals: Signals, _shape: Mapping[str, float]) -> Columns:
        return Columns((model.wrench_along(model.acting(signals)) - signals.wrench)[:, :, None])

    return Effect(
        name="whole_vehicle",
        title="whole vehicle",
        kind="wrench",
        formula="(M, F) = G(rotors) x(R'v, omega) - (M, F) of squared rotor speeds",
        sentence="The vehicle is as a whole model of it says.",
        needs=frozenset(),
        excitation="",
        rivals={},
        source="`cpfls vehicle`",
        columns=columns,
    )
