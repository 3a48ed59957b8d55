"""Faults of sensors that are significant and matter, each in one sentence."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtr

from cpfls_cli.arrays import Array
from cpfls_cli.blocks import half_width
from cpfls_cli.consistency.findings import AuditFinding, FaultNumber
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.hooks import FaultFit, SensorTest

# Largest probability of chance, after Holm over all that is tested: an audit that cries wolf is not read.
_SIGNIFICANCE = 1e-3
# Share of the size that matters which must be exceeded significantly: a jackknife over two dozen blocks has heavier
# tails than Student's t where few of them tell, and what it then calls significant is small.
_SHARE_EXCEEDED = 0.5


@dataclass(frozen=True)
class CheckedFault:
    """An effect that the audit tests, with its estimate."""

    effect: Effect
    fit: FaultFit

    @property
    def test(self) -> SensorTest:
        """Test of the effect."""
        assert self.effect.test is not None, "chosen so"
        return self.effect.test

    def smallest(self, period: float) -> float:
        """Compute the smallest relevant size at a sampling period in s."""
        return max(self.test.smallest, self.test.smallest_samples * period)


def findings(faults: Sequence[CheckedFault], period: float) -> tuple[AuditFinding, ...]:
    """Test faults of sensors.

    A number is named when its size matters, and Student's t of what exceeds the possible pull of noise and half of
    that size stays significant after Holm's correction over all numbers that the motion can tell.

    Parameters
    ----------
    period : float
        Sampling period, s.

    References
    ----------
    Holm 1979.
    """
    known_faults = [fault for fault in faults if fault.fit.known.any()]
    if not known_faults:
        return ()
    known = np.concatenate([fault.fit.known for fault in known_faults])
    p_values = np.ones(len(known))
    p_values[known] = _holm(np.concatenate([_chance(fault, period) for fault in known_faults])[known])
    by_fault = np.split(p_values, np.cumsum([len(fault.fit.known) for fault in known_faults])[:-1])
    return tuple(_finding(fault, chance, period) for fault, chance in zip(known_faults, by_fault, strict=True))


def _chance(fault: CheckedFault, period: float) -> Array:
    fit = fault.fit
    floor = fit.pull + _SHARE_EXCEEDED * fault.smallest(period)
    excess = np.maximum(np.abs(fit.value) - floor, 0.0) / np.maximum(fit.error, np.finfo(float).tiny)
    return np.asarray(2 * stdtr(fit.blocks - 1, -excess))


def _holm(p_values: Array) -> Array:
    order = np.argsort(p_values)
    stepped = np.maximum.accumulate(p_values[order] * np.arange(len(order), 0, -1))
    adjusted = np.empty_like(p_values)
    adjusted[order] = np.minimum(stepped, 1.0)
    return adjusted


def _finding(fault: CheckedFault, p_values: Array, period: float) -> AuditFinding:
    fit, test = fault.fit, fault.test
    reach = half_width(fit.error, fit.blocks) + fit.pull
    named = fit.known & (p_values < _SIGNIFICANCE) & (np.abs(fit.value) > fault.smallest(period))
    numbers = tuple(
        FaultNumber(
            label,
            float(fit.value[i]),
            "" if number.unit == "1" else number.unit,
            float(fit.value[i] - reach[i]),
            float(fit.value[i] + reach[i]),
            bool(named[i]),
        )
        for i, (label, number) in enumerate(zip(test.labels, fault.effect.numbers, strict=True))
        if fit.known[i]
    )
    parts = [test.number(each.name, each.value) for each in numbers if each.named]
    sentence = test.found.format(", ".join(parts)) if parts else test.nothing
    return AuditFinding(fault.effect.name, numbers, float(p_values[fit.known].min()), bool(parts), sentence)
