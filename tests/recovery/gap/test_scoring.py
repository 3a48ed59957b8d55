"""What a look at the candidates says of signs and sizes that no vehicle has, and of what the flights leave open."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.effect import Coefficient, Columns, Shape
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.refine import fit
from cpfls_cli.gap.naming.ranking import block_index, candidates_of, rank_effects
from cpfls_cli.gap.settings import GapSettings
from tests.builders.gap_flights import candidate, fly, weak

SETTINGS = GapSettings()


def scored(flights, effect):
    (only,) = rank_effects(flights, (), [effect], SETTINGS, None).ranking
    return only


def flights(*effects, seeds=(1, 2)):
    return [weak(fly(seed, effects, gyro=0.003, rotor=0.5)) for seed in seeds]


def test_a_damping_that_drives_is_set_to_zero_and_the_others_stay():
    found = scored(flights((candidate("linear_damping"), [0.2, -0.1, 0.1])), CATALOGUE["linear_damping"])
    np.testing.assert_allclose(found.coefficients, [0.2, 0.0, 0.1], atol=0.02)
    assert found.gain > 1000


def test_an_effect_of_one_refused_sign_is_refused():
    assert scored(flights((candidate("rotor_drag"), [-1.5e-3])), CATALOGUE["rotor_drag"]).gain == -np.inf
    assert scored(flights((candidate("rotor_drag"), [1.5e-3])), CATALOGUE["rotor_drag"]).gain > 100


@pytest.mark.parametrize(("damping", "refused"), [(1.2, False), (2.4, True)])
def test_a_damping_of_more_than_any_body_has_is_refused(damping, refused):
    found = scored(flights((candidate("linear_damping"), [damping, 0.0, 0.0])), CATALOGUE["linear_damping"])
    assert (found.gain == -np.inf) == refused
    assert refused or found.coefficients[0] == pytest.approx(damping, rel=0.02)


def half_open(bound):
    """An offset of torque about x, and a number that these flights hardly show, held within bounds."""

    def columns(signals, _shape):
        direct = np.zeros((len(signals), 6, 2))
        direct[:, 0, 0] = 1.0
        direct[:, 1, 1] = 1e-4 * np.sin(9.0 * signals.time)
        return Columns(direct)

    model = CATALOGUE["torque_bias"]
    coefficients = (Coefficient("M_x", "N m", -1.0, 1.0, "torque"), Coefficient("open", "1", *bound, "hardly seen"))
    return replace(model, name="half_open", coefficients=coefficients, columns=columns)


def test_an_open_coefficient_beyond_its_bounds_is_no_reason_to_refuse():
    known = flights((candidate("torque_bias"), [0.3, 0.0, 0.0]))
    # Least squares alone would put it at some hundred times its bound.
    found = scored(known, half_open((-0.5, 0.5)))
    assert found.coefficients[0] == pytest.approx(0.3, rel=0.01)
    assert found.gain > 100


def test_gain_is_what_fits_without_each_block_take_off_it():
    """The whole of it by hand: least squares on the other blocks with and without the effect."""
    known = flights((candidate("com_offset"), [0.01, 0.0]))
    hypothesis = system(known)
    step = rank_effects(known, (), [CATALOGUE["com_offset"]], SETTINGS, None)
    block = block_index(hypothesis, SETTINGS)
    columns = hypothesis.columns(candidate("com_offset"))
    right = hypothesis.residual / step.floor

    def error(base):
        total = 0.0
        flat = base / step.floor[:, None]
        length = np.sqrt((flat**2).sum(axis=(0, 1)))
        flat = flat[..., length > 0] / length[length > 0]
        for b in range(block.max() + 1):
            seen = block != b
            own = np.linalg.lstsq(flat[seen].reshape(-1, flat.shape[2]), right[seen].reshape(-1), rcond=None)[0]
            total += ((right[~seen] - flat[~seen] @ own) ** 2).sum()
        return total

    before, after = error(hypothesis.base), error(np.concatenate([hypothesis.base, columns], axis=2))
    assert step.ranking[0].gain == pytest.approx(before - after, rel=1e-4)
    assert step.ranking[0].block_error.sum() == pytest.approx(after, rel=1e-3)


def test_candidates_are_all_points_of_the_grids_that_are_tried():
    shapes = (Shape("a", "1", (1.0, 2.0, 3.0), "a"), Shape("b", "1", (0.0, 5.0), "b", first=0.0))
    shaped = replace(CATALOGUE["torque_bias"], shapes=(*shapes, Shape("c", "1", (7.0, 8.0), "c")))
    listed = candidates_of([shaped, CATALOGUE["com_offset"]])
    points = [tuple(found.shape.values()) for found in listed]
    assert points == [(a, 0.0, c) for a in (1.0, 2.0, 3.0) for c in (7.0, 8.0)] + [()]


def test_fit_is_weighted_by_the_floors():
    """Two channels that contradict each other: the one with the smaller floor is believed."""
    hypothesis = system(flights((candidate("rotor_gyroscopic"), [1e-3])), [candidate("rotor_gyroscopic")])
    hypothesis.residual[:, 1] = 0.0
    small_first = fit(hypothesis, np.array([1e-3, 1.0, 1.0, 1.0, 1.0, 1.0]))[-1]
    small_second = fit(hypothesis, np.array([1.0, 1e-3, 1.0, 1.0, 1.0, 1.0]))[-1]
    assert small_first == pytest.approx(1e-3, rel=0.1)
    assert abs(small_second) < 1e-4
