"""Curves over roll and pitch: where they run, and what stands on them."""

import numpy as np
import pytest

from cpfls_cli.dynamics import InertiaFunctions, inertia_matrix, visited_cells
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.regressor import Motion, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.validation.bands import Draws, inertia_band
from cpfls_cli.validation.validate import curves

BEST = np.array([0.6, 0.7, 1.2, 0.03, -0.02, 0.04])
STRUCTURE = model_structure(IdentificationSettings(harmonic_order=1))


def drawn(roll, pitch):
    """Curves of a random model over a flight whose roll and pitch lie within ranges in degrees."""
    rng = np.random.default_rng(12)
    angles = np.deg2rad([np.linspace(*ends, 2001) for ends in (roll, pitch)])
    attitude = np.column_stack([*angles, np.full(2001, 7.0)])
    still = np.zeros_like(attitude)
    training = TorqueData(0.01 * np.arange(2001), Motion(attitude, still, still), still)
    ranges, parameters = data_ranges(STRUCTURE, attitude), STRUCTURE.parameters
    partitions = uniform_breakpoints(STRUCTURE)
    model = InertiaFunctions(
        STRUCTURE, ranges, partitions, rng.standard_normal(parameters), BEST, visited_cells([attitude])
    )
    draws = Draws(
        model.coefficients + 0.1 * rng.standard_normal((30, parameters)),
        BEST + 0.01 * rng.standard_normal((30, 6)),
        BEST + 0.01 * rng.standard_normal((30, 6)),
        blocks=10,
        block_duration=1.0,
    )
    return curves(model, draws, BEST, training), model, draws


def test_whole_turns_where_the_flight_went_far():
    found, model, draws = drawn((-170, 180 + 350), (-20, 60))
    assert found.name == ("over roll", "over pitch")
    over_roll, over_pitch = np.rad2deg(found.attitude)
    np.testing.assert_allclose(over_roll[:, 0], np.linspace(-180, 180, 181), atol=1e-9)
    np.testing.assert_allclose(over_roll[:, 1:], [[20.0, 0.0]] * 181, atol=1e-9)
    np.testing.assert_allclose(over_pitch[:, 1], np.linspace(-180, 180, 181), atol=1e-9)
    assert not found.outside[:, 90].all()
    assert found.outside[1, 0]
    for curve in range(2):
        attitude = found.attitude[curve]
        np.testing.assert_allclose(found.inertia[curve], model.inertia(attitude).value)
        np.testing.assert_allclose(found.rigid_body[curve], inertia_matrix(attitude, symmetric(BEST)))
        np.testing.assert_array_equal(found.outside[curve], model.outside(attitude))
        np.testing.assert_allclose([found.low[curve], found.high[curve]], inertia_band(model, draws, attitude))


@pytest.mark.parametrize(("pitch", "ends"), [((-10, 30), (-20, 40)), ((5, 5), (3, 7)), ((-29, 30), (-43.75, 44.75))])
def test_close_up_where_it_did_not(pitch, ends):
    found, _, _ = drawn((-170, 170), pitch)
    over_roll, over_pitch = np.rad2deg(found.attitude)
    assert over_roll[[0, -1], 0] == pytest.approx((-180, 180))
    assert over_pitch[[0, -1], 1] == pytest.approx(ends)
    np.testing.assert_allclose(over_pitch[:, 0], 0.0, atol=1e-9)
