"""Sentences on effects as they were found."""

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.naming.estimate import _on_bounds, effect_sentence, estimates_of
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings
from tests.builders.gap_flights import candidate, fly, weak


def result(name, vehicle=None, **values):
    numbers = [Estimate(key, "1", v, v - e, v + e, (-1.0, 1.0)) for key, (v, e) in values.items()]
    sentence = effect_sentence(CATALOGUE[name], numbers, vehicle or VehicleSettings())
    assert sentence.startswith(CATALOGUE[name].sentence)
    return sentence.removeprefix(CATALOGUE[name].sentence).strip()


def test_weak_rotor_or_strong_opposite():
    said = result("rotor_mismatch", difference_1=(-0.05, 0.01), difference_2=(0.001, 0.01))
    assert said == "M1 pulls 5 % less than modelled, or M3 as much more."
    said = result("rotor_mismatch", difference_1=(0.05, 0.01), difference_2=(-0.12, 0.01))
    assert "M3 pulls 5 % less than modelled, or M1 as much more." in said
    assert "M2 pulls 12 % less than modelled, or M4 as much more." in said


def test_nothing_sure_says_nothing_more():
    assert result("rotor_mismatch", difference_1=(0.01, 0.02), difference_2=(-0.01, 0.02)) == ""
    assert result("vertical_descent", f_1=(0.01, 0.02)) == ""


def test_vehicle_without_opposite_pairs_names_the_weakest_rotor():
    angles = 2 * np.pi * np.arange(6) / 6
    hubs = [(0.3 * float(np.cos(a)), 0.3 * float(np.sin(a)), 0.0) for a in angles]
    vehicle = VehicleSettings(rotors=tuple(RotorSettings(position_m=h, spin=(-1) ** n) for n, h in enumerate(hubs)))
    said = result("rotor_mismatch", vehicle, difference_1=(-0.1, 0.01), difference_3=(-0.1, 0.01))
    assert said == "If one rotor alone differs: M1 pulls 15 % less than modelled."


@pytest.mark.parametrize(
    ("knots", "words"),
    [
        ({"f_0_5": (-0.05, 0.01), "f_1_25": (-0.31, 0.02)}, "vortex ring: 31 % less thrust at 1.25 times"),
        ({"f_2": (0.2, 0.02), "f_2_5": (0.1, 0.01)}, "turbulent wake: 20 % more thrust at 2 times"),
        ({"f_2_5": (0.4, 0.1)}, "windmill brake: 40 % more thrust at 2.5 times"),
    ],
)
def test_state_of_descent(knots, words):
    assert words in result("vertical_descent", **knots)


def test_too_little_thrust_may_be_more_mass():
    vehicle = VehicleSettings(mass_kg=0.0397)
    said = result("parameter_error", vehicle, thrust_scale=(-0.1059, 0.001))
    assert said == "A mass of 0.0444 kg instead, +0.0047 kg, would do the same."
    assert result("parameter_error", vehicle, inertia_x=(0.2, 0.01)) == ""
    assert result("parameter_error", vehicle, thrust_scale=(-1.5, 0.01)) == ""


def test_what_cannot_be_below_zero_has_no_interval_there():
    known = system([weak(fly(1))], [candidate("payload", length_m=0.52, damping_1_s=0.1, depth_m=0.01)])
    values = np.concatenate([np.zeros(known.base.shape[2]), known.shape_values])
    left_out = values + 0.01 * np.random.default_rng(1).standard_normal((20, len(values)))
    (numbers,) = estimates_of(known, values, left_out).effects
    hook, aside, *_, depth = numbers
    assert (hook.low, depth.low) == (0.0, 0.0)
    assert aside.low < 0.0
    assert depth.value == 0.01 < depth.high


def test_other_effects_keep_their_sentence():
    assert result("com_offset", c_x=(0.01, 0.001)) == ""


@pytest.mark.parametrize(("low", "listed"), [(0.01, True), (0.0, False), (-0.01, False)])
def test_what_may_be_0_is_not_surely_on_its_bound(low, listed):
    """Also where its interval ends at 0, below which it cannot be."""
    number = Estimate("k_d", "1", 0.05, low, 0.06, (0.0, 0.05))
    assert _on_bounds([number]) == ({number: 0.05} if listed else {})
