"""Models played back along flights: their errors by horizon, what beats them, and the runs that are worth a look."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.blocks import FEWEST_BLOCKS, MOST_COMPARED, contiguous, half_width, jackknife_error
from cpfls_cli.playback.errors import (
    FADING,
    MODEL,
    NOTHING_MOVES,
    PREDICTIONS,
    RATE_FADES,
    STATED,
    WITH_PAST,
    WITHOUT_MODEL,
    AlongFlights,
    ByHorizon,
    Errors,
    Prediction,
    Region,
)
from cpfls_cli.playback.flight import LoggedFlight, PlaybackFlight, contradictions_of
from cpfls_cli.playback.player import Player, free_runs, still_runs
from cpfls_cli.playback.windows import RunErrors
from cpfls_cli.result import BODY, WORLD, about, part, result

SIGNALS = ("position", "velocity", "attitude", "body_rate")
"""What errors are of, in the order of the compiled runs."""

_BATCH = 100_000
"""Steps of free runs at a time, which bounds the memory."""

_FADING = (1e2, 1e-1, 2000)
"""Time constants that are tried: the longest in horizons, the shortest in samples, and how many."""

_HORIZONS = 2
"""Length of a block at least, in horizons."""


@dataclass(frozen=True)
class Played:
    """A flight and what is played back along it.

    Attributes
    ----------
    with_past : Player or None
        A model that uses the past, next to one that does not.
    fading_s : float or None, s
        See `RATE_FADES`; None where no flights train.
    """

    flight: PlaybackFlight
    model: Player
    stated: Player
    with_past: Player | None = field(default=None, kw_only=True)
    fading_s: float | None = field(default=None, kw_only=True)

    def runs(self, prediction: str, starts: IntArray, horizon: int) -> RunErrors:
        """Predict from samples of the flight.

        Parameters
        ----------
        prediction : str
            Of `PREDICTIONS`, `WITH_PAST` or `RATE_FADES`.
        starts : array of int, shape (run,)
            Ascending.
        horizon : int
            Samples.
        """
        if prediction in WITHOUT_MODEL:
            fading = self.fading_s if prediction == RATE_FADES else None
            moves = prediction != NOTHING_MOVES
            return still_runs(self.flight, starts, horizon, moves=moves, fading_s=np.inf if fading is None else fading)
        players = {MODEL: self.model, STATED: self.stated, WITH_PAST: self.with_past}
        player = players[prediction]
        assert player is not None, "asked for where all flights have one"
        return free_runs(player, self.flight, starts, horizon)

    @property
    def knows(self) -> dict[str, bool]:
        """Whether errors of each signal are known."""
        flight = self.flight
        return {
            "body_rate": True,
            "attitude": flight.has_attitude,
            "velocity": flight.translates,
            "position": flight.translates and flight.has_position,
        }


def fading(flights: Sequence[PlaybackFlight], horizon: int) -> float:
    """Fit the time constant with which body rates of flights fade, s, by least squares over a horizon.

    Parameters
    ----------
    flights : sequence of PlaybackFlight
        Of one sampling period.
    horizon : int
        Samples.

    Returns
    -------
    float
        The longest that is tried where they do not fade.
    """
    period = flights[0].motion.period
    parts = [flight.motion.rate[part] for flight in flights for part in flight.stretches]
    steps = np.arange(1, horizon + 1)
    own = np.array([sum(float((part[:-step] ** 2).sum()) for part in parts) for step in steps])
    kept = np.array([sum(float((part[:-step] * part[step:]).sum()) for part in parts) for step in steps])
    longest, shortest, count = _FADING
    tried = period * np.geomspace(longest * horizon, shortest, count)
    share = np.exp(-period * steps / tried[:, None])
    # Of squared errors, what depends on the time constant.
    return float(tried[np.argmin((own * share**2 - 2.0 * kept * share).sum(axis=1))])


@dataclass(frozen=True)
class Replay:
    """Errors of predictions of flights by horizon, and where runs started and how far off they were.

    Attributes
    ----------
    models : dict of str to Prediction
        Of `PREDICTIONS`, and `WITH_PAST` and `RATE_FADES` where all flights have them.
    horizon_s : array, shape (horizon,), s
    flight : array of int, shape (window,)
    start : array of int, shape (window,)
        Sample of the flight.
    size : array, shape (prediction, window), rad/s
        Mean norm of the error of the body rate over the horizon.
    diverged : array of int, shape (prediction, window)
        Step at which a run was stopped; -1 for those that went on.
    """

    models: dict[str, Prediction]
    horizon_s: Array
    flight: IntArray
    start: IntArray
    size: Array
    diverged: IntArray

    @property
    def of_model(self) -> Array:
        """How far off the model was, shape (window,), rad/s."""
        return np.asarray(self.size[PREDICTIONS.index(MODEL)])

    def worst(self, count: int) -> list[int]:
        """List at most so many windows in which the model is farthest off, without overlap, the worst first."""
        chosen: list[int] = []
        for index in np.argsort(-self.of_model, kind="stable"):
            here = self.flight[chosen] == self.flight[index]
            if not np.any(here & (np.abs(self.start[chosen] - self.start[index]) <= len(self.horizon_s))):
                chosen.append(int(index))
            if len(chosen) == count:
                break
        return chosen

    def typical(self, count: int) -> list[int]:
        """List at most so many windows in a row that are as far off as the middle one of all such stretches is."""
        stretches = [part for flight in np.unique(self.flight) for part in self._stretches(int(flight), count)]
        sizes = np.array([self.of_model[part].mean() for part in stretches])
        return stretches[int(np.argsort(sizes, kind="stable")[(len(sizes) - 1) // 2])]

    def _stretches(self, flight: int, count: int) -> Iterator[list[int]]:
        """Tile a flight with windows, each the first that begins behind the one before."""
        tiles: list[int] = []
        for index in np.flatnonzero(self.flight == flight):
            if not tiles or self.start[index] >= self.start[tiles[-1]] + len(self.horizon_s):
                tiles.append(int(index))
        yield from (tiles[first : first + count] for first in range(0, max(len(tiles) - count + 1, 1), count))

    def along(self, flights: Sequence[Played], names: Mapping[str, str] | None = None) -> AlongFlights:
        """Sum up without the windows.

        Parameters
        ----------
        names : mapping of str to str, or None
            Predictions that are kept, with what they are called; None for all.
        """
        kept = names or {name: name for name in self.models}
        return AlongFlights(
            horizon_s=self.horizon_s,
            models={new: self.models[name] for name, new in kept.items()},
            flights=tuple(played.flight.name for played in flights),
            windows=len(self.start),
            fading_s=flights[0].fading_s,
            better=where_better(flights, self),
        )


_OUTER = 0.05
"""Share of the windows at each end that a region leaves out: one stray sample is no region."""


def where_better(flights: Sequence[Played], replayed: Replay) -> Region | None:
    """Find the speeds and rates at which a model is better than what knows no model; None where it is nowhere."""
    rivals = [row for row, name in enumerate(replayed.models) if name in WITHOUT_MODEL]
    better = replayed.of_model < replayed.size[rivals].min(axis=0)
    if not better.any():
        return None
    motions = [played.flight.motion for played in flights]
    places = [replayed.start[better & (replayed.flight == index)] for index in range(len(flights))]

    def span(signals: Sequence[Array]) -> Array:
        sizes = [np.linalg.norm(signal[at], axis=1) for signal, at in zip(signals, places, strict=True)]
        return np.asarray(np.quantile(np.concatenate(sizes), [_OUTER, 1 - _OUTER]))

    known = all(played.knows["velocity"] for played in flights)
    speed = span([motion.velocity for motion in motions]) if known else None
    return Region(share=float(better.mean()), speed_m_s=speed, rate_rad_s=span([motion.rate for motion in motions]))


@dataclass
class _Sums:
    """Sums over the windows so far, those of norms by block of windows."""

    horizon: int
    names: tuple[str, ...]
    block: IntArray
    count: IntArray = field(init=False)
    norm: Array = field(init=False)
    square: Array = field(init=False)

    def __post_init__(self) -> None:
        blocks, shape = int(self.block.max()) + 1, (len(self.names), self.horizon)
        self.count = np.zeros((4, blocks), dtype=np.int64)
        self.norm = np.zeros((4, blocks, *shape))
        self.square = np.zeros((4, *shape, 3))

    def add(self, prediction: int, windows: slice, errors: Array, knows: Mapping[str, bool]) -> None:
        """Add the errors of a batch of windows by one of the predictions, shape (run, horizon, 4, 3)."""
        norms = np.sqrt(np.einsum("nhsa,nhsa->nhs", errors, errors))
        squares, block = np.einsum("nhsa,nhsa->hsa", errors, errors), self.block[windows]
        known = [row for row, signal in enumerate(SIGNALS) if knows[signal]]
        self.square[known, prediction] += squares.swapaxes(0, 1)[known]
        for each in np.unique(block):
            own = norms[block == each]
            self.norm[known, each, prediction] += own.sum(axis=0).T[known]
            self.count[known, each] += len(own) if prediction == self.names.index(MODEL) else 0

    def predictions(self, diverged: IntArray) -> dict[str, Prediction]:
        """Take the means, with the windows in which each prediction ran away, shape (prediction,)."""
        known = {signal: self._errors(row) for row, signal in enumerate(SIGNALS) if self.count[row].any()}
        return {
            name: Prediction(diverged=int(diverged[index]), **{signal: own[index] for signal, own in known.items()})
            for index, name in enumerate(self.names)
        }

    def _errors(self, row: int) -> list[Errors]:
        """Take the means of one signal, of each prediction."""
        total, norm = int(self.count[row].sum()), self.norm[row]
        seen, chance = np.flatnonzero(self.count[row]), None
        if len(seen) >= FEWEST_BLOCKS:
            left_out = (norm.sum(axis=0) - norm[seen]) / (total - self.count[row, seen])[:, None, None]
            apart = left_out - left_out[:, [self.names.index(MODEL)]]
            chance = half_width(jackknife_error(apart), len(seen))
        means = zip(norm.sum(axis=0) / total, np.sqrt(self.square[row] / total), strict=True)
        return [
            Errors(mae=mae, rms_by_axis=rms, chance=None if chance is None else chance[index])
            for index, (mae, rms) in enumerate(means)
        ]


def _blocks(windows: int, horizon: int, every: int) -> IntArray:
    """Cut windows, one after another, into blocks that stand for independent ones: the number of the block of each."""
    return contiguous(windows, max(min(MOST_COMPARED, windows * every // (_HORIZONS * horizon)), 1))


def replay(
    flights: Sequence[Played], horizon: int, every: int, progress: Callable[[float], None] = lambda _: None
) -> Replay:
    """Play a model and what it has to beat back along flights.

    Parameters
    ----------
    flights : sequence of Played
        Of one sampling period.
    horizon, every : int
        Samples.
    progress : callable
        Takes the share that is done.

    Raises
    ------
    InputError
        If a flight is shorter than the horizon.

    References
    ----------
    The metric of arXiv 2512.14450: mean norms of errors by horizon, and their sums.
    """
    starts = [played.flight.starts(horizon, every) for played in flights]
    past = all(played.with_past is not None for played in flights)
    fades = all(played.fading_s is not None for played in flights)
    names = (*PREDICTIONS, *([WITH_PAST] if past else []), *([RATE_FADES] if fades else []))
    parts, done, total = [], 0, sum(map(len, starts))
    sums = _Sums(horizon, names, _blocks(total, horizon, every))
    for index, played in enumerate(flights):
        size = max(1, _BATCH // horizon)
        for first in range(0, len(starts[index]), size):
            batch = starts[index][first : first + size]
            parts.append(_added(sums, played, batch, index, done))
            done += len(batch)
            progress(done / total)
    flight, start, sizes, diverged = (np.concatenate(columns, axis=-1) for columns in zip(*parts, strict=True))
    horizon_s: Array = flights[0].flight.motion.period * np.arange(1.0, horizon + 1.0)
    return Replay(sums.predictions((diverged >= 0).sum(axis=1)), horizon_s, flight, start, sizes, diverged)


def _added(
    sums: _Sums, played: Played, starts: IntArray, flight: int, first: int
) -> tuple[IntArray, IntArray, Array, IntArray]:
    """Add a batch, from this window on, to the sums; give where its windows are and how far off, as `Replay` does."""
    size = np.empty((len(sums.names), len(starts)))
    diverged = np.empty(size.shape, dtype=np.int64)
    knows = played.knows
    model: RunErrors | None = None
    for row, prediction in enumerate(sums.names):
        again = model if prediction == STATED and played.stated is played.model else None
        runs = again or played.runs(prediction, starts, sums.horizon)
        model = runs if prediction == MODEL else model
        sums.add(row, slice(first, first + len(starts)), runs.errors, knows)
        size[row] = np.linalg.norm(runs.errors[:, :, SIGNALS.index("body_rate")], axis=2).mean(axis=1)
        diverged[row] = runs.diverged
    return np.full(len(starts), flight), starts, size, diverged


def drawn_runs(played: Played, starts: IntArray, horizon: int) -> dict[str, Array]:
    """Give what the model and the flight do from samples on, by the names of `DrawnRuns`, their starts included.

    Parameters
    ----------
    starts : array of int, shape (run,)
        Ascending.
    horizon : int
        Samples.
    """
    errors = played.runs(MODEL, starts, horizon).errors
    of_position, of_rate = (errors[:, :, SIGNALS.index(name)] for name in ("position", "body_rate"))
    samples = starts[:, None] + np.arange(horizon + 1)
    rate, position = played.flight.motion.rate[samples], played.flight.motion.position[samples]
    found = {"measured": rate, "model": _predicted(rate, of_rate)}
    if played.knows["position"]:
        found |= {"measured_position": position, "model_position": _predicted(position, of_position)}
    return found


def _predicted(measured: Array, errors: Array) -> Array:
    predicted = measured.copy()
    predicted[:, 1:] += errors
    return predicted


USUAL = "usual"
"""What is between samples where nobody says: measured speeds are straight lines, commands stay."""

_WORST = 5
"""Windows that are listed."""
_DRAWN_RUNS = 12


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
    measured: Array = about("body rate of the flight", "sample", "axis", unit="rad/s", frame=BODY, brief=False)
    model: Array = about("body rate of the model", "sample", "axis", unit="rad/s", frame=BODY, brief=False)


@result
class DrawnRuns:
    """Runs of the model one after another, with the flight."""

    flight: str = about("name of the flight")
    start_s: Array = about("begin of each run, on the clock of the flight", "run", unit="s")
    measured: Array = about("body rate of the flight", "run", "sample", "axis", unit="rad/s", frame=BODY, brief=False)
    model: Array = about("body rate of the model", "run", "sample", "axis", unit="rad/s", frame=BODY, brief=False)
    measured_position: Array | None = about(
        "position of the flight", "run", "sample", "axis", unit="m", frame=WORLD, brief=False, default=None
    )
    model_position: Array | None = about(
        "position of the model", "run", "sample", "axis", unit="m", frame=WORLD, brief=False, default=None
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
    asked: Mapping[str, Any],
    flights: Sequence[LoggedFlight],
    played: Sequence[Played],
    found: Replay,
    warnings: Sequence[str],
) -> Playback:
    """Put a replay together with what was asked for, by the result's fields, and the runs that are worth a look."""
    period = float(found.horizon_s[0])
    after = found.diverged[PREDICTIONS.index(MODEL)]
    counts = np.bincount(found.flight, minlength=len(flights)).tolist()
    starts = np.array([flights[at].time[start] for at, start in zip(found.flight, found.start, strict=True)])
    return Playback(
        horizon_s=found.horizon_s,
        models=found.models,
        **asked,
        fading_s=played[0].fading_s,
        flights=tuple(
            PlayedFlight(
                name=flight.name,
                windows=count,
                driven_by=flight.actuation,
                hold=flight.hold,
                rotation_alone=not own.flight.translates,
                begins_s=flight.parts[0].begins,
            )
            for flight, own, count in zip(flights, played, counts, strict=True)
        ),
        window_flight=found.flight,
        window_start=starts,
        window_error=found.size,
        window_diverged=np.where(after < 0, np.nan, period * (after + 1)),
        worst=tuple(_worst(played, found, starts)),
        drawn=_drawn(played, found, starts),
        warnings=tuple(warnings),
        contradictions=contradictions_of(flights),
    )


def _worst(played: Sequence[Played], found: Replay, starts: Array) -> Iterator[WorstRun]:
    chosen = found.worst(_WORST)
    ran: dict[int, tuple[Array, Array]] = {}
    # Those of a flight are played back side by side, which takes no longer than one.
    for flight in {int(found.flight[at]) for at in chosen}:
        own = sorted(at for at in chosen if found.flight[at] == flight)
        runs = drawn_runs(played[flight], found.start[own], len(found.horizon_s))
        ran |= zip(own, zip(runs["measured"], runs["model"], strict=True), strict=True)
    for at in chosen:
        measured, model = ran[at]
        yield WorstRun(
            flight=played[found.flight[at]].flight.name,
            start_s=float(starts[at]),
            error_rad_s=float(found.of_model[at]),
            nothing_moves_rad_s=float(found.size[PREDICTIONS.index(NOTHING_MOVES), at]),
            measured=measured,
            model=model,
        )


def _drawn(played: Sequence[Played], found: Replay, starts: Array) -> DrawnRuns:
    chosen = found.typical(_DRAWN_RUNS)
    own = played[found.flight[chosen[0]]]
    runs = drawn_runs(own, found.start[chosen], len(found.horizon_s))
    return DrawnRuns(flight=own.flight.name, start_s=starts[chosen], **runs)
