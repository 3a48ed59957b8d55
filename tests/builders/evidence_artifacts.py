"""Evidence on a model with known numbers, as `cpfls identify` stores it."""

from functools import reduce

import numpy as np
from scipy.stats import norm

from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.store import read, write
from cpfls_cli.validation.verdict import Reason
from tests.builders.identified_models import with_parts

LAGS, INPUTS, POINTS, DRAWS, STEPS = 40, 7, 91, 60, 50
REASONS = ("R2 of body torque is 0.97 or more on held-out data", "errors follow roll", "the search was short")


def residuals(rng):
    lag = np.arange(1, LAGS + 1)
    probability = norm.ppf(np.arange(1, 100) / 100)
    input_lag = np.arange(-LAGS, LAGS + 1)
    follows = 0.4 * np.exp(-(((input_lag - 6) / 9) ** 2))
    correlation = 0.02 * rng.standard_normal((INPUTS, len(input_lag), 3))
    correlation[0, :, 0] += follows
    correlation[3] = np.nan
    return {
        "residuals/part": "held-out rest",
        "residuals/samples": 2500,
        "residuals/available": 7300,
        "residuals/mean": np.array([0.002, 0.125, 1e-20]),
        "residuals/mean_p": np.array([0.3, 1e-30, np.nan]),
        "residuals/lag": lag * 0.01,
        "residuals/autocorrelation": 0.7 ** lag[:, None] * np.array([1.0, 0.2, np.nan]),
        "residuals/band": 1.96 / 50,
        "residuals/ljung_box": np.array([1e-30, 0.4, np.nan]),
        "residuals/input": ("roll", "pitch", "p_dot", "yaw", "p", "q", "a|b <i>"),
        "residuals/input_lag": input_lag * 0.01,
        "residuals/correlation": correlation,
        "residuals/histogram_edge": np.linspace(-4, 4, 42)[:, None] * np.array([1e-3, 2e-3, 3e-3]),
        "residuals/histogram_count": np.int64(400 * np.exp(-0.5 * np.linspace(-4, 4, 41)[:, None] ** 2))
        * np.ones(3, dtype=int),
        "residuals/exact": np.array([False, False, True]),
        "residuals/normal_quantile": probability,
        "residuals/quantile": (probability + 0.05 * probability**3)[:, None] * np.array([1e-3, 2e-3, 3e-3]),
    }


def curves():
    angle = np.deg2rad(np.linspace(-60, 60, POINTS))
    attitude = np.zeros((2, POINTS, 3))
    attitude[0, :, 0] = attitude[1, :, 1] = angle
    inertia = np.tile(np.diag([0.6, 0.6, 1.2]), (2, POINTS, 1, 1))
    inertia[:, :, 1, 1] += 0.1 * np.sin(angle) ** 2
    inertia[:, :, 1, 2] = inertia[:, :, 2, 1] = 0.2 * np.sin(angle)
    outside = np.abs(angle) > np.deg2rad(40)
    half = (0.01 + 5.0 * np.maximum(np.abs(angle) - np.deg2rad(40), 0) ** 2)[None, :, None, None]
    return {
        "curves/name": ("over roll", "over pitch"),
        "curves/attitude": attitude,
        "curves/inertia": inertia,
        "curves/low": inertia - half,
        "curves/high": inertia + half,
        "curves/rigid_body": np.tile(np.diag([0.61, 0.62, 1.21]), (2, POINTS, 1, 1)),
        "curves/outside": np.tile(outside, (2, 1)),
        "round_trip/inertia": inertia + 0.004,
        "round_trip/inside": np.where(np.eye(3) > 0, 0.96, np.nan),
    }


def uncertainty(model, rng):
    def around(path, deviation):
        value = reduce(getattr, path.split("/"), model)
        return value + deviation * rng.standard_normal((DRAWS, len(value)))

    return {
        "uncertainty/blocks": 40,
        "uncertainty/block_duration": 1.25,
        "uncertainty/coefficients": around("model/fuzzy/coefficients", 1e-3),
        "uncertainty/rigid_body": around("model/fuzzy/rigid_body", 2e-3),
        "uncertainty/best_rigid_body": around("rigid_body", 2e-3),
    }


def steps():
    horizon = np.arange(1, STEPS + 1) * 0.01
    growth = np.array([1.0, 2.0, 40.0])[:, None, None] * (horizon[:, None] ** 1.5) * np.array([1.0, 0.8, 0.5])
    rate = growth.copy()
    rate[1, 30:] = np.nan
    return {
        "steps/part": "held-out rest",
        "steps/model": ("model", "rigid-body", "nothing-moves"),
        "steps/samples": np.arange(1, STEPS + 1),
        "steps/horizon": horizon,
        "steps/windows": 77,
        "steps/lost": np.zeros((3, STEPS), dtype=int),
        "steps/attitude": 0.01 * growth,
        "steps/body_rate": rate,
        "steps/window_error": np.zeros((3, 77, 3)),
        "steps/start": np.arange(77),
    }


def verdict(label):
    return {
        "verdict/label": label,
        "verdict/region": "roll and pitch within 32 degrees",
        "verdict/reasons": tuple(map(Reason, REASONS, (1, -1, 0))),
    }


def others():
    return {
        "structures/name": ("rigid body", "5 functions | harmonic", "7 functions"),
        "structures/parameters": np.array([0, 60, 120]),
        "structures/error": np.array([0.05, 0.031, 0.033]),
        "structures/standard_error": np.array([0.004, 0.003, 0.003]),
        "structures/ridge_weight": np.array([np.inf, 0.01, 0.1]),
        "structures/own": np.array([False, False, True]),
        "physics/cells": 120,
        "physics/indefinite": 3,
        "physics/smallest_eigenvalue": -0.0123,
        "physics/worst_attitude": np.deg2rad([12.0, -34.0]),
        "physics/indefinite_anywhere": 3,
        "physics/every_cell": 4000,
    }


def with_evidence(model, output, label="good-inside-region", **changed):
    """Write a model again, with evidence; a part of which a field is changed to None is left out."""
    given, origin = read(model, IdentifiedModel)
    rng = np.random.default_rng(4)
    own = {**residuals(rng), **curves(), **uncertainty(given, rng), **steps(), **verdict(label), **others()}
    write(output, with_parts(given, own | changed), origin)
    return output
