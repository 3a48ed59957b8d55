"""First-stage fits: what instruments predict of signals, each part of the flights by what the other parts show.

A prediction by the same samples would follow their disturbance again, however few instruments there are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cpfls_cli.arrays import Array, Numbers
from cpfls_cli.blocks import contiguous

FOLDS = 5
"""Parts of the flights that are kept aside in turn."""
RIDGE, OF_MANY = 1e-6, 1e-3
"""So that instruments that hardly differ do no harm; of many that go together, in flights that differ."""


def fits_of_others(ztz: Numbers, ztx: Numbers, ridge: Numbers | float, neighbours: int = 0) -> Numbers:
    """Fit signals X to instruments Z on all parts but each, shape (part, ..., instrument, signal).

    Parameters
    ----------
    ztz : array, shape (part, ..., instrument, instrument)
    ztx : array, shape (part, ..., instrument, signal)
    ridge : float or array, broadcast to (part, ..., instrument, instrument)
        Added to the diagonal.
    neighbours : int
        How many parts to either side are left out too.

    References
    ----------
    Angrist, Imbens and Krueger 1999 (jackknife instrumental variables).
    """
    apart = np.abs(np.subtract.outer(np.arange(len(ztz)), np.arange(len(ztz)))) > neighbours
    gram, moment = (np.tensordot(apart.astype(float), each, 1) for each in (ztz, ztx))
    return np.asarray(np.linalg.solve(gram + ridge * np.eye(gram.shape[-1]), moment))


def first_stage_fit(instruments: Array, values: Array, ridge: float = RIDGE) -> Array:
    """Predict values, time first, from instruments and a constant, each of five parts by the other ones.

    `ridge`: prior precision of the prediction, for instruments as large as 1.
    """
    size, part = instruments.std(axis=0), contiguous(len(values), FOLDS)
    z = np.hstack([np.ones((len(values), 1)), instruments / np.where(size > 0, size, 1.0)])
    parts = [part == fold for fold in range(FOLDS)]
    flat = values.reshape(len(values), -1)
    ztz, ztx = (np.array([z[own].T @ each[own] for own in parts]) for each in (z, flat))
    rest = ridge * (len(z) - np.bincount(part, minlength=FOLDS))
    weights = fits_of_others(ztz, ztx, rest[:, None, None])
    return np.concatenate([z[own] @ fit for own, fit in zip(parts, weights, strict=True)]).reshape(values.shape)


def first_stage_fit_by_run(
    instruments: Mapping[int, Array], values: Sequence[Array] | Mapping[int, Array], ridge: float = RIDGE
) -> dict[int, Array]:
    """Predict values of runs by their numbers, all runs together; see `first_stage_fit`."""
    if not instruments:
        return {}
    together = np.concatenate(list(instruments.values())), np.concatenate([values[number] for number in instruments])
    ends = np.cumsum([len(own) for own in instruments.values()])[:-1]
    return dict(zip(instruments, np.split(first_stage_fit(*together, ridge), ends), strict=True))
