"""Share rows out among workers."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import IntArray

_CHUNKS_PER_WORKER = 4


def chunks(rows: int, workers: int) -> list[IntArray]:
    """Cut rows into chunks that shrink towards the end, down to a single row.

    Each chunk takes a fixed share of what is left, so there are few of them, and yet nobody waits long for the
    last one, however uneven the rows are (guided self-scheduling).

    Returns
    -------
    list of array of int
        Consecutive rows; one empty chunk where there are no rows.

    References
    ----------
    Polychronopoulos and Kuck, Guided self-scheduling, IEEE Transactions on Computers C-36(12), 1987.
    """
    bounds = [0]
    while bounds[-1] < rows:
        left = rows - bounds[-1]
        bounds.append(bounds[-1] - (-left // (_CHUNKS_PER_WORKER * workers)))
    return np.split(np.arange(rows), bounds[1:-1])
