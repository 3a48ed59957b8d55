"""Whether a log is right: one check, whose findings every command reports."""

from collections.abc import Iterator, Sequence

import numpy as np

from cpfls_cli.consistency.findings import Finding
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
from cpfls_cli.consistency.sensors import Sensors, sensors_of
from cpfls_cli.effects.signals import Signals, stretch_of
from cpfls_cli.flightlog.crash import Signs, upright_of
from cpfls_cli.flightlog.flown import FlownPart, find_flown, rotor_shares
from cpfls_cli.units import STANDARD_GRAVITY
from cpfls_cli.weak_form.windows import FEWEST_WINDOWS, WindowSettings, fitting_windows

_HANGS = -0.5  # Mean upward part of body z below which an attitude is turned over; full rotations come to 0.
_SHORT_S = 5.0  # A shorter part is no log with a take-off and a landing.
_WEIGHED_S, _WEIGHED = 10.0, (0.7, 5.0)
"""Seconds in which nobody falls or climbs enough to feel less than the first share of gravity on average (that takes
30 m/s), or pulls the second without an end."""

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
