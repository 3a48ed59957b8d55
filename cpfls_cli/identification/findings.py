"""How well flights excite a model, how it does on them, and warnings about an identification, in sentences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy import linalg

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.dynamics import VERTICAL, rigid_columns, vertical, why_unphysical
from cpfls_cli.identification.closed_loop import FreedTorque
from cpfls_cli.identification.data import TorqueData, TorqueSource, axis_scale
from cpfls_cli.identification.samples import Samples
from cpfls_cli.identification.solver import Fit, regressor_blocks
from cpfls_cli.inertia import INERTIA_PARAMETERS, symmetric_columns
from cpfls_cli.least_squares import LeastSquares, Triangle
from cpfls_cli.playback.loop import LoopBounds
from cpfls_cli.regressor.regressor import RIGID, Breakpoints, Motion
from cpfls_cli.result import about
from cpfls_cli.rotations import body_acceleration, body_torque, euler_rate_matrix
from cpfls_cli.rounding import less
from cpfls_cli.words import joined, some

Columns = Callable[[Motion], Array]


@dataclass(frozen=True)
class Score:
    """Scores of a torque prediction; other fields are described at `Judged`.

    Attributes
    ----------
    r2_body : array, shape (3,)
        The same for body torque, at samples where the pitch is not vertical: it is divided by cos(pitch), and errors
        with it. NaN if no such sample is left.
    """

    mse: Array
    max_error: Array
    relative_error: Array
    r2: Array
    r2_body: Array
    vaf: Array

    @property
    def worst_relative_error(self) -> float:
        """Largest relative error of the axes that have torque; 0 if none has."""
        return float(np.max(self.relative_error[np.isfinite(self.relative_error)], initial=0.0))


def score_of(source: TorqueSource, torque: Callable[[Motion], Array]) -> Score:
    """Compare the predictions of a model with the torque of flights, chunk by chunk.

    Parameters
    ----------
    torque : callable
        Predicts the generalised torque of a motion.
    """
    sums = ScoreSums()
    for data in source.chunks():
        sums.add(data, torque(data.motion))
    return sums.score()


class VarianceExplained:
    """Sums for the share of the variance explained, ``1 - sum e^2 / sum (y - mean y)^2``, chunk by chunk.

    Chan, Golub and LeVeque, The American Statistician 37 (1983), 242 (sums of squares about a mean, pairwise).
    """

    def __init__(self) -> None:
        self._count, self._square = 0, np.zeros(3)
        # Of what is measured, then of the errors.
        self._mean, self._about_mean = np.zeros((2, 3)), np.zeros((2, 3))

    def add(self, measured: Array, error: Array) -> None:
        """Add samples, if any; both arrays have the shape (samples, 3)."""
        if len(measured) == 0:
            return
        values, count = np.stack([measured, error]), self._count + len(measured)
        mean = values.mean(axis=1)
        apart = mean - self._mean
        self._about_mean += ((values - mean[:, None]) ** 2).sum(axis=1) + apart**2 * self._count * len(error) / count
        self._mean, self._count = self._mean + apart * (len(error) / count), count
        self._square = self._square + np.sum(error**2, axis=0)

    @property
    def mean_squared_error(self) -> Array:
        """Mean squared error by channel."""
        return np.asarray(self._square / self._count)

    @property
    def r2(self) -> Array:
        """Share of the variance explained by channel; NaN where the measured channel does not vary."""
        return 1.0 - _ratio(self._square, self._about_mean[0])

    @property
    def vaf(self) -> Array:
        """Variance accounted for by channel: the same of the error about its mean, without its constant part."""
        return 1.0 - _ratio(self._about_mean[1], self._about_mean[0])


class ScoreSums:
    """Sums over samples that a score is made of, chunk by chunk."""

    def __init__(self) -> None:
        """Begin with no samples."""
        self._largest, self._largest_error = np.zeros(3), np.zeros(3)
        self._euler, self._body = VarianceExplained(), VarianceExplained()

    def add(self, data: TorqueData, predicted: Array) -> None:
        """Add samples, and the torque predicted for them."""
        error, attitude = data.torque - predicted, data.motion.attitude
        self._euler.add(data.torque, error)
        known = ~vertical(attitude)
        self._body.add(*(body_torque(attitude[known], torque[known]) for torque in (data.torque, error)))
        self._largest = np.maximum(self._largest, np.max(np.abs(data.torque), axis=0))
        self._largest_error = np.maximum(self._largest_error, np.max(np.abs(error), axis=0))

    def score(self) -> Score:
        """Give the score of all samples so far."""
        return Score(
            mse=self._euler.mean_squared_error,
            max_error=self._largest_error,
            relative_error=_ratio(self._largest_error, self._largest),
            r2=self._euler.r2,
            r2_body=self._body.r2,
            vaf=self._euler.vaf,
        )


def _ratio(numerator: Array, denominator: Array) -> Array:
    safe = np.where(denominator > 0, denominator, 1.0)
    return np.where(denominator > 0, numerator / safe, np.nan)


@dataclass(frozen=True)
class Baseline:
    """A linear model with few parameters; `columns` takes motion to shape (samples, 3, parameters)."""

    name: str
    columns: Columns
    parameters: Array

    def torque(self, motion: Motion) -> Array:
        """Predict the generalised torque, shape (samples, 3), N m."""
        return np.asarray(self.columns(motion) @ self.parameters)


def constant_inertia_columns(motion: Motion) -> Array:
    """Build the columns of a constant symmetric J in ``J qdd``: J11, J22, J33, J12, J13, J23; shape (samples, 3, 6)."""
    return symmetric_columns(motion.acceleration)


def fit_baselines(source: TorqueSource, row_scale: Array, rank_tolerance: float) -> tuple[Baseline, ...]:
    """Fit rigid body, constant inertia and torque zero to the samples learned from, with weights by axis."""
    kinds: tuple[tuple[str, Columns], ...] = (
        ("rigid-body", rigid_columns),
        ("constant-inertia", constant_inertia_columns),
        ("torque-zero", lambda motion: np.zeros((len(motion), 3, 0))),
    )
    return tuple(Baseline(name, columns, _fit(columns, source, row_scale, rank_tolerance)) for name, columns in kinds)


def _fit(columns: Columns, source: TorqueSource, row_scale: Array, rank_tolerance: float) -> Array:
    blocks = ((columns(data.motion) * row_scale[:, None], data.torque * row_scale) for data in source.chunks())
    rows = ((matrix.reshape(torque.size, matrix.shape[2]), torque.reshape(-1)) for matrix, torque in blocks)
    return Triangle.of(rows).solve(rank_tolerance).coefficients


# A rule that never fires by more adds nothing to a torque; half of its directions known are a surface, if a rough one.
_SILENT_FIRING, _DETERMINED_SHARE = 1e-3, 0.5
# Standard deviations beyond which a rate is clearly on one side of its mean, so that noise does not count.
_CLEARLY = 0.5


@dataclass(frozen=True, eq=False)
class RuleExcitation:
    """Excitation of each rule by data."""

    name: tuple[str, ...] = about("inertia function and rule", "rule")
    firing: Array = about("largest firing strength in training", "rule")
    determined: Array = about("share of the rule's coefficients that data determine", "rule")

    @property
    def excited(self) -> BoolArray:
        """Whether a rule fires at all and data determine at least half of its coefficients."""
        return np.asarray((self.firing > _SILENT_FIRING) & (self.determined >= _DETERMINED_SHARE))


def rule_excitation(
    learned: Samples, partitions: Breakpoints, noise: float, inertia: float, rank_tolerance: float
) -> RuleExcitation:
    """Measure how far samples excite each rule.

    A direction of the coefficients counts as determined where noise in the torque (root mean square of what no model
    explains, N m) moves it by less than the inertia itself (a typical moment, kg m^2): its singular value is above
    noise over inertia, and above the rank tolerance.
    """
    blocks, singular_values, Vt = learned.structure.blocks, *_decomposed(learned, partitions)
    floor = max(rank_tolerance * singular_values[0], noise / inertia if inertia > 0 else 0.0)
    share = np.sum(Vt[singular_values > floor] ** 2, axis=0)
    names = [f"{block.function.name} rule {rule + 1}" for block in blocks for rule in range(block.rules)]
    determined = [np.mean(share[block.columns].reshape(block.rules, block.features), axis=1) for block in blocks]
    return RuleExcitation(tuple(names), _firing(learned, partitions), np.concatenate(determined))


def _decomposed(learned: Samples, partitions: Breakpoints) -> tuple[Array, Array]:
    """Singular values and right singular vectors of the fuzzy columns alone."""
    rows = (
        (regressor.matrix(partitions).reshape(-1, learned.structure.parameters), data.torque.reshape(-1))
        for data, regressor in regressor_blocks(learned)
    )
    _, singular_values, Vt = linalg.svd(Triangle.of(rows).matrix[:, :-1], full_matrices=False, check_finite=False)
    return singular_values, Vt


def _firing(learned: Samples, partitions: Breakpoints) -> Array:
    """Largest firing strength of every rule over the samples."""
    blocks = range(len(learned.structure.blocks))
    strongest = [
        np.concatenate([np.max(regressor.firing(index, partitions), axis=0) for index in blocks])
        for _, regressor in regressor_blocks(learned)
    ]
    return np.asarray(np.max(strongest, axis=0))


@dataclass(frozen=True)
class AxisEvidence:
    """Share of each body axis that a rigid body and a constant torque explain, where the pitch is not vertical.

    `constant`: body torque fitted jointly with the rigid body, N m; `r2`: share of the body torque explained by both,
    NaN without samples; `torque` and `acceleration`: root mean squares of it, N m, and of the derivative of the body
    rates, rad/s^2.
    """

    constant: Array
    r2: Array
    torque: Array
    acceleration: Array


def axis_evidence(source: TorqueSource, rank_tolerance: float) -> AxisEvidence:
    """Fit six inertia parameters and a constant body torque, and measure what they explain of each axis."""
    scale = 1.0 / axis_scale(source)
    rows = ((_columns(data) * scale[:, None], data.torque * scale) for data in source.chunks())
    triangle = Triangle.of((columns.reshape(-1, columns.shape[2]), torque.reshape(-1)) for columns, torque in rows)
    parameters = triangle.solve(rank_tolerance).coefficients
    explained, count, torque, acceleration = VarianceExplained(), 0, np.zeros(3), np.zeros(3)
    for data in source.chunks():
        motion, known = data.motion, ~vertical(data.motion.attitude)
        by_both = _columns(data) @ parameters
        measured, predicted = (body_torque(motion.attitude[known], values[known]) for values in (data.torque, by_both))
        explained.add(measured, measured - predicted)
        count, torque = count + len(measured), torque + np.sum(measured**2, axis=0)
        acceleration += np.sum(body_acceleration(motion.attitude, motion.rate, motion.acceleration) ** 2, axis=0)
    size = np.sqrt([torque / max(count, 1), acceleration / len(source)])
    return AxisEvidence(parameters[RIGID:], explained.r2, size[0], size[1])


def _columns(data: TorqueData) -> Array:
    """Columns of six inertia parameters and three constant body torques, shape (samples, 3, 9)."""
    constant = euler_rate_matrix(data.motion.attitude).swapaxes(1, 2)
    return np.concatenate([rigid_columns(data.motion), constant], axis=2)


@dataclass(frozen=True)
class Swings:
    """How often a flight turns round: its seconds, and changes of direction of the Euler rates by axis."""

    seconds: float
    by_axis: IntArray


def swings(source: TorqueSource) -> Swings:
    """Count how often each Euler rate goes from clearly above its mean to clearly below, or back.

    Clearly is half a standard deviation, so that noise does not count. A signal of bandwidth B holds about 2 B T
    independent numbers in the time T, and one of a narrow band crosses its mean as often.
    """
    count, total, squares = 0, np.zeros(3), np.zeros(3)
    for data in source.chunks():
        rate = data.motion.rate
        count, total, squares = count + len(data), total + rate.sum(axis=0), squares + np.sum(rate**2, axis=0)
    mean = total / count
    clearly = _CLEARLY * np.sqrt(np.maximum(squares / count - mean**2, 0.0))
    found, side, seconds = np.zeros(3, dtype=np.int64), np.zeros(3), 0.0
    for data in source.chunks():
        seconds += float(data.time[-1] - data.time[0]) * len(data) / max(1, len(data) - 1)
        for axis, rate in enumerate((data.motion.rate - mean).T):
            sides = np.concatenate([side[axis : axis + 1], np.sign(rate[np.abs(rate) > clearly[axis]])])
            sides = sides[sides != 0]
            found[axis] += int((np.diff(sides) != 0).sum())
            side[axis] = sides[-1] if len(sides) else 0.0
    return Swings(seconds, found)


AXES = ("roll", "pitch", "yaw")
"""Euler axes, in the order in which scores have them."""
_BADLY_EXPLAINED_R2 = 0.5
"""Below it most of a torque is something else."""

HARDLY_EXCITED_SHARE = 1 / 3
"""Of the acceleration of the liveliest axis: below it, torque about an axis is mostly what is not inertial."""

_LARGE_CONSTANT_SHARE = 0.25
"""Of the torque about an axis, from which on a constant one is worth a warning."""

_LARGEST_SCALE = 3.0
"""Ratio of inertia found and stated beyond any mistake in weighing: wrong units come in larger ones."""

_NAMED = 8
"""Rules at most in one sentence."""

RIVALS = {
    "rigid-body": "the rigid body with six inertia parameters",
    "constant-inertia": "a constant inertia matrix",
    "uniform-partitions": "the same structure with uniform partitions and no search",
}


@dataclass(frozen=True)
class FitDiagnostics:
    """Diagnostics of an identification that its warnings, and a verdict on it, rest on.

    `system`: regressor of the model's parameters, without penalty; `axes`: of the training part; `rigid_body`: that
    fits the learned samples best, and the one `stated`, six parameters in kg m^2; `indefinite`: training samples at
    which D(q) is not positive definite; `samples`, `outside`, `vertical`: samples judged, and of them outside the
    visited attitudes, and near a pitch of +-90 degrees, by part, the training part first; `scores`: by part, then by
    model; `learned`: of the model on the samples learned from; `freed`: what the parameters were learned from, where
    instruments identify the vehicle and not its loop; `loop`: how far it may have misled the model, where nothing from
    outside separates it from the vehicle.
    """

    fit: Fit
    system: LeastSquares
    excitation: RuleExcitation
    axes: AxisEvidence
    rigid_body: Array
    stated: Array | None
    indefinite: int
    samples: Mapping[str, int]
    outside: Mapping[str, int]
    vertical: Mapping[str, int]
    scores: Mapping[str, Mapping[str, Score]]
    learned: Score
    freed: FreedTorque | None = field(default=None, kw_only=True)
    loop: LoopBounds | None = field(default=None, kw_only=True)

    @property
    def training_scores(self) -> Mapping[str, Score]:
        """Scores on the training part, by model."""
        return next(iter(self.scores.values()))


def findings(diagnostics: FitDiagnostics) -> list[str]:
    """List what failed or was not excited in sentences, the most important first."""
    of_the_model = (_physics, _instruments, _loop, _scale, _axes, _rank, _silent_rules, _fuzzy_part_off)
    of_its_errors = (_beaten, _badly_explained, _outside, _vertical)
    return [finding for rule in of_the_model + of_its_errors for finding in rule(diagnostics)]


def _physics(diagnostics: FitDiagnostics) -> Iterator[str]:
    remedy = "check signs, axes, frames and units of the log"
    why = why_unphysical(diagnostics.rigid_body)
    if why is not None:
        yield f"the best-fitting rigid body {why}: {remedy}"
    if diagnostics.indefinite:
        training = next(iter(diagnostics.samples.values()))
        share = f"{diagnostics.indefinite} of {training} training samples"
        if why is None and np.all(diagnostics.training_scores["rigid-body"].r2_body > _BADLY_EXPLAINED_R2):
            remedy = "a rigid body explains this flight, so the structure or its excitation is at fault"
        yield f"D(q) is not positive definite at {share}: this is not a model of a body, do not use it; {remedy}"


def _scale(diagnostics: FitDiagnostics) -> Iterator[str]:
    if diagnostics.stated is None:
        return
    # An axis that the flight does not explain says nothing about scales.
    explained = diagnostics.axes.r2 > _BADLY_EXPLAINED_R2
    ratio = (diagnostics.rigid_body[:3] / diagnostics.stated[:3])[explained]
    if np.any(ratio > _LARGEST_SCALE) or np.any(ratio < 1 / _LARGEST_SCALE):
        ratios = " ".join(f"{value:.3g}" for value in ratio)
        axes = ", ".join(np.array(AXES)[explained])
        yield (
            f"the moments of inertia found ({axes}) are {ratios} times those stated (vehicle.inertia_kg_m2): check the "
            "units of torque and rates, the rotors' factors, and the vehicle"
        )


def _instruments(diagnostics: FitDiagnostics) -> Iterator[str]:
    """Say what the parameters rest on where instruments identify the vehicle and not its loop."""
    freed = diagnostics.freed
    if freed is None:
        return
    pure = "in which no gust acts"
    if freed.setpoints:
        asked = joined("the sticks" if name == "sticks" else f"the setpoint of {name}" for name in freed.setpoints)
        know = "know" if len(freed.setpoints) > 1 or freed.setpoints == ("sticks",) else "knows"
        source = f"{asked} {know} no gust, so the rigid body comes from the torque that follows, {pure}"
        little, without = "too little of yaw follows", "have no such setpoint"
    elif freed.instrument_kind == "past":
        source = (
            "the flights show the loop, so roll and pitch come from past windows, which know no innovation of a gust"
        )
        little, without = "past windows do not identify it", ""
    else:
        paths = "1 path" if freed.paths == 1 else f"{freed.paths} paths"
        source = f"{freed.runs} runs repeat {paths}, so the rigid body comes from the repeatable torque, {pure}"
        little, without = "too little of yaw is repeatable", "repeat none"
    moments = ", ".join(
        f"{name} {value:.3g} ({value * np.exp(-half):.3g} to {value * np.exp(half):.3g})"
        if identified
        else f"{name} not determined because {little}, so the value of least squares is kept"
        for name, value, half, identified in zip(
            INERTIA_PARAMETERS, freed.rigid_body, freed.half, freed.identified, strict=False
        )
    )
    rest = f"; {freed.alone} of the training flights {without} and contribute nothing" if freed.alone else ""
    least = " ".join(f"{value:.3g}" for value in freed.least_squares[:3])
    yield (
        f"{source}; scores are for the torque as measured, gusts included. "
        f"Rigid body, kg m^2: {moments}; least squares of the torque as measured finds {least}{rest}"
    )


def _loop(diagnostics: FitDiagnostics) -> Iterator[str]:
    """Say where the flights show the loop and nothing separates it from the vehicle."""
    loop = diagnostics.loop
    if loop is not None and loop.shows_loop and diagnostics.freed is None:
        yield loop_in_words(loop)


def loop_in_words(loop: LoopBounds, *, by_past: bool = False) -> str:
    """Say how far the loop may have misled a model, and what to fly."""
    shares = ", ".join(
        f"{100 * max(share, 0):.0f} % of {axis}" for axis, share in zip(AXES[:2], loop.explained, strict=False)
    )
    shown = f"the flights show the loop: torque explains {shares} in some band of 0.5 to 6 Hz"
    fly = (
        "Fly each path at least three times, one log each, and give all flights (cpfls trajectory --repeat plans them),"
        " or log the setpoint of position or velocity, or the sticks"
    )
    if by_past:
        return f"{shown}. The past identifies roll and pitch, but nothing judges the model. {fly}"
    bounds = " and ".join(
        f"{name} from {low:.2g} to {high:.2g}"
        for name, low, high in zip(INERTIA_PARAMETERS[:2], loop.low, loop.high, strict=False)
    )
    return (
        f"{shown}. An autopilot that reacts to gusts, or an effect missing here, makes a body look heavier or lighter "
        f"than it is; true moments over those found: {bounds}. Past windows do not identify them better. {fly}"
    )


def _axes(diagnostics: FitDiagnostics) -> Iterator[str]:
    """Tell a constant torque, a lack of excitation, and torque that is not inertial from each other."""
    alone = diagnostics.training_scores["rigid-body"].r2_body
    seen = diagnostics.axes
    for axis, name in enumerate(AXES):
        large = abs(seen.constant[axis]) > _LARGE_CONSTANT_SHARE * seen.torque[axis]
        if large and 1 - seen.r2[axis] < 0.75 * (1 - alone[axis]):
            yield (
                f"{name}: a constant torque of {seen.constant[axis]:.3g} N m acts that no motion explains (centre of "
                "mass, trim or sensor bias); the model has no term for it"
            )
        if not seen.r2[axis] > _BADLY_EXPLAINED_R2:
            moves = seen.acceleration[axis] > HARDLY_EXCITED_SHARE * np.max(seen.acceleration)
            reason = ": something other than inertia acts, or columns are wrong" if moves else " is hardly excited"
            yield (
                f"{name}{reason}: motion and a constant explain less than half of its torque in training (R2 "
                f"{seen.r2[axis]:.2f}); do not trust this axis"
            )


def _rank(diagnostics: FitDiagnostics) -> Iterator[str]:
    parameters = diagnostics.system.parameters
    if diagnostics.system.rank < parameters:
        yield f"rank {diagnostics.system.rank} of {parameters}: the minimum-norm solution was taken"


def _silent_rules(diagnostics: FitDiagnostics) -> Iterator[str]:
    rules = diagnostics.excitation
    silent = [name for name, excited in zip(rules.name, rules.excited, strict=True) if not excited]
    if silent:
        yield f"{len(silent)} of {len(rules.name)} rules not excited beyond the noise: {some(silent, _NAMED)}"


def _fuzzy_part_off(diagnostics: FitDiagnostics) -> Iterator[str]:
    if np.isinf(diagnostics.fit.ridge_weight):
        unexplained = _percent(1 - diagnostics.training_scores["model"].r2_body)
        yield (
            "cross-validation switched the fuzzy part off: no evidence for an inertia that depends on attitude; what "
            f"the rigid body leaves unexplained of roll, pitch, yaw ({unexplained}; above 100 % a constant explains "
            "more) is noise or an effect without a term"
        )


def _beaten(diagnostics: FitDiagnostics) -> Iterator[str]:
    """Name the parts of the data on which a simpler model explains more about most axes."""
    for part, by_model in diagnostics.scores.items():
        ours = by_model["model"].r2_body
        for rival, words in RIVALS.items():
            theirs = by_model[rival].r2_body if rival in by_model else ours
            better = less(1 - theirs, 1 - ours, 1.0)
            if np.sum(better) > 1:
                axes = ", ".join(np.array(AXES)[better])
                shares = f"{_percent(1 - theirs[better])}; the model {_percent(1 - ours[better])}"
                yield f"{part}: {words} leaves less of the torque about {axes} unexplained ({shares})"


def _badly_explained(diagnostics: FitDiagnostics) -> Iterator[str]:
    """Name held-out parts and axes that the model does not explain, where it did in training."""
    training, *held_out = diagnostics.scores
    learned = diagnostics.scores[training]["model"].r2_body
    for part in held_out:
        r2 = diagnostics.scores[part]["model"].r2_body
        bad = [
            name
            for name, ours, before in zip(AXES, r2, learned, strict=True)
            if not ours > _BADLY_EXPLAINED_R2 and before > _BADLY_EXPLAINED_R2
        ]
        if bad:
            yield f"{part}: the model explains less than half of the torque about {', '.join(bad)}"


def _percent(shares: Array) -> str:
    return ", ".join(f"{100 * share:.3g}" for share in shares) + " %"


def _outside(diagnostics: FitDiagnostics) -> Iterator[str]:
    for part, outside in diagnostics.outside.items():
        if outside:
            samples = diagnostics.samples[part]
            yield f"{part}: {outside} of {samples} samples lie outside the attitudes that training visited"


def _vertical(diagnostics: FitDiagnostics) -> Iterator[str]:
    """Name the samples that the shares of body torque in the other sentences leave out."""
    samples, vertical = diagnostics.samples, diagnostics.vertical
    left_out = [f"{count} of {samples[part]} ({part})" for part, count in vertical.items() if count]
    if left_out:
        yield (
            f"body torque is judged without the samples closer than {np.degrees(np.arcsin(VERTICAL)):.0f} degrees to a "
            f"pitch of +-90 degrees, {', '.join(left_out)}: it is divided by cos(pitch), and so is every error"
        )


def short_flight(training: Swings, parameters: int) -> str | None:
    """Warn of recordings that turn round less often than a model has parameters.

    A swing about an axis is about one independent number, whatever the rate of the log: fewer of them than parameters
    leave some to the noise.
    """
    counted = int(training.by_axis.sum())
    if counted >= parameters:
        return None
    needed = "a flight that moves"
    if counted:
        needed = f"about {float(f'{training.seconds * parameters / counted:.2g}'):g} s of such flight"
    return (
        f"the training flights are short: in {training.seconds:.3g} s the rates reverse"
        f" {', '.join(map(str, training.by_axis))} times about {', '.join(AXES)}, {counted} swings for {parameters}"
        f" parameters, and one swing determines about one number, so noise decides the rest; train on {needed}, or use"
        " a structure with fewer parameters"
    )
