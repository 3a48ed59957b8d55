"""The sensor audit: faults that look like physics, found and repaired on sensors alone, before any torque."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np

from cpfls_cli.consistency.channels import channel_warnings, filter_warnings
from cpfls_cli.consistency.check import findings_of
from cpfls_cli.consistency.clocks import actuation_delay
from cpfls_cli.consistency.findings import AuditFinding, contradictions, doubts
from cpfls_cli.consistency.gyroscope import GyroFit
from cpfls_cli.consistency.repairs import ChannelRepair, shifted
from cpfls_cli.consistency.sensors import CheckedFault, findings, sensors_of
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals
from cpfls_cli.result import about, part
from cpfls_cli.weak_form.windows import Windows
from cpfls_cli.words import capitalised

# What is only mentioned, never repaired: biases of flights that lie apart by more than a warm-up makes, rad/s, and axes
# that are less square than those of usual sensors; beyond chance over some dozen numbers.
_BIAS_APART, _CROSS = 0.0015, 0.005
_BY_CHANCE = 4.0


@dataclass(frozen=True)
class Audit:
    """Result of the sensor audit."""

    findings: tuple[AuditFinding, ...] = part()
    """Faults that were tested, named or not."""
    untested: Mapping[str, str] = about("faults that could not be tested, with the reason")
    warnings: tuple[str, ...] = about("channels that disagree or look broken; nothing is repaired for them", "warning")
    notes: tuple[str, ...] = about("for information", "note")
    repairs: tuple[ChannelRepair, ...] = part(default=())
    """Channels that contradict two others, in the order in which they are set right or left out."""
    filtered: tuple[str, ...] = about("filters before the log, which noise floors depend on", "filter", default=())
    contradictions: tuple[str, ...] = about(
        "contradictions that rule out a verdict; nothing repairs them", "contradiction", default=()
    )

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
                reading = shifted(getattr(signals, signal), signals.time, sum(error.delay for error in errors))
                matrix = reduce(np.matmul, [error.matrix for error in errors])
                offset = np.sum([error.offset for error in errors], axis=0)
                truth[signal] = np.asarray((reading - offset) @ np.linalg.inv(matrix).T)
        return replace(signals, **truth) if truth else signals


def audit(flights: Sequence[Signals], windows: Windows, whole: Sequence[Signals] = ()) -> Audit:
    """Check the sensors of flights with the same hardware against each other.

    `flights`: at least one, with the sampling period of the windows.
    `whole`: those that rotors and attitude are held against the vehicle in, where `flights` are but a part of them.
    Reference: Weak form: Shinbrot 1957. Reverse regression and its bounds: Frisch 1934.
    """
    key = (audit, tuple(flights), windows, tuple(whole))
    return flights[0].once(key, lambda: _audit(flights, windows, whole or flights))


def _audit(flights: Sequence[Signals], windows: Windows, whole: Sequence[Signals]) -> Audit:
    sensors = sensors_of(flights, windows)
    fit = sensors.gyroscope.fit
    stays = [finding for finding in findings_of(whole, sensors) if not finding.repairable]
    return Audit(
        findings=findings([*sensors.gyroscope.faults, *_others(sensors.flights)], windows.period),
        untested=sensors.gyroscope.untested,
        warnings=(*(f"{capitalised(each)}." for each in doubts(stays)), *channel_warnings(sensors.flights)),
        notes=(*actuation_delay(sensors.flights), *(_gyro_notes(fit) if fit is not None else ())),
        repairs=(*sensors.clocks, *sensors.motion.repairs),
        filtered=filter_warnings(sensors.flights),
        contradictions=contradictions(stays),
    )


def _others(flights: Sequence[Signals]) -> Iterator[CheckedFault]:
    """Estimate the faults that have an estimator of their own."""
    for effect in CATALOGUE.values():
        if effect.test is not None and callable(effect.test.estimate):
            fit = effect.test.estimate(flights)
            if fit is not None:
                yield CheckedFault(effect, fit)


def _gyro_notes(fit: GyroFit) -> tuple[str, ...]:
    apart = np.abs(fit.flight_bias) > np.maximum(_BIAS_APART, _BY_CHANCE * fit.flight_bias_error)
    cross = fit.known[9:12] & (np.abs(fit.value[9:12]) > np.maximum(_CROSS, _BY_CHANCE * fit.error[9:12]))
    notes = []
    if apart.any():
        between = np.ptp(fit.flight_bias, axis=0).max()
        notes.append(f"The gyroscope's constant error differs by {between:.4f} rad/s between flights.")
    if cross.any():
        square = np.abs(fit.value[9:12])[cross].max()
        notes.append(f"The axes of the gyroscope or the attitude are not orthogonal, by {square:.3f}.")
    return tuple(notes)
