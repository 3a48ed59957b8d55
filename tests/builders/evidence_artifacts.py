"""Evidence on a model with known numbers, as `cpfls identify` stores it."""

from dataclasses import replace

import numpy as np
from scipy.stats import norm

from cpfls_cli.artifacts.store import read_artifact, write_artifact

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
        "residuals/part": np.array("held-out rest"),
        "residuals/samples": 2500,
        "residuals/available": 7300,
        "residuals/mean": np.array([0.002, 0.125, 1e-20]),
        "residuals/mean_p": np.array([0.3, 1e-30, np.nan]),
        "residuals/lag": lag * 0.01,
        "residuals/autocorrelation": 0.7 ** lag[:, None] * np.array([1.0, 0.2, np.nan]),
        "residuals/band": 1.96 / 50,
        "residuals/ljung_box": np.array([1e-30, 0.4, np.nan]),
        "residuals/input": np.array(["roll", "pitch", "p_dot", "yaw", "p", "q", "a|b <i>"]),
        "residuals/input_lag": input_lag * 0.01,
        "residuals/correlation": correlation,
        "residuals/histogram_edge": np.linspace(-4, 4, 42)[:, None] * np.array([1e-3, 2e-3, 3e-3]),
        "residuals/histogram_count": np.round(400 * np.exp(-0.5 * np.linspace(-4, 4, 41)[:, None] ** 2)) * np.ones(3),
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
        "curves/name": np.array(["over roll", "over pitch"]),
        "curves/attitude": attitude,
        "curves/inertia": inertia,
        "curves/low": inertia - half,
        "curves/high": inertia + half,
        "curves/rigid_body": np.tile(np.diag([0.61, 0.62, 1.21]), (2, POINTS, 1, 1)),
        "curves/outside": np.tile(outside, (2, 1)).astype(float),
        "round_trip/inertia": inertia + 0.004,
        "round_trip/inside": np.where(np.eye(3) > 0, 0.96, np.nan),
    }


def uncertainty(artifact, rng):
    def around(path, deviation):
        value = artifact.array(path)
        return value + deviation * rng.standard_normal((DRAWS, len(value)))

    return {
        "uncertainty/blocks": 40,
        "uncertainty/block_duration": 1.25,
        "uncertainty/coefficients": around("vehicle/inertia_functions/coefficients", 1e-3),
        "uncertainty/rigid_body": around("vehicle/inertia_functions/rigid_body", 2e-3),
        "uncertainty/best_rigid_body": around("baselines/rigid_body", 2e-3),
    }


def steps():
    horizon = np.arange(1, STEPS + 1) * 0.01
    growth = np.array([1.0, 2.0, 40.0])[:, None, None] * (horizon[:, None] ** 1.5) * np.array([1.0, 0.8, 0.5])
    rate = growth.copy()
    rate[1, 30:] = np.nan
    return {
        "steps/part": np.array("held-out rest"),
        "steps/model": np.array(["model", "rigid-body", "nothing-moves"]),
        "steps/samples": np.arange(1, STEPS + 1),
        "steps/horizon": horizon,
        "steps/windows": 77,
        "steps/lost": np.zeros((3, STEPS), dtype=int),
        "steps/attitude": 0.01 * growth,
        "steps/body_rate": rate,
    }


def verdict(label):
    return {
        "verdict/label": np.array(label),
        "verdict/region": np.array("roll and pitch within 32 degrees"),
        "verdict/reason": np.array(REASONS),
        "verdict/speaks": np.array([1, -1, 0]),
    }


def others():
    return {
        "structures/name": np.array(["rigid body", "5 functions | harmonic", "7 functions"]),
        "structures/parameters": np.array([0, 60, 120]),
        "structures/error": np.array([0.05, 0.031, 0.033]),
        "structures/standard_error": np.array([0.004, 0.003, 0.003]),
        "structures/ridge_weight": np.array([np.inf, 0.01, 0.1]),
        "structures/own": np.array([0, 0, 1]),
        "physics/cells": 120,
        "physics/indefinite": 3,
        "physics/smallest_eigenvalue": -0.0123,
        "physics/worst_attitude": np.deg2rad([12.0, -34.0]),
        "physics/energy": 3e-16,
        "period/parts": np.array(["training"]),
        "period/mse": np.full((1, 3), 4e-6),
        "period/max_error": np.full((1, 3), 7e-3),
    }


def with_evidence(model, output, label="good-inside-region", **changed):
    """Write a model again, with evidence; a dataset that is changed to None is left out."""
    artifact = read_artifact(model)
    rng = np.random.default_rng(4)
    own = {**residuals(rng), **curves(), **uncertainty(artifact, rng), **steps(), **verdict(label), **others()}
    data = {**artifact.data, **own, **changed}
    kept = {path: values for path, values in data.items() if values is not None}
    write_artifact(output, replace(artifact, data=kept))
    return output
