"""Commands whose thrust is no square of them are named as such, and are no wrong inertia; a wrong inertia is one."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.diagnose import diagnose
from cpfls_cli.gap.naming.ranking import rank_effects
from cpfls_cli.gap.settings import GapSettings
from tests.builders.gap_flights import VEHICLE, candidate, fly, weak

FEW = GapSettings(shifts=39)
HOVER = np.sqrt(VEHICLE.mass_kg * 9.81 / sum(rotor.thrust_factor_n_s2 for rotor in VEHICLE.rotors))


def commanded(seed, share=0.0, gyro=0.005, **given):
    """A log of the commands of rotors whose thrust is a square and, this share of it in hover, a line of them."""
    signals = fly(seed, gyro=gyro)
    ratio = (signals.rotor_speed / HOVER) ** 2
    command = HOVER * (-share + np.sqrt(share**2 + 4 * (1 - share) * ratio)) / (2 * (1 - share))
    assert (1 - share) * command**2 + share * HOVER * command == pytest.approx(signals.rotor_speed**2)
    force = signals.specific_force + 0.05 * np.random.default_rng(100 + seed).standard_normal((len(signals), 3))
    vehicle = replace(VEHICLE, **given)
    return replace(signals, rotor_speed=command, commanded=True, specific_force=force, vehicle=vehicle)


def named(**known):
    flights = [commanded(seed, **known) for seed in (1, 2, 3)]
    return diagnose(flights[:2], flights[2:], FEW, np.random.default_rng(1)).diagnosis


@pytest.mark.parametrize("share", [0.2, 0.5])
def test_a_curve_of_the_commands_is_no_wrong_inertia(share):
    found = named(share=share)
    assert (found.verdict, [each.name for each in found.effects]) == ("NAMED", ["thrust_slope"])
    (number,) = found.effects[0].numbers
    assert number.name == "linear"
    assert number.low < share < number.high
    assert number.value == pytest.approx(share, abs=0.02)


@pytest.mark.parametrize("heavier", [0.1, 0.4])
def test_next_to_a_wrong_mass_the_curve_leaves_the_inertia_as_it_is(heavier):
    """A vehicle that weighs less than stated hovers at another command, about which the curve has its share."""
    found = named(share=0.5, mass_kg=(1 + heavier) * VEHICLE.mass_kg)
    curve, wrong = found.effects
    assert (found.verdict, curve.name, wrong.name) == ("NAMED", "thrust_slope", "parameter_error")
    assert curve.coefficients["linear"].low < 0.5 < curve.coefficients["linear"].high
    assert [number.name for number in wrong.numbers] == ["thrust_scale"]
    assert wrong.numbers[0].low < heavier < wrong.numbers[0].high


def test_a_wrong_inertia_that_a_curve_makes_up_for_is_named():
    """Less steep thrust turns the vehicle less, and a smaller inertia more: neither shows as long as both are there."""
    moments = (*(0.75**-1 * each for each in VEHICLE.inertia_kg_m2[:2]), VEHICLE.inertia_kg_m2[2])
    found = named(share=0.5, inertia_kg_m2=moments)
    assert {each.name for each in found.effects} == {"thrust_slope", "parameter_error"}
    wrong = next(each for each in found.effects if each.name == "parameter_error")
    assert {number.name for number in wrong.numbers} == {"inertia_x", "inertia_y"}
    for number in wrong.numbers:
        assert number.value == pytest.approx(-0.25, abs=0.02)


def test_a_wrong_inertia_is_no_curve_of_the_commands():
    moments = tuple(1.25 * each for each in VEHICLE.inertia_kg_m2[:3])
    found = named(inertia_kg_m2=moments)
    assert [each.name for each in found.effects] == ["parameter_error"]
    assert found.effects[0].coefficients["inertia_x"].value == pytest.approx(-0.2, abs=0.02)


def test_a_square_is_named_nothing():
    assert named().verdict == "NO_GAP"


@pytest.mark.parametrize("share", [0.3, 0.5])
def test_next_to_a_curve_less_drag_with_less_inertia_explains_nothing(share):
    """It leaves less of the yaw torque, noise with it, and so it did where the curve was no part of that torque."""
    flights = [weak(commanded(seed, share, gyro=0.02), force=True) for seed in (1, 2)]
    curve, drag = candidate("thrust_slope", thrust_scale=0.0), CATALOGUE["drag_factor_error"]
    (best,) = rank_effects(flights, [curve], [drag], FEW, None).ranking
    assert best.gain < 1.0


def test_flights_of_which_one_has_measured_speeds_have_no_curve():
    """Where it cannot be judged it is not tried: it ended with an error of the flights held out."""
    flights = [commanded(seed, share=0.5) for seed in (1, 2, 3)]
    held = [replace(flights[2], commanded=False)]
    found = diagnose(flights[:2], held, FEW, np.random.default_rng(1)).diagnosis
    assert "thrust_slope" not in {each.name for each in (*found.effects, *found.closest)}
