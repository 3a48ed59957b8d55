"""Torque where an angle closes its circle (2 pi to 0) and where the seesaw folds (pi/2 and 3 pi/2)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpfls_cli.fuzzy.basis import breakpoints
from cpfls_cli.regressor.regressor import Motion, Regressor, data_ranges
from cpfls_cli.regressor.structure import StructureSettings, model_structure

SEESAW = model_structure(StructureSettings(consequents="seesaw", products="additive", membership_functions=5))
HARMONIC = [
    model_structure(StructureSettings(harmonic_order=order, products=products, membership_functions=functions))
    for order, products, functions in ((1, "additive", 5), (1, "tensor", 3), (2, "tensor", 1), (2, "additive", 2))
]
STEP = 1e-7
FOLDS = (0.5 * np.pi, 1.5 * np.pi)
PLACES = (0.0, *FOLDS, np.pi)

weights = st.lists(st.integers(3000, 65535), min_size=24, max_size=24)
angles = st.sampled_from([0, 1])
elsewhere = st.floats(-10, 10)
seeds = st.integers(0, 2**32 - 1)


class Crossing:
    """A random model, and a random motion that crosses one place of roll or pitch at different speeds."""

    def __init__(self, structure, genes, angle, place, other, seed):
        rng = np.random.default_rng(seed)
        self.structure, self.angle, self.place, self.other = structure, angle, place, other
        self.rate, self.acceleration = rng.uniform(-3, 3, (2, 3))
        self.coefficients = rng.uniform(-1, 1, structure.parameters)
        parts = list(structure.weight_slices())
        self.partitions = tuple(breakpoints(np.array(genes[part], dtype=float)) for part in parts)

    def regressor(self, offsets):
        attitude = np.full((len(offsets), 3), self.other)
        # On the circle, so that 0 is met from 2 pi.
        attitude[:, self.angle] = np.mod(self.place + offsets, 2 * np.pi)
        rate, acceleration = (np.tile(row, (len(offsets), 1)) for row in (self.rate, self.acceleration))
        motion = Motion(attitude, rate, acceleration)
        return Regressor(self.structure, motion, data_ranges(self.structure, attitude))

    def torque(self, offsets):
        return self.regressor(offsets).torque(self.partitions, self.coefficients)

    def jump(self):
        before, after = self.torque(STEP * np.array([-1.0, 1.0]))
        return after - before

    def explained(self):
        """How far the torque may change over the two steps by its steepest slope on either side."""
        beside = np.linspace(2 * STEP, 2e-4, 100)
        slopes = [np.diff(self.torque(side * beside), axis=0) / (beside[1] - beside[0]) for side in (-1, 1)]
        return 2 * STEP * 1.5 * np.max(np.abs(slopes)) + 1e-9 * (1 + np.max(np.abs(self.torque(beside))))

    def folded(self):
        """The jump by formula: the slope of the seesaw changes by ``d = -+4 / pi``, so that of a function f = sum_r
        mu_r (c_r0 + ... + c_rk s(q_k)) by ``g = d sum_r mu_r c_rk``, and the torque by
        ``E qd qd_k g - (qd^T E qd / 2) g e_k``, whatever the acceleration."""
        change = {FOLDS[0]: -4 / np.pi, FOLDS[1]: 4 / np.pi}.get(self.place, 0.0)
        regressor, total = self.regressor(np.zeros(1)), np.zeros(3)
        for index, block in enumerate(self.structure.blocks):
            if self.angle not in block.function.inputs:
                continue
            own = self.coefficients[block.columns].reshape(block.rules, block.features)
            slope = (
                change
                * (regressor.firing(index, self.partitions)[0] @ own)[1 + block.function.inputs.index(self.angle)]
            )
            E = np.zeros((3, 3))
            E[block.function.row, block.function.column] = E[block.function.column, block.function.row] = 1.0
            total += E @ self.rate * self.rate[self.angle] * slope
            total[self.angle] -= 0.5 * (self.rate @ E @ self.rate) * slope
        return total


@pytest.mark.parametrize("structure", HARMONIC, ids=lambda s: f"{s.parameters} parameters")
@pytest.mark.parametrize("place", PLACES)
@settings(deadline=None, max_examples=15)
@given(weights, angles, elsewhere, seeds)
def test_harmonic_torque_jumps_nowhere(structure, place, genes, angle, other, seed):
    crossing = Crossing(structure, genes, angle, place, other, seed)
    assert np.max(np.abs(crossing.jump())) <= crossing.explained()


@pytest.mark.parametrize("place", PLACES)
@settings(deadline=None, max_examples=40)
@given(weights, angles, elsewhere, seeds)
def test_seesaw_torque_jumps_where_it_folds_by_what_its_slope_changes(place, genes, angle, other, seed):
    crossing = Crossing(SEESAW, genes, angle, place, other, seed)
    expected = crossing.folded()
    assert (place in FOLDS) == bool(np.any(expected))
    assert np.max(np.abs(crossing.jump() - expected)) <= crossing.explained()


@settings(deadline=None, max_examples=20)
@given(weights, angles, elsewhere, seeds)
def test_the_jump_at_the_fold_is_more_than_the_derivative_explains(genes, angle, other, seed):
    """Without this, what is explained could be so generous that the tests above would pass on anything."""
    crossing = Crossing(SEESAW, genes, angle, FOLDS[0], other, seed)
    if np.max(np.abs(crossing.folded())) > 0.1:
        assert np.max(np.abs(crossing.jump())) > crossing.explained()
