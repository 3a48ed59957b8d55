"""First-stage fits against plain least squares on the other parts."""

import numpy as np

from cpfls_cli.blocks import contiguous
from cpfls_cli.estimation.first_stage import FOLDS, first_stage_fit, first_stage_fit_by_run, fits_of_others


def test_each_part_is_predicted_by_the_others():
    rng = np.random.default_rng(1)
    z, x = rng.normal([5.0, 0.0, -2.0], 1.0, (200, 3)), rng.standard_normal((200, 2, 2))
    found, part = first_stage_fit(z, x, ridge=0.0), contiguous(200, FOLDS)
    both = np.column_stack([np.ones(200), z])
    for fold in range(FOLDS):
        fit = np.linalg.lstsq(both[part != fold], x[part != fold].reshape(-1, 4), rcond=None)[0]
        np.testing.assert_allclose(found[part == fold].reshape(-1, 4), both[part == fold] @ fit, rtol=1e-9)
    runs = first_stage_fit_by_run({2: z[:120], 0: z[120:]}, {0: x[120:], 2: x[:120]}, 0.0)
    np.testing.assert_array_equal(np.concatenate([runs[2], runs[0]]), found)
    assert first_stage_fit_by_run({}, []) == {}


def test_neighbours_are_left_out_too():
    rng = np.random.default_rng(2)
    z, x = rng.standard_normal((2, 8, 50, 2))
    ztz, ztx = z.swapaxes(1, 2) @ z, z.swapaxes(1, 2) @ x
    found = fits_of_others(ztz, ztx, 0.0, beside=1)
    far = [0, 1, 5, 6, 7]
    expected = np.linalg.lstsq(z[far].reshape(-1, 2), x[far].reshape(-1, 2), rcond=None)[0]
    np.testing.assert_allclose(found[3], expected, rtol=1e-9)
