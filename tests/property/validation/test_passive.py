"""Any structure with any coefficients: D and C store and give back energy, and make none; torque is D qdd + C qd."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpfls_cli.dynamics import InertiaFunctions, coriolis_matrix
from cpfls_cli.fuzzy.basis import InputRange
from cpfls_cli.regressor.regressor import Motion, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure

SEESAW = {"consequents": "seesaw", "products": "additive", "membership_functions": 5}
STRUCTURES = {
    "paper, full circle": SEESAW,
    "paper, data range": {**SEESAW, "input_map": "data-range"},
    "classic": {**SEESAW, "structure": "fls"},
    "classic, data range": {**SEESAW, "structure": "fls", "input_map": "data-range"},
    "harmonic, additive": {"harmonic_order": 1, "products": "additive", "membership_functions": 3},
    "harmonic, tensor": {"harmonic_order": 2, "products": "tensor", "membership_functions": 1},
}
STEP = 1e-6


def drawn(structure, seed):
    """A model with random coefficients over a random rigid body."""
    rng = np.random.default_rng(seed)
    counted = model_structure(StructureSettings(**STRUCTURES[structure]))
    ranges = (InputRange(-0.9, 0.8), InputRange(-0.7, 0.9))
    coefficients, rigid_body = rng.standard_normal(counted.parameters), rng.standard_normal(6)
    visited = rng.random((72, 72)) < 0.05
    return InertiaFunctions(counted, ranges, uniform_breakpoints(counted), coefficients, rigid_body, visited), rng


def attitudes(rng, samples=40):
    """Away from quarter turns, where the triangle wave has its corners and the classic system its seam."""
    return rng.integers(-4, 4, (samples, 3)) * (np.pi / 2) + rng.uniform(0.01, np.pi / 2 - 0.01, (samples, 3))


any_model = pytest.mark.parametrize("structure", STRUCTURES)
any_seed = given(st.integers(0, 2**32 - 1))
few = settings(deadline=None, max_examples=10)


@any_model
@few
@any_seed
def test_no_energy_is_made(structure, seed):
    model, rng = drawn(structure, seed)
    q, qd = attitudes(rng), rng.standard_normal((40, 3))
    C = coriolis_matrix(model.inertia(q), qd)
    ahead, behind = (model.inertia(q + sign * STEP * qd).value for sign in (1, -1))
    along = (ahead - behind) / (2 * STEP)
    skew = along - 2 * C
    np.testing.assert_allclose(skew, -skew.swapaxes(1, 2), atol=1e-4 * np.max(np.abs(C)))


@any_model
@few
@any_seed
def test_torque_is_inertia_times_acceleration_and_coriolis_times_rate(structure, seed):
    model, rng = drawn(structure, seed)
    motion = Motion(attitudes(rng), *rng.standard_normal((2, 40, 3)))
    inertial = np.einsum("nij,nj->ni", model.inertia(motion.attitude).value, motion.acceleration)
    turning = np.einsum("nij,nj->ni", coriolis_matrix(model.inertia(motion.attitude), motion.rate), motion.rate)
    torque = model.torque(motion)
    np.testing.assert_allclose(torque, inertial + turning, atol=1e-12 * np.max(np.abs(torque)))
