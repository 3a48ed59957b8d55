"""A model before and after its effects, on held-out flights: playback, whiteness, and the worst stretches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.weak_flight import CHANNELS, weak_flight
from cpfls_cli.gap.extended import ExtendedModel, plain
from cpfls_cli.gap.naming.held_out import HeldOut
from cpfls_cli.gap.playback import PlayedPair, WorstStretch, errors_by_horizon, played_pairs, worst_stretch
from cpfls_cli.gap.preparation import Preparation
from cpfls_cli.gap.residual.repeated import ComesAgain, RepeatedRuns
from cpfls_cli.gap.residual.views import GapStretch, Whiteness, stretches, whiteness
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.gap.whole_vehicle import whole_vehicle
from cpfls_cli.playback.replay import Replay
from cpfls_cli.weak_form.windows import Recording, Windows, common_windows

# Shown around a stretch at least, and points in a window of a picture, which look like a curve.
_SHORTEST_S = 4.0
_PER_WINDOW = 16


@dataclass(frozen=True)
class StretchCurves:
    """Measured and simulated torque or force over the stretch of the largest gap.

    Attributes
    ----------
    flight : int
        Number of the held-out flight.
    time : array, shape (moment,), s
    measured : array, shape (moment,), N m or N
        What the measured motion takes.
    before, after : array, shape (moment,), N m or N
        Simulated by the model as given and with effects.
    """

    flight: int
    channel: str
    time: Array
    measured: Array
    before: Array
    after: Array


@dataclass(frozen=True)
class BeforeAfter:
    """Errors of the model as given and of the model with effects on held-out flights.

    Attributes
    ----------
    centres : array, shape (window,), s
    flight_index : array of int, shape (window,)
    stretches : tuple of GapStretch
        Of the model as given, largest gap first.
    lag_s : float
        Between windows without common samples.
    run : WorstStretch
        Free runs over the stretch in which the model as given was worst.
    again_before, again_after : ComesAgain or None
        What of the gap comes again, of training flights too; None where no flight repeats another.
    """

    centres: Array
    flight_index: IntArray
    played: list[PlayedPair]
    playback: Replay
    stretches: tuple[GapStretch, ...]
    white_before: Whiteness
    white_after: Whiteness
    lag_s: float
    picture: StretchCurves
    run: WorstStretch
    again_before: ComesAgain | None
    again_after: ComesAgain | None


def before_after(
    training: Sequence[Recording],
    held: Sequence[Recording],
    unseen: HeldOut,
    model: ExtendedModel,
    settings: GapSettings,
) -> BeforeAfter:
    """Compare a model with effects with the model as given on held-out flights.

    Parameters
    ----------
    training, held : sequence of Recording
        Flights that the effects were found in, and that they are judged on.
    unseen : HeldOut
        Their residuals.
    """
    windows = common_windows(held, settings)
    centres = [windows.centres(recording.signals.time) for recording in held]
    index = np.repeat(np.arange(len(held)), [len(each) for each in centres])
    stride = -(-len(windows.weight) // windows.hop)
    stated = held[0].signals.vehicle
    with_effects, given = (whole_vehicle(each, stated) for each in (model, plain(model.base)))
    played = played_pairs(held, with_effects, given)
    in_floors = unseen.before * unseen.known / unseen.floor
    found = stretches(in_floors, np.concatenate(centres), index, level=0.0)
    return BeforeAfter(
        np.concatenate(centres),
        index,
        played,
        errors_by_horizon(played, settings.horizon_s),
        found,
        whiteness(unseen.before * unseen.known, index, stride),
        whiteness(unseen.after * unseen.known, index, stride),
        stride * windows.hop * windows.period,
        _picture(held, found[0], windows, model, settings),
        worst_stretch(played),
        *_again(training, held, model, settings),
    )


def _again(
    training: Sequence[Recording], held: Sequence[Recording], model: ExtendedModel, settings: GapSettings
) -> tuple[ComesAgain | None, ComesAgain | None]:
    """Split the gap of the model as given, of signals as logged, and of the model with effects where paths repeat."""
    recordings = [*training, *held]
    repeated = RepeatedRuns.of(recordings, len(held))
    if repeated is None or model.audit is None:
        return None, None
    prepared = Preparation(common_windows(recordings, settings), model.base, settings, model.audit)
    given, known = plain(model.base), system(prepared.repaired(recordings), model.chosen)
    before = repeated.split(given.system(prepared.logged(recordings)), given.linear)
    return before, repeated.split(known, model.linear)


def _picture(
    held: Sequence[Recording], stretch: GapStretch, windows: Windows, model: ExtendedModel, settings: GapSettings
) -> StretchCurves:
    channel = CHANNELS.index(stretch.channel)
    dense = replace(windows, hop=max(1, len(windows.weight) // _PER_WINDOW))
    recording = held[stretch.flight]
    raw, repaired = (
        weak_flight(recording.name, signals, dense, model.base, settings.force, settings.axes)
        for signals in (recording.signals, model.repaired(recording.signals))
    )
    time = dense.centres(recording.signals.time)
    middle, half = 0.5 * (stretch.start_s + stretch.end_s), 0.5 * max(_SHORTEST_S, stretch.end_s - stretch.start_s)
    shown = np.abs(time - middle) <= half
    measured = repaired.averaged(repaired.inertial)[shown, channel]
    logged = dense.average(raw.signals.wrench)[shown, channel]
    after = measured - model.residual([repaired])[shown, channel]
    return StretchCurves(stretch.flight, stretch.channel, time[shown], measured, logged, after)
