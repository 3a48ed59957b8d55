"""A comparison of attitude controllers as datasets of a flight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.config.study import Study
from cpfls_cli.control import Plan, Scores
from cpfls_cli.dynamics.rigid_body import not_positive_definite
from cpfls_cli.identification.model import Model
from cpfls_cli.simulation.measured import noisy
from cpfls_cli.vehicle.rotors import rotor_demand


def tracking_data(plan: Plan, names: Sequence[str], found: Scores, model: Model, attitude: Array) -> dict[str, Any]:
    """Arrange a comparison as datasets.

    Parameters
    ----------
    names : sequence of str
        Of the controllers.
    attitude : array, shape (time, 3), rad
        Of the flight under the model's controller.
    """
    return {
        "tracking/controller": np.array(names),
        "tracking/time": plan.time[:: plan.parts],
        "tracking/error": found.error,
        "tracking/settled_from": found.settled_from,
        "tracking/rms": found.rms,
        "tracking/settled_rms": found.settled_rms,
        "tracking/max_error": found.largest,
        "tracking/settled_max": found.settled_largest,
        "tracking/torque_rms": found.effort,
        "tracking/clipped": found.clipped,
        "tracking/lost_at": found.lost,
        "tracking/control_rate": 1 / plan.period,
        "tracking/outside": model.outside(attitude).astype(np.uint8),
        "tracking/not_positive_definite": int(np.sum(not_positive_definite(model.inertia(attitude).value, attitude))),
    }


def logged_signals(
    exact: Mapping[str, Array], study: Study, rng: np.random.Generator
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Log a flight: rotor speeds where hover thrust lets all rotors do it, and the noise of the log.

    Parameters
    ----------
    exact : mapping of str to array
        By the names of the flight artifact.

    Returns
    -------
    noise_std : dict of str to array
        Standard deviation of the noise of each channel, of the signals that have noise.
    """
    weight = np.full(len(exact["time"]), study.vehicle.mass_kg * study.vehicle.gravity_m_s2)
    demand = rotor_demand(study.vehicle, weight, exact["body_torque"])
    rotors = {} if demand.violations else {"rotor_speed": demand.speed}
    signals, std = noisy({**exact, **rotors}, study.simulation, rng)
    if {"attitude", "torque"} & std.keys():
        signals["body_torque"] = rotations.body_torque(signals["attitude"], signals["torque"])
    return signals, std
