"""The search finds what was put into flights, stops, exchanges a poor choice, and knows what chance can do."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import gumbel_r

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.refine import fit, refined
from cpfls_cli.gap.naming.ranking import RankedStep, rank_effects
from cpfls_cli.gap.naming.search import acceptable, forward_selection, grown_elsewhere
from cpfls_cli.gap.settings import GapSettings
from tests.builders.gap_flights import candidate, fly, weak

SETTINGS = GapSettings(shifts=99)
TRIED = [
    CATALOGUE[name]
    for name in (
        "com_offset",
        "torque_bias",
        "linear_damping",
        "rotor_mismatch",
        "rotor_tilt",
        "products_of_inertia",
        "rotor_drag",
    )
]


def flights(*effects, seeds=(1, 2), **given):
    return [weak(fly(seed, effects, gyro=0.005, rotor=1.0, **given)) for seed in seeds]


def names(chosen):
    return [found.effect.name for found in chosen]


@pytest.mark.parametrize(
    ("name", "coefficients"),
    [
        ("com_offset", [0.004, -0.003]),
        ("linear_damping", [0.1, 0.1, 0.05]),
        ("products_of_inertia", [0.03, 0.0, 0.02]),
        ("rotor_drag", [1.5e-3]),
        ("rotor_mismatch", [0.05, -0.03, 0.02, 0.0, 0.0, 0.0]),
        # A single rotor: M1 leans by a degree, as its arm is twisted, and half of that outwards.
        ("rotor_tilt", [0.0044, 0.0175, 0.0087, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    ],
)
def test_forward_finds_one_effect_and_stops(name, coefficients):
    looks = []
    chosen, steps = forward_selection(
        flights((candidate(name), coefficients)), TRIED, SETTINGS, np.random.default_rng(0), looks.append
    )
    assert names(chosen) == [name]
    assert looks == [1, 2]
    assert steps[0].p_value(steps[0].ranking[0].gain) <= 0.01
    assert not acceptable(steps[-1], SETTINGS)
    assert steps[-1].above_floor < 0.02 * steps[0].above_floor


def test_two_effects_are_both_found():
    truth = [(candidate("com_offset"), [0.004, 0.0]), (candidate("linear_damping"), [0.1, 0.1, 0.05])]
    chosen, _ = forward_selection(flights(*truth), TRIED, SETTINGS, np.random.default_rng(0))
    assert sorted(names(chosen)) == ["com_offset", "linear_damping"]


def test_noise_alone_has_no_name():
    named = 0
    for seed in range(5):
        known = flights(seeds=(10 + 2 * seed, 11 + 2 * seed), seconds=16.0, tilt=0.1)
        named += len(forward_selection(known, TRIED, SETTINGS, np.random.default_rng(seed))[0])
    assert named == 0


def test_as_many_effects_as_the_settings_allow():
    truth = [(candidate("com_offset"), [0.004, 0.0]), (candidate("linear_damping"), [0.1, 0.1, 0.05])]
    chosen, steps = forward_selection(
        flights(*truth), TRIED, replace(SETTINGS, effects_max=1), np.random.default_rng(0)
    )
    assert (len(chosen), len(steps)) == (1, 2)


def test_a_poor_choice_is_replaced_by_what_serves_better():
    known = flights((candidate("com_offset"), [0.004, -0.003]), (candidate("linear_damping"), [0.1, 0.1, 0.05]))
    step = rank_effects(known, [candidate("torque_bias"), candidate("linear_damping")], TRIED, SETTINGS, None)
    (better,) = grown_elsewhere([[candidate("com_offset")]], step, TRIED, SETTINGS)
    assert sorted(names(better.chosen)) == ["com_offset", "linear_damping"]


def test_what_took_up_two_effects_makes_room_for_the_simpler_one():
    """Tilted rotors push aside as an askew autopilot does, and turn the vehicle as an offset does."""
    known = flights((candidate("com_offset"), [0.001, -0.0005]), (candidate("mounting"), [-0.01, 0.03, 0.03]))
    chosen, steps = forward_selection(known, [*TRIED, CATALOGUE["mounting"]], SETTINGS, np.random.default_rng(0))
    assert names(steps[1].hypothesis.chosen) == ["rotor_tilt"]
    assert sorted(names(chosen)) == ["com_offset", "mounting"]


def test_what_others_explain_is_left_out_and_nothing_takes_its_place():
    tilt = [0.0044, 0.0175, 0.0087, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    known = flights((candidate("com_offset"), [0.004, -0.003]), (candidate("rotor_tilt"), tilt))
    chosen, _ = forward_selection(known, TRIED, SETTINGS, np.random.default_rng(0))
    assert sorted(names(chosen)) == ["com_offset", "rotor_tilt"]


def test_what_is_chosen_is_not_looked_at_again_and_each_effect_is_listed_once():
    known = flights((candidate("com_offset"), [0.004, -0.003]))
    step = rank_effects(known, [candidate("com_offset")], [*TRIED, CATALOGUE["channel_delay"]], SETTINGS, None)
    listed = names([scored.candidate for scored in step.ranking])
    assert sorted(listed) == sorted([*(effect.name for effect in TRIED[1:]), "channel_delay"])
    gains = [scored.gain for scored in step.ranking]
    assert gains == sorted(gains, reverse=True)


def step_of(chance):
    return RankedStep(system([]), np.ones(6), (), chance, 1.0, np.zeros(0, dtype=int))


def test_p_value_is_the_share_of_shifts_that_do_as_well():
    step = step_of(np.arange(99.0))
    assert step.p_value(49.0) == pytest.approx(51 / 100)
    assert step.p_value(90.0) == pytest.approx(10 / 100)
    assert step.p_value(-np.inf) == 1.0


def test_p_value_beyond_all_shifts_is_the_tail_of_extreme_values():
    """What one in two thousand draws reaches, from ninety-nine of them."""
    law = gumbel_r(5.0, 2.0)
    found = [
        step_of(law.rvs(99, random_state=np.random.default_rng(seed))).p_value(law.isf(5e-4)) for seed in range(200)
    ]
    assert np.median(found) == pytest.approx(5e-4, rel=0.5)
    assert max(found) <= 0.02
    rising = [step_of(law.rvs(99, random_state=0)).p_value(gain) for gain in np.linspace(0, 40, 200)]
    assert (np.diff(rising) <= 0).all()


def commanded(seed, lag, delay):
    """Logs the command of rotors that follow it late: u(t) = w(t + d) + tau w'(t + d), with w by inverse dynamics."""
    signals = fly(seed, gyro=0.002, seconds=30.0)
    time, speed = signals.time, signals.speed
    command = speed + lag * np.gradient(speed, time, axis=0)
    early = np.column_stack([np.interp(time + delay, time, channel) for channel in command.T])
    return weak(replace(signals, rotor_speed=early, commanded=True))


@pytest.mark.parametrize(("lag", "delay"), [(0.05, 0.02), (0.03, 0.04)])
def test_lag_and_delay_come_back_together(lag, delay):
    known = [commanded(seed, lag, delay) for seed in (1, 2)]
    start = [candidate("motor_lag", time_constant_s=0.065), candidate("command_delay", delay_s=0.012)]
    shapes = [found.shape for found in refined(known, start, np.ones(6)).chosen]
    assert shapes[0]["time_constant_s"] == pytest.approx(lag, abs=0.004)
    assert shapes[1]["delay_s"] == pytest.approx(delay, abs=0.004)


def test_one_shape_is_refined_between_the_points_of_its_grid():
    known = [commanded(1, 0.0445, 0.0)]
    (found,) = refined(known, [candidate("motor_lag", time_constant_s=0.05)], np.ones(6)).chosen
    assert found.shape["time_constant_s"] == pytest.approx(0.0445, abs=0.0015)


def test_a_load_that_swings_all_flight_long_is_found_in_its_narrow_valley():
    """A cable 2 % longer is out of step at the end; the best of the coarse grid lies in another valley."""
    hidden = {"length_m": 2.14, "damping_1_s": 0.06, "depth_m": 0.1}
    effect = (candidate("payload", **hidden), [0.04, 0.0, 0.0, 0.4])
    known = [weak(fly(2, [effect], gyro=5e-4, seconds=30.0, speed=1.0))]
    (found,) = refined(known, [candidate("payload", length_m=1.9, damping_1_s=0.2, depth_m=0.0)], np.ones(6)).chosen
    assert found.shape["length_m"] == pytest.approx(hidden["length_m"], rel=0.01)
    assert found.shape["damping_1_s"] == pytest.approx(hidden["damping_1_s"], abs=0.01)


def test_noise_deepens_no_hook_whose_torque_says_where_it_is():
    hidden = {"length_m": 0.52, "damping_1_s": 0.1, "depth_m": 0.02}
    effect, known = (candidate("payload", **hidden), [0.012, 0.0, 0.0, 0.6]), []
    for seed in (1, 2, 3):
        flown = fly(seed, [effect], gyro=0.02, rotor=1.0, seconds=30.0, speed=1.0)
        noise = 0.05 * np.random.default_rng(seed).standard_normal(flown.velocity.shape)
        known.append(weak(replace(flown, velocity=flown.velocity + noise), force=True))
    found = refined(known, [candidate("payload", length_m=0.53, damping_1_s=0.2, depth_m=0.0)], np.ones(6))
    ((_, place),) = found.places[1:]
    depth, *_, mass = fit(found, np.ones(6))[place]
    assert mass == pytest.approx(0.6, rel=0.05)
    assert found.chosen[0].shape["depth_m"] == pytest.approx(depth / mass, rel=0.02)
    assert found.chosen[0].shape["length_m"] == pytest.approx(hidden["length_m"], rel=0.01)


def test_where_numbers_of_the_vehicle_alone_are_named_there_is_nothing_to_refine():
    known = flights()
    unrefined = system(known)
    found = refined(known, [], np.ones(6))
    assert list(found.chosen) == []
    np.testing.assert_array_equal(found.residual, unrefined.residual)
