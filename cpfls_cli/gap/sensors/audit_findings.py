"""Faults of the gyroscope that are significant and matter, in words a pilot understands."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy import stats

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.gap.sensors.audit_gyro import GyroFit

FaultName = Literal["gyro_bias", "gyro_scale", "imu_misalignment", "channel_delay"]

# Largest probability of chance, after Holm over all that is tested: an audit that cries wolf is not read.
_SIGNIFICANCE = 1e-3
# Below these sizes a fault moves no torque by more than the noise of one window, so there is nothing to repair.
_SMALLEST_BIAS = 0.0015
_SMALLEST_SCALE = 0.003
_SMALLEST_MISALIGNMENT = 0.0025
_SMALLEST_DELAY_S = 0.002
_SMALLEST_DELAY_SAMPLES = 0.2
# Share of that size which must be exceeded significantly: a jackknife over two dozen blocks has heavier tails than
# Student's t where few of them tell, and what it then calls significant is small.
_SHARE_EXCEEDED = 0.5


class Coefficient(NamedTuple):
    """One number of a fault.

    Attributes
    ----------
    name : str
    value : float
    unit : str
    low, high : float
        Interval of 95 %, widened by what noise of the gyroscope can have pulled.
    named : bool
        Whether it is significant and of practical size.
    """

    name: str
    value: float
    unit: str
    low: float
    high: float
    named: bool


@dataclass(frozen=True)
class AuditFinding:
    """A fault that was tested.

    Attributes
    ----------
    name : {"gyro_bias", "gyro_scale", "imu_misalignment", "channel_delay"}
    coefficients : tuple of Coefficient
    p_value : float
        Probability that chance takes the most significant coefficient past half of the size that matters, after Holm.
    named : bool
        Whether any coefficient is named.
    sentence : str
    """

    name: FaultName
    coefficients: tuple[Coefficient, ...]
    p_value: float
    named: bool
    sentence: str

    def named_values(self, names: Sequence[str]) -> Array:
        """Give the named values, 0 for those that are not.

        Parameters
        ----------
        names : sequence of str
            Names of coefficients.
        """
        found = {each.name: each.value for each in self.coefficients if each.named}
        return np.array([found.get(name, 0.0) for name in names])


class _Fault(NamedTuple):
    name: FaultName
    start: int
    labels: tuple[str, ...]
    unit: str
    smallest: float
    say: Callable[[str, float], str]


def _side(value: float) -> str:
    return "much" if value > 0 else "little"


def _faults(period: float) -> tuple[_Fault, ...]:
    shortest = max(_SMALLEST_DELAY_S, _SMALLEST_DELAY_SAMPLES * period)
    axes = ("x", "y", "z")
    return (
        _Fault("gyro_bias", 0, axes, "rad/s", _SMALLEST_BIAS, lambda at, v: f"{v:+.4f} rad/s about {at}"),
        _Fault(
            "gyro_scale", 3, axes, "", _SMALLEST_SCALE, lambda at, v: f"{100 * abs(v):.2g} % too {_side(v)} about {at}"
        ),
        _Fault(
            "imu_misalignment",
            6,
            axes,
            "rad",
            _SMALLEST_MISALIGNMENT,
            lambda at, v: f"{np.degrees(v):+.2f} deg about {at}",
        ),
        _Fault(
            "channel_delay",
            12,
            ("delay",),
            "s",
            shortest,
            lambda _, v: f"{1000 * abs(v):.3g} ms {'behind' if v > 0 else 'ahead of'}",
        ),
    )


_SENTENCES: Mapping[FaultName, tuple[str, str]] = {
    "gyro_bias": (
        "The gyroscope shows a rate where there is none: {}.",
        "No constant error of the gyroscope that matters.",
    ),
    "gyro_scale": ("The gyroscope reads {}.", "The gyroscope's scale agrees with the attitude."),
    "imu_misalignment": (
        "The gyroscope sits turned against the attitude: {}.",
        "The gyroscope sits straight against the attitude.",
    ),
    "channel_delay": ("The gyroscope runs {} the attitude.", "Gyroscope and attitude keep the same time."),
}


def findings(fit: GyroFit, tested: Sequence[FaultName], period: float) -> tuple[AuditFinding, ...]:
    """Test each fault that the motion can tell.

    A coefficient is named when its size matters, and Student's t of what exceeds the possible pull of noise and half
    of that size stays significant after Holm's correction over all coefficients.

    Parameters
    ----------
    fit : GyroFit
    tested : sequence of str
        Names of faults.
    period : float
        Sampling period, s.

    References
    ----------
    Holm 1979.
    """
    faults = [fault for fault in _faults(period) if fault.name in tested]
    used = np.zeros(len(fit.value), dtype=bool)
    for fault in faults:
        used[fault.start : fault.start + len(fault.labels)] = True
    used &= fit.known
    p_values = _p_values(fit, used, faults)
    return tuple(_finding(fault, fit, used, p_values) for fault in faults if used[_own(fault)].any())


def _own(fault: _Fault) -> slice:
    return slice(fault.start, fault.start + len(fault.labels))


def _p_values(fit: GyroFit, used: BoolArray, faults: Sequence[_Fault]) -> Array:
    floor = fit.pull.copy()
    for fault in faults:
        floor[_own(fault)] += _SHARE_EXCEEDED * fault.smallest
    excess = np.maximum(np.abs(fit.value) - floor, 0.0) / np.maximum(fit.error, np.finfo(float).tiny)
    p_values = np.ones(len(used))
    p_values[used] = _holm(2 * stats.t.sf(excess[used], fit.blocks - 1))
    return p_values


def _holm(p_values: Array) -> Array:
    order = np.argsort(p_values)
    stepped = np.maximum.accumulate(p_values[order] * np.arange(len(order), 0, -1))
    adjusted = np.empty_like(p_values)
    adjusted[order] = np.minimum(stepped, 1.0)
    return adjusted


def _finding(fault: _Fault, fit: GyroFit, used: BoolArray, p_values: Array) -> AuditFinding:
    reach = float(stats.t.ppf(0.975, fit.blocks - 1)) * fit.error + fit.pull
    named = used & (p_values < _SIGNIFICANCE) & (np.abs(fit.value) > fault.smallest)
    places = [i for i in range(fault.start, fault.start + len(fault.labels)) if used[i]]
    coefficients = tuple(
        Coefficient(
            fault.labels[i - fault.start],
            float(fit.value[i]),
            fault.unit,
            float(fit.value[i] - reach[i]),
            float(fit.value[i] + reach[i]),
            bool(named[i]),
        )
        for i in places
    )
    found, nothing = _SENTENCES[fault.name]
    parts = [fault.say(each.name, each.value) for each in coefficients if each.named]
    sentence = found.format(", ".join(parts)) if parts else nothing
    return AuditFinding(fault.name, coefficients, float(p_values[places].min()), bool(parts), sentence)
