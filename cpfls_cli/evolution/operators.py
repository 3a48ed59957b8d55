"""Recombination of pairs, and mutation of bit strings."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import BoolArray, IntArray

_BEYOND = 0.25


def intermediate_recombination(genes: IntArray, rate: float, largest: int, rng: np.random.Generator) -> IntArray:
    """Draw offspring between the parents of consecutive pairs and a little beyond (RECINT of the Sheffield toolbox).

    ``offspring = first + u (second - first)``, u uniform from -0.25 to 1.25 for each gene of each offspring.

    Parameters
    ----------
    genes : array of int, shape (individuals, genes)
        Rows 0 and 1 are a pair, rows 2 and 3, and so on; an odd last row stays as it is.
    rate : float
        Probability that a pair is recombined.
    largest : int
        Offspring are clipped to 0 and this.
    rng : numpy.random.Generator

    Returns
    -------
    array of int, shape (individuals, genes)

    References
    ----------
    Mühlenbein and Schlierkamp-Voosen, Evolutionary Computation 1 (1993): extended intermediate recombination.
    """
    paired = 2 * (len(genes) // 2)
    recombined = np.repeat(rng.random(paired // 2) < rate, 2)
    share = rng.uniform(-_BEYOND, 1.0 + _BEYOND, size=(paired, genes.shape[1]))
    partner = genes[:paired].reshape(-1, 2, genes.shape[1])[:, ::-1].reshape(paired, -1)
    drawn = np.rint(genes[:paired] + share * (partner - genes[:paired])).astype(np.int64)
    offspring = genes.copy()
    offspring[:paired][recombined] = np.clip(drawn, 0, largest)[recombined]
    return offspring


def single_point_crossover(bits: BoolArray, rate: float, rng: np.random.Generator) -> BoolArray:
    """Exchange the tails of consecutive pairs (XOVSP of the Sheffield toolbox).

    Parameters
    ----------
    bits : array of bool, shape (individuals, bits)
        Rows 0 and 1 are a pair, rows 2 and 3, and so on; an odd last row stays as it is.
    rate : float
        Probability that a pair is crossed.
    rng : numpy.random.Generator

    Returns
    -------
    array of bool, shape (individuals, bits)
        Each crossed pair keeps at least the first bit and exchanges at least the last.
    """
    individuals, length = bits.shape
    pairs = individuals // 2
    crossed = rng.random(pairs) < rate
    point = rng.integers(1, length, size=pairs) if length > 1 else np.ones(pairs, dtype=np.int64)
    tail = crossed[:, np.newaxis] & (np.arange(length) >= point[:, np.newaxis])
    first, second = bits[0 : 2 * pairs : 2], bits[1 : 2 * pairs : 2]
    offspring = bits.copy()
    offspring[0 : 2 * pairs : 2] = np.where(tail, second, first)
    offspring[1 : 2 * pairs : 2] = np.where(tail, first, second)
    return offspring


def mutate(bits: BoolArray, individuals_share: float, bits_share: float, rng: np.random.Generator) -> BoolArray:
    """Flip a share of the bits of a share of the individuals (MUT of the Sheffield toolbox, on some rows).

    Every individual and every bit is drawn on its own, so the shares are expectations and hold for small
    populations and short chromosomes too.

    Parameters
    ----------
    bits : array of bool, shape (individuals, bits)
    individuals_share : float
        Probability that an individual mutates.
    bits_share : float
        Probability that a bit of a mutating individual flips.
    rng : numpy.random.Generator

    Returns
    -------
    array of bool, shape (individuals, bits)
    """
    mutating = rng.random((len(bits), 1)) < individuals_share
    flipped = rng.random(bits.shape) < bits_share
    mutated: BoolArray = bits ^ (mutating & flipped)
    return mutated
