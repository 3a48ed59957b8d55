"""The artifact of a replay: a model played back along flights, beside what it has to beat."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeAlias

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.flight import BEGINS, known_begins
from cpfls_cli.artifacts.spec import BODY, WORLD, Format, Record, columns_of, dataset, group, group_of, record, rows_of
from cpfls_cli.playback.flight import contradictions_of
from cpfls_cli.playback.replay import (
    AFTER,
    MODEL,
    PREDICTIONS,
    RATE_FADES,
    WITHOUT_MODEL,
    drawn_runs,
    where_better,
)
from cpfls_cli.playback.settings import VEHICLE
from cpfls_cli.rounding import less
from cpfls_cli.validation.trust import Trust

if TYPE_CHECKING:
    from cpfls_cli.playback.flight import LoggedFlight
    from cpfls_cli.playback.replay import Played, Replay, ReplayOptions, ReplayWindows, SignalErrors

WORST = 5
"""Windows that are listed."""


def played_words(played: str) -> str:
    """Name what is played: a file, or the vehicle of the config."""
    return "the vehicle of the config" if played == VEHICLE else played


USUAL = "usual"
"""What is between samples where nobody says: measured speeds are straight lines, commands stay."""

CONTROL_HORIZON = 0.1
"""Horizon in s to which a controller of the attitude relies on its model."""

FADING = "time constant with which the body rates of the training flights fade"
"""Of the prediction "rate fades"."""

CONTROL_BAND = (0.04, 0.25)
"""Horizons in s at which a controller of the attitude corrects what its model got wrong."""

_VISIBLY = 0.95
"""Ratio of errors that is visible: on real flights decay by axis, in place of one time constant, saves up to 3 %."""

_DRAWN_RUNS = 12
_KEYS = {"actuation": "driven_by", "begins": "begins_s"}
"""What fields of a flight are called for machines."""


@record
class SignalErrorGroup:
    """Errors of one signal by prediction and horizon."""

    mae: Array = dataset(
        "mean norm of the error; of attitudes the geodesic distance", "prediction", "horizon", units="SI"
    )
    rms: Array = dataset("root mean square error by axis", "prediction", "horizon", "axis", units="SI")
    chance: Array | None = dataset(
        "half of the 95 % interval of the difference of its mean norm from that of the model, over blocks of windows",
        "prediction",
        "horizon",
        units="SI",
        least=0.0,
        default=None,
    )

    @classmethod
    def of(cls, errors: SignalErrors | None, rows: Sequence[int]) -> Self | None:
        """Arrange the errors of some predictions; None where no flight knows the signal."""
        if errors is None:
            return None
        chance = None if errors.chance is None else errors.chance[rows]
        return cls(mae=errors.mae[rows], rms=errors.rms[rows], chance=chance)

    @property
    def total(self) -> Array:
        """Sum of the mean norms over the horizon, by prediction."""
        return np.asarray(self.mae.sum(axis=1))

    def by_chance(self, row: int) -> Array:
        """Give how far errors of a prediction are from those of the model by chance; 0 where too few windows tell."""
        return np.zeros(self.mae.shape[1]) if self.chance is None else self.chance[row]

    def summary(self, prediction: int) -> dict[str, Any]:
        """One prediction for machines."""
        by_axis = self.rms[prediction]
        return {
            "mae": self.mae[prediction].tolist(),
            "rms": np.sqrt((by_axis**2).sum(axis=1)).tolist(),
            "rms_by_axis": by_axis.tolist(),
            "sum": float(self.total[prediction]),
        }


ErrorsByHorizon: TypeAlias = "PlaybackGroup | ReplayRecord"
"""What says how far a model and its rivals are off by horizon; rows of `errors` are those of `prediction`."""


def row_of(errors: ErrorsByHorizon, *names: str) -> int:
    """Find the row of a prediction, the first of these names that is there."""
    return next(errors.prediction.index(name) for name in names if name in errors.prediction)


def played_row(errors: ErrorsByHorizon) -> int:
    """Find the row of what is judged: a model, or the one with effects."""
    return row_of(errors, MODEL, AFTER)


def rival_rows(errors: ErrorsByHorizon) -> list[int]:
    """List the rows of what knows no model, which a model has to beat."""
    return [row_of(errors, name) for name in WITHOUT_MODEL if name in errors.prediction]


def rival_row(errors: ErrorsByHorizon, group: SignalErrorGroup) -> int:
    """Find what is best, over all horizons, of what knows no model; of ties the first."""
    best, *others = rival_rows(errors)
    for row in others:
        best = row if less(group.total[row], group.total[best]) else best
    return best


def _by_signal(found: ErrorsByHorizon) -> dict[str, SignalErrorGroup | None]:
    """List errors by signal, what is asked of first first."""
    return {
        "body_rate": found.body_rate,
        "attitude": found.attitude,
        "velocity": found.velocity,
        "position": found.position,
    }


def _summaries(errors: ErrorsByHorizon) -> dict[str, Any]:
    """Describe the errors of each prediction for machines, by signal, and how often it ran away."""
    known = errors.errors.items()
    return {
        name: {signal: found and found.summary(row) for signal, found in known}
        | {"diverged": int(errors.diverged[row])}
        for row, name in enumerate(errors.prediction)
    }


@record
class RegionGroup:
    """Where a model predicts body rates better than what knows no model."""

    share: float = dataset("of the windows")
    rate: Array = dataset("body rate at the start of nine tenths of these windows: least, most", "2", units="rad/s")
    speed: Array | None = dataset("the same of the speed of the flight", "2", units="m/s", default=None)

    @property
    def summary(self) -> dict[str, Any]:
        """The region for machines."""
        speed = None if self.speed is None else self.speed.tolist()
        return {"share": self.share, "rate_rad_s": self.rate.tolist(), "speed_m_s": speed}


@record
class PlaybackGroup:
    """A model played back along flights, beside what it has to beat."""

    flown: tuple[str, ...] = dataset("file names", "playback_flight", path="flight")
    windows: int = dataset("samples from which it was played back")
    prediction: tuple[str, ...] = dataset(
        "as in cpfls/replay; with-past: the same model with /history; before, after: as given and with the effects",
        "prediction",
    )
    horizon_s: Array = dataset("horizons", "horizon", units="s")
    diverged: IntArray = dataset("windows in which a prediction ran away and was stopped", "prediction")
    body_rate: SignalErrorGroup = group()
    attitude: SignalErrorGroup | None = group(default=None)
    velocity: SignalErrorGroup | None = group(default=None)
    position: SignalErrorGroup | None = group(default=None)

    @classmethod
    def of(cls, flights: Sequence[Played], replay: Replay, names: Mapping[str, str], **more: Any) -> Self:
        """Arrange a replay without its windows: what it calls its predictions; others are left out."""
        rows = [replay.predictions.index(name) for name in names]
        groups = {signal: SignalErrorGroup.of(found, rows) for signal, found in replay.errors.items()}
        assert groups["body_rate"] is not None, "every flight has rates"
        steps = np.arange(1, groups["body_rate"].mae.shape[1] + 1)
        return cls(
            flown=tuple(played.flight.name for played in flights),
            windows=len(replay.windows.start),
            prediction=tuple(names.values()),
            horizon_s=flights[0].flight.motion.period * steps,
            diverged=(replay.windows.diverged[rows] >= 0).sum(axis=1),
            **groups,  # type: ignore[arg-type]  # only the body rate is always known
            **more,
        )

    @property
    def played(self) -> str:
        """What is played back."""
        return "the model"

    @property
    def errors(self) -> Mapping[str, SignalErrorGroup | None]:
        """Errors by signal, what is asked of first first."""
        return _by_signal(self)

    @property
    def summary(self) -> dict[str, Any]:
        """The replay for machines: mean errors by prediction and signal."""
        known = {name: found.mae for name, found in self.errors.items() if found is not None}
        return {
            "flights": list(self.flown),
            "windows": self.windows,
            "horizon_s": self.horizon_s.tolist(),
            "models": {
                prediction: {name: mae[index].tolist() for name, mae in known.items()}
                for index, prediction in enumerate(self.prediction)
            },
        }


@record
class HeldOutGroup(PlaybackGroup):
    """A model played back along flights that it was not found in, beside what it has to beat."""

    better: RegionGroup | None = group(default=None)

    @property
    def played(self) -> str:
        """What is played back."""
        return "the vehicle found"

    @classmethod
    def judged(cls, flights: Sequence[Played], replay: Replay) -> Self:
        """Arrange a replay without its windows, and where the model is better than what knows no model."""
        better = where_better(flights, replay)
        region = None if better is None else group_of(RegionGroup, better)
        return cls.of(flights, replay, {name: name for name in replay.predictions}, better=region)

    @property
    def summary(self) -> dict[str, Any]:
        """The replay for machines."""
        return {
            **super().summary,
            "models": _summaries(self),
            "better": None if self.better is None else self.better.summary,
        }


def better_to(errors: ErrorsByHorizon, signal: str) -> float:
    """Find the longest horizon, s, up to which the errors of the model add up to less than those of all its rivals.

    They are what knows no model. Sums are compared, because over the first samples noise of the start decides, and
    there nothing beats a state that stays. 0 where there is none, NaN for a signal that no flight knows.
    """
    group = errors.errors[signal]
    if group is None:
        return float("nan")
    summed = np.cumsum(group.mae, axis=1)
    better = np.flatnonzero(less(summed[played_row(errors)], summed[rival_rows(errors)].min(axis=0)))
    return float(errors.horizon_s[better[-1]]) if len(better) else 0.0


def lost_to(errors: ErrorsByHorizon) -> dict[str, tuple[str, float, float]]:
    """Find where a model loses in rates or attitude to what knows no model at horizons where control lives.

    A loss is one beyond chance, as far as chance is known.

    Returns
    -------
    dict of str to (str, float, float)
        By signal: the rival that it loses to first, and from which horizon to which, s.
    """
    horizon, inside = errors.horizon_s, _inside(errors)
    row, rows = played_row(errors), rival_rows(errors)
    lost: dict[str, tuple[str, float, float]] = {}
    for signal in ("body_rate", "attitude"):
        group = errors.errors[signal]
        if group is None:
            continue
        loses = np.array([inside & less(group.mae[each] + group.by_chance(each), group.mae[row]) for each in rows])
        where = np.flatnonzero(loses.any(axis=0))
        if len(where):
            first, last = where[[0, -1]]
            rival = rows[int(np.where(loses[:, first], group.mae[rows, first], np.inf).argmin())]
            lost[signal] = (errors.prediction[rival], float(horizon[first]), float(horizon[last]))
    return lost


def _inside(errors: ErrorsByHorizon) -> BoolArray:
    """Flag the horizons where control lives; all of a playback that ends before."""
    horizon, (low, high) = errors.horizon_s, CONTROL_BAND
    # A rounding error is no horizon apart.
    return ~less(horizon, low) & ~less(high, horizon) if not less(horizon[-1], low) else np.ones(len(horizon), bool)


def like_fading(errors: ErrorsByHorizon) -> float | None:
    """Find where a model has to beat "rate fades" in rates, s; None where it does, visibly and by more than chance.

    That is the end of where control lives: what knows nothing of the torque has forgotten most there. None too where
    it is not known how rates fade.
    """
    group = errors.errors["body_rate"]
    if group is None or RATE_FADES not in errors.prediction:
        return None
    last = int(np.flatnonzero(_inside(errors))[-1])
    fades, model = row_of(errors, RATE_FADES), played_row(errors)
    most = np.minimum(group.mae[fades] - group.by_chance(fades), _VISIBLY * group.mae[fades])
    better = less(group.mae[model], most)[last]
    return None if better else float(errors.horizon_s[last])


def behind_both(errors: ErrorsByHorizon) -> tuple[str, ...]:
    """List what of velocity and position a model predicts worse, over all horizons, than each that knows no model."""
    groups = {signal: errors.errors[signal] for signal in ("velocity", "position")}
    totals = {signal: group.total for signal, group in groups.items() if group is not None}
    model, rivals = played_row(errors), rival_rows(errors)
    return tuple(signal for signal, total in totals.items() if less(total[rivals].max(), total[model]))


def trust_by_playback(held_out: PlaybackGroup | None) -> Trust:
    """Judge a model by its playback along flights that it was not found in.

    Good for simulation where errors of rates, attitude, velocity and position, as far as the flights know them, add
    up to less over the horizon than those of what knows no model; for control where those of the rates do, over
    0.1 s at least. Nothing is good for either that loses in rates or attitude where control lives, that predicts rates
    there no better than mere decay, or whose velocity or position is worse than all of what knows no model.
    """
    if held_out is None:
        return Trust.NOT_JUDGED
    last, known = float(held_out.horizon_s[-1]), held_out.errors
    reached = {signal: better_to(held_out, signal) for signal, group in known.items() if group is not None}
    if reached["body_rate"] < min(CONTROL_HORIZON, last):
        return Trust.DO_NOT_USE
    if lost_to(held_out) or like_fading(held_out) or behind_both(held_out):
        return Trust.NOT_CONTROL
    simulates = known["velocity"] is not None and all(horizon >= last for horizon in reached.values())
    return Trust.SIMULATION if simulates else Trust.CONTROL


@record
class PlayedFlightsGroup:
    """Flights that a model was played back along."""

    name: tuple[str, ...] = dataset("file name", "flight")
    windows: IntArray = dataset("samples from which it was played back", "flight")
    actuation: tuple[str, ...] = dataset("what drove the playback", "flight")
    hold: tuple[str, ...] = dataset("what that is between samples: linear or previous", "flight")
    rotation_alone: BoolArray = dataset("1 where velocity was not played back", "flight")
    begins: Array | None = dataset(BEGINS, "flight", units="s", gaps=True, default=None)

    @classmethod
    def of(cls, flights: Sequence[LoggedFlight], played: Sequence[Played], windows: ReplayWindows) -> Self:
        """Arrange flights."""
        return columns_of(
            cls,
            flights,
            windows=np.bincount(windows.flight, minlength=len(flights)),
            rotation_alone=np.array([not each.flight.translates for each in played]),
            begins=known_begins(flight.begins for flight in flights),
        )


@record
class WindowGroup:
    """Free runs, one for each sample from which the model was played back."""

    flight: IntArray = dataset("index of the flight", "window", into="flight")
    start: Array = dataset("begin, on the clock of the flight", "window", units="s")
    error: Array = dataset(
        "mean norm of the error of the body rate over the horizon", "prediction", "window", units="rad/s"
    )
    diverged: Array = dataset(
        "when the model ran away, after the start; not finite where it did not", "window", units="s", gaps=True
    )

    @classmethod
    def of(cls, windows: ReplayWindows, times: Sequence[Array], period: float) -> Self:
        """Arrange windows, given the times of the samples of each flight and the period, s."""
        start = np.empty(len(windows.start))
        for index, time in enumerate(times):
            own = windows.flight == index
            start[own] = time[windows.start[own]]
        after = windows.diverged[PREDICTIONS.index(MODEL)]
        return cls(
            flight=windows.flight,
            start=start,
            error=windows.size,
            diverged=np.where(after < 0, np.nan, period * (after + 1)),
        )


@record
class WorstGroup:
    """Runs of the model beside the flight in the windows in which it is farthest off."""

    window: IntArray = dataset("index of the window, the worst first", "worst", into="window")
    measured: Array = dataset("body rate of the flight", "worst", "sample", "axis", units="rad/s", frame=BODY)
    model: Array = dataset("body rate of the model", "worst", "sample", "axis", units="rad/s", frame=BODY)

    @classmethod
    def of(cls, windows: ReplayWindows, played: Sequence[Played], horizon: int) -> Self:
        """Draw the worst windows."""
        chosen = windows.worst(horizon, WORST)
        runs = [drawn_runs(played[windows.flight[index]], windows.start[[index]], horizon) for index in chosen]
        return cls(
            window=np.array(chosen, dtype=np.int64),
            measured=np.concatenate([run.measured for run in runs]),
            model=np.concatenate([run.model for run in runs]),
        )


@record
class DrawnGroup:
    """Runs of the model one after another beside a stretch of a flight."""

    window: IntArray = dataset("index of the window", "run", into="window")
    measured: Array = dataset("body rate of the flight", "run", "sample", "axis", units="rad/s", frame=BODY)
    model: Array = dataset("body rate of the model", "run", "sample", "axis", units="rad/s", frame=BODY)
    measured_position: Array | None = dataset(
        "position of the flight", "run", "sample", "axis", units="m", frame=WORLD, default=None
    )
    model_position: Array | None = dataset(
        "position of the model", "run", "sample", "axis", units="m", frame=WORLD, default=None
    )

    @classmethod
    def of(cls, windows: ReplayWindows, played: Sequence[Played], horizon: int) -> Self:
        """Draw a stretch of which half are better and half are worse."""
        chosen = windows.typical(horizon, _DRAWN_RUNS)
        runs = drawn_runs(played[windows.flight[chosen[0]]], windows.start[chosen], horizon)
        return cls(window=np.array(chosen, dtype=np.int64), **vars(runs))


@record
class ReplayRecord(Record):
    """The artifact `cpfls/replay`."""

    FORMAT: ClassVar = Format(
        "cpfls/replay",
        "a model played back along flights from many of their samples, beside what it has to beat",
        "replay",
        ("model", "flight"),
    )

    played: str = dataset("what is played back: a file, or vehicle for that of /config")
    prediction: tuple[str, ...] = dataset(
        "model; nothing-moves: the whole state stays; rate-stays: rates and velocity; stated: the vehicle of the "
        "config; rate-fades: rates fade by fading_s, velocity stays",
        "prediction",
    )
    asked_s: float = dataset("longest horizon, as asked for", units="s")
    every: int = dataset("samples from one begin to the next")
    hold: str = dataset("what is between samples, as asked for: linear, previous; usual where nothing was")
    history_s: float | None = dataset("how much of the flight before a start the model uses", units="s", default=None)
    fading_s: float | None = dataset(FADING, units="s", default=None)
    horizon_s: Array = dataset("horizons", "horizon", units="s")
    diverged: IntArray = dataset("windows in which a prediction ran away and was stopped", "prediction")
    body_rate: SignalErrorGroup = group()
    attitude: SignalErrorGroup | None = group(default=None)
    velocity: SignalErrorGroup | None = group(default=None)
    position: SignalErrorGroup | None = group(default=None)
    flight: PlayedFlightsGroup = group()
    window: WindowGroup = group()
    worst: WorstGroup = group()
    drawn: DrawnGroup = group()
    warning: tuple[str, ...] = dataset("what to know about flights and model", "warning")
    contradiction: tuple[str, ...] | None = dataset(
        "contradictions within the flights or with the vehicle", "contradiction", default=None
    )

    @classmethod
    def of(
        cls,
        name: str,
        asked: ReplayOptions,
        flights: Sequence[LoggedFlight],
        played: Sequence[Played],
        replay: Replay,
        warnings: Sequence[str],
    ) -> Self:
        """Arrange a replay."""
        errors, windows, period = replay.errors, replay.windows, played[0].flight.motion.period
        rows = range(len(replay.predictions))
        groups = {signal: SignalErrorGroup.of(found, rows) for signal, found in errors.items()}
        assert groups["body_rate"] is not None, "every flight has rates"
        horizon = groups["body_rate"].mae.shape[1]
        return cls(
            played=name,
            prediction=replay.predictions,
            asked_s=asked.horizon_s,
            every=asked.every,
            hold=asked.hold or USUAL,
            history_s=asked.history_s or None,
            fading_s=played[0].fading_s,
            horizon_s=period * np.arange(1, horizon + 1),
            diverged=(windows.diverged >= 0).sum(axis=1),
            flight=PlayedFlightsGroup.of(flights, played, windows),
            window=WindowGroup.of(windows, [flight.time for flight in flights], period),
            worst=WorstGroup.of(windows, played, horizon),
            drawn=DrawnGroup.of(windows, played, horizon),
            warning=tuple(warnings),
            contradiction=contradictions_of(flights) or None,
            **groups,  # type: ignore[arg-type]  # only the body rate is always known
        )

    @property
    def errors(self) -> Mapping[str, SignalErrorGroup | None]:
        """Errors by signal, what is asked of first first."""
        return _by_signal(self)

    @property
    def flown(self) -> tuple[str, ...]:
        """Names of the flights."""
        return self.flight.name

    @property
    def windows(self) -> int:
        """Number of windows."""
        return len(self.window.start)

    @property
    def summary(self) -> dict[str, Any]:
        """The replay for machines."""
        return {
            "played": self.played,
            "history_s": self.history_s or 0.0,
            "fading_s": self.fading_s,
            "horizon_s": self.horizon_s.tolist(),
            "windows": self.windows,
            "models": _summaries(self),
            "flights": [{_KEYS.get(key, key): value for key, value in row.items()} for row in rows_of(self.flight)],
            "worst": [
                {
                    "flight": self.flight.name[self.window.flight[index]],
                    "start_s": float(self.window.start[index]),
                    "error_rad_s": float(self.window.error[played_row(self), index]),
                }
                for index in self.worst.window
            ],
            "contradictions": list(self.contradiction or ()),
            "warnings": list(self.warning),
        }
