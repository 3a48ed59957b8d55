"""Print how well a periodic function of two angles is fitted: ours, other fuzzy libraries, and plain baselines.

    python benchmarks/fuzzy_fitting.py

Samples are random over one turn of both angles, with Gaussian noise of 1 % of the function's standard deviation. Errors
are against the function without noise on 5000 fresh points, and on the same points one turn further in both angles.
pyFUME, which evaluates in a loop, gets 1000 samples and 500 points. Everything is fitted to the same samples in turn on
one thread, after one fit of each that is not counted; medians over the seeds, in seconds of the processor. The other
tables have other functions, errors in per cent of the function's standard deviation; in the last one 3000 samples lie
within 1 rad of zero only, and the fit is judged there and on the rest of the circle.
"""

from __future__ import annotations

import contextlib
import io
import logging
import sys
import tempfile
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from time import process_time
from types import ModuleType

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np
from anfis_toolbox import ANFISRegressor
from scipy.interpolate import LSQBivariateSpline, RBFInterpolator

from cpfls_cli.arrays import Array
from cpfls_cli.fuzzy.membership import breakpoints, uniform_weights
from cpfls_cli.fuzzy.periodic_fit import PeriodicSettings, fit_periodic
from cpfls_cli.fuzzy.periodic_system import PeriodicStructure

Predict = Callable[[Array], Array]
Fit = Callable[[Array, Array], Predict]

NOISE, POINTS, FEW_POINTS, TURN = 0.01, 5000, 500, 2.0 * np.pi
SLOW = ("anfis", "pyFUME")
SEEDS, SLOW_SEEDS = range(9), range(3)
FUNCTIONS: dict[str, Callable[[Array, Array], Array]] = {
    "the benchmark's": lambda a, b: np.sin(a) * np.cos(b) + 0.5 * np.sin(2 * a + b) + 0.2 * np.cos(3 * a),
    "low harmonics": lambda a, b: 1 + 0.3 * np.cos(a) * np.sin(b),
    "high harmonics": lambda a, b: np.sin(6 * a) * np.cos(b) + 0.5 * np.cos(5 * b),
    "twelfth harmonic": lambda a, b: np.sin(12 * a) + np.cos(b),
    "narrow peak": lambda a, b: np.exp(8 * (np.cos(a - 1) + np.cos(b - 2) - 2)),
    "very narrow peak": lambda a, b: np.exp(60 * (np.cos(a - 1) + np.cos(b - 2) - 2)),
    "kinks": lambda a, b: np.abs(np.sin(a)) * np.cos(b) + np.abs(np.cos(0.5 * (a + b))),
    "jumps": lambda a, b: np.sign(np.sin(a)) + np.cos(b),
}


def ours(**settings: object) -> Fit:
    return partial(_ours, PeriodicSettings(**settings))


def _ours(settings: PeriodicSettings, angles: Array, values: Array) -> Predict:
    return fit_periodic(angles, values, settings)


def dense(angles: Array, values: Array) -> Predict:
    uniform = breakpoints(uniform_weights(7))
    structure = PeriodicStructure((uniform, uniform), "harmonic", 1, "tensor")
    coefficients = np.linalg.lstsq(structure.columns(angles), values, rcond=1e-6)[0]
    return lambda points: structure.columns(points) @ coefficients


def anfis(functions: int, epochs: int) -> Fit:
    def fit(angles: Array, values: Array) -> Predict:
        model = ANFISRegressor(n_mfs=functions, optimizer="hybrid", epochs=epochs, random_state=0)
        model.fit(angles, values)
        return lambda points: np.ravel(model.predict(points))

    return fit


class _Columns:
    """In place of a type that pyFUME 0.3.1 takes for the star of ``np.c_[*slices]``."""

    def __class_getitem__(cls, slices: list[Array]) -> tuple[Array, ...]:
        return tuple(slices)


def _pyfume() -> ModuleType:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import pyfume
    # Without these two lines version 0.3.1 fits nothing here: NumPy 2 writes numbers as np.float64(...).
    pyfume.EstimateConsequentParameters.Unpack = _Columns
    pyfume.simpfulfier.np = np
    return pyfume


def fume(clusters: int) -> Fit:
    def fit(angles: Array, values: Array) -> Predict:
        import pandas

        frame = pandas.DataFrame({"a": angles[:, 0], "b": angles[:, 1], "value": values})
        with _silent():
            model = _pyfume().pyFUME(dataframe=frame, nr_clus=clusters)

        def predict(points: Array) -> Array:
            with _silent():
                return np.ravel(model.predict_label(points))

        return predict

    return fit


def fourier(order: int) -> Fit:
    def columns(angles: Array) -> Array:
        phases = angles[:, :, None] * np.arange(1, order + 1)
        first, second = np.concatenate([np.ones((len(angles), 2, 1)), np.sin(phases), np.cos(phases)], 2).swapaxes(0, 1)
        return (first[:, :, None] * second[:, None, :]).reshape(len(angles), -1)

    def fit(angles: Array, values: Array) -> Predict:
        coefficients = np.linalg.lstsq(columns(angles), values, rcond=None)[0]
        return lambda points: columns(points) @ coefficients

    return fit


def spline(knots: int) -> Fit:
    def fit(angles: Array, values: Array) -> Predict:
        inner = np.linspace(-np.pi, np.pi, knots + 2)[1:-1]
        bounds = (-np.pi, np.pi, -np.pi, np.pi)
        return partial(LSQBivariateSpline(*angles.T, values, inner, inner, bbox=bounds), grid=False)

    return lambda angles, values: _spread(fit(angles, values))


def _spread(predict: Callable[..., Array]) -> Predict:
    return lambda points: predict(points[:, 0], points[:, 1])


def radial(angles: Array, values: Array) -> Predict:
    def circles(points: Array) -> Array:
        return np.hstack([np.sin(points), np.cos(points)])

    interpolator = RBFInterpolator(circles(angles), values, neighbors=50, smoothing=1e-3)
    return lambda points: interpolator(circles(points))


METHODS: dict[str, tuple[Fit, int]] = {
    "ours, as it comes (7 functions, 324 coefficients)": (ours(), 5000),
    "the same by a singular value decomposition of its columns": (dense, 5000),
    "ours, 6 functions, 225": (ours(membership_functions=6), 5000),
    "ours, order 2, 4 functions, 225": (ours(membership_functions=4, harmonic_order=2), 5000),
    "ours, seesaw, 7 functions, tensor, 144": (ours(membership_functions=7, consequents="seesaw"), 5000),
    "ours, one rule of order 3, 49": (ours(membership_functions=1, harmonic_order=3), 5000),
    "anfis-toolbox, 5 x 5, hybrid, 5 epochs": (anfis(5, 5), 5000),
    "anfis-toolbox, 7 x 7, hybrid, 10 epochs": (anfis(7, 10), 5000),
    "pyFUME, 10 clusters, of 1000 samples": (fume(10), 1000),
    "pyFUME, 25 clusters, of 1000 samples": (fume(25), 1000),
    "Fourier series of order 7, 225": (fourier(7), 5000),
    "Fourier series of order 8, 289": (fourier(8), 5000),
    "spline (scipy), 14 x 14 inner knots, 324": (spline(14), 5000),
    "radial functions on the circles (scipy), 50 neighbours": (radial, 5000),
}


def main() -> None:
    warnings.simplefilter("ignore")
    logging.disable(logging.WARNING)
    print("\nThe benchmark's function\n")
    table("fuzzy_fitting", COLUMNS, _compared(), seeds=len(SEEDS), seeds_of_slow_methods=len(SLOW_SEEDS))
    for count in (5000, 500):
        print(f"\nOther functions, {count} samples, RMSE in per cent of the standard deviation\n")
        names = [name for name in OTHERS if count == 5000 or "order 8" not in name]
        table(f"fuzzy_functions_{count}", ("function", *names), _functions(count, names))
    print("\nSamples on a part of the circle only\n")
    table("fuzzy_part", ("fit", "RMSE there", "RMSE elsewhere", "largest error elsewhere"), _on_a_part())


PART = 1.0
PART_METHODS: dict[str, Fit] = {
    "ours, as it comes": ours(),
    "ours, one rule of order 3, 49": ours(membership_functions=1, harmonic_order=3),
    "ours, one rule of order 8, 289": ours(membership_functions=1, harmonic_order=8),
    "Fourier series of order 3, 49": fourier(3),
    "radial functions": radial,
}
COLUMNS = ("fit", "RMSE", "largest error", "RMSE one turn away", "microseconds a point", "seconds", "over ours (range)")
OTHERS: dict[str, Fit] = {
    "ours, as it comes": ours(),
    "ours, order 2, 4 functions": ours(membership_functions=4, harmonic_order=2),
    "ours, seesaw, 7 functions": ours(membership_functions=7, consequents="seesaw"),
    "Fourier series of order 4, 81": fourier(4),
    "Fourier series of order 8, 289": fourier(8),
    "spline, 14 x 14 knots, 324": spline(14),
    "radial functions": radial,
}


def _compared() -> list[tuple[object, ...]]:
    function = FUNCTIONS["the benchmark's"]
    records: dict[str, list[tuple[float, ...]]] = {name: [] for name in METHODS}
    # One seed more at the start, for what a first call alone takes.
    for seed in (len(SEEDS), *SEEDS):
        for name, (fit, count) in METHODS.items():
            if seed in SLOW_SEEDS or seed == len(SEEDS) or not name.startswith(SLOW):
                record = _scored(fit, function, count, seed, FEW_POINTS if name.startswith("pyFUME") else POINTS)
                if seed in SEEDS:
                    records[name].append(record)
    own = records[next(iter(METHODS))]
    return [(name, *_summary(rows, own)) for name, rows in records.items()]


def _summary(rows: list[tuple[float, ...]], own: list[tuple[float, ...]]) -> tuple[object, ...]:
    ratios = [row[-1] / mine[-1] for row, mine in zip(rows, own, strict=False)]
    ratio = f"{median(ratios):.3g} ({min(ratios):.3g} to {max(ratios):.3g})"
    return (*(float(median(column)) for column in zip(*rows, strict=True)), ratio)


def _functions(count: int, names: list[str]) -> list[tuple[object, ...]]:
    return [
        (label, *(float(median(_share(OTHERS[name], function, count, seed) for seed in SLOW_SEEDS)) for name in names))
        for label, function in FUNCTIONS.items()
    ]


def _on_a_part() -> list[tuple[object, ...]]:
    function = FUNCTIONS["the benchmark's"]
    rows = []
    for name, fit in PART_METHODS.items():
        scores = [_part_scored(fit, function, seed) for seed in SEEDS]
        rows.append((name, *(float(median(column)) for column in zip(*scores, strict=True))))
    return rows


def _part_scored(fit: Fit, function: Callable[[Array, Array], Array], seed: int) -> tuple[float, ...]:
    rng = np.random.default_rng(seed)
    angles, points = rng.uniform(-PART, PART, (3000, 2)), _uniform(rng, POINTS)
    truth = function(*angles.T)
    predict = fit(angles, truth + NOISE * np.std(truth) * rng.standard_normal(len(truth)))
    error = predict(points) - function(*points.T)
    inside = np.all(np.abs(points) < PART, axis=1)
    return _rms(error[inside]), _rms(error[~inside]), float(np.max(np.abs(error[~inside])))


def _share(fit: Fit, function: Callable[[Array, Array], Array], count: int, seed: int) -> float:
    points = _uniform(np.random.default_rng(1000), POINTS)
    try:
        rmse = _scored(fit, function, count, seed)[0]
    except ValueError:
        return float("nan")
    return 100.0 * rmse / float(np.std(function(*points.T)))


def _scored(
    fit: Fit, function: Callable[[Array, Array], Array], count: int, seed: int, fresh: int = POINTS
) -> tuple[float, ...]:
    rng = np.random.default_rng(seed)
    angles, points = _uniform(rng, count), _uniform(np.random.default_rng(1000 + seed), fresh)
    truth = function(*angles.T)
    values = truth + NOISE * np.std(truth) * rng.standard_normal(count)
    start = process_time()
    predict = fit(angles, values)
    fitted = process_time()
    error = predict(points) - function(*points.T)
    evaluated = process_time()
    away = predict(points + TURN) - function(*points.T)
    spent = 1e6 * (evaluated - fitted) / len(points), fitted - start
    return _rms(error), float(np.max(np.abs(error))), _rms(away), *spent


def _uniform(rng: np.random.Generator, count: int) -> Array:
    return rng.uniform(-np.pi, np.pi, (count, 2))


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


@contextlib.contextmanager
def _silent():
    """Let pyFUME print what it likes and leave its files where nobody looks."""
    with (
        contextlib.redirect_stdout(io.StringIO()),
        tempfile.TemporaryDirectory() as folder,
        contextlib.chdir(folder),
    ):
        yield


if __name__ == "__main__":
    main()
