"""Division of a population into subpopulations that breed apart."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import IntArray


def subpopulation_labels(population: int, subpopulations: int) -> IntArray:
    """Split a population as evenly as possible.

    Returns
    -------
    array of int, shape (population,)
        Label of each individual's subpopulation, in increasing order; sizes differ by one at most.
    """
    return np.sort(np.arange(population, dtype=np.int64) % subpopulations)


def members(labels: IntArray) -> list[IntArray]:
    """List the individuals of each subpopulation.

    Parameters
    ----------
    labels : array of int, shape (population,)

    Returns
    -------
    list of array of int
        Indices into the population, one array per subpopulation.
    """
    return [np.flatnonzero(labels == label) for label in np.unique(labels)]
