"""Points of a path at which the vehicle comes to rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

from annotated_types import Ge
from typing_extensions import Doc

from cpfls_cli.errors import SettingError
from cpfls_cli.settings import Settings


@dataclass(frozen=True, kw_only=True)
class WaypointSettings(Settings):
    """Describe a point at which the vehicle comes to rest."""

    position_m: Annotated[tuple[float, float, float], Doc("position, m, world frame with z up")]
    yaw_rad: Annotated[
        float | None, Doc("yaw there, rad, turned to while it moves; null at all of them: see yaw_turn_rad")
    ] = None
    pause_s: Annotated[float, Ge(0), Doc("rest there beside pause_s of the path, s")] = 0.0


def check_waypoints(waypoints: Sequence[WaypointSettings], paused: bool) -> None:
    """Refuse points that make no path.

    Parameters
    ----------
    waypoints : sequence of WaypointSettings
    paused : bool
        Whether the points may have pauses of their own.

    Raises
    ------
    SettingError
        If there are fewer than two, one repeats the one before, only some have a yaw, or one has a pause that it
        must not have; it names the entry, counted from 0 as in all messages on a config.
    """
    if len(waypoints) < 2:
        raise SettingError("waypoints", f"holds {len(waypoints)}; a path needs two or more, here or in a CSV file")
    for number, (before, point) in enumerate(pairwise(waypoints), start=1):
        if before.position_m == point.position_m:
            message = "repeats the point before; take one out: a rest is pause_s, and no turn on the spot is planned"
            raise SettingError(f"waypoints.{number}.position_m", message)
    headings = [point.yaw_rad is None for point in waypoints]
    if len(set(headings)) > 1:
        message = "is missing while other points have a yaw; give it at all of them, or at none"
        raise SettingError(f"waypoints.{headings.index(True)}.yaw_rad", message)
    for number, point in enumerate(waypoints):
        if point.pause_s and not paused:
            message = "contradicts duration_s, which leaves what rest there is; set duration_s to null"
            raise SettingError(f"waypoints.{number}.pause_s", message)
