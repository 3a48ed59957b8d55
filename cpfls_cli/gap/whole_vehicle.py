"""Between a model with effects and the model of a whole vehicle: each as the other, as far as it goes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.catalogue.parameter_error import coupling, inertia_correction
from cpfls_cli.effects.effect import Columns, Effect
from cpfls_cli.effects.polynomial import Probe, polynomial
from cpfls_cli.effects.registry import VEHICLE_NUMBERS
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.gap.balance.weak_flight import Candidate, actuated
from cpfls_cli.gap.extended import ExtendedModel, FittedEffect, plain
from cpfls_cli.inertia import INERTIA_ENTRIES
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import Recording


class WholeVehicle(NamedTuple):
    """A model with effects as one table of weights, as far as it is one.

    Attributes
    ----------
    model : VehicleModel
    not_held : tuple of str
        Effects that are no polynomials of motion and rotor speeds.
    """

    model: VehicleModel
    not_held: tuple[str, ...]


def whole_vehicle(extended: ExtendedModel, vehicle: VehicleSettings, inertia: Array) -> WholeVehicle:
    """Turn a model with effects into that of a whole vehicle.

    Parameters
    ----------
    vehicle : VehicleSettings
        That the effects were fitted with.
    inertia : array, shape (3, 3), kg m^2
        Of the base, where it does not depend on the attitude.
    """
    acting = [one for one in extended.effects if one.candidate.effect.kind in ("wrench", "actuator")]
    corrected = inertia + inertia_correction(extended.parameters, vehicle)
    effects = list(_numbers(extended.parameters, vehicle, corrected))
    probe, times, not_held = Probe.of(vehicle), {"delay_s": 0.0, "lag_s": 0.0}, []
    for fitted in acting:
        (known, shape), linear = fitted.in_still_air
        hooks = known.actuation
        if known.vehicle is not None:
            vehicle = known.vehicle(vehicle, shape)
        elif known.inertia is not None:
            corrected = corrected + known.inertia(linear)
        elif hooks is not None and (hooks.lag or hooks.delay):
            times |= {"lag_s": hooks.lag(shape)} if hooks.lag else {}
            times |= {"delay_s": hooks.delay(shape)} if hooks.delay else {}
        elif known.carried is None and polynomial(known, probe, shape) is not None:
            effects.append(ModelEffect(known.name, dict(shape), linear))
        else:
            not_held.append(known.name)
    xx, yy, zz, xy, xz, yz = (float(corrected[entry]) for entry in INERTIA_ENTRIES)
    if np.linalg.eigvalsh(corrected).min() > 0:
        vehicle = replace(vehicle, inertia_kg_m2=(xx, yy, zz, xy, xz, yz))
    else:
        not_held.append("inertia, which is not positive definite")
    return WholeVehicle(
        VehicleModel(
            vehicle=vehicle,
            response=RotorResponse(**times),
            effects=tuple(effects),
            wind=actuated(probe.signals, extended.chosen).steady_wind,
        ),
        tuple(not_held),
    )


def _numbers(parameters: Array, vehicle: VehicleSettings, corrected: Array) -> tuple[ModelEffect, ...]:
    """Keep what no inertia holds: coupling of the rates, scale of the thrust; nothing where there is none of it."""
    stated, found = np.array(vehicle.inertia_kg_m2[:3]), np.diag(corrected)
    kept = coupling(parameters)
    # A coupling multiplies the mean of two moments of inertia, which are now the corrected ones.
    kept[3:6] *= [stated[list(pair)].sum() / found[list(pair)].sum() for pair in ((1, 2), (2, 0), (0, 1))]
    kept[6] = parameters[6]
    return (ModelEffect(VEHICLE_NUMBERS.name, {}, kept),) if kept.any() else ()


def with_effects(model: VehicleModel) -> ExtendedModel:
    """Turn the model of a whole vehicle into one with a single effect: all that it has beyond its rigid body.

    Parameters
    ----------
    model : VehicleModel
        Of constant inertia; signals have to be those of its vehicle, see `of_vehicle`.
    """
    whole = FittedEffect(Candidate(_beyond_rigid_body(model), {}), np.zeros(0))
    return replace(plain(None), effects=(whole,))


def of_vehicle(recording: Recording, model: VehicleModel) -> Recording:
    """Exchange the stated vehicle of a flight for that of a model.

    Raises
    ------
    InputError
        If the flight lacks a signal that the model needs.
    """
    (whole,) = with_effects(model).chosen
    missing = whole.effect.missing(recording.signals)
    if missing:
        lacking = " and ".join(name.replace("_", " ") for name in missing)
        raise InputError(f"{recording.name}: lacks {lacking}, which the model of the whole vehicle needs")
    return replace(recording, signals=replace(recording.signals, vehicle=model.vehicle))


def _beyond_rigid_body(model: VehicleModel) -> Effect:
    """Make an effect of what a vehicle does beyond squared rotor speeds: response, law, effects and remainder."""

    def columns(signals: Signals, _shape: Mapping[str, float]) -> Columns:
        rotor = model.rotor_terms_at(signals.speed, signals.period, "previous" if signals.commanded else "linear")
        velocity = signals.air_velocity if model.needs_velocity else np.zeros_like(signals.body_rate)
        wrench = model.wrench(velocity, signals.body_rate, rotor)
        return Columns((wrench - signals.wrench)[:, :, None])

    return Effect(
        name="whole_vehicle",
        title="whole vehicle",
        kind="wrench",
        formula="(M, F) = G(rotors) x(R'v, omega) - (M, F) of squared rotor speeds",
        sentence="The vehicle is as a whole model of it says.",
        coefficients=(),
        needs=frozenset({"rotor_speed", *(("velocity",) if model.needs_velocity else ())}),
        excitation="",
        rivals={},
        source="`cpfls vehicle`",
        columns=columns,
        unit_coefficient=True,
    )
