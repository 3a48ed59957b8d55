"""Windows of the weak form, and resampling."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from scipy.interpolate import CubicSpline

from cpfls_cli.errors import InputError
from cpfls_cli.weak_form.windows import blocks_of, folds, windows

TIME = 3.0 + 0.01 * np.arange(500)
LOCAL = np.array(TIME - 5.5)
THROUGH = windows(0.01, 0.4, 0.5)
CUBIC = st.lists(st.floats(-5, 5, allow_subnormal=False), min_size=4, max_size=4)
WINDOWS, CHANNELS, COLUMNS, BLOCKS = 60, 6, 5, 4


@given(CUBIC)
def test_integration_by_parts_is_exact_on_cubics(coefficients):
    cubic = Polynomial(coefficients)
    by_parts, direct = THROUGH.derivative(cubic(LOCAL)), THROUGH.average(cubic.deriv()(LOCAL))
    size = np.abs(coefficients).max() * 20
    np.testing.assert_allclose(by_parts, direct, atol=2e-5 * size + 1e-300)


def test_slope_is_the_derivative_of_the_window():
    place = 0.01 * np.arange(len(THROUGH.weight))
    np.testing.assert_allclose(CubicSpline(place, THROUGH.weight)(place, 1)[3:-3], THROUGH.slope[3:-3], rtol=2e-3)
    assert (THROUGH.weight.sum(), THROUGH.slope.sum()) == (pytest.approx(1), pytest.approx(0, abs=1e-12))
    np.testing.assert_allclose(THROUGH.slope, -THROUGH.slope[::-1], atol=1e-12)


@pytest.mark.parametrize("samples", [8, 9, 40])
def test_the_derivative_of_time_is_1_however_few_samples_a_window_has(samples):
    np.testing.assert_allclose(windows(0.01, 0.01 * samples, 0.5).derivative(TIME), 1.0, rtol=1e-9)


def test_a_line_is_seen_at_the_centre_of_each_window():
    np.testing.assert_allclose(THROUGH.average(7 * TIME), 7 * THROUGH.centres(TIME))
    np.testing.assert_allclose(np.diff(THROUGH.centres(TIME)), 0.2)
    assert THROUGH.centres(TIME)[0] == pytest.approx(3.0 + 0.195)


def test_average_of_a_sine_falls_off_as_the_transform_of_the_window():
    """Slow sines pass and fast ones do not, which is why the window can do without a derivative."""
    gain = [np.abs(THROUGH.average(np.exp(2j * np.pi * f * TIME))).mean() for f in (0.5, 2.5, 12.5)]
    shape = np.sin(np.pi * np.linspace(0, 1, 4001)) ** 4
    place = np.linspace(-0.2, 0.2, 4001)
    expected = [abs((shape * np.exp(2j * np.pi * f * place)).sum()) / shape.sum() for f in (0.5, 2.5, 12.5)]
    np.testing.assert_allclose(gain, expected, atol=2e-3)
    assert gain[2] < 1e-3 < gain[1] < gain[0]


@pytest.mark.parametrize("samples", [0, 39, 40, 59, 60, 500])
def test_count_is_the_number_of_windows_that_fit(samples):
    fitting = [start for start in range(0, samples, 20) if start + 40 <= samples]
    assert THROUGH.count(samples) == len(fitting)
    if fitting:
        assert THROUGH.average(np.zeros((samples, 6, 2))).shape == (len(fitting), 6, 2)


def test_windows_of_few_samples_are_refused_by_name():
    with pytest.raises(InputError, match=r"gap.window_s = 0.05: holds 5 samples at 100 Hz; at least 8"):
        windows(0.01, 0.05, 0.5)


def problem(seed=0, draws=None):
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((WINDOWS, CHANNELS, COLUMNS)) * [1.0, 1e3, 1e-3, 1.0, 1.0]
    shape = (WINDOWS, CHANNELS) if draws is None else (WINDOWS, CHANNELS, draws)
    return columns, rng.standard_normal(shape), np.arange(WINDOWS) * BLOCKS // WINDOWS


def least_squares(columns, right):
    return np.linalg.lstsq(columns.reshape(-1, columns.shape[2]), right.reshape(-1), rcond=None)[0]


@pytest.mark.parametrize("chosen", [[0], [1, 3], [0, 1, 2, 3, 4]])
def test_each_block_is_judged_by_a_fit_to_the_others(chosen):
    columns, right, block = problem()
    coefficients, error = folds(columns, right, block).solve(np.array(chosen))
    for b in range(BLOCKS):
        seen, unseen = block != b, block == b
        expected = least_squares(columns[seen][..., chosen], right[seen])
        left = right[unseen] - columns[unseen][..., chosen] @ expected
        np.testing.assert_allclose(coefficients[b, :, 0], expected, rtol=1e-6)
        assert error[b, 0] == pytest.approx((left**2).sum())


def test_fit_uses_all_blocks_and_its_errors_are_those_of_textbooks():
    columns, right, block = problem(1)
    right = 3 * right
    chosen = np.array([0, 1, 4])
    normal = folds(columns, right, block)
    coefficients, error = normal.fit(chosen)
    flat = columns[..., chosen].reshape(-1, 3)
    expected = least_squares(columns[..., chosen], right)
    left = right.reshape(-1) - flat @ expected
    np.testing.assert_allclose(coefficients[:, 0], expected, rtol=1e-6)
    assert error.sum() == pytest.approx(left @ left)
    covariance = np.linalg.inv(flat.T @ flat) * (left @ left) / len(left)
    conditional, unsure = normal.conditional_on(chosen[:1]).fit(chosen[1:])
    np.testing.assert_allclose(conditional, expected[1:], rtol=1e-6)
    np.testing.assert_allclose(unsure, np.sqrt(np.diag(covariance))[1:], rtol=1e-6)


def test_errors_never_fall_below_those_of_unit_noise():
    columns, right, block = problem(2)
    flat = columns.reshape(-1, COLUMNS)
    _, unsure = folds(columns, 0.1 * right, block).conditional_on(np.array([0])).fit(np.arange(1, 5))
    np.testing.assert_allclose(unsure, np.sqrt(np.diag(np.linalg.inv(flat.T @ flat)))[1:], rtol=1e-6)


@pytest.mark.parametrize("known", [0.0, 0.3])
def test_columns_next_to_a_base_are_judged_as_one_fit_of_both(known):
    columns, right, block = problem(7, draws=3)
    # Nearly what the base is, nothing at all, seen in one block only.
    columns[..., 3] = columns[..., 0] + 1e-4 * columns[..., 3]
    columns[..., 2] = 0.0
    columns[block != 2, :, 4] = 0.0
    normal, base = folds(columns, right, block, np.full(COLUMNS, known)), np.array([0, 4])
    conditional = normal.conditional_on(base)
    np.testing.assert_allclose(conditional.before, normal.solve(base)[1], rtol=1e-9)
    for own in ([1], [3], [2], [1, 2, 3], []):
        together = np.array([*base, *own])
        np.testing.assert_allclose(conditional.unseen(np.array(own, dtype=int)), normal.solve(together)[1], rtol=1e-6)
        found, _ = conditional.fit(np.array(own, dtype=int))
        np.testing.assert_allclose(found, normal.fit(together)[0][2:, 0], rtol=1e-6)


def test_draws_are_right_sides_of_their_own():
    columns, right, block = problem(3, draws=3)
    chosen = np.array([0, 2])
    together = folds(columns, right, block).solve(chosen)
    for draw in range(3):
        alone = folds(columns, right[..., draw], block).solve(chosen)
        np.testing.assert_allclose(together[0][..., draw], alone[0][..., 0], rtol=1e-9)
        np.testing.assert_allclose(together[1][:, draw], alone[1][:, 0], rtol=1e-9)


@pytest.mark.parametrize("weight", [np.ones(6), np.array([1.0, 2.0, 0.5, 1.0, 1.0, 3.0])])
@pytest.mark.parametrize("order", [np.arange(WINDOWS), np.arange(WINDOWS)[::-1] * 7 % WINDOWS])
def test_a_subtracted_column_is_gone_from_the_right_side_and_channels_weigh_what_they_are_given(weight, order):
    columns, right, block = problem(4, draws=3)
    columns[..., 1] *= 1e-3
    # Of blocks whose windows stand one after another, and of others.
    kept, block = np.array([0, 4]), block[order]
    found = folds(columns, right, block).conditional_on(kept).subtracted(1, weight)
    by_hand = weight[:, None] * columns[..., kept], weight[:, None] * (right - columns[..., [1]])
    for b in range(BLOCKS):
        seen, unseen = (tuple(each[rows] for each in by_hand) for rows in (block != b, block == b))
        for draw in range(3):
            left = unseen[1][..., draw] - unseen[0] @ least_squares(seen[0], seen[1][..., draw])
            assert found[b, draw] == pytest.approx((left**2).sum())


def test_a_column_that_a_fit_never_sees_gets_nothing():
    """An effect that acts in one block only cannot be judged on it."""
    columns, right, block = problem(5)
    columns[block != 2, :, 3] = 0.0
    coefficients, error = folds(columns, right, block).solve(np.array([0, 3]))
    without = folds(columns, right, block).solve(np.array([0]))[1]
    assert coefficients[2, 1, 0] == 0.0
    assert error[2] == pytest.approx(without[2])


def test_a_column_of_zeros_does_no_harm():
    columns, right, block = problem(6)
    columns[..., 3] = 0.0
    coefficients, error = folds(columns, right, block).solve(np.array([0, 3]))
    np.testing.assert_allclose(error, folds(columns, right, block).solve(np.array([0]))[1])
    assert not coefficients[:, 1].any()


@given(st.lists(st.integers(1, 400), min_size=1, max_size=5), st.floats(0.5, 20))
def test_blocks_are_contiguous_within_flights_and_numbered_without_gaps(lengths, block_s):
    flight = np.repeat(np.arange(len(lengths)), lengths)
    centres = np.concatenate([0.2 * np.arange(length) for length in lengths])
    block = blocks_of(flight, centres, block_s)
    assert set(np.diff(block)) <= {0, 1}
    assert (np.diff(block)[np.diff(flight) > 0] == 1).all()
    assert block[0] == 0
    assert block.max() < 24 + len(lengths)


def test_blocks_have_about_the_wanted_length():
    flight, centres = np.repeat([0, 1], 100), np.tile(0.2 * np.arange(100), 2)
    assert np.bincount(blocks_of(flight, centres, 4.0)).tolist() == [20] * 10
