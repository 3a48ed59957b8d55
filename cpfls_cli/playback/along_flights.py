"""The result of a replay: a model played back along flights, with the runs that are worth a look."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.playback.errors import FADING, MODEL, NOTHING_MOVES, PREDICTIONS, ByHorizon
from cpfls_cli.playback.flight import LoggedFlight, contradictions_of
from cpfls_cli.playback.replay import Played, Replay, ReplayOptions, ReplayWindows, drawn_runs
from cpfls_cli.result import about, part, result

USUAL = "usual"
"""What is between samples where nobody says: measured speeds are straight lines, commands stay."""

_WORST = 5
"""Windows that are listed."""
_DRAWN_RUNS = 12
_BODY, _WORLD = "body (FLU)", "world (z up)"


@result
class PlayedFlight:
    """A flight that a model was played back along."""

    name: str = about("file name")
    windows: int = about("samples from which it was played back")
    driven_by: str = about("what drove the playback")
    hold: str = about("what that is between samples: linear or previous")
    rotation_alone: bool = about("1 where velocity was not played back")
    begins_s: float = about(
        "stamp of the log's own clock at time 0; not finite where there is none", unit="s", gaps=True
    )


@result
class WorstRun:
    """A run of the model in a window in which it is far off."""

    flight: str = about("name of the flight")
    start_s: float = about("begin of the window, on the clock of the flight", unit="s")
    error_rad_s: float = about("mean norm of the error of the body rate over the horizon", unit="rad/s")
    nothing_moves_rad_s: float = about("the same if nothing moves", unit="rad/s")
    measured: Array = about("body rate of the flight", "sample", "axis", unit="rad/s", frame=_BODY, brief=False)
    model: Array = about("body rate of the model", "sample", "axis", unit="rad/s", frame=_BODY, brief=False)


@result
class DrawnRuns:
    """Runs of the model one after another, with the flight."""

    flight: str = about("name of the flight")
    start_s: Array = about("begin of each run, on the clock of the flight", "run", unit="s")
    measured: Array = about("body rate of the flight", "run", "sample", "axis", unit="rad/s", frame=_BODY, brief=False)
    model: Array = about("body rate of the model", "run", "sample", "axis", unit="rad/s", frame=_BODY, brief=False)
    measured_position: Array | None = about(
        "position of the flight", "run", "sample", "axis", unit="m", frame=_WORLD, brief=False, default=None
    )
    model_position: Array | None = about(
        "position of the model", "run", "sample", "axis", unit="m", frame=_WORLD, brief=False, default=None
    )


@result
class Playback(ByHorizon):
    """A model played back along flights from many of their samples, and what it has to beat."""

    FORMAT: ClassVar = "cpfls/replay"
    SHOWN: ClassVar = ("windows",)

    played: str = about("what is played back: a file, or vehicle for that of /config")
    asked_s: float = about("longest horizon, as asked for", unit="s")
    every: int = about("samples from one begin to the next")
    hold: str = about("what is between samples, as asked for: linear, previous; usual where nothing was")
    history_s: float = about("how much of the flight before a start the model uses", unit="s")
    fading_s: float | None = about(FADING, unit="s", default=None)
    flights: tuple[PlayedFlight, ...] = part()
    window_flight: IntArray = about("index of the flight of each window", "window", brief=False)
    window_start: Array = about("begin, on the clock of the flight", "window", unit="s", brief=False)
    window_error: Array = about(
        "mean norm of the error of the body rate over the horizon, of each prediction",
        "prediction",
        "window",
        unit="rad/s",
        brief=False,
    )
    window_diverged: Array = about(
        "when the model ran away, after the start; not finite where it did not",
        "window",
        unit="s",
        gaps=True,
        brief=False,
    )
    worst: tuple[WorstRun, ...] = part()
    drawn: DrawnRuns = part()
    warnings: tuple[str, ...] = about("what to know about flights and model", "warning", default=())
    contradictions: tuple[str, ...] = about(
        "contradictions within the flights or with the vehicle", "contradiction", default=()
    )

    @property
    def windows(self) -> int:
        """Number of windows."""
        return len(self.window_start)

    def errors_of(self, name: str) -> Array:
        """Give how far off a prediction is in each window, shape (window,), rad/s."""
        return np.asarray(self.window_error[list(self.models).index(name)])


def playback(
    name: str,
    asked: ReplayOptions,
    flights: Sequence[LoggedFlight],
    played: Sequence[Played],
    found: Replay,
    warnings: Sequence[str],
) -> Playback:
    """Put a replay together with the runs that are worth a look."""
    windows, period = found.windows, float(found.horizon_s[0])
    after = windows.diverged[PREDICTIONS.index(MODEL)]
    counts = np.bincount(windows.flight, minlength=len(flights)).tolist()
    starts = np.array([flights[at].time[start] for at, start in zip(windows.flight, windows.start, strict=True)])
    return Playback(
        horizon_s=found.horizon_s,
        models=found.models,
        played=name,
        asked_s=asked.horizon_s,
        every=asked.every,
        hold=asked.hold or USUAL,
        history_s=asked.history_s,
        fading_s=played[0].fading_s,
        flights=tuple(
            PlayedFlight(
                name=flight.name,
                windows=count,
                driven_by=flight.actuation,
                hold=flight.hold,
                rotation_alone=not own.flight.translates,
                begins_s=flight.begins,
            )
            for flight, own, count in zip(flights, played, counts, strict=True)
        ),
        window_flight=windows.flight,
        window_start=starts,
        window_error=windows.size,
        window_diverged=np.where(after < 0, np.nan, period * (after + 1)),
        worst=tuple(_worst(played, windows, starts, len(found.horizon_s))),
        drawn=_drawn(played, windows, starts, len(found.horizon_s)),
        warnings=tuple(warnings),
        contradictions=contradictions_of(flights),
    )


def _worst(played: Sequence[Played], windows: ReplayWindows, starts: Array, horizon: int) -> Iterator[WorstRun]:
    chosen = windows.worst(horizon, _WORST)
    ran: dict[int, tuple[Array, Array]] = {}
    # Those of a flight are played back side by side, which takes no longer than one.
    for flight in {int(windows.flight[at]) for at in chosen}:
        own = sorted(at for at in chosen if windows.flight[at] == flight)
        runs = drawn_runs(played[flight], windows.start[own], horizon)
        ran |= zip(own, zip(runs["measured"], runs["model"], strict=True), strict=True)
    for at in chosen:
        measured, model = ran[at]
        yield WorstRun(
            flight=played[windows.flight[at]].flight.name,
            start_s=float(starts[at]),
            error_rad_s=float(windows.of_model[at]),
            nothing_moves_rad_s=float(windows.size[PREDICTIONS.index(NOTHING_MOVES), at]),
            measured=measured,
            model=model,
        )


def _drawn(played: Sequence[Played], windows: ReplayWindows, starts: Array, horizon: int) -> DrawnRuns:
    chosen = windows.typical(horizon, _DRAWN_RUNS)
    own = played[windows.flight[chosen[0]]]
    runs = drawn_runs(own, windows.start[chosen], horizon)
    return DrawnRuns(flight=own.flight.name, start_s=starts[chosen], **runs)
