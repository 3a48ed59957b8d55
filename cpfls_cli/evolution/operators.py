"""Crossover and mutation of bit strings."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import BoolArray


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
