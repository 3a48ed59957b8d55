"""Estimates of effects: least squares with noisy columns, bounds, how explanations are compared, and what is said."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import permutation_test, wilcoxon

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.refine import Equations, least_squares
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.naming.causes import judge_effects
from cpfls_cli.gap.naming.estimate import effect_sentence, ends_on_bound, estimates_of, fitted, may_be_another, on_bound
from cpfls_cli.gap.naming.ranking import chance_of_ranks, likely, off_by, within_bounds
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings
from tests.builders.gap_flights import VEHICLE, candidate, fly, weak

DAMPING, OFFSET, WIND = (CATALOGUE[name] for name in ("linear_damping", "com_offset", "wind"))
SURE = np.full(3, 1e-6)


def result(name, vehicle=None, **values):
    numbers = [Estimate(key, "1", v, v - e, v + e, (-1.0, 1.0)) for key, (v, e) in values.items()]
    sentence = effect_sentence(CATALOGUE[name], numbers, vehicle or VehicleSettings())
    assert sentence.startswith(CATALOGUE[name].sentence)
    return sentence.removeprefix(CATALOGUE[name].sentence).strip()


def test_a_weak_rotor_or_its_strong_opposite_is_said_where_it_is_sure():
    said = result("rotor_mismatch", difference_1=(-0.05, 0.01), difference_2=(0.001, 0.01))
    assert said == "M1 pulls 5 % less than modelled, or M3 as much more."
    said = result("rotor_mismatch", difference_1=(0.05, 0.01), difference_2=(-0.12, 0.01))
    assert "M3 pulls 5 % less than modelled, or M1 as much more." in said
    assert "M2 pulls 12 % less than modelled, or M4 as much more." in said
    assert result("rotor_mismatch", difference_1=(0.01, 0.02), difference_2=(-0.01, 0.02)) == ""
    assert result("vertical_descent", f_1=(0.01, 0.02)) == ""
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
    estimates = SimpleNamespace(
        effects=((Estimate("k_d", "1", 0.05, low, 0.06, (0.0, 0.05)),),), of_effect=(np.array([0.05]),)
    )
    hypothesis = SimpleNamespace(chosen=((CATALOGUE["rotor_drag"], {}),))
    refusal = ends_on_bound(SimpleNamespace(hypothesis=hypothesis, estimates=estimates))
    assert (refusal is not None) == listed
    assert not listed or refusal.sentence.endswith("its k_d sits on the bound of what is possible, 0.05 1")


@pytest.mark.parametrize(("sideways", "error", "refused"), [(1.5, 0.8, True), (1.5, 0.0, True), (0.6, 0.15, False)])
def test_a_curve_over_descent_that_sideways_speed_may_not_end_is_no_name(sideways, error, refused):
    """It is one over axial speed then, which the formula of an inflow may be off by."""
    descent, vehicle = CATALOGUE["vertical_descent"], VehicleSettings()
    numbers = {each.name: (0.2, 0.05) for each in descent.coefficients} | {"sideways": (sideways, error)}
    known = tuple(
        Estimate(each.name, each.unit, value, value - error, value + error, each.bounds(vehicle))
        for each, (value, error) in zip(descent.numbers, numbers.values(), strict=True)
    )
    found = SimpleNamespace(
        hypothesis=SimpleNamespace(chosen=((descent, {"sideways": sideways}),)),
        estimates=SimpleNamespace(effects=(known,)),
    )
    refusal = on_bound(found)
    assert (refusal is not None) == refused
    if refusal is not None:
        assert not refusal.in_the_way
        assert refusal.sentence.endswith("not named: sideways may be at the bounds of what is possible")


@pytest.mark.parametrize(("east", "north", "refused"), [(0.05, -0.1, True), (0.05, 0.4, False)])
def test_a_wind_that_may_not_blow_is_rotor_drag(east, north, refused):
    numbers = {"k_d": (1e-4, 1e-5), "W_x": (east, 0.2), "W_y": (north, 0.2)}
    of_wind = tuple(Estimate(name, "1", v, v - e, v + e, (-15.0, 15.0)) for name, (v, e) in numbers.items())
    damping = (Estimate("d_x", "1", 0.0, -1.0, 1.0, (0.0, 2.0)),)
    chosen, effects = ((DAMPING, {}), (WIND, {})), (damping, of_wind)
    found = SimpleNamespace(hypothesis=SimpleNamespace(chosen=chosen), estimates=SimpleNamespace(effects=effects))
    refusal = may_be_another(found)
    assert (refusal is not None) == refused
    if refusal is not None:
        assert (refusal.name, refusal.in_the_way) == ("wind", True)
        assert refusal.sentence.endswith("not named: W_x and W_y may all be 0, where it is rotor drag (H-force)")


@pytest.mark.parametrize("blocks", [1, 2, 7, 40])
@pytest.mark.parametrize("mean", [-0.5, 0.0, 0.5])
def test_the_chance_of_ranks_is_that_of_scipy(blocks, mean):
    margin = np.random.default_rng(blocks).standard_normal(blocks) + mean
    expected = wilcoxon(margin, alternative="greater", method="exact").pvalue
    assert chance_of_ranks(np.append(margin, 0.0)) == pytest.approx(expected, rel=1e-12)


def test_equal_margins_share_their_ranks_and_are_chance():
    margin = np.array([1.0, -1.0, 2.0, 2.0, 2.0, -0.5, 3.0, 1.0])
    ranks = np.array([3.0, 3.0, 6.0, 6.0, 6.0, 1.0, 8.0, 3.0]) * np.sign(margin)
    above = lambda each: each[each > 0].sum()  # noqa: E731
    exact = permutation_test((ranks,), above, permutation_type="samples", alternative="greater")
    assert chance_of_ranks(margin) == pytest.approx(exact.pvalue, rel=1e-12)
    assert chance_of_ranks(np.zeros(4)) == 1.0


@pytest.mark.parametrize(
    ("explained", "left", "above", "off"),
    [(1e3, 600.0, 0.0, 10.0), (1e6, 600.0, 0.0, 25.0), (1e6, 1200.0, 600.0, 650.0), (1e4, 1200.0, 600.0, 100.0)],
    ids=["a tenth of a small gap", "what the floor hides", "what is left above it", "a tenth is the most"],
)
def test_formulas_are_off_by_what_is_left_above_the_floor_and_a_tenth_at_most(explained, left, above, off):
    assert off_by(explained, left, above) == pytest.approx(off)


def test_a_set_alone_is_certain_two_that_predict_alike_are_not_and_even_odds_multiply():
    assert (likely([]).tolist(), likely([np.zeros(12), np.zeros(12)])) == ([1.0], pytest.approx([1 / 3] * 3))
    # How far blocks differ is not known of one.
    assert likely([np.array([5.0])]) == pytest.approx([0.5, 0.5])
    # Where all blocks say the same their weights do not matter: Bayes' rule remains.
    assert likely([np.full(12, each / 12) for each in np.log([1 / 4, 1 / 19])]) == pytest.approx(
        [1 / 1.302632, 0.25 / 1.302632, 0.052632 / 1.302632], abs=1e-5
    )


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_one_block_makes_nothing_certain(sign):
    """However much it says: were it left out, nothing would be known."""
    (own, other) = likely([np.r_[sign * 40.0, np.zeros(11)]])
    assert 0.005 < min(own, other) < 0.1
    assert (other > own) == (sign > 0)


def test_a_refused_sign_takes_out_one_coefficient_only():
    keep, admissible = within_bounds(DAMPING, np.array([0.1, -0.2, 0.3]), SURE, VEHICLE)
    assert keep.tolist() == [True, False, True]
    assert admissible


@pytest.mark.parametrize(("length", "admissible"), [(0.10, True), (0.13, False), (-0.13, False)])
def test_a_centre_of_mass_lies_inside_four_tenths_of_the_arm(length, admissible):
    keep, found = within_bounds(OFFSET, np.array([length, 0.0]), SURE[:2], VEHICLE)
    assert found == admissible
    assert keep.all()


def test_a_damping_beyond_all_bodies_is_refused_and_one_that_is_open_is_not():
    far = np.array([0.15, 0.0])
    assert within_bounds(OFFSET, far, np.array([0.02, 0.02]), VEHICLE)[1]
    assert not within_bounds(OFFSET, far, np.array([0.01, 0.02]), VEHICLE)[1]
    assert within_bounds(DAMPING, np.array([1.7, 0.0, 0.0]), SURE, VEHICLE)[1]
    assert not within_bounds(DAMPING, np.array([1.9, 0.0, 0.0]), SURE, VEHICLE)[1]


@pytest.mark.parametrize(
    ("drag", "wind", "error", "admissible"),
    [(1.3e-3, 8.0, 1e-9, True), (1.3e-3, 20.0, 1e-9, False), (1.3e-3, 20.0, 5e-3, True), (-1.3e-3, 8.0, 1e-9, False)],
    ids=["usual", "storm", "storm not sure", "drag that pushes"],
)
def test_wind_is_bounded_by_its_speed_not_by_its_column(drag, wind, error, admissible):
    keep, found = within_bounds(WIND, np.array([drag, drag * wind, 0.0]), np.full(3, error), VEHICLE)
    assert keep.all()
    assert found == admissible


RNG = np.random.default_rng(8)
ROWS = 4000
TIME = np.linspace(0.0, 1.0, ROWS)
CLEAN = np.column_stack([np.sin(20 * TIME), np.cos(33 * TIME), np.sin(20 * TIME + 0.4), np.zeros(ROWS)])
TRUE = np.array([1.0, -2.0, 0.5, 0.0])
MIXING = np.array([[0.3, 0.0, 0.1, 0.0], [0.0, 0.2, 0.2, 0.0]])


def drawn(size, right=0.0, rng=RNG):
    """Columns with correlated noise, a right side that shares some of it, and noise like both drawn again."""

    def noise():
        own = size * rng.standard_normal((ROWS, 2))
        return np.column_stack([own @ MIXING, right * own[:, 0]])

    met = noise()
    return Equations(CLEAN + met[:, :-1], CLEAN @ TRUE + met[:, -1] + 0.01 * rng.standard_normal(ROWS), noise())


def test_noise_is_taken_off_the_normal_equations_of_least_squares():
    rows = drawn(0.0)
    plain = np.linalg.lstsq(rows.columns[:, :3], rows.right, rcond=None)[0]
    assert (rows.solve(), rows.trusted) == (pytest.approx([*plain, 0.0], rel=1e-9, abs=1e-12), 1.0)
    rows = drawn(0.6, right=0.4)
    noise, own = rows.noise[:, :3], rows.noise[:, -1]
    gram = rows.columns[:, :3].T @ rows.columns[:, :3] - noise.T @ noise
    moment = rows.columns[:, :3].T @ rows.right - noise.T @ own
    assert (rows.trusted, rows.solve()[:3]) == (1.0, pytest.approx(np.linalg.solve(gram, moment), rel=1e-8))


def test_numbers_that_noise_shrinks_come_out_as_they_are():
    """Against 200 draws: the mean is the truth to three of its standard errors, that of least squares is not."""
    rng = np.random.default_rng(3)
    drawn_rows = [drawn(0.8, right=0.4, rng=rng) for _ in range(200)]
    found = np.array([rows.solve()[:3] for rows in drawn_rows])
    plain = np.array([np.linalg.lstsq(rows.columns[:, :3], rows.right, rcond=None)[0] for rows in drawn_rows])
    error = found.std(axis=0) / np.sqrt(len(found))
    assert np.all(np.abs(found.mean(axis=0) - TRUE[:3]) < 3 * error)
    assert np.abs(plain.mean(axis=0) - TRUE[:3]).max() > 0.1


def test_no_more_than_half_of_any_combination_is_taken_for_noise():
    """The difference of the first and the third column is mostly noise."""
    rows = drawn(5.0)
    assert 0.0 < rows.trusted < 1.0
    columns, _ = rows.root
    assert np.linalg.eigvals(
        np.linalg.solve(rows.columns[:, :3].T @ rows.columns[:, :3], (columns.T @ columns)[:3, :3])
    ).real.min() == pytest.approx(0.5, rel=1e-6)


def test_about_a_solution_nothing_is_left_to_do():
    rows = drawn(0.6, right=0.4)
    there = rows.around(rows.solve(), np.array([True, True, True, False]), np.zeros((ROWS, 4)))
    assert there.solve() == pytest.approx(np.zeros(3), abs=1e-9)


def test_a_column_that_shows_nothing_gets_0_and_not_its_rounding():
    rng = np.random.default_rng(1)
    matrix = rng.standard_normal((400, 12)) * 10.0 ** rng.integers(-6, 6, 12)
    matrix[:, [3, 8]] = 0.0
    assert least_squares(matrix, matrix @ np.ones(12) + rng.standard_normal(400))[[3, 8]].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(("offset", "rivals"), [((0.0, 0.0), ["flapping_moment"]), ((0.01, 0.0), [])])
def test_a_height_of_the_centre_of_mass_alone_may_be_a_moment_of_flapping(offset, rivals):
    """Both follow the drag of the rotors."""
    drag, plain, exact = candidate("rotor_drag"), candidate("com_offset"), Candidate(OFFSET.exact, {})
    flown = [(drag, [2e-4]), (candidate("flapping_moment"), [6e-6]), (plain, offset)]
    flights = [weak(fly(seed, flown, gyro=1e-4)) for seed in (1, 2)]
    settings = GapSettings()
    found = fitted(flights, [exact, drag], np.array([2e-3] * 3 + [2e-2] * 3), settings)
    judged, _ = judge_effects(found, [OFFSET, drag.effect], np.random.default_rng(1))
    height = judged.effect.numbers[2]
    assert 0 < height.low < 0.03 < height.high
    assert [each.name for each in judged.alternatives] == rivals
