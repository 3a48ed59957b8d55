"""A model with effects as that of a whole vehicle: the same torque, force and inertia."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.catalogue.parameter_error import inertia_correction
from cpfls_cli.effects.registry import VEHICLE_NUMBERS, effect
from cpfls_cli.effects.signals import Signals, as_slow_as_rotors
from cpfls_cli.errors import InputError
from cpfls_cli.export.holding import Off
from cpfls_cli.gap.balance.weak_flight import Candidate, actuated, columns_of, nuisance
from cpfls_cli.gap.before_after import left_out
from cpfls_cli.gap.extended import ExtendedModel, FittedEffect, plain
from cpfls_cli.gap.whole_vehicle import of_vehicle, whole_vehicle, with_effects, with_known_wrench
from cpfls_cli.inertia import symmetric
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.playback.player import free_runs, made_ready, player_of
from cpfls_cli.vehicle.rotors import with_factors
from tests.builders import vehicle_models
from tests.builders.vehicle_models import QUAD

STATED = symmetric(QUAD.inertia_kg_m2)


def fitted(name, *linear, **shape):
    return FittedEffect(Candidate(effect(name), shape), np.array(linear))


def parameters(**values):
    return np.array([values.get(one.name, 0.0) for one in VEHICLE_NUMBERS.coefficients])


def signals(samples=60):
    rng = np.random.default_rng(4)
    return Signals(
        time=np.arange(samples) * 0.01,
        body_rate=rng.normal(0, 2, (samples, 3)),
        vehicle=QUAD,
        attitude=rng.uniform(-1, 1, (samples, 3)),
        velocity=rng.normal(0, 3, (samples, 3)),
        rotor_speed=rng.uniform(800, 1300, (samples, 4)),
    )


def _columns(extended, flown):
    return [(each.candidate, flown, each.linear) for each in extended.effects if each.candidate.effect.kind == "wrench"]


def test_torque_force_and_inertia_are_those_of_the_effects():
    numbers = parameters(inertia_x=0.3, inertia_z=-0.2, coupling_y=0.4, thrust_scale=0.1, reference_x=0.2)
    effects = (fitted("com_offset", 0.004, -0.002), fitted("linear_damping", 1e-3, 2e-3, 3e-3))
    effects += (fitted("drag_factor_error", error=0.3),)
    extended, flown = ExtendedModel(None, numbers, effects), signals()
    whole = whole_vehicle(extended, QUAD)
    assert whole.unsimulated == ()
    steady = np.zeros((len(flown), 17))
    steady[:, 0], steady[:, 1:5], steady[:, 5:9] = 1.0, flown.rotor_speed, flown.rotor_speed**2
    found = whole.wrench(flown.air_velocity, flown.body_rate, steady)
    moved = actuated(flown, extended.chosen)
    wanted = moved.wrench + sum(columns_of(*pair).direct @ each for *pair, each in _columns(extended, moved))
    # The coupling of the rates alone, which no inertia holds.
    wanted += columns_of(nuisance(), flown).direct[..., 3:6] @ numbers[3:6]
    wanted[:, 5] += 0.1 * flown.thrust
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())
    np.testing.assert_allclose(whole.body.inertia, STATED + inertia_correction(numbers, QUAD), rtol=1e-12)


def test_what_the_vehicle_holds_is_taken_and_what_is_not_simulated_with_the_state_is_named():
    products = fitted("products_of_inertia", 1e-4, 2e-4, 0)
    whole = whole_vehicle(ExtendedModel(None, parameters(), (products,)), QUAD)
    np.testing.assert_allclose(whole.body.inertia, STATED + symmetric([0, 0, 0, 1e-4, 2e-4, 0]), rtol=1e-12)
    assert whole.effects == ()
    effects = (fitted("motor_lag", time_constant_s=0.04), fitted("command_delay", delay_s=0.02))
    whole = whole_vehicle(ExtendedModel(None, parameters(), effects), QUAD)
    assert (whole.response.lag_s, whole.response.delay_s) == (0.04, 0.02)
    assert whole.effects == ()
    effects = (fitted("wind", 1.0, 0.0), fitted("torque_bias", 0.1, 0, 0), fitted("battery_sag", exponent=1.5))
    whole = whole_vehicle(ExtendedModel(None, parameters(), effects), QUAD)
    assert whole.unsimulated == ("battery_sag", "wind")
    assert [each.name for each in whole.parts] == ["rotors", "torque_bias"]


def test_height_of_the_mass_and_wind_are_those_of_the_effects():
    wind, offset = effect("wind").exact, effect("com_offset").exact
    effects = (
        FittedEffect(Candidate(wind, {"W_x": 4.0, "W_y": -1.5}), np.array([3e-5])),
        FittedEffect(Candidate(offset, {}), np.array([0.004, -0.003, 0.02])),
        fitted("parasitic_drag", 0.02, 0.03, 0.04, 0.0, 0.001, 0.0),
    )
    extended = ExtendedModel(None, parameters(thrust_scale=0.05), effects)
    whole = whole_vehicle(extended, QUAD)
    assert (whole.unsimulated, whole.wind) == ((), (4.0, -1.5, 0.0))
    (offset,) = (each for each in whole.effects if each.is_lever)
    flown = replace(whole.acting(signals()), rotor_speed=np.full((60, 4), 1000.0))
    blown = [each for each in extended.effects if each.candidate.effect.name != "com_offset"]
    total = flown.wrench + sum(columns_of(each.candidate, flown).direct @ each.linear for each in blown)
    total[:, 5] += 0.05 * flown.thrust
    total[:, :3] -= np.cross(offset.coefficients, total[:, 3:])
    np.testing.assert_allclose(whole.wrench_along(flown), total, atol=1e-10)
    flight, player = made_ready(whole, LoggedFlight.of(signals()))
    starts = np.arange(0, 40, 8)
    runs = free_runs(player, flight, starts, 12).errors
    lower = replace(whole, effects=tuple(e for e in whole.effects if not e.is_lever))
    for changed in (lower, replace(whole, wind=(0.0, 0.0, 0.0))):
        assert np.abs(free_runs(player_of(changed, flight), flight, starts, 12).errors - runs).max() > 1e-3
    # The height alone has a lever for the forces across the rotors, which the thrust is none of.
    air, rate = np.random.default_rng(0).normal(0, 2, (2, 5, 3))
    steady = np.hstack([np.ones((5, 1)), np.full((5, 4), 1000.0), np.full((5, 4), 1e6), np.zeros((5, 8))])
    lever, force = whole.wrench_by_part(air, rate, steady)["com_offset"], whole.wrench(air, rate, steady)[:, 3:]
    np.testing.assert_allclose(lever[:, :3], -np.cross([0.004, -0.003, 0.02], force), atol=1e-15)


def test_what_is_left_out_is_measured_along_flights():
    sag = fitted("battery_sag", exponent=1.5)
    steady = np.full((60, 4), 1000.0)
    flown = replace(signals(), voltage=np.linspace(1.0, 0.8, 60), commanded=True, rotor_speed=steady)
    extended = replace(plain(None), effects=(fitted("torque_bias", 0.01, 0.0, 0.0), sag))
    (left,) = left_out(whole_vehicle(extended, QUAD), ["battery_sag"], [replace(flown, name="flight")], 0.5)
    assert left.name == "battery_sag"
    lost = (1.0 - actuated(flown, extended.chosen).speed ** 2 / flown.speed**2) * flown.thrust[:, None]
    assert left.wrench[5] == pytest.approx(np.sqrt((lost[:, 0] ** 2).mean()), rel=0.02)
    assert left.ends[1] > 0.1
    still = replace(flown, velocity=None, acceleration=None, position=None)
    (unseen,) = left_out(whole_vehicle(extended, QUAD), ["battery_sag"], [replace(still, name="flight")], 0.5)
    np.testing.assert_array_equal(np.isfinite(unseen.ends), [False, False, True, True])
    assert Off.of(unseen.ends).sentence.endswith(" degrees")


def test_a_plain_model_is_the_vehicle_and_an_inertia_of_no_body_is_not_taken():
    whole = whole_vehicle(plain(None), QUAD)
    assert (whole.vehicle, whole.is_rigid_body) == (QUAD, True)
    products = fitted("products_of_inertia", 0.1, 0.0, 0.0)
    whole = whole_vehicle(ExtendedModel(None, parameters(), (products,)), QUAD)
    assert whole.vehicle == QUAD


def test_a_whole_vehicle_as_a_model_with_one_effect_has_its_torque_force_and_inertia():
    model = vehicle_models.whole(effects=vehicle_models.whole().effects[:4])
    (flown,) = of_vehicle([replace(signals(), vehicle=replace(QUAD, mass_kg=1.0), name="flight")], model)
    extended = with_effects(model)
    assert (flown.vehicle, extended.base) == (model.vehicle, None)
    rotor = model.response.terms_at_samples(flown.rotor_speed, flown.period, "linear")
    wanted = model.wrench(flown.air_velocity, flown.body_rate, rotor)
    (beyond,) = extended.chosen
    found = flown.wrench + columns_of(beyond, flown).direct[:, :, 0]
    np.testing.assert_allclose(found, wanted, atol=1e-12 * np.abs(wanted).max())
    assert not extended.parameters.any()


def test_a_rigid_body_has_no_effect_and_the_place_of_a_sensor_stays_a_number():
    assert with_effects(VehicleModel(vehicle=QUAD)).effects == ()
    numbers = parameters(thrust_scale=0.1, reference_x=0.2)
    again = with_effects(whole_vehicle(ExtendedModel(None, numbers, ()), QUAD))
    np.testing.assert_array_equal(again.parameters, numbers)
    model = whole_vehicle(ExtendedModel(None, numbers, ()), QUAD)
    late = with_effects(replace(model, remainder=vehicle_models.remainder(1)))
    np.testing.assert_array_equal(late.parameters, parameters(reference_x=0.2))


@pytest.mark.parametrize(
    ("model", "lacking", "needed"),
    [
        (vehicle_models.whole(), {"velocity": None}, "lacks velocity,"),
        (vehicle_models.whole(), {"velocity": None, "rotor_speed": None}, "lacks rotor speed and velocity,"),
        (vehicle_models.whole(effects=(), remainder=None), {"velocity": None}, None),
    ],
)
def test_a_flight_has_to_have_what_the_model_depends_on(model, lacking, needed):
    recording = replace(signals(), **lacking, name="flight")
    if needed is None:
        assert of_vehicle([recording], model)[0].vehicle == model.vehicle
        return
    with pytest.raises(InputError, match=f"^flight: {needed} which the model of the whole vehicle needs$"):
        of_vehicle([recording], model)


def test_flights_are_compared_with_the_numbers_of_a_vehicle_that_was_found_without_effects():
    flown = signals()
    found = replace(QUAD, rotors=tuple(replace(each, thrust_factor_n_s2=1e-5) for each in QUAD.rotors))
    (given,) = with_known_wrench([replace(flown, name="flight")], VehicleModel(vehicle=found))
    np.testing.assert_allclose(given.wrench[:, 5], 1e-5 * (flown.rotor_speed**2).sum(axis=1))
    (same,) = with_known_wrench([flown], VehicleModel(vehicle=QUAD))
    assert same is flown


def test_what_one_model_knew_is_no_part_of_what_the_next_one_does():
    model = VehicleModel(vehicle=QUAD, effects=(ModelEffect("rotor_drag", {}, np.array([1e-4])),))
    stronger = replace(model, vehicle=with_factors(QUAD, 1.2, 1.1))
    once = with_known_wrench([replace(signals(), name="flight")], stronger)
    again = with_known_wrench(with_known_wrench([replace(signals(), name="flight")], model), stronger)
    np.testing.assert_allclose(again[0].wrench, once[0].wrench, rtol=1e-12)
    np.testing.assert_allclose(once[0].thrust, 1.2 * signals().thrust, rtol=1e-12)


def test_what_a_model_knows_is_averaged_as_rotors_are_that_are_logged_rarely():
    drag = ModelEffect("rotor_drag", {}, np.array([1e-4]))
    rarely = replace(signals(), name="flight", rotor_span_s=10 * signals().period)
    (given,) = with_known_wrench([rarely], VehicleModel(vehicle=QUAD, effects=(drag,)))
    (averaged,) = with_known_wrench(
        [replace(as_slow_as_rotors(rarely), rotor_span_s=0.0)], VehicleModel(vehicle=QUAD, effects=(drag,))
    )
    np.testing.assert_allclose(given.known_wrench, averaged.known_wrench, rtol=1e-12)
    np.testing.assert_array_equal(given.velocity, rarely.velocity)
