"""Free runs against an independent integration, and exact models at the level of interpolation."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from cpfls_cli import rotations
from cpfls_cli.dynamics import InertiaFunctions, coriolis_matrix
from cpfls_cli.fuzzy.basis import InputRange
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.regressor import Motion, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.validation.replay import replay_steps
from tests.builders.flights import rigid_torque, rotating_motion

INERTIA = np.array([0.6, 0.8, 1.2, 0.03, -0.02, 0.04])
RANGE = InputRange(-1.0, 1.0)


def bent_model(seed=81, size=0.004):
    """A body whose inertia depends on attitude."""
    structure = model_structure(StructureSettings())
    coefficients = size * np.random.default_rng(seed).standard_normal(structure.parameters)
    visited = np.ones((72, 72), dtype=bool)
    return InertiaFunctions(structure, (RANGE, RANGE), uniform_breakpoints(structure), coefficients, INERTIA, visited)


def motion(samples, seed=82):
    return rotating_motion(seed, samples, duration=8.0)


def rigid_flight(samples):
    time, m = motion(samples)
    return TorqueData(time, m, rigid_torque(symmetric(INERTIA))(m))


def bent_flight(samples):
    time, m = motion(samples)
    return TorqueData(time, m, bent_model().torque(m))


def only_window(data, predictor, horizon=20):
    """Replay a single window, and find where it is: the first that stays clear of the vertical."""
    clear = np.abs(np.cos(data.motion.attitude[:, 1])) > 0.35
    start = next(first for first in range(len(data)) if clear[first : first + horizon + 1].all())
    own = data[start : start + horizon + 1]
    return own, replay_steps("x", own, {"it": predictor}, horizon, 1)


def body_torque(data):
    measured = rotations.body_torque(data.motion.attitude, data.torque)
    return lambda t: np.array([np.interp(t, data.time, channel) for channel in measured.T])


def integrated(slope, start, data):
    """Integrate sample by sample, so that no step sees a corner of the torque."""
    states = [start]
    for begin, end in zip(data.time[:-1], data.time[1:], strict=True):
        states.append(solve_ivp(slope, (begin, end), states[-1], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1])
    return np.array(states[1:])


def test_a_rigid_body_turns_as_an_independent_integration_says():
    """Quaternion and rate by DOP853; the inertia is wrong, so that there is an error to agree on."""
    wrong = 1.3 * INERTIA + [0.1, 0, 0, 0, 0, 0]
    data, found = only_window(rigid_flight(800), wrong)
    tensor, torque = symmetric(wrong), body_torque(data)

    def slope(t, state):
        x, y, z, w = state[:4]
        rate = state[4:]
        turning = 0.5 * np.array([[w, -z, y], [z, w, -x], [-y, x, w], [-x, -y, -z]]) @ rate
        return np.concatenate([turning, np.linalg.solve(tensor, torque(t) - rotations.cross(rate, tensor @ rate))])

    measured = Rotation.from_euler("ZYX", data.motion.attitude[:, ::-1])
    rates = rotations.body_rate(data.motion.attitude, data.motion.rate)
    states = integrated(slope, np.concatenate([measured[0].as_quat(), rates[0]]), data)
    away = (measured[1:].inv() * Rotation.from_quat(states[:, :4])).as_rotvec()
    np.testing.assert_allclose(found.attitude[0], np.abs(away), rtol=1e-3, atol=2e-7)
    np.testing.assert_allclose(found.body_rate[0], np.abs(states[:, 4:] - rates[1:]), rtol=1e-3, atol=2e-7)
    assert np.max(found.attitude[0]) > 0.01


@pytest.mark.parametrize("seed", [82, 83, 85])
def test_a_model_turns_as_its_equation_in_euler_angles_says(seed):
    """D(q) qdd + C(q, qd) qd = W^T M, integrated in Euler angles."""
    time, m = motion(800, seed=seed)
    data = TorqueData(time, m, 1.2 * bent_model().torque(m))
    model = bent_model()
    data, found = only_window(data, model)
    torque = body_torque(data)

    def slope(t, state):
        q, qd = state[None, :3], state[None, 3:]
        tau = rotations.generalised_torque(q, torque(t)[None])[0] - coriolis_matrix(model.inertia(q), qd)[0] @ qd[0]
        return np.concatenate([qd[0], np.linalg.solve(model.inertia(q).value[0], tau)])

    states = integrated(slope, np.concatenate([data.motion.attitude[0], data.motion.rate[0]]), data)
    rates = rotations.body_rate(data.motion.attitude, data.motion.rate)
    predicted = rotations.body_rate(states[:, :3], states[:, 3:])
    np.testing.assert_allclose(found.body_rate[0], np.abs(predicted - rates[1:]), rtol=1e-3, atol=2e-7)
    assert np.max(found.body_rate[0]) > 0.01


def test_pitch_beyond_the_vertical_is_met_as_it_was_learned():
    """Both sides of the vertical name the same attitudes; a model of the full circle may differ there."""
    time, m = motion(800, seed=82)
    data = TorqueData(time, m, bent_model().torque(m))
    beyond = np.cos(m.attitude[:, 1]) < 0
    assert 0.1 < np.mean(beyond) < 0.9
    found = replay_steps("x", data, {"it": bent_model()}, 20, 200)
    near = Motion(np.where(beyond[:, None], np.pi + m.attitude * [1, -1, 1], m.attitude), m.rate * [1, 1, 1], m.rate)
    assert np.max(np.abs(bent_model().inertia(near.attitude).value - bent_model().inertia(m.attitude).value)) > 0.01
    assert np.max(found.attitude[0]) < 1e-3


@pytest.mark.parametrize(("flight", "predictor"), [(rigid_flight, INERTIA), (bent_flight, bent_model())])
def test_an_exact_model_errs_by_interpolation_alone(flight, predictor):
    """Torque between samples is a straight line: the error falls with the square of the sample time."""
    duration_samples = (401, 801, 1601)
    errors = []
    for samples, horizon in zip(duration_samples, (10, 20, 40), strict=True):
        found = replay_steps("x", flight(samples), {"it": predictor}, horizon, 400)
        errors.append(np.sqrt(np.mean(found.body_rate[0, -1] ** 2)))
    np.testing.assert_allclose(np.array(errors[:-1]) / errors[1:], 4.0, rtol=0.15)
    assert errors[-1] < 1e-3


def test_long_samples_are_taken_in_smaller_steps():
    """At a turn of half a radian per sample, the torque constant in time, the free spin of a body stays exact."""
    time = 0.1 * np.arange(30)
    spin = np.zeros((30, 3))
    attitude, rate = spin.copy(), spin.copy()
    attitude[:, 2], rate[:, 2] = 5.0 * time, 5.0
    data = TorqueData(time, Motion(attitude, rate, spin), spin)
    found = replay_steps("x", data, {"it": replace(bent_model(), coefficients=0 * bent_model().coefficients)}, 10, 5)
    # Ixz and Iyz make a spin about yaw no equilibrium; a body without them keeps it.
    pure = replay_steps("x", data, {"it": np.array([0.6, 0.8, 1.2, 0, 0, 0])}, 10, 5)
    assert np.max(found.attitude[0]) > 0.01
    assert np.max(pure.attitude[0]) < 1e-5
