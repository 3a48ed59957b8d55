"""Claims of the paper about errors, time, reduced training sets and the path, each with its measure and threshold."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from benchmarks.paper.printed import (
    PRINTED_CONTRIBUTION,
    PRINTED_JERK_INTEGRAL,
    PRINTED_MOVE_S,
    PRINTED_PEAKS,
    PRINTED_PERIOD_S,
    PRINTED_RELATIVE_ERROR,
    PRINTED_SHARE,
    TABLE_4,
)
from benchmarks.paper.replicates import ALL_SAMPLES, Setting, Sweep, joined_sweeps
from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.flights.path import PlannedPath
from cpfls_cli.identification.data import TRAINING
from cpfls_cli.identification.identify import MODEL
from cpfls_cli.reduction.training_set import Selection
from cpfls_cli.report.content import UNKNOWN, change, number, percent
from cpfls_cli.report.source import Source, Sources
from cpfls_cli.words import joined

Settings = Sequence[Setting]
Searches = Sequence[Settings]
"""Settings with their runs, by sweep."""


@dataclass(frozen=True)
class EvaluationTime:
    """Duration of an evaluation on so many samples, s: of the decomposition in it, as the paper does it, compiled."""

    samples: int
    svd_s: float
    evaluation_s: float
    compiled_s: float


@dataclass(frozen=True)
class PaperSources(Sources):
    """Everything that a report on the paper is about: its searches too, and times, for no artifact holds one."""

    times: Sequence[EvaluationTime] = ()
    sweeps: Sequence[Source[Sweep]] = ()


class ClaimVerdict(StrEnum):
    """Whether a claim of the paper holds here."""

    PASS = "PASS"
    FAIL = "FAIL"
    UNDECIDED = "UNDECIDED"
    NOT_MEASURED = "NOT MEASURED"


@dataclass(frozen=True)
class Measurement:
    """What was measured for a claim of the paper: a verdict, the number, and why in one or two sentences."""

    verdict: ClaimVerdict
    ours: str
    why: str


@dataclass(frozen=True)
class Claim:
    """One claim of the paper, in its own words.

    `rule` states what is measured and what counts as a pass, without the outcome. `of_searches` measures the claim on
    searches alone, those of one reading of the paper; None for a claim about other things.
    """

    name: str
    where: str
    words: str
    rule: str
    paper: str
    measure: Callable[[PaperSources], Measurement]
    of_searches: Callable[[Searches], Measurement] | None = None


def reading_of(setting: Setting) -> tuple[str, str]:
    """Name what chose the samples of a setting, and on which of them it was judged."""
    return setting.criterion, setting.judged_on


def compares_readings(settings: Settings) -> bool:
    """Tell whether searches choose equally many samples in several ways, or judge on different ones."""
    return len({reading_of(setting) for setting in settings if setting.criterion != ALL_SAMPLES}) > 1


def searches(sources: PaperSources) -> Searches:
    """Gather the searches of a report that are no comparison of readings, the largest first."""
    found = [sweep.record.settings for sweep in joined_sweeps(sources.sweeps)]
    own = [settings for settings in found if not compares_readings(settings)]
    return sorted(own, key=lambda settings: -max(setting.chromosomes for setting in settings))


def decided(passed: bool, ours: str, why: str) -> Measurement:
    """Report a number that settles a claim."""
    return Measurement(ClaimVerdict.PASS if passed else ClaimVerdict.FAIL, ours, why)


def undecided(ours: str, why: str) -> Measurement:
    """Report a number that does not settle a claim."""
    return Measurement(ClaimVerdict.UNDECIDED, ours, why)


def not_measured(missing: str, command: str) -> Measurement:
    """Name what is missing to measure a claim, and the command that makes it."""
    return Measurement(ClaimVerdict.NOT_MEASURED, UNKNOWN, f"Missing: {missing}. Made by: {command}")


def _relative_error(sources: PaperSources) -> Measurement:
    models = (model for model in sources.models if _is_periodic(model))
    identified = np.array([model.record.judged.worst(MODEL, TRAINING)[0] for model in models])
    return _small_enough([*_relative_errors(searches(sources)), identified], _elsewhere(sources))


def _is_periodic(model: Source[IdentifiedModel]) -> bool:
    return bool(model.config["identification"]["structure"] == "cpfls")


def _small_enough(found: Iterable[Array], elsewhere: str = "") -> Measurement:
    errors = np.concatenate([np.zeros(0), *found])
    if not len(errors):
        return not_measured("a model or a sweep", "cpfls identify CONFIG flight.h5 -o model.h5")
    largest, typical = float(np.max(errors)), float(np.median(errors))
    below = int(np.sum(errors < PRINTED_RELATIVE_ERROR))
    why = f"{below} of {len(errors)} models below it, median {percent(typical, 2)}. {elsewhere}".strip()
    return decided(largest < PRINTED_RELATIVE_ERROR, f"at most {percent(largest, 2)}", why)


def _relative_errors(found: Searches) -> Iterator[Array]:
    for settings in found:
        for setting in settings:
            if setting.structure == "cpfls":
                # A run without a model reaches no error at all.
                yield np.nan_to_num(setting.errors[:, 2], nan=np.inf)


def _elsewhere(sources: PaperSources) -> str:
    """Report what the claim leaves out: flights that the models did not learn from."""
    errors = [
        f"{percent(model.record.judged.worst(MODEL, part)[0], 2)} on {part}"
        for model in sources.models
        for part in model.record.judged.parts
        if part != TRAINING
    ]
    return f"On what was not learned from: {', '.join(errors)}." if errors else ""


RELATIVE_ERROR_CLAIM = Claim(
    name="Relative error",
    where="Sections 10, 11",
    words="typical torque identification error is <10% … the relative torque error being uniformly <10%",
    rule="Largest error over largest torque, worst axis, on the flight learned from. Pass: below 10 % for every cpFLS "
    "model of this report.",
    paper="< 10 %",
    measure=_relative_error,
    of_searches=lambda found: _small_enough(_relative_errors(found)),
)


_TIMING_COMMAND = "make reproduce, which measures them with benchmarks/reproduction_time.py"
_FEWEST_SIZES = 3
_SLOPE_TOLERANCE, _LEAST_R2 = 0.1, 0.98


@dataclass(frozen=True)
class Line:
    """A straight line through points."""

    slope: float
    r2: float


def line_through(x: Array, y: Array) -> Line:
    """Fit a straight line by least squares."""
    slope = float(np.polyfit(x, y, 1)[0])
    return Line(slope, float(np.corrcoef(x, y)[0, 1] ** 2))


def _times(sources: PaperSources) -> dict[str, Array] | None:
    """Gather the times of evaluations by attribute of `EvaluationTime`; None for too few sizes."""
    times = sources.times
    if len({time.samples for time in times}) < _FEWEST_SIZES:
        return None
    keys = ("samples", "svd_s", "evaluation_s", "compiled_s")
    return {key: np.array([getattr(time, key) for time in times]) for key in keys}


def _evaluation_time(sources: PaperSources) -> Measurement:
    times = _times(sources)
    if times is None:
        return not_measured("times of evaluations", _TIMING_COMMAND)
    samples, svd, evaluation, compiled = times.values()
    fitted = line_through(np.log(svd), np.log(evaluation))
    most, fewest = int(np.argmax(samples)), int(np.argmin(samples))
    why = (
        f"Between {int(samples[fewest])} and {int(samples[most])} samples the decomposition becomes "
        f"{number(svd[most] / svd[fewest], 3)} times dearer and the evaluation with it "
        f"{number(evaluation[most] / evaluation[fewest], 3)} times; the compiled evaluation of this program, which "
        f"decomposes a Gram matrix of constant size, {number(compiled[most] / compiled[fewest], 3)} times."
    )
    passed = abs(fitted.slope - 1.0) <= _SLOPE_TOLERANCE and fitted.r2 >= _LEAST_R2
    return decided(passed, f"slope {number(fitted.slope, 3)}, R² {number(fitted.r2, 4)}", why)


EVALUATION_TIME_CLAIM = Claim(
    name="Time of an evaluation",
    where="Section 10",
    words="the time required for evaluation, which is proportional to the increased speed of singular value "
    "decompositions of different sized samples",
    rule="Slope of log time of an evaluation over log time of the decomposition in it, as the paper does it, over "
    f"sizes of the training set. Pass: within {_SLOPE_TOLERANCE} of 1, R² at least {_LEAST_R2}.",
    paper="proportional (slope 1)",
    measure=_evaluation_time,
)


def _decomposition_time(sources: PaperSources) -> Measurement:
    times = _times(sources)
    if times is None:
        return not_measured("times of evaluations", _TIMING_COMMAND)
    samples, svd = times["samples"], times["svd_s"]
    power = line_through(np.log(samples), np.log(svd))
    exponential = line_through(samples.astype(float), np.log(svd))
    ours = f"power {number(power.slope, 3)}, R² {number(power.r2, 4)}; exponential R² {number(exponential.r2, 3)}"
    why = "With a fixed number of columns the operations of a decomposition grow with the number of rows, no faster."
    return decided(exponential.r2 > power.r2, ours, why)


DECOMPOSITION_TIME_CLAIM = Claim(
    name="Time of a decomposition",
    where="Section 8",
    words="calculating SVD decomposition for large matrices is [a] very processor and memory demanding task, which "
    "increases exponentially with the data set size",
    rule="Log time of the decomposition over log size (a power) and over size (an exponential). Pass: the exponential "
    "has the larger R².",
    paper="exponential",
    measure=_decomposition_time,
)


_FEWEST = TABLE_4[-1]
_REDUCE = "cpfls reduce CONFIG flight.h5 -o selection.h5"


def _share(selection: Selection) -> float:
    return len(selection.indices) / selection.candidates


def _kept(selection: Selection) -> float:
    """Divide the condition number of all samples by that of the chosen ones; 0 where rank is lost."""
    return 0.0 if selection.stalled else selection.condition_number_full / selection.condition_number


def _chosen(found: Searches) -> Iterator[tuple[float, float]]:
    """Give share and kept condition of the samples that searches learn from, as far as they were chosen."""
    for settings in found:
        periodic = [setting for setting in settings if setting.structure == "cpfls"]
        for full in [setting for setting in periodic if setting.criterion == ALL_SAMPLES][:1]:
            for setting in periodic:
                if setting.criterion != ALL_SAMPLES:
                    kept = full.uniform_condition_number / setting.uniform_condition_number
                    yield setting.samples / full.samples, float(np.nan_to_num(kept))


def _contribution(sources: Sources) -> Measurement:
    few = [selection for selection in sources.selections if _share(selection.record) < PRINTED_SHARE]
    if not few:
        return _not_reduced()
    selection = max(few, key=lambda source: _share(source.record))
    record = selection.record
    random = record.condition_number_full / record.condition_number_random
    why = f"{selection.label}: {_first_enough(record)}A random choice of equal size keeps {percent(random)}"
    weak = " too, so the claim says more about the path than about the choice" if random > PRINTED_CONTRIBUTION else ""
    return _contributes(_share(record), _kept(record), f"{why}{weak}.")


def _contribution_of(found: Searches) -> Measurement:
    few = [chosen for chosen in _chosen(found) if chosen[0] < PRINTED_SHARE]
    return _contributes(*max(few), "") if few else _not_reduced()


def _not_reduced() -> Measurement:
    return not_measured("a selection of fewer than 20 % of the samples", _REDUCE)


def _contributes(share: float, kept: float, why: str) -> Measurement:
    return decided(kept > PRINTED_CONTRIBUTION, f"{percent(kept)} with {percent(share)} of the samples", why)


def _first_enough(selection: Selection) -> str:
    """Count the samples from which on, in the order of the choice, 80 % is kept."""
    enough = selection.condition_number_trace * PRINTED_CONTRIBUTION < selection.condition_number_full
    if not len(enough) or not enough[-1]:
        return ""
    first = len(enough) - int(np.argmin(enough[::-1])) + 1 if not enough.all() else 1
    return f"{first} samples ({percent(first / selection.candidates, 2)}) already keep 80 %. "


CONTRIBUTION_CLAIM = Claim(
    name="A fifth of the samples",
    where="Section 10",
    words="less than 20% of data points give more than 80% of contribution to the system condition number",
    rule="Condition number of all samples over that of a reduced set with fewer than 20 % of them. Pass: above 80 %. "
    "(So read, the claim is the last column of Table 4.)",
    paper=f"{percent(TABLE_4[0].condition_number / _FEWEST.condition_number)} with "
    f"{percent(_FEWEST.samples / TABLE_4[0].samples)} of the samples",
    measure=_contribution,
    of_searches=_contribution_of,
)


def _floor(kept: Sequence[float]) -> Measurement:
    changes = [1.0 / share - 1.0 for share in kept if share > 0.0]
    if not changes:
        return not_measured("a selection of full rank", _REDUCE)
    ours = " and ".join(dict.fromkeys(change(share) for share in (max(changes), min(changes))))
    if min(changes) >= 0.0:
        return decided(True, ours, "No reduced set here is better conditioned than all samples.")
    why = "A reduced set can be better conditioned than the full one: what is left out weighs on strong directions."
    return decided(False, ours, why)


FLOOR_CLAIM = Claim(
    name="Floor of the condition number",
    where="Section 8",
    words="The target condition number of the ReducedTrainingSet cannot be set to lower than the reference condition "
    "number of the full FullTrainingSet data set",
    rule="Change of the condition number against all samples. Fail: any reduced set of full rank has a lower one.",
    paper=f"{change(TABLE_4[1].change)} to {change(_FEWEST.change)}",
    measure=lambda sources: _floor([_kept(selection.record) for selection in sources.selections]),
    of_searches=lambda found: _floor([kept for _, kept in _chosen(found)]),
)


_MOVE_TOLERANCE = 0.01
_PRINTED_MOVE = PRINTED_PEAKS | {"time": PRINTED_MOVE_S, "integral of jerk": PRINTED_JERK_INTEGRAL}


def _move(sources: Sources) -> Measurement:
    moving = [trajectory for trajectory in sources.trajectories if trajectory.record.position is not None]
    if not moving:
        return not_measured("a trajectory", "cpfls trajectory CONFIG -o trajectory.h5")
    # The numbers are those of P = 1 s; where no path has it, the first one is that of training.
    moving.sort(key=lambda trajectory: trajectory.config["trajectory"]["period_s"] != PRINTED_PERIOD_S)
    measured = _move_numbers(moving[0])
    off = {name: abs(measured[name] / value - 1.0) for name, value in _PRINTED_MOVE.items()}
    worst = max(off, key=lambda name: off[name])
    why = f"{moving[0].label}, at its samples: {', '.join(f'{name} {number(v, 4)}' for name, v in measured.items())}."
    return decided(off[worst] <= _MOVE_TOLERANCE, f"{percent(off[worst], 2)} ({worst})", why)


def _move_numbers(trajectory: Source[PlannedPath]) -> dict[str, float]:
    """Measure the first move of a path: its peaks by derivative, its time and its integral of absolute jerk."""
    from scipy.integrate import trapezoid

    time, curves = trajectory.record.first_leg()
    peaks = {name: float(np.max(np.abs(curves[name]))) for name in PRINTED_PEAKS}
    taken = float(time[-1] - time[0])
    return peaks | {"time": taken, "integral of jerk": float(trapezoid(np.abs(curves["jerk"]), time))}


MOVE_CLAIM = Claim(
    name="Base move",
    where="Section 10",
    words="maximum … pop = 2π … crackle = 2 … snap = 1 … jerk = 1 … acceleration = 2 … velocity = 8 … displacement = "
    "64[m], within time = 16[sec]. The integral of absolute jerk is 8",
    rule="The same nine numbers of the first move of a path with P = 1 s, as printed, where there is one. Pass: none "
    "differs by more than 1 %.",
    paper="0 %",
    measure=_move,
)


_SEAM_STEP = 1e-9
_SEAM_JUMP = 1e-6
_SEAM_STATES = 64


def _continuity(sources: Sources) -> Measurement:
    models = [model for model in sources.models if _is_periodic(model)]
    if not models:
        return not_measured("a model", "cpfls identify CONFIG flight.h5 -o model.h5")
    worst = max(_jump(model) for model in models)
    states = f"{_SEAM_STATES} random states on each side of 0 = 2π, roll and pitch in turn"
    why = f"{joined(model.label for model in models)} at {states}."
    return decided(worst < _SEAM_JUMP, f"{number(worst, 2)} of the torque there", why)


def _jump(model: Source[IdentifiedModel]) -> float:
    """Find by how much torque changes across 2 pi, as a share of the largest there."""
    from cpfls_cli.regressor.regressor import Motion

    rng = np.random.default_rng(0)
    attitude, rate, acceleration = rng.uniform(-1.0, 1.0, (3, _SEAM_STATES, 3))
    functions, worst = model.record.functions, 0.0
    for angle in (0, 1):
        before, after = attitude.copy(), attitude.copy()
        before[:, angle], after[:, angle] = 2.0 * np.pi - _SEAM_STEP, _SEAM_STEP
        torque = [functions.torque(Motion(side, rate, acceleration)) for side in (before, after)]
        worst = max(worst, float(np.max(np.abs(torque[1] - torque[0])) / np.max(np.abs(torque))))
    return worst


CONTINUITY_CLAIM = Claim(
    name="Continuity",
    where="Section 10",
    words="smooth output transitions for (2kπ − ε) − (0 + ε) input space changes of continuous periodic FLSs",
    rule=f"Largest change of the torque between 2π − {_SEAM_STEP:g} and {_SEAM_STEP:g} rad, over the largest torque "
    f"there. Pass: below {_SEAM_JUMP:g} for every cpFLS model of this report.",
    paper="0",
    measure=_continuity,
)
