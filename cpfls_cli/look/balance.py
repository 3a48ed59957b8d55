"""How thrust is shared among the rotors in steady flight, and what may cause that it is uneven."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.blocks import half_width
from cpfls_cli.look.flight import LogFlight, Samples
from cpfls_cli.look.steady import (
    WINDOW_S,
    Known,
    StatedCurve,
    Windows,
    calm,
    jackknifed,
    on_clock,
    stated_curve,
    windows_of,
)
from cpfls_cli.result import Estimate, about, part, result

SOUND, _KNOWN = 0.03, 0.05
"""Shares of thrust by which sound motors, propellers and batteries differ from the mean: less is no finding; and half
of an interval beyond which a finding may stay unseen."""
_AT_LIMIT, _LIMITED = 0.01, 0.02
"""How near to a limit is at it, share of the range; most share of a window at it."""
_RARE, _NORMAL = 0.01, 1.96
"""Probability below which a cause does not explain a pattern; half of the interval of a normal error of 1."""
_MOST = 0.5
"""Least share of the squared differences that one rotor explains to be listed though others differ too."""
_TURNED = 0.2
"""Least of one minus the squared mean of the headings' unit vectors, that parts wind from what turns with the body."""
_SIGNAL_TO_THRUST = (1.0, 2.0)
"""Share of thrust over that of commands, where the curve between them is unknown: straight to square."""


@result
class RotorBalance:
    """One rotor in steady flight."""

    rotor: int = about("number of the rotor, as the autopilot counts")
    share: Estimate | None = part(default=None)
    expected: float = about("share where all rotors are equal and the centre of mass is where the autopilot has it")


@result
class Cause:
    """What may make the shares uneven."""

    kind: str = about("rotor, centre of mass, yaw torque, or wind (or the vehicle's own speed)")
    rotor: int = about("number of the rotor where it is one; else 0", default=0)
    alone: bool = about("whether it explains all of the pattern")
    size: Estimate = part()
    forward: Estimate | None = part(default=None)
    right: Estimate | None = part(default=None)
    unit: str = about("of the size: share of thrust, share of the arm", default="share of thrust")


@result
class Balance:
    """Shares of thrust by rotor in steady flight, over their mean, and what may cause them."""

    SHOWN = ("uneven", "even")

    measured_by: str = about("rotor speed (squared), thrust curve (of the autopilot), or command (thrust not known)")
    lacks: str = about("what is missing: empty, steady flight (no shares), or places of the rotors (no causes)")
    steady_s: float = about("steady flight that is used", unit="s")
    blocks: int = about("blocks of the jackknife")
    rotors: tuple[RotorBalance, ...] = part()
    roll: Estimate | None = part(default=None)
    pitch: Estimate | None = part(default=None)
    yaw: Estimate | None = part(default=None)
    turned: float = about("how far headings spread: 0 for one, 1 for all alike", gaps=True)
    fixed_forward: Estimate | None = part(default=None)
    fixed_right: Estimate | None = part(default=None)
    wind: Estimate | None = part(default=None)
    causes: tuple[Cause, ...] = part()
    time: Array = about("middle of each steady window", "window", unit="s", brief=False)
    shares: Array = about("share of each rotor in each window", "window", "rotor", brief=False)
    heading: Array = about("heading in each window", "window", unit="rad", gaps=True, brief=False)

    @property
    def uneven(self) -> tuple[int, ...]:
        """Number the rotors whose share surely differs by more than sound rotors do, the most uneven first."""
        known = [(each.share.value, each.share.half, each.expected) for each in self.rotors if each.share]
        by = _beyond(*np.array(known).T) if known else np.empty(0)
        return tuple(int(k) + 1 for k in np.argsort(-by) if by[k] > SOUND)

    @property
    def even(self) -> bool:
        """Whether shares are known well enough to say that no rotor differs."""
        halves = [each.share.half for each in self.rotors if each.share]
        return bool(halves) and not self.uneven and max(halves) <= _KNOWN


def balance_of(flight: LogFlight) -> Balance | None:
    """Estimate the share of thrust of each rotor in steady flight; None where the log has no rotors.

    Windows of 2 s count where the body hardly turns, tilts less than 15 degrees and no rotor is at a limit. Intervals
    are by a jackknife over blocks of neighbouring windows.
    """
    stated = stated_curve(flight)
    source, measured_by = _thrusts(flight, stated)
    if not source.values.size:
        return None
    windows = _steady(flight, stated, source)
    thrust = windows.means(source)
    shares = thrust / thrust.mean(axis=1, keepdims=True)
    yaw = flight.attitude[:, 2]
    north, east = windows.means(on_clock(flight, np.stack([np.cos(yaw), np.sin(yaw)], axis=1))).T
    heading = np.arctan2(east, north)
    expected = _expected(flight, shares.shape[1])
    means = jackknifed(lambda kept: shares[kept].mean(axis=0), len(shares))
    placed = len(_columns(flight)) == len(expected)
    trims = _Trims(flight, means, expected, measured_by) if means and placed else None
    lean = trims.leans(shares, heading) if trims else None
    return Balance(
        measured_by=measured_by,
        lacks="steady flight" if means is None else "places" if trims is None else "",
        steady_s=len(shares) * WINDOW_S,
        blocks=means.blocks if means else 0,
        rotors=tuple(
            RotorBalance(rotor=k + 1, share=means.estimate(k) if means else None, expected=float(expected[k]))
            for k in range(len(expected))
        ),
        roll=trims.known.estimate(0) if trims else None,
        pitch=trims.known.estimate(1) if trims else None,
        yaw=trims.known.estimate(2) if trims and flight.spins is not None else None,
        turned=_spread(heading),
        fixed_forward=lean.estimate(0) if lean else None,
        fixed_right=lean.estimate(1) if lean else None,
        wind=_length(lean, 2) if lean else None,
        causes=trims.causes(lean) if trims else (),
        time=windows.begin + 0.5 * windows.length_s,
        shares=shares,
        heading=heading,
    )


def _thrusts(flight: LogFlight, stated: StatedCurve) -> tuple[Samples, str]:
    if flight.rotor_speed is not None:
        return flight.rotor_speed._replace(values=flight.rotor_speed.values**2), "rotor speed"
    known = "thrust curve" if stated.name and stated.value != 0 else "command"
    return flight.rotors._replace(values=stated.thrusts(flight.rotors.values)), known


def _steady(flight: LogFlight, stated: StatedCurve, source: Samples) -> Windows:
    windows = windows_of(flight)
    steady = calm(flight, windows)
    if flight.rotors.values.size:
        low, high = (0.0, 1.0) if stated.thrust else (stated.curve.low, stated.curve.high)
        command, near = flight.rotors.values, _AT_LIMIT * (high - low)
        limited = ((command >= high - near) | (command <= low + near)).astype(float)
        steady &= ~(windows.means(flight.rotors._replace(values=limited)).max(axis=1) > _LIMITED)
    thrust = windows.means(source)
    return windows.keep(steady & np.isfinite(thrust).all(axis=1) & (thrust > 0).all(axis=1))


def _spread(heading: Array) -> float:
    return float(1 - np.abs(np.mean(np.exp(1j * heading))) ** 2) if len(heading) else np.nan


def _columns(flight: LogFlight) -> Array:
    """Give forward place, right place and spin of each rotor, shape (rotor, 3); no spin where it is not known."""
    if flight.places is None:
        return np.empty((0, 3))
    spins = np.zeros(len(flight.places)) if flight.spins is None else flight.spins
    return np.column_stack([flight.places, spins])


def _expected(flight: LogFlight, rotors: int) -> Array:
    """Give the shares with which equal rotors about the stated centre hover, shape (rotor,)."""
    columns = _columns(flight)
    if len(columns) != rotors:
        return np.ones(rotors)
    thrust = np.linalg.pinv(np.column_stack([np.ones(rotors), columns]).T)[:, 0]
    return np.asarray(thrust / thrust.mean())


def _beyond(shares: Array, half: Array, expected: Array) -> Array:
    """Give how far shares surely lie beyond both the mean of all rotors and what hover asks of each.

    Rotors that all work alike are sound, whatever the autopilot was given for their places: hover asks for what is
    nearest to the shares between that and what these places ask for.
    """
    apart, toward = shares - 1.0, expected - 1.0
    asked = toward * np.clip(apart @ toward / max(float(toward @ toward), 1e-12), 0.0, 1.0)
    return np.asarray(np.maximum(apart - np.maximum(asked, 0.0), np.minimum(asked, 0.0) - apart) - half)


def _length(known: Known, first: int) -> Estimate:
    """Give the length of a vector of two numbers with its interval, not below 0."""
    value = known.value[first : first + 2]
    size = float(np.hypot(*value))
    along = np.zeros((1, len(known.value)))
    along[0, first : first + 2] = value / max(size, 1e-12)
    half = float(known.moved(along).half[0])
    return Estimate(value=size, low=max(size - half, 0.0), high=size + half)


class _Trims:
    """Trim about roll, pitch and yaw in shares of thrust, and the causes that it leaves possible."""

    def __init__(self, flight: LogFlight, means: Known, expected: Array, measured_by: str) -> None:
        columns, rotors = _columns(flight), len(expected)
        self.columns = columns
        self.measured_by, self.expected = measured_by, expected
        self.apart = means._replace(value=means.value - expected)
        centred = columns - columns.mean(axis=0)
        # Right rotors push less to roll to the right.
        signs = np.array([0, -1, 0]), np.array([1, 0, 0]), np.array([0, 0, 1])
        self.known = self.apart.moved(np.array(signs) @ np.linalg.pinv(centred))
        self.lean = np.stack([columns[:, 0], columns[:, 1]]) / rotors
        # Of the arm, that makes half as much as sound rotors differ by.
        self.small = 0.5 * SOUND * float(np.sqrt(np.mean(columns[:, :2] ** 2)))
        self.uneven = bool(np.any(_beyond(means.value, means.half, expected) > SOUND))

    def leans(self, shares: Array, heading: Array) -> Known | None:
        """Part where the thrust acts, forward and right, into what turns with the body and what does not."""
        if not np.isfinite(heading).all() or not _spread(heading) > _TURNED:
            return None
        leans = (shares - self.expected) @ self.lean.T
        cosine, sine = np.cos(heading), np.sin(heading)
        zero, one = np.zeros_like(cosine), np.ones_like(cosine)
        rows = np.stack([np.stack([one, zero, cosine, sine], 1), np.stack([zero, one, -sine, cosine], 1)], axis=1)

        def parted(kept: BoolArray) -> Array:
            return np.asarray(np.linalg.lstsq(rows[kept].reshape(-1, 4), leans[kept].ravel(), rcond=None)[0])

        return jackknifed(parted, len(shares))

    def causes(self, lean: Known | None) -> tuple[Cause, ...]:
        """List what may cause a pattern that is larger than sound rotors make; what the flight excludes is left out."""
        if not self.uneven:
            return ()
        lever = self.apart.moved(self.lean) if lean is None else lean
        unit = "share of the arm"
        flat, straight = self._explained(self.columns[:, :2]), self._explained(self.columns[:, 2:])
        found, yaw = self._single_rotors(), self.known.estimate(2)
        of_mass, of_wind = _length(lever, 0), _length(lever, 0) if lean is None else _length(lean, 2)
        if of_mass.low > 0 and of_mass.value > self.small:
            ends = (self._as_thrust(lever.estimate(axis)) for axis in (0, 1))
            size = self._as_thrust(of_mass)
            found.append(
                Cause(kind="centre of mass", alone=flat, size=size, unit=unit, forward=next(ends), right=next(ends))
            )
        if yaw.low * yaw.high > 0 and abs(yaw.value) > 0.5 * SOUND:
            found.append(Cause(kind="yaw torque", alone=straight, size=yaw))
        if of_wind.low > 0 and of_wind.value > self.small:
            found.append(Cause(kind="wind", alone=flat, size=self._as_thrust(of_wind), unit=unit))
        return tuple(found)

    def _single_rotors(self) -> list[Cause]:
        """List the rotors each of which explains the pattern alone; else the one that explains most, if most of it."""
        rotors = len(self.expected)
        rows = np.column_stack([np.ones(rotors), self.columns])
        project = rows @ np.linalg.pinv(rows)
        found = []
        for k in range(rotors):
            pattern = project[:, k] - project[:, k].mean()
            known = self.apart.moved(pattern[None] / (pattern @ pattern))
            size = known.estimate()
            share = float(known.value[0] ** 2 * (pattern @ pattern) / (self.apart.value @ self.apart.value))
            alone = self._explained(pattern[:, None])
            if size.low * size.high > 0 and abs(size.value) > SOUND and (alone or share > _MOST):
                found.append((share, Cause(kind="rotor", rotor=k + 1, alone=alone, size=size)))
        found.sort(key=lambda each: -each[0])
        return [cause for _, cause in found if cause.alone] or [cause for _, cause in found[:1]]

    def _explained(self, patterns: Array) -> bool:
        """Test whether patterns, shape (rotor, pattern), leave nothing but noise and what sound rotors differ by."""
        from scipy.special import chdtrc

        rotors = len(self.expected)
        flat = np.column_stack([np.ones(rotors), patterns])
        basis = np.linalg.svd(flat)[0][:, np.linalg.matrix_rank(flat) :]
        left = basis.T @ self.apart.value
        if not len(left):
            return True
        # As wide as the intervals, which know how few blocks there are.
        wide = (float(half_width(np.ones(1), self.apart.blocks)[0]) / _NORMAL) ** 2
        covariance = wide * basis.T @ self.apart.covariance @ basis + SOUND**2 * np.eye(len(left))
        return bool(chdtrc(len(left), float(left @ np.linalg.solve(covariance, left))) > _RARE)

    def _as_thrust(self, given: Estimate) -> Estimate:
        """Scale a share of commands to one of thrust, over all curves that may lie between them."""
        factors = _SIGNAL_TO_THRUST if self.measured_by == "command" else (1.0, 1.0)
        ends = [factor * end for factor in factors for end in (given.low, given.high)]
        return Estimate(value=0.5 * sum(factors) * given.value, low=min(ends), high=max(ends))
