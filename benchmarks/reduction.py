"""Reduction of the paper's training path by our criteria and by others: conditioning, what the models are worth, time.

Time is set against the greedy rule done with one eigensolve per candidate and step, extrapolated from a few hundred
eigensolves timed in turn with each selection; the larger the number, the faster. A model is fitted to the selected
samples with 5 % torque noise; its error is the largest one over the whole path without noise, over the largest torque.

A sample is three rows. To packages that take one vector per sample it is the vector of its 3 x 113 values.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import scipy.linalg

from benchmarks.shared.measure import in_turn, program, seconds, table
from benchmarks.shared.studies import paper_flight, regressor_matrix
from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.reduction.settings import CriterionName, ReductionSettings
from tests.builders.reductions import reduce

SIZES = (685, 80)
CRITERIA: tuple[CriterionName, ...] = ("KD-exchange", "K-exchange", "sigma_min", "A", "D", "paper-literal")
RANDOM_DRAWS = 20
NOISE, NOISE_DRAWS = 0.05, 20
EIGENSOLVES = 200
# A selection that takes longer is timed once.
SHORT_S, REPEATS = 6.0, 5
COLUMNS = (
    "selection | samples | rank | condition number | share of the full set's | model error, median | "
    "model error, worst | times faster than one eigensolve per candidate"
)

Choose = Callable[[], IntArray]


def ours(Q: Array, criterion: CriterionName, size: int) -> IntArray:
    return reduce(Q, ReductionSettings(criterion=criterion, size=size)).indices


def random_best(Q: Array, size: int) -> IntArray:
    rng = np.random.default_rng(0)
    draws = [rng.choice(len(Q), size, replace=False) for _ in range(RANDOM_DRAWS)]
    return min(draws, key=partial(condition_number, Q))


def every_kth(Q: Array, size: int) -> IntArray:
    return np.linspace(0, len(Q) - 1, size).round().astype(np.int64)


def pivoted_qr(Q: Array, size: int) -> IntArray:
    return scipy.linalg.qr(Q.reshape(len(Q), -1).T, mode="r", pivoting=True)[1][:size]


def farthest_points(Q: Array, size: int) -> IntArray:
    from skmatter.sample_selection import FPS

    return FPS(n_to_select=size, initialize=0).fit(Q.reshape(len(Q), -1)).selected_idx_


def cur(Q: Array, size: int) -> IntArray:
    from skmatter.sample_selection import CUR

    return CUR(n_to_select=size).fit(Q.reshape(len(Q), -1)).selected_idx_


def facility_location(Q: Array, size: int) -> IntArray:
    from apricot import FacilityLocationSelection

    return FacilityLocationSelection(size, metric="euclidean", optimizer="lazy").fit(Q.reshape(len(Q), -1)).ranking


OTHERS = {
    f"random, best of {RANDOM_DRAWS}": random_best,
    "every k-th": every_kth,
    "pivoted QR (scipy)": pivoted_qr,
    "farthest points (skmatter)": farthest_points,
    "CUR (skmatter)": cur,
    "facility location (apricot)": facility_location,
}


def condition_number(Q: Array, indices: IntArray) -> float:
    rows = Q[indices].reshape(-1, Q.shape[2])
    return float(np.linalg.cond(rows)) if np.linalg.matrix_rank(rows) == Q.shape[2] else np.inf


def model_errors(Q: Array, torque: Array, indices: IntArray) -> Array:
    rng, size = np.random.default_rng(1), NOISE * np.sqrt(np.mean(torque**2, axis=0))
    noisy = torque[indices] + size * rng.standard_normal((NOISE_DRAWS, len(indices), 3))
    models = np.linalg.lstsq(Q[indices].reshape(-1, Q.shape[2]), noisy.reshape(NOISE_DRAWS, -1).T, rcond=None)[0]
    return np.abs(Q @ models - torque[..., None]).max(axis=(0, 1)) / np.abs(torque).max()


def eigensolves(Q: Array, gram: Array) -> None:
    for rows in Q[:EIGENSOLVES]:
        scipy.linalg.eigh(gram + rows.T @ rows, eigvals_only=True, subset_by_index=[0, 0])


def times_faster(Q: Array, size: int, choose: Choose) -> float:
    brute_force = partial(eigensolves, Q, np.einsum("nij,nik->jk", Q, Q))
    solves = sum(len(Q) - step for step in range(size)) / EIGENSOLVES
    first = seconds(choose)
    if first > SHORT_S:
        return solves * seconds(brute_force) / first
    return solves * in_turn(brute_force, choose, REPEATS).ratio


def selections(Q: Array, size: int) -> Iterator[tuple[str, Choose]]:
    for criterion in CRITERIA:
        yield criterion, partial(ours, Q, criterion, size)
    for name, choose in OTHERS.items():
        yield name, partial(choose, Q, size)


def row(Q: Array, torque: Array, name: str, indices: IntArray, faster: object) -> tuple[object, ...]:
    condition, full = condition_number(Q, indices), condition_number(Q, np.arange(len(Q)))
    errors = model_errors(Q, torque, indices)
    rank = np.linalg.matrix_rank(Q[indices].reshape(-1, Q.shape[2]))
    share = round(condition / full, 3)
    return name, len(indices), int(rank), f"{condition:.0f}", share, float(np.median(errors)), errors.max(), faster


def main() -> None:
    # CUR warns once per column that its own orthogonalisation has emptied.
    warnings.simplefilter("ignore")
    flight = paper_flight()
    Q, torque = regressor_matrix(flight.motion), flight.torque
    rows = [row(Q, torque, "full set", np.arange(len(Q)), "")]
    for size in SIZES:
        for name, choose in selections(Q, size):
            rows.append(row(Q, torque, name, choose(), f"{times_faster(Q, size, choose):.0f}"))
    table("reduction", COLUMNS, rows)


if __name__ == "__main__":
    program(main)
