"""Bands that hold the truth in 95 of 100 flights, by a bootstrap of blocks, and whether a model is one of a body."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.dynamics import CELLS, InertiaFunctions, inertia_matrix, not_positive_definite, rigid_columns, vertical
from cpfls_cli.identification.data import OtherTorque, TorqueSource
from cpfls_cli.identification.evaluator import Evaluator
from cpfls_cli.identification.samples import Products, Ready
from cpfls_cli.identification.settings import ValidationSettings
from cpfls_cli.identification.solver import Fit
from cpfls_cli.inertia import INERTIA_ENTRIES, symmetric
from cpfls_cli.least_squares import SMALLEST_SINGULAR_SHARE
from cpfls_cli.regressor.regressor import RIGID, Motion, Regressor
from cpfls_cli.result import BODY, EULER, about
from cpfls_cli.validation.replay import CLEAR
from cpfls_cli.validation.residuals import time_blocks

POWER = 0.75
"""Of the correction for leverage: between 1/2, CR2, and 1, CR3; benchmarks/band_coverage.py measures all three."""

# A direction that one block alone determines leaves it no residual: there the correction would find rounding.
_SMALLEST_REST = 1e-3

# A band of two standard deviations then holds a truth shifted by any number of them in 94 of 100 flights.
_BIAS_DEVIATION = 0.75

# Sums of products in memory, 160 MB; a model of very many parameters gets fewer blocks.
_MOST_PRODUCTS = 20_000_000


@dataclass(frozen=True)
class BlockScores:
    """Least squares ``(A^T A + P) x = A^T tau`` by block b, with residuals r_b.

    `gram`: ``A_b^T A_b``, shape (blocks, parameters, parameters); `score`: ``A_b^T r_b``, shape (blocks, parameters);
    `penalty`: diagonal of P; `parameters`: x; `power`: of the correction for what the fit has followed of the noise.
    """

    gram: Array
    score: Array
    penalty: Array
    parameters: Array
    power: float = POWER

    def draws(self, weights: Array, rank_tolerance: float) -> Array:
        """Draw deviations from the parameters by weighting the blocks.

        Parameters
        ----------
        weights : array, shape (draws, blocks)

        Returns
        -------
        array, shape (draws, parameters)
            Deviations from x.
        """
        half = self._half_inverse(rank_tolerance)
        values, vectors = np.linalg.eigh(half.T @ self.gram @ half)
        along = np.einsum("bij,bi->bj", vectors, self.score @ half)
        along *= np.maximum(1.0 - values, _SMALLEST_REST) ** -self.power
        return np.asarray(weights @ np.einsum("bij,bj->bi", vectors, along) @ half.T)

    def with_penalty(self, penalty: Array, rank_tolerance: float) -> BlockScores:
        """Solve the same least squares with another penalty."""
        half = replace(self, penalty=penalty)._half_inverse(rank_tolerance)
        # The scores add up to P x: taken from there, parameters without a penalty do not move by rounding.
        step = half @ (half.T @ ((self.penalty - penalty) * self.parameters))
        return replace(self, score=self.score - self.gram @ step, penalty=penalty, parameters=self.parameters + step)

    def undetermined(self, values: Array, rank_tolerance: float) -> Array:
        """Project parameters onto what the samples do not determine, ``(A^T A + P)^-1 P z``.

        Parameters
        ----------
        values : array, shape (draws, parameters)
            z.

        Returns
        -------
        array, shape (draws, parameters)
        """
        half = self._half_inverse(rank_tolerance)
        kept = half / np.linalg.norm(half, axis=0)
        return np.asarray((values * self.penalty) @ half @ half.T + values - values @ kept @ kept.T)

    def solution(self, rank_tolerance: float) -> Array:
        """Solve for the parameters of smallest norm, with the scores taken as ``A_b^T tau_b``."""
        half = self._half_inverse(rank_tolerance)
        return np.asarray(half @ (half.T @ np.sum(self.score, axis=0)))

    def _half_inverse(self, rank_tolerance: float) -> Array:
        """V with ``V V^T = (A^T A + P)^-1`` over what the samples determine, shape (parameters, rank)."""
        values, vectors = np.linalg.eigh(np.sum(self.gram, axis=0) + np.diag(self.penalty))
        kept = values > max(rank_tolerance, SMALLEST_SINGULAR_SHARE) ** 2 * max(values[-1], 0.0)
        return np.asarray(vectors[:, kept] / np.sqrt(values[kept]))


def missed_torque(source: TorqueSource, model: InertiaFunctions) -> OtherTorque:
    """Take the motion of a source with the torque that a model misses: measured minus predicted."""
    return OtherTorque(source, lambda data: data.torque - model.torque(data.motion))


@dataclass(frozen=True, eq=False)
class Draws:
    """Bootstrap draws of the parameters of a model: what other flights with the same noise might give.

    They scatter about the model's own. A band is wider than their spread by a factor that the number of blocks gives:
    see `cpfls_cli.validation.bands.band`.
    """

    coefficients: Array = about(
        "of the rule consequents, each draw", "draw", "rule_coefficient", unit="kg m^2", frame=EULER, brief=False
    )
    rigid_body: Array = about("under the fuzzy part, each draw", "draw", "6", unit="kg m^2", frame=BODY, brief=False)
    best_rigid_body: Array = about("that fits best, each draw", "draw", "6", unit="kg m^2", frame=BODY, brief=False)
    blocks: int = about("contiguous blocks of samples that were drawn")
    block_duration: float = about("duration of a block", unit="s")


def bootstrap(
    evaluator: Evaluator,
    training: TorqueSource,
    model: InertiaFunctions,
    fit: Fit,
    settings: ValidationSettings,
    rng: np.random.Generator,
) -> Draws:
    """Draw parameters by a wild bootstrap over contiguous blocks of samples.

    The parameters x of the model solve ``(A^T A + P) x = A^T tau``. A draw adds ``(A^T A + P)^-1 sum_b w_b (1 - A_b^T
    A_b (A^T A + P)^-1)^(-3/4) A_b^T r_b``, r_b the residuals of block b and w_b standard normal. Drawing whole blocks
    keeps whatever correlation the noise has within them; a block that is not drawn would leave parameters undetermined,
    so blocks are weighted and not drawn with replacement. Residuals are smaller than the noise by what the fit has
    followed of it, which the power undoes: -1/2 (CR2) gives the variance of white noise without bias, but the bands of
    attitudes that few blocks speak of are then too narrow, -1 (CR3, the jackknife) gives bands that are too wide;
    benchmarks/band_coverage.py.

    A ridge pulls the parameters towards a rigid body, most where the samples say least. What it hides cannot be seen
    from the parameters that it has shrunk, so the band of a model with a ridge does not lean on it: the sum above is
    taken under the weakest ridge that has a meaning, P_1, with the residuals r_b that it leaves, and to it are added
    ``(A^T A + P_1)^-1 P_1 z`` and ``0.75 u (x_1 - x)``, x_1 its parameters, z and u standard normal. P_1 is the mean
    squared residual of a row: it takes fuzzy parameters for normal numbers of variance 1, each of which alone would
    make a torque as large as the flight has. The first term is what that leaves open: of directions that the samples do
    not determine the whole of it, of determined ones nothing. The second is the bias of the model, as far as the flight
    shows it.

    Partitions and ridge weight are held at the model's. Without a ridge, what the samples do not determine stays where
    it is, at the smallest norm: there a band is what the structure does at attitudes that were not visited, not what
    the vehicle does. The same holds of a fuzzy part that the ridge switched off.

    Cameron, Gelbach and Miller, Review of Economics and Statistics 90 (2008), 414 (wild bootstrap by cluster); Bell and
    McCaffrey, Survey Methodology 28 (2002), 169 (CR2, CR3); Nychka, Journal of the American Statistical Association 83
    (1988), 1134, and Marra and Wood, Scandinavian Journal of Statistics 39 (2012), 53 (bands that hold their truth
    because the variance of what is left open contains the bias).
    """
    columns = RIGID + len(model.coefficients)
    blocks = time_blocks(training, settings.block_s, _MOST_PRODUCTS // columns**2)
    learned, tolerance = evaluator.solver.learned, evaluator.solver.rank_tolerance
    label = blocks.labels(learned.ready.source)
    count = int(label[-1]) + 1
    missed = Ready(missed_torque(learned.ready.source, model), rigid=True)
    products = replace(learned, ready=missed, label=label, labels=count).products(model.partitions)
    weights = rng.standard_normal((settings.draws, count))
    hidden = _BIAS_DEVIATION * rng.standard_normal((settings.draws, 1))
    scores, parameters = _model_scores(products, model, fit, over_rigid_body=learned.ready.rigid)
    held = scores.penalty > 0
    mean_square = float(np.sum(products.square) / np.sum(products.rows))
    weakest = scores.with_penalty(np.where(held, mean_square, 0.0), tolerance)
    prior = np.zeros((settings.draws, len(held)))
    prior[:, held] = rng.standard_normal((settings.draws, np.count_nonzero(held)))
    deviations = np.zeros((settings.draws, columns))
    deviations[:, parameters] = weakest.draws(weights, tolerance) + weakest.undetermined(prior, tolerance)
    deviations[:, parameters] += hidden * (weakest.parameters - scores.parameters)
    deviations *= _divide(fit)
    best, best_rigid_body = _rigid_scores(products, model, tolerance)
    return Draws(
        coefficients=model.coefficients + deviations[:, RIGID:],
        rigid_body=model.rigid_body + deviations[:, :RIGID],
        best_rigid_body=best_rigid_body + best.draws(weights, tolerance),
        blocks=count,
        block_duration=blocks.duration,
    )


def _model_scores(
    products: Products, model: InertiaFunctions, fit: Fit, *, over_rigid_body: bool
) -> tuple[BlockScores, slice]:
    """Select the columns that the model has, scaled as the ridge holds them, and return which they are."""
    off = np.isinf(fit.ridge_weight)
    parameters = slice(0 if over_rigid_body else RIGID, RIGID if off else None)
    divide = _divide(fit)
    gram, moment = products.gram * divide * divide[:, None], products.moment * divide
    penalty = np.full(len(divide), 0.0 if off else fit.ridge_weight * float(np.sum(products.rows)))
    penalty[:RIGID] = 0.0
    x = np.concatenate([model.rigid_body, model.coefficients]) / divide
    scores = BlockScores(gram[:, parameters, parameters], moment[:, parameters], penalty[parameters], x[parameters])
    return scores, parameters


def _rigid_scores(products: Products, model: InertiaFunctions, rank_tolerance: float) -> tuple[BlockScores, Array]:
    """Fit a rigid body in place of the model, from products with the torque that the model misses."""
    rigid, x = slice(0, RIGID), np.concatenate([model.rigid_body, model.coefficients])
    gram = products.gram[:, rigid, rigid]
    torque = products.moment[:, rigid] + products.gram[:, rigid] @ x
    free = BlockScores(gram, torque, np.zeros(RIGID), np.zeros(RIGID))
    best = free.solution(rank_tolerance)
    return replace(free, score=torque - gram @ best, parameters=best), best


def _divide(fit: Fit) -> Array:
    """Compute the factors from the parameters that the ridge holds to those of the model."""
    return np.concatenate([np.ones(RIGID), 1.0 / fit.column_size])


@dataclass(frozen=True, eq=False)
class Physics:
    """Physical plausibility of a model over the cells of roll and pitch that training visited."""

    cells: int = about("cells of roll and pitch that training visited, those near a pitch of +-90 deg left out")
    indefinite: int = about("of them where D(q) is not positive definite")
    smallest_eigenvalue: float = about(
        "smallest eigenvalue of D(q) over these cells", unit="kg m^2", frame=EULER, gaps=True
    )
    worst_attitude: Array = about("roll and pitch where it is smallest", "2", unit="rad", frame=EULER, gaps=True)
    indefinite_anywhere: int = about("cells of all roll and pitch where D(q) is not positive definite")
    every_cell: int = about("all cells but those near a pitch of +-90 deg")


def physical_sense(model: InertiaFunctions) -> Physics:
    """Check the plausibility of a model at the cells that training visited, and its D(q) at all cells."""
    attitude, everywhere = cell_centres(model.visited), cell_centres(np.ones_like(model.visited))
    anywhere = int(np.sum(not_positive_definite(model.inertia(everywhere).value, everywhere)))
    if len(attitude) == 0:
        return Physics(0, 0, float("nan"), np.full(2, np.nan), anywhere, len(everywhere))
    values = model.inertia(attitude).value
    smallest = np.linalg.eigvalsh(values)[:, 0]
    worst = int(np.argmin(smallest))
    return Physics(
        cells=len(attitude),
        indefinite=int(np.sum(not_positive_definite(values, attitude))),
        smallest_eigenvalue=float(smallest[worst]),
        worst_attitude=attitude[worst, :2],
        indefinite_anywhere=anywhere,
        every_cell=len(everywhere),
    )


def cell_centres(visited: BoolArray) -> Array:
    """Compute the attitudes, rad, yaw 0, at the centres of visited cells but those near a pitch of +-90 degrees.

    Roll is along the first axis of the cells, from -180 degrees.
    """
    roll, pitch = np.nonzero(visited)
    centres = (np.stack([roll, pitch, np.zeros_like(roll)], axis=1) + 0.5) * (2 * np.pi / CELLS) - np.pi
    attitude = centres * [1.0, 1.0, 0.0]
    return np.asarray(attitude[~vertical(attitude)])


COVERAGE = 0.95
# Attitudes at a time, which bounds the memory.
_BATCH = 1024

# Cells times draws at a time: 50 MB for the six entries.
_AT_ONCE = 1_000_000


def band(estimate: Array, drawn: Array, blocks: int) -> tuple[Array, Array]:
    """Put a band around an estimate.

    ``estimate +- t s``: s is the root mean square deviation of the draws, and t the quantile of Student's distribution
    with one degree of freedom less than there are blocks.

    Parameters
    ----------
    estimate : array, shape (...)
    drawn : array, shape (draws, ...)

    Returns
    -------
    low, high : array, shape (...)
    """
    half = _quantile(blocks) * np.sqrt(np.mean((drawn - estimate) ** 2, axis=0))
    return estimate - half, estimate + half


def inertia_band(
    model: InertiaFunctions, draws: Draws, attitude: Array, value: Array | None = None
) -> tuple[Array, Array]:
    """Put a band around the inertia matrix of a model, entry by entry.

    Of a model without a ridge, attitudes that training did not visit have a band of what its structure does there, not
    of what the vehicle does: coefficients that no sample determines do not scatter.

    Parameters
    ----------
    attitude : array, shape (samples, 3), rad
    value : array, shape (samples, 3, 3), or None
        The model's inertia matrix there, where it is at hand.

    Returns
    -------
    low, high : array, shape (samples, 3, 3), kg m^2
    """
    half = np.zeros((len(attitude), 3, 3))
    deviations = _deviations(model, draws)
    for part in _batches(len(attitude)):
        for (row, column), rows, columns in _inertia_rows(model, attitude[part]):
            half[part, row, column] = half[part, column, row] = _spread(rows, deviations[columns])
    half *= _quantile(draws.blocks)
    if value is None:
        value = model.inertia(attitude).value
    return value - half, value + half


def torque_band(
    model: InertiaFunctions, draws: Draws, motion: Motion, value: Array | None = None
) -> tuple[Array, Array]:
    """Put a band around the torque that a model predicts.

    It is the band of the prediction; a measured torque has its own noise besides.

    Parameters
    ----------
    value : array, shape (samples, 3), or None
        The model's torque, where it is at hand.

    Returns
    -------
    low, high : array, shape (samples, 3), N m
    """
    half = np.zeros((len(motion), 3))
    deviations = _deviations(model, draws)
    for part in _batches(len(motion)):
        some = motion[part]
        matrix = Regressor(model.structure, some, model.ranges).matrix(model.partitions)
        half[part] = _spread(np.concatenate([rigid_columns(some), matrix], axis=2), deviations)
    half *= _quantile(draws.blocks)
    if value is None:
        value = model.torque(motion)
    return value - half, value + half


def _inertia_rows(model: InertiaFunctions, attitude: Array) -> Iterator[tuple[tuple[int, int], Array, IntArray]]:
    """Yield the entries of the inertia matrix: row and column, basis, shape (samples, columns), and which columns."""
    still = Motion(attitude, np.zeros_like(attitude), np.zeros_like(attitude))
    regressor = Regressor(model.structure, still, model.ranges)
    rigid = np.stack([inertia_matrix(attitude, symmetric(unit)) for unit in np.eye(RIGID)], axis=-1)
    blocks = {(block.function.row, block.function.column): i for i, block in enumerate(model.structure.blocks)}
    for entry in INERTIA_ENTRIES:
        rows, columns = rigid[:, *entry], np.arange(RIGID, dtype=np.int64)
        if entry in blocks:
            index = blocks[entry]
            fuzzy = model.structure.blocks[index].columns
            rows = np.hstack([rows, regressor.basis(index, model.partitions).value])
            columns = np.append(columns, RIGID + np.arange(fuzzy.start, fuzzy.stop))
        yield entry, rows, columns


def _deviations(model: InertiaFunctions, draws: Draws) -> Array:
    """Deviations of the draws from the model, rigid body first, shape (6 + parameters, draws)."""
    return np.hstack([draws.rigid_body - model.rigid_body, draws.coefficients - model.coefficients]).T


def _spread(rows: Array, deviations: Array) -> Array:
    return np.asarray(np.sqrt(np.mean((rows @ deviations) ** 2, axis=-1)))


def _quantile(blocks: int) -> float:
    return float(stdtrit(max(blocks - 1, 1), 0.5 + 0.5 * COVERAGE))


def _batches(samples: int) -> Iterator[slice]:
    return (slice(start, start + _BATCH) for start in range(0, samples, _BATCH))


def definite_share(model: InertiaFunctions, draws: Draws) -> float | None:
    """Compute the share of draws whose D(q) is positive definite at the centres of all cells visited; None without any.

    Cells within 17 degrees of a vertical pitch are left out, as they are from the windows replayed: there the smallest
    eigenvalue of every body falls with the square of cos(pitch), and all noise is larger.
    """
    attitude = cell_centres(model.visited)
    attitude = attitude[np.abs(np.cos(attitude[:, 1])) >= CLEAR]
    if len(attitude) == 0:
        return None
    parameters = np.hstack([draws.rigid_body, draws.coefficients]).T
    basis, batch = list(_inertia_rows(model, attitude)), max(_AT_ONCE // len(attitude), 1)
    starts = range(0, parameters.shape[1], batch)
    definite = [_definite([rows @ parameters[columns, s : s + batch] for _, rows, columns in basis]) for s in starts]
    return float(np.mean(np.concatenate(definite)))


def _definite(entries: list[Array]) -> BoolArray:
    """Flag draws, shape (draws,), by the leading minors (Sylvester) of entries in the order of `INERTIA_ENTRIES`."""
    d11, d22, d33, d12, d13, d23 = entries
    minor = d11 * d22 - d12**2
    determinant = d33 * minor - d11 * d23**2 + 2 * d12 * d13 * d23 - d22 * d13**2
    return np.asarray(np.all((d11 > 0) & (minor > 0) & (determinant > 0), axis=0))
