"""Effects that look alike come back under their own names, or as rivals of each other, from a simulator of its own.

A body turns under torques that are sums of sines; what lies between command and rotors is the sines' own answer.
"""

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals, stretch_of
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.refine import refined
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.naming.estimate import fitted
from cpfls_cli.gap.naming.noisy_rate import with_noisy_rate
from cpfls_cli.gap.naming.ranking import best_floor, rank_effects
from cpfls_cli.gap.naming.search import alternatives, chance_given_actuation, forward_selection, in_place_of
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.rotations import cross
from cpfls_cli.vehicle.rotors import body_wrench, rotor_demand
from tests.builders.gap_flights import INERTIA, PERIOD, VEHICLE, candidate, fly, weak

SETTINGS = GapSettings(shifts=99)
SECONDS = 24.0
TIME = PERIOD * np.arange(round(SECONDS / PERIOD))
THRUST = np.full(len(TIME), VEHICLE.mass_kg * 9.81)
STILL = ("motor_lag", "command_delay", "notch_filter", "flexible_mount", "linear_damping", "products_of_inertia")
ALIKE = (
    "flapping_moment", "rotor_drag", "parasitic_drag", "translational_lift", "inflow", "com_offset", "torque_bias",
    "payload", "own_wake",
)  # fmt: skip


def found(flights, names):
    effects = [CATALOGUE[name] for name in names]
    return forward_selection(flights, effects, SETTINGS, np.random.default_rng(0))[0]


def shape_of(chosen, name):
    return next(each.shape for each in chosen if each.effect.name == name)


def names_of(chosen):
    return {each.effect.name for each in chosen}


class Waves:
    """Torques as sums of sines about all axes, and what a filter makes of them."""

    def __init__(self, seed, low=0.2, high=3.0):
        rng = np.random.default_rng(seed)
        self.turn = 2 * np.pi * rng.uniform(low, high, (12, 1))
        self.size = rng.normal(size=(12, 3)) * [0.3, 0.3, 0.1] + 1j * rng.normal(size=(12, 3)) * [0.3, 0.3, 0.1]

    def at(self, time, answer=lambda s: np.ones_like(s)):
        """Evaluate at times, shape (time, 3), with the gain of a filter at each frequency."""
        return (np.exp(1j * time[:, None] * self.turn.T) @ (answer(1j * self.turn) * self.size)).real


def turned(torques, share=0.0, natural=1.0, damping=0.0):
    """Integrate the rates of a body a share of whose inertia is on springs, by the classical Runge-Kutta method.

    Several flights at once, shape (flight, time, 3).
    """
    torque, moments = np.stack(torques, axis=1), np.diag(INERTIA)

    def rate(state, driven):
        turning, angle, swing = state
        stiff = (driven - cross(turning, turning @ INERTIA)) / moments
        spring = natural**2 * angle + 2 * damping * natural * swing
        spun = (stiff + share * spring) / (1 - share)
        return np.array([spun, swing, -spun - spring])

    state, rates = np.zeros((3, *torque.shape[1:])), []
    # Torques stand at every half step.
    for start in range(0, len(torque) - 2, 2):
        rates.append(state[0])
        first = rate(state, torque[start])
        second = rate(state + PERIOD / 2 * first, torque[start + 1])
        third = rate(state + PERIOD / 2 * second, torque[start + 1])
        fourth = rate(state + PERIOD * third, torque[start + 2])
        state = state + PERIOD / 6 * (first + 2 * second + 2 * third + fourth)
    return np.stack(rates, axis=1)


HALVES = np.arange(2 * len(TIME) + 1) * PERIOD / 2


def logged(rates, speed, seed, gyro=0.003, **known):
    rng = np.random.default_rng(100 + seed)
    return weak(
        Signals(
            time=TIME,
            vehicle=VEHICLE,
            body_rate=rates + gyro * rng.standard_normal(rates.shape),
            rotor_speed=speed + 0.5 * rng.standard_normal(speed.shape),
            **known,
        )
    )


def on_springs(seeds, gyro=0.003, **spring):
    waves = [Waves(seed) for seed in seeds]
    rates = turned([own.at(HALVES) for own in waves], **spring)
    return [
        logged(rate, rotor_demand(VEHICLE, THRUST, own.at(TIME)).speed, seed, gyro)
        for rate, own, seed in zip(rates, waves, seeds, strict=True)
    ]


def late(seeds, answer):
    """Log the commands of rotors that answer them by a filter, in speed."""
    waves = [Waves(seed) for seed in seeds]
    mix = rotor_demand(VEHICLE, THRUST[:1], np.zeros((1, 3))).speed[0]
    lever = np.array([[0, 1, -1], [-1, 0, 1], [0, -1, -1], [1, 0, 1]]) * 8.0

    rates = turned([body_wrench(VEHICLE, mix + own.at(HALVES, answer) @ lever.T).body_torque for own in waves])
    return [
        logged(rate, mix + own.at(TIME) @ lever.T, seed, commanded=True)
        for rate, own, seed in zip(rates, waves, seeds, strict=True)
    ]


def lag(s):
    return 1 / (1 + 0.05 * s)


def notch(s, width=0.7, natural=2 * np.pi * 4.0):
    return (s**2 + natural**2) / (s**2 + 2 * width * natural * s + natural**2)


def low_pass(s, damping=0.7, natural=2 * np.pi * 3.0):
    return natural**2 / (s**2 + 2 * damping * natural * s + natural**2)


def test_a_part_on_springs_is_named_with_its_frequency_and_share():
    chosen = found(on_springs((1, 2, 3), share=0.3, natural=2 * np.pi * 2.65, damping=0.1), STILL)
    assert names_of(chosen) == {"flexible_mount"}
    assert shape_of(chosen, "flexible_mount")["frequency_hz"] == pytest.approx(2.65, rel=0.02)
    assert shape_of(chosen, "flexible_mount")["damping"] == pytest.approx(0.1, rel=0.1)


def test_noise_of_the_gyroscope_takes_nothing_off_the_share_on_springs():
    """The column amplifies it at its own frequency, and least squares make its numbers too small."""
    flights = on_springs((4, 5, 6), 0.02, share=0.3, natural=2 * np.pi * 2.65, damping=0.1)
    own = candidate("flexible_mount", frequency_hz=2.65, damping=0.1)
    squares = fitted(flights, [own], best_floor(system(flights, [own])), SETTINGS)
    likely = with_noisy_rate(squares)
    small, right = ({each.name: each for each in found.estimates.effects[0]} for found in (squares, likely))
    truth = {"share_x": 0.3, "share_y": 0.3, "share_z": 0.3, "frequency_hz": 2.65, "damping": 0.1}
    assert small["share_z"].high < 0.3
    assert all(right[name].low <= value <= right[name].high for name, value in truth.items())
    assert abs(right["share_z"].value - 0.3) < 0.5 * abs(small["share_z"].value - 0.3)
    assert likely.hypothesis.shape_values == pytest.approx([right[name].value for name in ("frequency_hz", "damping")])


def test_a_short_flight_takes_nothing_from_long_ones_and_gives_no_numbers_alone():
    whole = on_springs((4, 5, 6), share=0.3, natural=2 * np.pi * 2.65, damping=0.1)
    short = weak(stretch_of(whole[2].signals, slice(0, round(2.0 / PERIOD))))
    own = candidate("flexible_mount", frequency_hz=2.65, damping=0.1)

    def squares(flights):
        return fitted(flights, [own], best_floor(system(flights, [own])), SETTINGS)

    likely = {each.name: each for each in with_noisy_rate(squares([*whole[:2], short])).estimates.effects[0]}
    assert likely["frequency_hz"].value == pytest.approx(2.65, rel=0.02)
    assert all(likely[name].value == pytest.approx(0.3, abs=0.05) for name in ("share_x", "share_y", "share_z"))
    alone = squares([weak(stretch_of(whole[0].signals, slice(0, round(12.0 / PERIOD))))])
    assert with_noisy_rate(alone) is alone


def test_a_stiff_body_has_no_springs():
    assert not found(on_springs((1, 2)), STILL)


def test_a_notch_is_named_and_lag_and_delay_next_to_it_are_rivals():
    """Of lag and delay next to a notch the width of the notch takes what shows them apart."""
    flights = late((1, 2), lambda s: lag(s) * notch(s))
    chosen = found(flights, STILL)
    (beside,) = names_of(chosen) - {"notch_filter"}
    assert beside in ("motor_lag", "command_delay")
    assert shape_of(chosen, "notch_filter")["frequency_hz"] == pytest.approx(4.0, rel=0.1)
    assert {"motor_lag", "command_delay"} - {beside} <= rivals_of(flights, chosen, beside)
    assert not rivals_of(flights, chosen, "notch_filter")


def rivals_of(flights, chosen, name):
    index = [each.effect.name for each in chosen].index(name)
    others = [each for each in chosen if each.effect.name != name]
    effects = [CATALOGUE[each] for each in STILL]
    step = rank_effects(flights, others, effects, SETTINGS, None, also=(chosen[index],))
    own, *ranking = in_place_of(chosen[index], step)
    assert own.candidate.effect.name == name
    return {rival.name for rival in alternatives(own, ranking, step.above_floor, SETTINGS)}


def test_a_lag_and_a_delay_are_no_notch_and_no_low_pass():
    flights = late((1, 2), lambda s: lag(s) * np.exp(-0.03 * s))
    chosen = found(flights, (*STILL, "low_pass_filter"))
    assert names_of(chosen) == {"motor_lag", "command_delay"}
    assert "notch_filter" not in rivals_of(flights, chosen, "command_delay")
    assert max(chances(flights, chosen)) < 1e-3


def test_a_low_pass_is_no_lag_and_delay():
    (chosen,) = found(late((1, 2), low_pass), (*STILL, "low_pass_filter"))
    assert chosen.effect.name == "low_pass_filter"
    assert chosen.shape == {"frequency_hz": pytest.approx(3.0, rel=0.05), "damping": pytest.approx(0.7, rel=0.05)}


def test_a_lag_with_a_short_delay_is_a_rival_as_the_pair_that_it_is():
    """Slow waves cannot tell it from a low-pass; neither lag nor delay would do alone."""
    flights = late((1, 2), lambda s: lag(s) * np.exp(-0.012 * s))
    low = Candidate(CATALOGUE["low_pass_filter"], {"frequency_hz": 6.0, "damping": 1.2})
    effects = [CATALOGUE[each] for each in (*STILL, "low_pass_filter")]
    step = rank_effects(flights, (), effects, SETTINGS, None, also=(low,))
    (moved,) = refined(flights, [low], step.floor).chosen
    own, *ranking = in_place_of(moved, step)
    pairs = {
        frozenset((rival.name, rival.jointly_with)) for rival in alternatives(own, ranking, step.above_floor, SETTINGS)
    }
    assert pairs == {frozenset(("motor_lag", "command_delay"))}


def test_a_notch_and_a_lag_are_no_low_pass_with_what_fills_in_next_to_it():
    flights = late((1, 2, 3, 4), lambda s: lag(s) * notch(s, 0.8, 2 * np.pi * 6.5))
    chosen = found(flights, (*STILL, "low_pass_filter"))
    assert names_of(chosen) == {"motor_lag", "notch_filter"}
    assert shape_of(chosen, "notch_filter")["frequency_hz"] == pytest.approx(6.5, rel=0.1)
    assert shape_of(chosen, "motor_lag")["time_constant_s"] == pytest.approx(0.05, rel=0.15)


def test_a_delay_that_is_not_there_is_chance_next_to_a_lag():
    flights = late((1, 2), lag)
    lagging = {"time_constant_s": 0.05}
    chosen = [Candidate(CATALOGUE["motor_lag"], lagging), Candidate(CATALOGUE["command_delay"], {"delay_s": 0.004})]
    of_lag, of_delay = chances(flights, chosen)
    assert of_lag < 1e-3
    assert of_delay > 0.1


def chances(flights, chosen):
    effects, together = [CATALOGUE[each] for each in STILL], system(flights, chosen)
    return [chance_given_actuation(together, index, effects, SETTINGS) for index in range(len(chosen))]


@pytest.mark.parametrize(
    ("name", "coefficients"),
    [
        ("own_wake", [0.05, 0.01, 0.01]),
        ("flapping_moment", [-4e-5]),
        ("flapping_moment", [4e-5]),
        ("translational_lift", [0.03]),
        ("com_offset", [0.004, -0.003]),
    ],
)
def test_the_own_wake_and_its_neighbours_are_named_rightly(name, coefficients):
    truth = (candidate(name), coefficients)
    flights = [weak(fly(seed, (truth,), gyro=0.005, rotor=1.0), force=True) for seed in (1, 2)]
    assert names_of(found(flights, ALIKE)) == {name}
