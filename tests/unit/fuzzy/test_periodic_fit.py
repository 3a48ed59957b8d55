"""A periodic system fitted by itself: exact where it can be, the least-squares solution elsewhere, clear refusals."""

import numpy as np
import pytest

from cpfls_cli.fuzzy.basis import InputRange, antecedent, basis, breakpoints, features, map_input
from cpfls_cli.fuzzy.periodic import PeriodicSettings, fit_periodic

STRUCTURES = [
    PeriodicSettings(),
    PeriodicSettings(membership_functions=(5, 3), products="additive"),
    PeriodicSettings(membership_functions=4, harmonic_order=2),
    PeriodicSettings(membership_functions=6, consequents="seesaw"),
]


def surface(angles):
    roll, pitch = angles.T
    return np.sin(roll) * np.cos(pitch) + 0.5 * np.sin(2 * roll + pitch) + 0.2 * np.cos(3 * roll)


def samples(count, seed=0, inputs=2):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, inputs))


def columns(angles, partitions, consequents, order, products):
    """The columns of a system by the functions that the regressor takes, which differentiate as well."""
    mapped = [map_input(angle, "full-circle", True, InputRange(0.0, 1.0)) for angle in angles.T]
    rules = [antecedent(one, partition, circular=True) for one, partition in zip(mapped, partitions, strict=True)]
    return basis(rules, features(list(angles.T), mapped, consequents, order, products)).value


@pytest.mark.parametrize("settings", STRUCTURES, ids=repr)
def test_it_is_the_solution_of_a_dense_decomposition(settings):
    angles = samples(2500)
    values = surface(angles) + 0.1 * np.random.default_rng(1).standard_normal(len(angles))
    system = fit_periodic(angles, values, settings)
    A = columns(angles, system.breakpoints, settings.consequents, settings.harmonic_order, settings.products)
    solution, _, rank, singular_values = np.linalg.lstsq(A, values, rcond=1e-6)
    np.testing.assert_allclose(system.coefficients, solution, rtol=1e-6, atol=1e-6 * np.abs(solution).max())
    assert system.quality.rank == rank == A.shape[1]
    assert system.quality.condition_number == pytest.approx(singular_values[0] / singular_values[-1], rel=0.01)
    assert system.quality.residual_rms == pytest.approx(np.sqrt(np.mean((values - A @ solution) ** 2)), rel=1e-9)


def test_what_the_rules_contain_comes_back_exactly():
    angles = samples(3000)
    system = fit_periodic(angles, 2 + np.sin(angles[:, 0]) * np.cos(angles[:, 1]))
    elsewhere = samples(500, seed=3) + 40 * np.pi
    truth = 2 + np.sin(elsewhere[:, 0]) * np.cos(elsewhere[:, 1])
    np.testing.assert_allclose(system(elsewhere), truth, atol=1e-10)
    assert system.quality.residual_rms < 1e-10


def test_the_default_reaches_its_aim_with_noise():
    angles, elsewhere = samples(5000), samples(5000, seed=9)
    values = surface(angles) + 0.01 * np.random.default_rng(1).standard_normal(5000)
    system = fit_periodic(angles, values)
    error = system(elsewhere) - surface(elsewhere)
    assert np.sqrt(np.mean(error**2)) < 0.012
    # What it says of itself holds on new noisy samples.
    noisy = error + 0.01 * np.random.default_rng(2).standard_normal(5000)
    assert system.quality.cross_validation_rms == pytest.approx(np.sqrt(np.mean(noisy**2)), rel=0.05)


def test_weight_shrinks_as_rows_below_the_columns_do():
    angles, weight = samples(400), 0.03
    values = surface(angles)
    system = fit_periodic(angles, values, PeriodicSettings(membership_functions=4, ridge_weight=weight))
    A = columns(angles, system.breakpoints, "harmonic", 1, "tensor")
    below = np.sqrt(weight * len(angles)) * np.eye(A.shape[1])
    solution = np.linalg.lstsq(np.vstack([A, below]), np.concatenate([values, np.zeros(A.shape[1])]), rcond=None)[0]
    np.testing.assert_allclose(system.coefficients, solution, atol=1e-11)
    hat = A @ np.linalg.solve(A.T @ A + weight * len(angles) * np.eye(A.shape[1]), A.T)
    assert system.quality.effective_coefficients == pytest.approx(np.trace(hat), rel=1e-9)


def test_directions_that_are_hardly_determined_keep_their_digits():
    """Sums of products, refined once, are 1e-4 off here."""
    angles = samples(6000)
    values = surface(angles) + 0.1 * np.random.default_rng(3).standard_normal(6000)
    system = fit_periodic(angles, values, membership_functions=8, harmonic_order=2)
    A = columns(angles, system.breakpoints, "harmonic", 2, "tensor")
    solution, _, rank, _ = np.linalg.lstsq(A, values, rcond=1e-6)
    assert (system.quality.rank, system.quality.condition_number > 1e5) == (rank, True)
    np.testing.assert_allclose(system.coefficients, solution, atol=1e-7 * np.abs(solution).max())


def test_one_input_in_either_shape():
    angles = samples(400, inputs=1)
    values = np.abs(np.sin(angles[:, 0]))
    flat, column = fit_periodic(angles[:, 0], values), fit_periodic(angles, values)
    np.testing.assert_array_equal(flat.coefficients, column.coefficients)
    assert len(flat.breakpoints[0]) == 21
    np.testing.assert_array_equal(flat(angles[:, 0]), column(angles))
    assert flat.gradient(angles[:, 0]).shape == (400, 1)
    assert np.sqrt(np.mean((flat(angles) - values) ** 2)) < 0.01


@pytest.mark.parametrize(("count", "functions"), [(9, 1), (107, 1), (108, 3), (971, 6), (972, 7), (5000, 7)])
def test_functions_that_the_samples_carry(count, functions):
    system = fit_periodic(samples(count), np.zeros(count))
    assert [len(partition) for partition in system.breakpoints] == [functions] * 2


def test_samples_of_a_part_of_the_circle_give_finite_coefficients_and_a_lower_rank():
    angles = 0.1 * samples(2000)
    system = fit_periodic(angles, surface(angles))
    assert system.quality.rank < len(system.coefficients)
    assert np.all(np.isfinite(system.coefficients))
    np.testing.assert_allclose(system(angles), surface(angles), atol=1e-3)
    # Samples at one place only: one direction is known.
    system = fit_periodic(np.zeros((50, 2)), np.full(50, 3.0), PeriodicSettings(membership_functions=3))
    assert (system.quality.rank, system([[0.0, 0.0]])[0]) == (1, pytest.approx(3.0))


GOOD = samples(100)


@pytest.mark.parametrize(
    ("angles", "values", "message"),
    [
        (np.zeros((100, 3)), np.zeros(100), r"angles: expected shape \(samples, 1 or 2\), got \(100, 3\)"),
        (np.zeros((2, 5, 2)), np.zeros(10), r"angles: expected shape \(samples, 1 or 2\), got \(2, 5, 2\)"),
        (GOOD, np.zeros(99), r"values: expected shape \(100,\), one value for each row of angles, got \(99,\)"),
        (GOOD, np.zeros((100, 1)), r"values: expected shape \(100,\).*got \(100, 1\)"),
        (
            GOOD,
            np.where(np.arange(100) == 7, np.nan, 1.0),
            r"values: 1 values are not finite, the first is values\[7\]",
        ),
        (np.where(GOOD > 3, np.inf, GOOD), np.zeros(100), r"angles: .* not finite, the first is angles\["),
        (GOOD.astype(complex), np.zeros(100), "angles: expected an array of real numbers"),
        ([["a", "b"]] * 100, np.zeros(100), "angles: expected an array of real numbers"),
        (GOOD[:8], np.zeros(8), r"angles: 8 samples do not determine the 9 coefficients .* shape \(9 or more, 2\)"),
        (np.zeros((0, 2)), np.zeros(0), "angles: 0 samples do not determine"),
    ],
)
def test_what_cannot_be_fitted_is_refused_in_words(angles, values, message):
    with pytest.raises(ValueError, match=message):
        fit_periodic(angles, values)


def test_more_coefficients_than_samples_need_a_weight():
    with pytest.raises(ValueError, match=r"100 samples do not determine the 324 coefficients.*ridge_weight above 0"):
        fit_periodic(GOOD, surface(GOOD), PeriodicSettings(membership_functions=7))
    system = fit_periodic(GOOD, surface(GOOD), PeriodicSettings(membership_functions=7, ridge_weight=1e-6))
    assert system.quality.effective_coefficients < 100


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("membership_functions", 0),
        ("membership_functions", (3, 0)),
        ("membership_functions", (3, 3, 3)),
        ("membership_functions", 3.5),
        ("membership_functions", "3"),
        ("membership_functions", ["a", 3]),
        ("harmonic_order", 2.5),
        ("harmonic_order", "2"),
        ("ridge_weight", "much"),
        ("consequents", "linear"),
        ("products", "sum"),
        ("harmonic_order", 0),
        ("ridge_weight", -1.0),
        ("ridge_weight", float("nan")),
        ("rank_tolerance", 1e-12),
        ("rank_tolerance", 1.0),
    ],
)
def test_settings_name_the_key(key, value):
    with pytest.raises(ValueError, match=f"^{key} = "):
        fit_periodic(GOOD, surface(GOOD), PeriodicSettings(**{key: value}))


def test_partitions_are_equidistant():
    system = fit_periodic(GOOD, surface(GOOD), PeriodicSettings(membership_functions=(3, 4)))
    np.testing.assert_allclose(system.breakpoints[1], [0, 1 / 3, 2 / 3, 1])
    np.testing.assert_allclose(system.breakpoints[0], breakpoints(np.ones(2)))


@pytest.mark.parametrize("size", [1e200, 1e-200, 1e300, 1e-300])
def test_values_of_any_size_are_fitted_alike(size):
    angles = samples(300)
    values = surface(angles)
    plain, scaled = fit_periodic(angles, values), fit_periodic(angles, values * size)
    np.testing.assert_allclose(scaled(angles) / size, plain(angles), rtol=1e-9, atol=1e-12)
    assert plain.quality.residual_rms > 1e-3
    assert scaled.quality.residual_rms / size == pytest.approx(plain.quality.residual_rms, rel=1e-9)
    assert scaled.quality.cross_validation_rms / size == pytest.approx(plain.quality.cross_validation_rms, rel=1e-9)


def test_coefficients_beyond_all_numbers_are_refused():
    angles = 0.01 * samples(400)
    with pytest.raises(ValueError, match=r"values: up to .* scale the values down"):
        fit_periodic(angles, 1.7e308 * np.sign(angles[:, 0]))


def test_settings_are_given_by_name_as_a_list_and_of_numpy_and_by_no_other_type():
    wanted = fit_periodic(GOOD, surface(GOOD), PeriodicSettings(membership_functions=(3, 1), harmonic_order=2))
    for settings, keys in [
        (None, {"membership_functions": [3, 1], "harmonic_order": 2}),
        (PeriodicSettings(membership_functions=(3, 1)), {"harmonic_order": np.int64(2)}),
    ]:
        system = fit_periodic(GOOD, surface(GOOD), settings, **keys)
        np.testing.assert_array_equal(system.coefficients, wanted.coefficients)
    with pytest.raises(TypeError, match=r"settings: expected PeriodicSettings\(\.\.\.\), got dict; .*harmonic_order=2"):
        fit_periodic(GOOD, surface(GOOD), {"harmonic_order": 2})
    with pytest.raises(TypeError, match=r"order: is no key of PeriodicSettings; use membership_functions, "):
        fit_periodic(GOOD, surface(GOOD), order=2)


def test_a_single_point_gives_a_single_value():
    two = fit_periodic(GOOD, surface(GOOD))
    assert (two([0.1, 0.2]).shape, two([0.1, 0.2])) == ((), two([[0.1, 0.2]])[0])
    np.testing.assert_array_equal(two.gradient([0.1, 0.2]), two.gradient([[0.1, 0.2]])[0])
    one = fit_periodic(GOOD[:, 0], np.sin(GOOD[:, 0]))
    assert (one(0.3).shape, one(0.3), one([0.3, 0.4]).shape) == ((), one([0.3])[0], (2,))
    assert one.gradient(0.3).shape == (1,)
    with pytest.raises(ValueError, match=r"angles: expected shape \(samples, 1\), or \(\) for one point, got \(3, 2\)"):
        one(np.zeros((3, 2)))


def test_the_share_that_samples_determine_is_said():
    assert fit_periodic(samples(3000), np.zeros(3000)).quality.determined == 1.0
    quality = fit_periodic(np.full((400, 2), 0.5), np.full(400, 3.0)).quality
    assert (quality.rank, quality.coefficients) == (1, 81)
    assert quality.determined == pytest.approx(1 / 81)
