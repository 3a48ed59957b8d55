"""Fits find the vehicle that flew: its numbers, its predictions, and the blocks that are there."""

import numpy as np
import pytest

from benchmarks.shared.playback_scores import free_runs, score
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.playback.fit import fit, windows_of
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


def fitted(vehicle, blocks, flights):
    windows = [own for flight in flights for own in windows_of([flight], 0.5, 0.6)]
    return fit(Structure(blocks).free(vehicle), windows, {}, 60, 3e-5)


def numbers(found):
    return {name: number.value for name, number in found.free.physical(found.values).items()}


def chosen(vehicle, flights, candidates, **asked):
    others = tuple(block for block in blocks_of(vehicle) if block not in candidates)
    settings = PlaybackSettings(leave_out=others, **asked)
    choice = choose(vehicle, flights, settings, lambda *_: None)
    return choice.chosen, settings


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
