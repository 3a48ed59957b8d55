"""Settings of the fit of a whole vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, MinLen
from typing_extensions import Doc

from cpfls_cli.settings import Settings

VEHICLE = "vehicle"
"""In the place of a model: the vehicle of the config."""


@dataclass(frozen=True, kw_only=True)
class GroupSettings(Settings):
    """Flights of the same vehicle in another configuration, such as with a payload or other propellers."""

    name: Annotated[str, MinLen(1), Doc("of the configuration")]
    flights: Annotated[tuple[str, ...], MinLen(1), Doc("its flights: names of files, * and ? as in a shell")]
    differs: Annotated[
        tuple[str, ...] | None,
        Doc("blocks of numbers of its own, all others shared; null: what a weight changes, mass, its centre, inertia"),
    ] = None


@dataclass(frozen=True, kw_only=True)
class PlaybackSettings(Settings):
    """Configure playback, the fit of a vehicle to it, and the choice of what the vehicle's model holds."""

    horizon_s: Annotated[float, Gt(0), Doc("how far free runs go, s")] = 0.5
    window_interval_s: Annotated[float, Gt(0), Doc("time between the starts of the windows that are fitted, s")] = 0.6
    history_s: Annotated[
        float, Ge(0), Doc("how much of the past before its start a forecast may use, s; 0: no such forecast is fitted")
    ] = 0.5
    search_windows: Annotated[int, Ge(20), Doc("about how many windows the structures are judged on in the search")] = (
        400
    )
    folds: Annotated[int, Ge(2), Doc("parts of the flights, each of which is kept aside once in the search")] = 3
    quick: Annotated[
        bool,
        Doc("a first answer: named effects alone, judged on at most 100 windows, no forecast by the past; --quick"),
    ] = False
    leave_out: Annotated[
        tuple[str, ...],
        Doc("blocks that are not tried, such as inertia, an effect, remainder or remainder_force (docs/playback.md)"),
    ] = ()
    anyway: Annotated[
        bool, Doc("search in logs that contradict themselves or are too slow to identify what is sought, too; --anyway")
    ] = False
    groups: Annotated[
        tuple[GroupSettings, ...],
        Doc("other configurations of the vehicle, fitted at once; flights of none are those of the section vehicle"),
    ] = ()
