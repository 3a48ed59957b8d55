"""Fits find the vehicle that flew, and what flew explains these flights down to the noise, as nothing else does."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.shared.playback_scores import free_runs, rate_stays, score
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.playback.fit import fit, windows_of
from cpfls_cli.playback.model import ModelEffect, Remainder, VehicleModel
from cpfls_cli.playback.parameters import blocks_of
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.structure import Structure, choose, fitted_to_all
from cpfls_cli.playback.vehicle import find_vehicle
from tests.builders.playback_flights import (
    KINDS,
    MIDDLING,
    ROTORPY,
    ROTORPY_HIDDEN,
    STATED,
    TRUE_BLOCKS,
    flown,
    judged,
    nothing_known,
    pushed,
    rotorpy_flight,
    true_numbers,
    truth,
)
from tests.builders.vehicle_models import thrust_curve

RATE = 3
# Mean length of the difference of two 3-vectors of noise, for a deviation of 1.
DIFFERENCE = np.sqrt(2) * np.sqrt(8 / np.pi)


def fitted(vehicle, blocks, flights):
    windows = [own for flight in flights for own in windows_of([flight], 0.5, 0.6)]
    return fit(Structure(blocks).free(vehicle), windows, {}, 60, 3e-5)


def numbers(found):
    return {name: number.value for name, number in found.free.physical(found.values).items()}


def chosen(vehicle, flights, candidates, **asked):
    others = tuple(block for block in blocks_of(vehicle) if block not in candidates)
    settings = PlaybackSettings(leave_out=others, **asked)
    return choose(vehicle, flights, settings, lambda *_: None).chosen, settings


@pytest.fixture(scope="module")
def noisy():
    return flown(truth(), KINDS * 3, seed=1, noise=MIDDLING, duration_s=15.0)


def test_without_noise_the_numbers_come_back():
    found = fitted(STATED, TRUE_BLOCKS, flown(truth(), duration_s=10.0, seed=1))
    assert numbers(found) == pytest.approx(true_numbers(), rel=0.002)


def test_with_noise_they_come_back_and_predict_another_flight(noisy):
    found = fitted(STATED, TRUE_BLOCKS, noisy)
    assert judged(numbers(found)) == pytest.approx(judged(true_numbers()), rel=0.05)
    other = flown(truth(), duration_s=10.0, seed=2, noise=MIDDLING)
    by_found, by_truth = (score([free_runs(model, flight, 5) for flight in other]) for model in (found.model, truth()))
    assert (by_found.sums < 1.1 * by_truth.sums).all()


def test_from_mass_and_geometry_alone_the_constants_come_back():
    """Thrust factor, drag factor and inertia are guesses, up to twice too large or a third of what they are."""
    flights = flown(truth(), ("multisine", "figure"), seed=1, noise=MIDDLING)
    others = tuple(block for block in blocks_of(nothing_known()) if block not in TRUE_BLOCKS)
    settings = PlaybackSettings(leave_out=others, search_windows=40, folds=2)
    found = find_vehicle(nothing_known(), flights, settings, lambda *_: None)
    true, guessed = true_numbers(), nothing_known()
    assert guessed.rotors[0].drag_factor_n_m_s2 < 0.3 * true["drag_factor"]
    by_name = {number.name: number for number in found.numbers}
    asked = dict.fromkeys(("drag_factor", *(name for name in true if name.startswith("inertia"))), 0.03)
    for name, part in {"thrust_factor": 0.01, **asked}.items():
        number = by_name[name]
        assert number.value == pytest.approx(true[name], rel=part)
        assert number.low < true[name] < number.high
        assert number.determined
    assert (found.guessed, found.model.vehicle.unknown) == ((), ())
    assert by_name["lag.time_constant_s"].value == pytest.approx(truth().response.lag_s, abs=0.002)
    # About yaw all is known by its inertia far better than by itself, and named as it is known.
    pairs = {(trade.first, trade.second) for trade in found.trades}
    assert {("drag_factor", "inertia.Izz"), ("drag_factor", "linear_damping.d_z")} <= pairs


def test_the_blocks_that_are_there_are_chosen_and_no_others(noisy):
    found, _ = chosen(STATED, noisy, (*TRUE_BLOCKS, "delay"), search_windows=60, folds=2, horizon_s=0.3)
    assert set(found.structure.blocks) == set(TRUE_BLOCKS)


def test_a_force_without_a_name_is_learned_and_what_has_a_name_is_not():
    """A learned torque would do for flapping as well, with 18 numbers instead of one."""
    flights = flown(pushed(), KINDS * 2, seed=1, noise=MIDDLING, duration_s=15.0)
    true = {*TRUE_BLOCKS, "remainder_force"} - {"rotor_drag"}
    found, settings = chosen(STATED, flights, (*true, "remainder"), search_windows=60, folds=2, horizon_s=0.3)
    assert set(found.structure.blocks) == true
    final, _ = fitted_to_all(found.structure, STATED, flights, settings, found.fit)
    learned, flew = (pushes(model) for model in (final.model, pushed()))
    assert np.abs(learned - flew).max() < 0.1 * np.abs(flew).max()


def test_tilted_rotors_are_found_and_are_no_rotors_that_differ():
    """All arms are twisted by half a degree, one more than its opposite by 1 degree and bent by 2."""
    bent = np.deg2rad([0.5, 1.0, 2.0, 0.0, 0.0])
    true = replace(truth(), effects=(*truth().effects, ModelEffect("rotor_tilt", {}, bent)))
    flights = flown(true, KINDS * 2, seed=1, noise=MIDDLING, duration_s=15.0)
    candidates = (*TRUE_BLOCKS, "rotor_tilt", "rotor_mismatch")
    found, settings = chosen(STATED, flights, candidates, search_windows=60, folds=2, horizon_s=0.3)
    assert set(found.structure.blocks) == {*TRUE_BLOCKS, "rotor_tilt"}
    final, _ = fitted_to_all(found.structure, STATED, flights, settings, found.fit)
    (tilt,) = (each for each in final.model.effects if each.name == "rotor_tilt")
    assert tilt.coefficients == pytest.approx(bent, abs=np.deg2rad(0.3))


def pushes(model, speed=2.0):
    """The learned force over the direction of flight, near hover."""
    angle = np.linspace(0, 2 * np.pi, 36)
    velocity = speed * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    rotor = model.response.terms_by_step(np.full((len(angle), model.rotors), hover_speed(STATED)), 0.01, "previous")
    return model.wrench_by_part(velocity, 0 * velocity, rotor)["remainder"][:, 3:]


def test_the_drag_of_another_simulator_is_found():
    flights, hidden = [rotorpy_flight("drag")], ROTORPY_HIDDEN["drag"]
    candidates = (*(effect.name for effect in hidden), "com_offset")
    found, settings = chosen(ROTORPY, flights, candidates, search_windows=20, folds=2)
    final, _ = fitted_to_all(found.structure, ROTORPY, flights, settings, found.fit)
    free = final.free
    assert {effect.name for effect in hidden} <= set(free.base.blocks)
    known = {effect.name: effect.coefficients for effect in hidden}
    for effect in final.model.effects:
        scale = free.scales[[number.block == effect.name for number in free.numbers]]
        # Without noise, another block may be left to make up for the step of 10 ms: it is next to nothing.
        true = known.get(effect.name, np.zeros(len(scale)))
        assert effect.coefficients == pytest.approx(true, rel=0.02, abs=1e-4 * scale.max())


def errors(model, flights):
    return score([free_runs(model, flight) for flight in flights])


def everything():
    """A model with all that a model can have."""
    known = truth()
    response = replace(known.response, delay_s=0.007, slow_roll_pitch=-0.3, slow_yaw=-0.2, slow_s=0.4)
    remainder = Remainder(
        breakpoints=np.array([0.0, 0.5, 1.0]),
        harmonic_order=1,
        rows=np.array([0, 1, 5]),
        coefficients=np.full((3, 6, 2), 2e-6),
    )
    return replace(known, response=response, effects=(*known.effects, thrust_curve(0.3)), remainder=remainder)


@pytest.fixture(scope="module")
def clean():
    return flown(truth(), duration_s=8.0, seed=3)


@pytest.fixture(scope="module")
def measured():
    return flown(truth(), duration_s=8.0, seed=3, noise=MIDDLING)


@pytest.mark.parametrize("hold", ["previous", "linear"])
@pytest.mark.parametrize("model", [truth(), everything()], ids=["truth", "everything"])
def test_without_noise_the_true_model_plays_every_flight_back(model, hold):
    flights = flown(model, duration_s=4.0, hold=hold)
    stays = score([rate_stays(flight) for flight in flights])
    # What is left are steps of 10 ms with mean rotor speeds where the flight had finer ones.
    assert (errors(model, flights).sums < 0.004 * stays.sums).all()


def test_with_noise_the_true_model_is_off_by_the_noise(measured):
    found = errors(truth(), measured)
    sizes = np.array([MIDDLING.position, MIDDLING.velocity, MIDDLING.attitude, MIDDLING.rate])
    assert found.mae[0] == pytest.approx(DIFFERENCE * sizes, rel=0.06)
    # The wrong rate at the start, damped, has turned the body after half a second; rotor noise adds a little.
    assert DIFFERENCE * MIDDLING.rate < 2 * found.mae[49, RATE] < 8 * DIFFERENCE * MIDDLING.rate


def test_the_stated_vehicle_does_not_explain_the_flights(measured):
    assert errors(VehicleModel(vehicle=STATED), measured).sums[RATE] > 20 * errors(truth(), measured).sums[RATE]


@pytest.mark.parametrize("time_constant", [0.0, 0.05])
def test_noise_has_its_size_and_its_colour(clean, time_constant):
    noise = replace(MIDDLING, time_constant_s=time_constant)
    logged = flown(truth(), duration_s=8.0, seed=3, noise=noise)
    rate = np.concatenate([a.motion.rate - b.motion.rate for a, b in zip(logged, clean, strict=True)])
    turned = [
        (Rotation.from_matrix(b.motion.rotation).inv() * Rotation.from_matrix(a.motion.rotation)).as_rotvec()
        for a, b in zip(logged, clean, strict=True)
    ]
    speed = np.concatenate([a.speed - b.speed for a, b in zip(logged, clean, strict=True)])
    assert rate.std() == pytest.approx(noise.rate, rel=0.1)
    assert np.concatenate(turned).std() == pytest.approx(noise.attitude, rel=0.1)
    assert speed.std() == pytest.approx(noise.speed, rel=0.1)
    following = np.mean(rate[1:] * rate[:-1]) / rate.var()
    assert following == pytest.approx(np.exp(-0.01 / time_constant) if time_constant else 0.0, abs=0.05)


def test_a_flight_follows_from_its_seed(measured):
    again = flown(truth(), duration_s=8.0, seed=3, noise=MIDDLING)
    other = flown(truth(), duration_s=8.0, seed=4, noise=MIDDLING)
    for first, second, third in zip(measured, again, other, strict=True):
        assert np.array_equal(first.motion.rate, second.motion.rate)
        assert np.array_equal(first.speed, second.speed)
        assert not np.array_equal(first.speed, third.speed)


def test_flights_excite_all_axes_and_stay_in_the_air_that_a_vehicle_can_fly(clean):
    assert [flight.name.partition("-")[0] for flight in clean] == list(KINDS)
    for flight in clean:
        assert (flight.motion.rate.std(axis=0) > 0.1).all()
        assert np.abs(flight.motion.velocity).max() < 15.0
        assert flight.motion.rotation[:, 2, 2].min() > 0.3


def test_a_log_of_250_hz():
    model = truth()
    flights = flown(model, ("multisine",), duration_s=2.0, rate_hz=250.0)
    assert (len(flights[0]), flights[0].motion.period) == (500, 0.004)
    assert errors(model, flights).mae[0, RATE] < 2e-3
