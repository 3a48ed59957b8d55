"""Sentences on effects as they were found."""

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.naming.estimate import effect_sentence
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings


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
    assert result("rotor_mismatch", vehicle, difference_1=(-0.1, 0.01)).startswith("M1 pulls least")


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


def test_other_effects_keep_their_sentence():
    assert result("com_offset", c_x=(0.01, 0.001)) == ""
