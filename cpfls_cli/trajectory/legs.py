"""The rest-to-rest moves of a path, one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.trajectory.profile import BaseProfile


@dataclass(frozen=True, kw_only=True)
class Leg:
    """One move from rest to rest.

    Attributes
    ----------
    begin : float, s
        When it starts.
    start : array, shape (3,), m, world frame
    profiles : tuple of BaseProfile
        One along a straight line; one for each axis that moves where every axis is planned by itself. All take
        the same time.
    directions : array, shape (profiles, 3)
        World vector that one metre of each profile moves along.
    yaw : tuple of float or None, rad
        At its start and its end; None where the yaw does not belong to the legs.
    limited_by : tuple of str
        Derivatives that reach their limit; empty where the move was not planned under limits.
    """

    begin: float
    start: Array
    profiles: tuple[BaseProfile, ...]
    directions: Array
    yaw: tuple[float, float] | None
    limited_by: tuple[str, ...]

    @property
    def duration(self) -> float:
        """Time from rest to rest, s."""
        return max(profile.duration for profile in self.profiles)

    @property
    def end(self) -> float:
        """When it is at rest again, s."""
        return self.begin + self.duration

    @property
    def vector(self) -> Array:
        """Displacement, shape (3,), m, world frame."""
        covered = np.array([profile.displacement for profile in self.profiles])
        return np.asarray(covered @ self.directions)


def along(legs: Sequence[Leg], time: Array) -> Array:
    """Evaluate position and its six derivatives along a path.

    Parameters
    ----------
    legs : sequence of Leg
        In the order of time.
    time : array, shape (time,), s
        Ascending.

    Returns
    -------
    array, shape (7, time, 3), m and s
    """
    motion = np.zeros((7, len(time), 3))
    motion[0] = legs[0].start
    for leg, samples in in_turn(legs, time):
        elapsed = time[samples] - leg.begin
        motion[0, samples] = leg.start
        for profile, direction in zip(leg.profiles, leg.directions, strict=True):
            motion[:, samples] += profile.sample(elapsed).T[..., None] * direction
    return motion


def in_turn(legs: Sequence[Leg], time: Array) -> Iterator[tuple[Leg, slice]]:
    """Divide samples among legs, so that the work grows with the samples and not with their product.

    Parameters
    ----------
    legs : sequence of Leg
    time : array, shape (time,), s
        Ascending.

    Yields
    ------
    leg : Leg
    samples : slice
        From its beginning to that of the next one; it is at rest at the end of them.
    """
    firsts = np.searchsorted(time, [*(leg.begin for leg in legs), np.inf])
    for leg, first, after in zip(legs, firsts[:-1], firsts[1:], strict=True):
        if first < after:
            yield leg, slice(int(first), int(after))
