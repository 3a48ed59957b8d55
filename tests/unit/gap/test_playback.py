"""A model with effects played back along a flight that has them: true numbers predict it, whatever the effect."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE, VEHICLE_NUMBERS
from cpfls_cli.errors import InputError
from cpfls_cli.flights.playback import played
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.before_after import errors_by_horizon, played_pairs, worst_stretch
from cpfls_cli.gap.extended import ExtendedModel, FittedEffect
from cpfls_cli.gap.whole_vehicle import whole_vehicle
from cpfls_cli.playback.errors import MODEL
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import made_ready, player_of
from cpfls_cli.playback.replay import Played, replay
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulation.model import simulated_effects
from tests.builders.closed_loop_flights import VEHICLE, by_columns, flown, signals_of
from tests.builders.playback_flights import mean_errors
from tests.builders.vehicle_models import thrust_curve

BIAS = np.array([0.0, 0.01, 0.05])
PARAMETERS = [coefficient.name for coefficient in VEHICLE_NUMBERS.coefficients]
# By how much the true model's rates are better than those of the stated vehicle. What comes late is known to a sample
# of the log, and what is evaluated along the motion has no state of its own.
EFFECTS = {
    "linear_damping": ({"d_x": 0.3, "d_y": 0.3, "d_z": 0.2}, 0.02),
    "rotor_drag": ([3e-4], 0.02),
    "products_of_inertia": ({"Ixy": 0.08, "Ixz": -0.06}, 0.02),
    "com_offset": ([0.01, -0.006], 0.02),
    "rotor_mismatch": ([0.04, -0.03, 0.0, 0.0], 0.02),
    "wind": ([4e-4, 3.0, -2.0], 0.02),
    "motor_lag": ([0.05], 0.1),
    "command_delay": ([0.04], 0.1),
}


def model_of(asked):
    """The true model of a simulated flight."""
    flying = simulated_effects(asked, VEHICLE).listed
    return whole(
        *(FittedEffect(Candidate(one.effect, shape), linear) for one in flying for shape, linear in [by_columns(one)])
    )


def whole(*fitted, **numbers):
    parameters = np.array([numbers.get(name, 0.0) for name in PARAMETERS])
    return whole_vehicle(ExtendedModel(None, parameters, fitted), VEHICLE)


def logged(*parts):
    named = tuple(replace(part, name="flight") for part in parts)
    return replace(LoggedFlight.of(named[0]), parts=named)


def played_back(model, signals, horizon=30):
    flight, player = made_ready(model, logged(signals))
    found = replay([Played(flight, player, player_of(VehicleModel(vehicle=VEHICLE), flight))], horizon, 5)
    return {name: mean_errors(found, name).sum(axis=1) for name in found.models[MODEL].signals}, flight


@pytest.mark.parametrize("name", EFFECTS)
def test_the_true_effect_predicts_the_flight(name):
    values, share = EFFECTS[name]
    signals = signals_of(flown(effects={name: values}))
    # The stated vehicle is played back along the speeds as logged.
    stated, _ = played_back(model_of({}), signals)
    errors, _ = played_back(model_of({name: values}), signals)
    assert errors["body_rate"][0] < share * stated["body_rate"][0]
    assert errors["attitude"][0] < share * stated["attitude"][0]


def test_a_load_on_a_short_cable_is_evaluated_along_the_motion():
    """Motions at random, a second apart, which tell polynomials, would make its swing diverge."""
    signals = signals_of(flown())
    shape = {"length_m": 0.3, "damping_1_s": 0.6, "depth_m": 0.05}
    load = FittedEffect(Candidate(CATALOGUE["payload"], shape), np.array([0.03, 0.0, 0.0, 0.3]))
    _, player = made_ready(whole(load), logged(signals))
    assert np.isfinite(player.along).all()
    assert np.abs(player.along[:, 5]).max() > 1.0


def test_without_effects_it_is_the_vehicle_of_the_config():
    errors, _ = played_back(model_of({}), signals_of(flown()))
    for by_prediction in errors.values():
        assert by_prediction[0] == pytest.approx(by_prediction[3])


def test_wrong_numbers_of_the_vehicle_are_in_inertia_and_thrust():
    signals = signals_of(flown())
    flight, player = made_ready(whole(inertia_x=0.2, coupling_y=0.3, thrust_scale=0.1), logged(signals))
    np.testing.assert_allclose(player.flown.body.inertia, np.diag([0.72, 0.6, 1.2]))
    turning = replace(flight, motion=flight.motion._replace(rate=np.tile([0.5, 0.0, 2.0], (len(flight), 1))))
    still = replace(flight, motion=flight.motion._replace(rate=np.zeros((len(flight), 3))))
    stated = player_of(VehicleModel(vehicle=VEHICLE), flight).wrench(still)
    np.testing.assert_allclose(player.wrench(still)[:, :3], stated[:, :3])
    np.testing.assert_allclose(player.wrench(still)[:, 5], 1.1 * stated[:, 5])
    # Of the catalogue: -g_y (I_x + I_z) / 2 times the other two rates.
    coupled = player.wrench(turning) - player.wrench(still)
    np.testing.assert_allclose(coupled, np.tile([0, -0.3 * 0.9 * 0.5 * 2.0, 0, 0, 0, 0], (len(flight), 1)), atol=1e-12)


def test_a_lag_leaves_measured_speeds_as_they_are():
    signals = signals_of(flown())
    errors, flight = played_back(model_of({"motor_lag": [0.05]}), signals)
    np.testing.assert_array_equal(flight.speed, signals.rotor_speed)
    assert errors["body_rate"][0] < 0.01 * errors["body_rate"][2]


def test_at_measured_speeds_neither_lag_nor_curve_of_the_commands_acts():
    measured = signals_of(flown())
    model = VehicleModel(
        vehicle=VEHICLE, response=RotorResponse(lag_s=0.05), effects=(thrust_curve(0.4),), commanded=True
    )
    rigid, commands = VehicleModel(vehicle=VEHICLE), replace(measured, commanded=True)
    np.testing.assert_array_equal(model.wrench_along(measured), rigid.wrench_along(measured))
    apart = np.abs(model.wrench_along(commands) - rigid.wrench_along(commands)).max(axis=0)
    assert (apart[[0, 1, 5]] > 1e-3).all()
    players = [player_of(each, logged(measured).playback, [measured]) for each in (model, rigid)]
    np.testing.assert_array_equal(*(player.wrench(logged(measured).playback) for player in players))


def test_what_the_flight_lacks_is_named():
    signals = signals_of(flown())
    blind = type(signals)(time=signals.time, body_rate=signals.body_rate, vehicle=VEHICLE, rotor_speed=signals.speed)
    ground = whole(FittedEffect(Candidate(CATALOGUE["ground_effect"], {"G": 1.0}), np.zeros(0)))
    with pytest.raises(InputError, match="flight: lacks height, which the model's effect ground_effect needs"):
        made_ready(ground, logged(blind))
    # Air that nobody measured is taken as still, which `replay` says.
    made_ready(model_of({"rotor_drag": [3e-4]}), logged(blind))
    assert model_of({"rotor_drag": [3e-4]}).feels_air


def test_stretches_are_played_apart():
    signals = signals_of(flown(effects={"wind": [4e-4, 3.0, -2.0]}))
    model = model_of({"wind": [4e-4, 3.0, -2.0]})
    names = ("time", "body_rate", "attitude", "velocity", "position", "acceleration", "rotor_speed")
    parts = [
        type(signals)(vehicle=VEHICLE, **{name: getattr(signals, name)[part] for name in names})
        for part in (slice(0, 120), slice(150, 300))
    ]
    flight, player = made_ready(model, logged(*parts))
    assert [part.stop - part.start for part in flight.stretches] == [120, 150]
    found = replay([Played(flight, player, player)], 30, 5)
    whole, _ = played_back(model, signals)
    assert mean_errors(found, "body_rate").sum(axis=1)[0] < 2 * whole["body_rate"][0]


class Repairing(NamedTuple):
    """A model's knowledge of a constant error of the gyroscope."""

    def repaired(self, signals):
        return replace(signals, body_rate=signals.body_rate - BIAS)


def test_before_and_after_are_those_of_each_model_alone():
    signals = signals_of(flown(effects={"linear_damping": {"d_x": 0.3, "d_y": 0.3, "d_z": 0.2}}))
    model, given = model_of({"linear_damping": {"d_x": 0.3, "d_y": 0.3, "d_z": 0.2}}), model_of({})
    found = errors_by_horizon(played_pairs([replace(signals, name="flight")], model, given), 0.3)
    after, before = (played_back(each, signals)[0] for each in (model, given))
    for name in found.models[MODEL].signals:
        sums = mean_errors(found, name).sum(axis=1)
        np.testing.assert_allclose(sums[:3], after[name][:3])
        assert sums[3] == pytest.approx(before[name][0])
        # Of noise there is none, so that without a model nothing is as good.
        assert sums[0] < 0.1 * min(sums[1:])


def test_the_model_as_given_takes_the_log_with_its_faults():
    exact = signals_of(flown())
    faulty = replace(exact, body_rate=exact.body_rate + BIAS)
    pairs = played_pairs([replace(faulty, name="flight")], replace(model_of({}), repairs=Repairing()), model_of({}))
    after, _, _, before = mean_errors(errors_by_horizon(pairs, 0.3), "attitude")[:, -1]
    assert before == pytest.approx(np.linalg.norm(BIAS) * 0.3, rel=0.2)
    assert after < 0.02 * before
    stretch = worst_stretch(pairs, [replace(faulty, name="flight")], 1.0, 2.0)
    np.testing.assert_allclose(stretch.measured, stretch.after, atol=1e-3)
    np.testing.assert_allclose((stretch.before - stretch.measured)[::100], np.tile(BIAS, (2, 1)), atol=1e-9)
    assert stretch.axis == 2


@pytest.mark.parametrize(("horizon_s", "samples"), [(100.0, 295), (0.3, 30), (0.001, 1)])
def test_a_horizon_is_in_seconds_and_within_the_flight(horizon_s, samples):
    pairs = played_pairs([replace(signals_of(flown()), name="flight")], *[model_of({})] * 2)
    errors = mean_errors(errors_by_horizon(pairs, horizon_s), "body_rate")
    assert errors.shape == (4, samples)
    np.testing.assert_array_equal(errors[0], errors[3])


def test_the_worst_stretch_is_where_the_model_as_given_is_wrong():
    exact = signals_of(flown(duration=6.0))
    burst = (exact.time > 3.3) & (exact.time < 4.6)
    speed = exact.rotor_speed.copy()
    speed[burst, 0] *= 1.02
    signals = replace(exact, rotor_speed=speed)
    recordings = [replace(exact, name="good"), replace(signals, name="wrong")]
    found = worst_stretch(played_pairs(recordings, *[model_of({})] * 2), recordings, 1.0, 2.0)
    assert found.flight == "wrong"
    np.testing.assert_array_equal(found.time, signals.time[300:500])
    np.testing.assert_array_equal(found.restart, signals.time[[300, 400]])
    # The thrust of the front rotor turns the vehicle about y.
    assert found.axis == 1
    np.testing.assert_allclose(found.measured, signals.body_rate[300:500])


def test_a_log_is_played_back_with_half_of_its_own_sample():
    signals = replace(signals_of(flown()), commanded=True)
    model = VehicleModel(vehicle=VEHICLE, response=RotorResponse(lag_s=0.03, delay_s=0.02), commanded=True)
    flight = logged(signals)
    for held_s in (flight.held_s, 0.5 * flight.held_s):
        own = replace(model, response=replace(model.response, delay_s=0.02 - 0.5 * (flight.held_s - held_s)))
        pair = played(replace(model, held_s=held_s), flight, VEHICLE)
        np.testing.assert_allclose(pair.model.rotor, made_ready(own, flight)[1].rotor, rtol=1e-12)
