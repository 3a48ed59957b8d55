"""The sensor audit: faults that look like physics, found and repaired on sensors alone, before any torque."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from math import comb
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.consistency.channels import channel_warnings, filter_warnings, frame_warnings
from cpfls_cli.consistency.clocks import ActuationDelay, actuation_delay, attitude_on_clock, rotors_on_clock
from cpfls_cli.consistency.faults import AuditFinding, CheckedFault, findings
from cpfls_cli.consistency.gyroscope import GyroFit, fit_gyro, kinematics, scan
from cpfls_cli.consistency.majority import settled
from cpfls_cli.consistency.motion import ChannelMatch
from cpfls_cli.consistency.repairs import ChannelRepair, shifted
from cpfls_cli.effects.hooks import FaultFit, ReadingError, SensorTest
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals
from cpfls_cli.weak_form.windows import Windows

# Agreement that no independent attitude reaches, rad/s in a window; every fault of practical size is larger.
_ROUNDING = 1e-4
# An independent attitude leaves at least the gyroscope's own noise; this share of it is left by one that contains it.
_SHARE_OF_NOISE = 0.3
_TURNING = 0.05
# What is only mentioned, never repaired.
_BIAS_APART = 0.0015
_CROSS = 0.005
_SIGMAS_APART = 4.0
# About twice the most that 23 real flights show, or more: rad/s, a share, rad, s.
_GROSS = {"bias": 0.1, "scale": 0.12, "misalignment": np.radians(8.0), "delay": 0.016}


@dataclass(frozen=True)
class Audit:
    """Result of the sensor audit.

    Attributes
    ----------
    findings : tuple of AuditFinding
        Faults that were tested, named or not.
    untested : mapping of str to str
        Faults that could not be tested, with the reason.
    warnings : tuple of str
        Sentences about channels that disagree or look broken; nothing is repaired for them.
    notes : tuple of str
        Sentences for information.
    gyro : GyroFit or None
        All that was estimated, with the symmetric cross-axis and the differences between flights.
    matches : tuple of ChannelMatch
    actuation : ActuationDelay or None
    repairs : tuple of ChannelRepair
        Channels that contradict two others, in the order in which they are set right or left out.
    filtered : tuple of str
        Sentences on filters before the log, which noise floors depend on.
    """

    findings: tuple[AuditFinding, ...]
    untested: Mapping[str, str]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    gyro: GyroFit | None
    matches: tuple[ChannelMatch, ...]
    actuation: ActuationDelay | None
    repairs: tuple[ChannelRepair, ...] = ()
    filtered: tuple[str, ...] = ()

    @property
    def named(self) -> tuple[AuditFinding, ...]:
        """Faults that are significant and matter."""
        return tuple(finding for finding in self.findings if finding.named)

    @property
    def settled(self) -> tuple[str, ...]:
        """Sentences on the channels that were set right or left out."""
        return tuple(repair.sentence for repair in self.repairs if repair.sentence)

    def consistent(self, signals: Signals) -> Signals:
        """Set right or leave out the channels that contradict the others."""
        for repair in self.repairs:
            signals = repair.applied(signals)
        return signals

    def repaired(self, signals: Signals) -> Signals:
        """Make the channels consistent and remove the named faults from the sensors.

        A fault is removed by ``truth = matrix^-1 (reading(t + delay) - offset)``. Numbers that are not named count
        as 0. The length stays: the end of a flight that is shifted holds its last value.
        """
        signals = self.consistent(signals)
        faults = [(test, finding) for finding in self.named if (test := CATALOGUE[finding.name].test) is not None]
        truth: dict[str, Any] = {}
        for signal in dict.fromkeys(test.signal for test, _ in faults):
            errors = [
                test.error(finding.named_values(test.labels)) for test, finding in faults if test.signal == signal
            ]
            if getattr(signals, signal) is not None:
                truth[signal] = _corrected(getattr(signals, signal), signals.time, errors)
        return replace(signals, **truth) if truth else signals


def _corrected(reading: Array, time: Array, errors: Sequence[ReadingError]) -> Array:
    delay = sum(error.delay for error in errors)
    offset = np.sum([error.offset for error in errors], axis=0)
    matrix = reduce(np.matmul, [error.matrix for error in errors])
    return np.asarray((shifted(reading, time, delay) - offset) @ np.linalg.inv(matrix).T)


def audit(flights: Sequence[Signals], windows: Windows) -> Audit:
    """Check the sensors of flights with the same hardware against each other.

    Parameters
    ----------
    flights : sequence of Signals
        At least one, with the sampling period of the windows.
    windows : Windows

    References
    ----------
    Weak form: Shinbrot 1957. Reverse regression and its bounds: Frisch 1934.
    """
    key = (audit, tuple(flights), windows)
    return flights[0].once(key, lambda: _audit(flights, windows))


def _audit(flights: Sequence[Signals], windows: Windows) -> Audit:
    gyroscope = _gyroscope(flights, windows)
    clock, doubts = _late_attitude(gyroscope[0], flights, windows)
    if clock:
        flights = [repair.applied(signals) for signals in flights for repair in clock]
        gyroscope = _gyroscope(flights, windows)
    faults, untested, fit, frames = gyroscope
    rotors = _late_rotors(faults, flights, windows)
    flights = [repair.applied(signals) for signals in flights for repair in rotors] if rotors else flights
    clock = (*clock, *rotors)
    actuation = actuation_delay(flights)
    motion = settled(flights, windows)
    delay_note = () if actuation is None else (actuation.sentence,)
    return Audit(
        findings=findings([*faults, *_others(flights)], windows.period),
        untested=untested,
        warnings=(*frames, *motion.warnings, *channel_warnings(flights)),
        notes=(*delay_note, *doubts, *(_gyro_notes(fit) if fit is not None else ())),
        gyro=fit,
        matches=tuple(match for check in motion.checks if check.pair.exact for match in check.matches),
        actuation=actuation,
        repairs=(*clock, *motion.repairs),
        filtered=filter_warnings(flights),
    )


def gross_faults(flights: Sequence[Signals], windows: Windows) -> tuple[str, ...]:
    """Name what is wrong with the gyroscope alone, far beyond what sensors of multirotors show, or else a late rotor.

    Parameters
    ----------
    flights : sequence of Signals
        As for `audit`.

    Returns
    -------
    tuple of str
        With what to mend.
    """
    faults, _, _, frames = _gyroscope(flights, windows)
    if frames:
        return ()
    gross = [finding.sentence for finding in findings(faults, windows.period) if _is_gross(finding)]
    late = (repair.unrepaired for repair in _late_rotors(faults, flights, windows))
    return (*(f"{sentence[:-1]}: check import.signals.body_rate." for sentence in gross), *late)


def _is_gross(finding: AuditFinding) -> bool:
    largest = max((abs(number.value) for number in finding.coefficients if number.named), default=0.0)
    return bool(largest > _GROSS[str(_estimate(finding.name))])


_Outcome = tuple[Sequence[CheckedFault], Mapping[str, str], GyroFit | None, tuple[str, ...]]


def _late_gyroscope(faults: Sequence[CheckedFault], windows: Windows) -> list[AuditFinding]:
    """Find the fault that shifts the gyroscope against the attitude."""
    return [each for each in findings(faults, windows.period) if each.named and _estimate(each.name) == "delay"]


def _late_rotors(
    faults: Sequence[CheckedFault], flights: Sequence[Signals], windows: Windows
) -> tuple[ChannelRepair, ...]:
    """Hold the rotors against the gyroscope where nothing is known against its clock."""
    repair = None if _late_gyroscope(faults, windows) else rotors_on_clock(flights, windows)
    return () if repair is None else (repair,)


def _late_attitude(
    faults: Sequence[CheckedFault], flights: Sequence[Signals], windows: Windows
) -> tuple[tuple[ChannelRepair, ...], tuple[str, ...]]:
    late = _late_gyroscope(faults, windows)
    return attitude_on_clock(late[0].coefficients[0].value, flights, windows) if late else ((), ())


def _estimate(name: str) -> object:
    test = CATALOGUE[name].test
    assert test is not None, "the audit tests what has a test"
    return test.estimate


def _of_gyroscope() -> dict[str, SensorTest]:
    """List the effects whose numbers are those of the regression of the gyroscope."""
    return {
        name: effect.test
        for name, effect in CATALOGUE.items()
        if effect.test is not None and isinstance(effect.test.estimate, str)
    }


def _others(flights: Sequence[Signals]) -> Iterator[CheckedFault]:
    """Estimate the faults that have an estimator of their own."""
    for effect in CATALOGUE.values():
        if effect.test is not None and callable(effect.test.estimate):
            fit = effect.test.estimate(flights)
            if fit is not None:
                yield CheckedFault(effect, fit)


def _gyroscope(flights: Sequence[Signals], windows: Windows) -> _Outcome:
    if all(signals.attitude is None for signals in flights):
        return _none("there is no attitude to judge the gyroscope by")
    cut = [motion for signals in flights if (motion := kinematics(signals, windows)) is not None]
    if not cut:
        return _none("the flights are too short")
    scanned = scan(cut)
    frames = frame_warnings("the rate by the attitude and the gyroscope", scanned.seen, scanned.read, _TURNING)
    if frames:
        reason = "the axes of gyroscope and attitude do not belong together"
        return (), dict.fromkeys(_of_gyroscope(), reason), None, tuple(frames)
    raw = scanned.seen - np.concatenate([flight.gyro_rate(0.0) for flight in cut])
    if np.sqrt((raw**2).mean()) < _ROUNDING:
        return _none("the attitude agrees with the gyroscope to rounding, as if it were integrated from it")
    fit = fit_gyro(cut, scanned)
    if fit is None:
        return _none("the flights are too short")
    fits = {name: fit.of(str(test.estimate)) for name, test in _of_gyroscope().items()}
    untested = _untestable(fits, fit, flights, windows)
    faults = [CheckedFault(CATALOGUE[name], numbers) for name, numbers in fits.items() if name not in untested]
    return faults, untested, fit, ()


def _none(reason: str) -> _Outcome:
    return (), dict.fromkeys(_of_gyroscope(), reason), None, ()


def _untestable(
    fits: Mapping[str, FaultFit], fit: GyroFit, flights: Sequence[Signals], windows: Windows
) -> Mapping[str, str]:
    still = "the flights hardly turn, so it would not show"
    untested = {name: still for name, numbers in fits.items() if not numbers.known.any()}
    if np.sqrt(fit.variance.max()) < _SHARE_OF_NOISE * _gyro_noise(flights, windows):
        derived = "the attitude contains the gyroscope's own noise, so it is integrated from it and would not show it"
        untested |= {name: derived for name, test in _of_gyroscope().items() if test.integrated}
    return untested


def _gyro_noise(flights: Sequence[Signals], windows: Windows) -> float:
    """Bound the noise of a window from below by fifth differences, which motion hardly reaches, rad/s."""
    fifth = np.concatenate([np.diff(signals.body_rate, 5, axis=0) for signals in flights])
    return float(np.sqrt((fifth**2).mean(axis=0).min() / comb(10, 5) * (windows.weight**2).sum()))


def _gyro_notes(fit: GyroFit) -> tuple[str, ...]:
    apart = np.abs(fit.flight_bias) > np.maximum(_BIAS_APART, _SIGMAS_APART * fit.flight_bias_error)
    cross = fit.known[9:12] & (np.abs(fit.value[9:12]) > np.maximum(_CROSS, _SIGMAS_APART * fit.error[9:12]))
    notes = []
    if apart.any():
        between = np.ptp(fit.flight_bias, axis=0).max()
        notes.append(f"The gyroscope's constant error differs between flights by {between:.4f} rad/s.")
    if cross.any():
        square = np.abs(fit.value[9:12])[cross].max()
        notes.append(f"The axes of gyroscope or attitude are not square to each other, by {square:.3f}.")
    return tuple(notes)
