"""Whether a log is right: one check, whose findings every command reports, and the audit that repairs sensors."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np

from cpfls_cli.consistency.channels import channel_warnings, filter_warnings
from cpfls_cli.consistency.findings import AuditFinding, ChannelRepair, Finding, contradictions, doubts, shifted
from cpfls_cli.consistency.gyroscope import GyroFit
from cpfls_cli.consistency.majority import taken_off
from cpfls_cli.consistency.motion import against_lean
from cpfls_cli.consistency.rotors import (
    IDLE,
    beyond_propellers,
    lift,
    misplaced,
    thrust_against_weight,
    thrust_is_known,
    too_fast,
)
from cpfls_cli.consistency.sensors import CheckedFault, Sensors, actuation_delay, findings, sensors_of
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals, stretch_of
from cpfls_cli.flightlog.crash import Signs, upright_of
from cpfls_cli.flightlog.flown import FlownPart, find_flown, rotor_shares
from cpfls_cli.result import about, part
from cpfls_cli.units import STANDARD_GRAVITY
from cpfls_cli.weak_form.windows import FEWEST_WINDOWS, Windows, WindowSettings, fitting_windows
from cpfls_cli.words import capitalised

_HANGS = -0.5  # Mean upward part of body z below which an attitude is turned over; full rotations come to 0.
_SHORT_S = 5.0  # A shorter part is no log with a take-off and a landing.
_WEIGHED_S, _WEIGHED = 10.0, (0.7, 5.0)
"""Seconds in which nobody falls or climbs enough to feel less than the first share of gravity on average (that takes
30 m/s), or pulls the second without an end."""

_LEANS_M_S2, _FASTEST_M_S = 1.0, 40.0
"""Force across gravity that an attitude which leans by 6 degrees makes, and a speed that hardly a multirotor gains."""

ENOUGH = 50_000  # Samples that identify units, axes and which rotor is where.


def check(parts: Sequence[Signals], settings: WindowSettings) -> tuple[Finding, ...]:
    """Hold the channels of a flight against each other and against its vehicle; nothing is set right.

    What is not flown, where a touchdown is a motion of its own, is left out.

    `parts`: stretches of one flight, or flights with the same hardware; those too short for windows are left out.
    `settings`: of the section `gap`, as in the sensor audit.
    """
    parts = [_flown(part) for part in parts]
    looked_at = _middle(parts)
    shared = fitting_windows(looked_at[0].period, settings)
    long = [part for part in looked_at if shared.count(len(part))]
    enough = sum(shared.count(len(part)) for part in long) >= FEWEST_WINDOWS
    return findings_of(parts, sensors_of(long, shared) if enough else None)


def _flown(part: Signals) -> Signals:
    """Cut off what is not flown; a part in which that is not known is taken as it is."""
    if part.rotor_speed is None or len(part) * part.period < _SHORT_S:
        return part
    span = flown(part).span_s
    if span is None:
        return part
    first, after = np.searchsorted(part.time - part.time[0], [span[0], span[1] + part.period / 2])
    return stretch_of(part, slice(int(first), int(after)))


def flown(part: Signals) -> FlownPart:
    """Find the stretches of a flight with rotors that are flown, as the import finds them."""
    assert part.rotor_speed is not None, "asked for"
    return find_flown(
        Signs(
            time=part.time - part.time[0],
            rotors=rotor_shares(part.rotor_speed, shares=False),
            height=None if part.position is None else part.position[:, 2],
            body_rate=part.body_rate if "body_rate" in part.available else None,
            upright=upright_of(part.attitude, None, "wxyz"),
            force=part.specific_force,
        )
    )


def findings_of(parts: Sequence[Signals], sensors: Sensors | None) -> tuple[Finding, ...]:
    """Gather what is wrong with rotors, attitude and sensors; None where the flights are too short to ask those."""
    return tuple(finding for finding in _findings(parts, sensors) if finding is not None)


def _findings(parts: Sequence[Signals], sensors: Sensors | None) -> Iterator[Finding | None]:
    yield too_fast(parts)
    weighs = thrust_against_weight(parts)
    yield weighs if weighs is not None else beyond_propellers(parts)
    hangs = _upside_down(_middle(parts))
    yield hangs
    if parts[0].attitude is None:
        yield _unlike_gravity(max(_middle(parts), key=len))
    if hangs is None:
        yield _runs_away(max(_middle(parts), key=len))
        yield from against_lean(max(_middle(parts), key=len))
    if sensors is None or hangs is not None:
        return
    if not sensors.gyroscope.apart:
        # A gyroscope that the attitude contradicts identifies no rotor.
        yield misplaced(_middle(parts))
    yield from sensors.findings
    if thrust_is_known(parts) and sensors.motion.against_thrust is None:
        yield lift(sensors.motion.checks, parts[0].vehicle)


def _upside_down(parts: Sequence[Signals]) -> Finding | None:
    if parts[0].attitude is None:
        return None
    upright = float(np.concatenate([part.rotation[:, 2, 2] for part in parts]).mean())
    if upright >= _HANGS:
        return None
    return Finding(
        "according to its attitude, the vehicle is upside down on average",
        "check import.world_frame, import.body_frame and the order of the quaternion",
        ("attitude",),
        upright,
    )


def _unlike_gravity(part: Signals) -> Finding | None:
    """Hold the accelerometer against gravity, which no other channel does where there is no attitude."""
    if part.specific_force is None or len(part) * part.period < _WEIGHED_S:
        return None
    felt = float(np.linalg.norm(part.specific_force, axis=1).mean())
    if _WEIGHED[0] < felt / STANDARD_GRAVITY < _WEIGHED[1]:
        return None
    return Finding(
        f"its accelerometer feels {felt:.3g} m/s^2 on average, where gravity alone is {STANDARD_GRAVITY:.3g}",
        "check import.signals.acceleration, its unit and scale",
        ("acceleration",),
        felt / STANDARD_GRAVITY,
    )


def _runs_away(part: Signals) -> Finding | None:
    """Say of an accelerometer that, by the attitude, would have made the vehicle faster than any flies.

    The mean of what it feels across gravity is the speed that is gained; no velocity is there that shows it.
    """
    if part.specific_force is None or part.attitude is None or part.velocity is not None:
        return None
    felt = float(np.hypot(*np.einsum("tij,tj->ti", part.rotation, part.specific_force).mean(axis=0)[:2]))
    lasts = len(part) * part.period
    if felt < _LEANS_M_S2 or felt * lasts < _FASTEST_M_S:
        return None
    return Finding(
        f"by accelerometer and attitude it would be {felt * lasts:.0f} m/s faster after {lasts:.0f} s: across gravity "
        f"it feels {felt:.2g} m/s^2 on average",
        "check the offset and the axes of import.signals.acceleration, and the attitude",
        ("acceleration", "attitude"),
        felt,
        "m/s^2",
        contradiction=False,
    )


def _middle(parts: Sequence[Signals]) -> list[Signals]:
    """Take no more of a long log than identifies units and axes, from the middle of where its rotors turn."""
    if sum(len(part) for part in parts) <= ENOUGH:
        return list(parts)
    longest = max(parts, key=len)
    centre = len(longest) // 2
    if longest.rotor_speed is not None:
        power = (longest.rotor_speed**2).sum(axis=1)
        centre = int(np.median(np.flatnonzero(power >= IDLE * np.quantile(power, 0.99))))
    first = max(0, min(centre - ENOUGH // 2, len(longest) - ENOUGH))
    return [stretch_of(longest, slice(first, first + ENOUGH))]


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

    def with_offsets(self, flights: Sequence[Signals], windows: Windows) -> "Audit":
        """Take off the constant offsets of other flights too: they are of each flight."""
        more = taken_off([self.consistent(each) for each in flights], windows)
        return replace(self, repairs=(*self.repairs, *more)) if more else self

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
    if fit.value[13]:
        within = f"within {1 / fit.value[13]:.2g} s"
        notes.append(f"The attitude is levelled by the accelerometer, {within}: it leans as the vehicle accelerates.")
    if apart.any():
        between = np.ptp(fit.flight_bias, axis=0).max()
        notes.append(f"The gyroscope's constant error differs by {between:.4f} rad/s between flights.")
    if cross.any():
        square = np.abs(fit.value[9:12])[cross].max()
        notes.append(f"The axes of the gyroscope or the attitude are not orthogonal, by {square:.3f}.")
    return tuple(notes)
