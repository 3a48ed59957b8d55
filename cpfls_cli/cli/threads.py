"""One thread for linear algebra: sums in one order, so the same bytes whatever the number of cores."""

from __future__ import annotations

import os

_LIMITS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)


def use_one_thread() -> None:
    """Limit linear algebra to one thread; its libraries read the limit when they load, so call this before."""
    os.environ.update(dict.fromkeys(_LIMITS, "1"))
