"""The claims about time: evaluations cost what their singular value decompositions cost, and how those grow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.config.study import EvaluationTime
from cpfls_cli.pages.claims.claim import Claim
from cpfls_cli.report.numbers import number

_TOLERANCE, _LEAST_R2 = 0.1, 0.98
_FEWEST = 3
_COMMAND = "make reproduce, which measures them with benchmarks/reproduction_time.py"
_PROPORTIONAL = Claim(
    name="Time of an evaluation",
    where="Section 10",
    words="the time required for evaluation, which is proportional to the increased speed of singular value "
    "decompositions of different sized samples",
    rule="Slope of log time of an evaluation over log time of the decomposition in it, as the paper does it, over "
    f"sizes of the training set. Pass: within {_TOLERANCE} of 1, R² at least {_LEAST_R2}.",
    paper="proportional (slope 1)",
)
_EXPONENTIAL = Claim(
    name="Time of a decomposition",
    where="Section 8",
    words="calculating SVD decomposition for large matrices is [a] very processor and memory demanding task, which "
    "increases exponentially with the data set size",
    rule="Log time of the decomposition over log size (a power) and over size (an exponential). Pass: the exponential "
    "has the larger R².",
    paper="exponential",
)


@dataclass(frozen=True)
class Line:
    """A straight line through points."""

    slope: float
    r2: float


def timing_claims(times: Sequence[EvaluationTime]) -> list[Claim]:
    """Check what the paper says of time.

    Parameters
    ----------
    times : sequence of EvaluationTime
        Measured elsewhere and given: no artifact holds a time, so that equal content stays an equal file.
    """
    if len({time.samples for time in times}) < _FEWEST:
        return [claim.lacks("report.evaluation_times", _COMMAND) for claim in (_PROPORTIONAL, _EXPONENTIAL)]
    keys = ("samples", "svd_s", "evaluation_s", "compiled_s")
    samples, svd, evaluation, compiled = (np.array([getattr(time, key) for time in times]) for key in keys)
    return [_proportional(samples, svd, evaluation, compiled), _exponential(samples, svd)]


def _proportional(samples: Array, svd: Array, evaluation: Array, compiled: Array) -> Claim:
    fitted = line_through(np.log(svd), np.log(evaluation))
    most, fewest = int(np.argmax(samples)), int(np.argmin(samples))
    own = compiled[most] / compiled[fewest]
    why = (
        f"Between {int(samples[fewest])} and {int(samples[most])} samples the decomposition becomes "
        f"{number(svd[most] / svd[fewest], 3)} times dearer and the evaluation with it "
        f"{number(evaluation[most] / evaluation[fewest], 3)} times; the compiled evaluation of this program, which "
        f"decomposes a Gram matrix of constant size, {number(own, 3)} times."
    )
    passed = abs(fitted.slope - 1.0) <= _TOLERANCE and fitted.r2 >= _LEAST_R2
    return _PROPORTIONAL.decided(passed, f"slope {number(fitted.slope, 3)}, R² {number(fitted.r2, 4)}", why)


def _exponential(samples: Array, svd: Array) -> Claim:
    power = line_through(np.log(samples), np.log(svd))
    exponential = line_through(samples.astype(float), np.log(svd))
    ours = f"power {number(power.slope, 3)}, R² {number(power.r2, 4)}; exponential R² {number(exponential.r2, 3)}"
    why = "With a fixed number of columns the operations of a decomposition grow with the number of rows, no faster."
    return _EXPONENTIAL.decided(exponential.r2 > power.r2, ours, why)


def line_through(x: Array, y: Array) -> Line:
    """Fit a straight line by least squares.

    Parameters
    ----------
    x, y : array, shape (points,)
    """
    slope = float(np.polyfit(x, y, 1)[0])
    return Line(slope, float(np.corrcoef(x, y)[0, 1] ** 2))
