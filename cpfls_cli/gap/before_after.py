"""A model before and after its effects, on held-out flights: playback, and the worst stretches."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Annotated, ClassVar, NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.weak_flight import CHANNELS, Preparation, dense, weak_flight
from cpfls_cli.gap.extended import ExtendedModel, plain
from cpfls_cli.gap.naming.held_out import HeldOut
from cpfls_cli.gap.naming.results import BODY
from cpfls_cli.gap.residual.dependence import GapStretch, stretches
from cpfls_cli.gap.residual.repeated import Repeatability, RepeatedRuns
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.gap.whole_vehicle import on_top_of, whole_vehicle
from cpfls_cli.playback.errors import AFTER, BEFORE, MODEL, NOTHING_MOVES, STATED, AlongFlights
from cpfls_cli.playback.flight import LoggedFlight, PlaybackFlight
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import apart, free_runs, made_ready
from cpfls_cli.playback.replay import Played, Replay, drawn_runs, fading, replay
from cpfls_cli.playback.windows import RunErrors
from cpfls_cli.result import About, about, result
from cpfls_cli.rounding import largest
from cpfls_cli.weak_form.windows import Windows, common_windows

_EVERY = 5  # Samples between starts of free runs, which are alike.


@dataclass(frozen=True)
class PlayedPair(Played):
    """A flight, a model with effects, and the model as given, which takes the log as it is."""

    logged: PlaybackFlight  # With the faults of the sensors, so that a fault shows.

    def runs(self, prediction: str, starts: IntArray, horizon: int) -> RunErrors:
        """Predict from samples of the flight."""
        if prediction == STATED:
            return free_runs(self.stated, self.logged, starts, horizon)
        return super().runs(prediction, starts, horizon)


def rates_fade(training: Sequence[Signals], horizon_s: float) -> float:
    """Fit the time constant with which body rates of training flights fade, s."""
    flights = [LoggedFlight.of(each).playback for each in training]
    return fading(flights, max(1, round(horizon_s / flights[0].motion.period)))


def played_pairs(
    flights: Sequence[Signals], model: VehicleModel, given: VehicleModel, fading_s: float | None = None
) -> list[PlayedPair]:
    """Make flights, a model with effects and the model as given ready for playback.

    `fading_s`: how fast rates of the flights fade that the effects were found in (`rates_fade`); None where none train.
    Raises InputError if a flight lacks a signal that an effect needs.
    """
    pairs = []
    for flight in map(LoggedFlight.of, flights):
        along, player = made_ready(model, flight)
        logged, stated = (along, player) if given is model else made_ready(given, flight)
        pairs.append(PlayedPair(along, player, stated, logged, fading_s=fading_s))
    return pairs


class LeftOut(NamedTuple):
    """What one effect of a model does along flights."""

    name: Annotated[str, About("identifier, see `cpfls effects`")]
    wrench: Annotated[Array, About("root mean square of torque (x y z, N m) and force (x y z, N)", ("6",), "SI", BODY)]
    ends: Annotated[
        Array,
        About(
            "how far off a free run of gap.horizon_s ends without it: position (m), velocity (m/s), attitude (rad), "
            "body rate (rad/s); NaN for what a flight does not show",
            ("4",),
            "SI",
            gaps=True,
        ),
    ]


def left_out(model: VehicleModel, names: Sequence[str], flights: Sequence[Signals], horizon_s: float) -> list[LeftOut]:
    """Play a model back along flights, as it is and without single effects.

    `names`: of effects.
    `horizon_s`, s: at which the ends of free runs are compared; errors still add up there.
    Raises InputError if a flight lacks a signal that an effect needs.
    """
    found = []
    for name in names:
        others = tuple(effect for effect in model.effects if effect.name != name)
        squares, ends, runs, samples = np.zeros(6), np.zeros(4), 0, 0
        for pair in played_pairs(flights, model, replace(model, effects=others)):
            difference = pair.model.wrench(pair.flight) - pair.stated.wrench(pair.logged)
            squares, samples = squares + (difference**2).sum(axis=0), samples + len(difference)
            horizon = min(max(1, round(horizon_s / pair.flight.motion.period)), len(pair.flight) - 1)
            starts = pair.flight.starts(horizon, _EVERY)
            both = [pair.runs(prediction, starts, horizon) for prediction in (MODEL, STATED)]
            off = np.where(pair.flight.shown, apart(*both), np.nan)
            ends, runs = ends + len(starts) * off, runs + len(starts)
        found.append(LeftOut(name, np.sqrt(squares / samples), ends / runs))
    return found


def errors_by_horizon(pairs: Sequence[PlayedPair], horizon_s: float, most: float = np.inf) -> Replay:
    """Play back from every fifth sample of the flights, or so few that about `most` samples are played back.

    `pairs`: of one rate; `horizon_s`, s: at most; one sample at least.
    """
    asked = max(1, round(horizon_s / pairs[0].flight.motion.period))
    longest = min(asked, *(len(pair.flight) - 1 - _EVERY for pair in pairs))
    samples = longest * sum(len(pair.flight) for pair in pairs)
    return replay(pairs, longest, max(_EVERY, ceil(samples / most)))


@result
class FreeRuns:
    """Free runs over the stretch of held-out flights in which the model as given is farthest off."""

    flight: str = about("held-out flight of the stretch whose free runs went astray most")
    axis: int = about("body axis on which they did: 0, 1, 2 for x, y, z")
    time: Array = about("on the clock of the flight", "run_sample", unit="s")
    restart: Array = about("times at which each free run starts from the measured rate", "run", unit="s")
    measured: Array = about("body rates", "run_sample", "axis", unit="rad/s", frame=BODY)
    before: Array = about("simulated, model as given", "run_sample", "axis", unit="rad/s", frame=BODY)
    after: Array = about("simulated, with the effects", "run_sample", "axis", unit="rad/s", frame=BODY)


def worst_stretch(
    pairs: Sequence[PlayedPair], flights: Sequence[Signals], horizon_s: float, shown_s: float
) -> FreeRuns:
    """Find where free runs of the model as given, one after another, are farthest off.

    `horizon_s`, `shown_s`, s: length of a run, and of all that are shown.
    Raises InputError if a flight is shorter than one run.
    """
    samples = max(2, round(horizon_s / pairs[0].flight.motion.period))
    most = max(1, round(shown_s / horizon_s))
    found = [_worst(pair, flight.time, samples, most) for pair, flight in zip(pairs, flights, strict=True)]
    return largest(found, lambda stretch: float(((stretch.before - stretch.measured) ** 2).mean()))


def _worst(pair: PlayedPair, time: Array, samples: int, most: int) -> FreeRuns:
    starts = pair.flight.starts(samples - 1, samples)
    before = drawn_runs(Played(pair.logged, pair.stated, pair.stated), starts, samples - 1)["model"]
    after = drawn_runs(pair, starts, samples - 1)
    square = ((before - after["measured"]) ** 2).sum(axis=1)
    joined = min(len(starts), most)
    begin = int(np.convolve(square.sum(axis=1), np.ones(joined), mode="valid").argmax())
    runs = slice(begin, begin + joined)
    first, flown = int(starts[begin]), joined * samples
    time = time[first : first + flown]
    return FreeRuns(
        flight=pair.flight.name,
        axis=int(square[runs].sum(axis=0).argmax()),
        time=time,
        restart=time[::samples],
        measured=after["measured"][runs].reshape(-1, 3),
        before=before[runs].reshape(-1, 3),
        after=after["model"][runs].reshape(-1, 3),
    )


@result
class WorstWindows:
    """Measured and simulated torque or force over the stretch of the largest gap."""

    flight: str = about("held-out flight of the stretch in which model and flight disagreed most")
    channel: str = about("channel of the stretch")
    time: Array = about("on the clock of the flight", "moment", unit="s")
    measured: Array = about("torque or force that the measured motion takes", "moment", unit="SI", frame=BODY)
    before: Array = about("simulated, model as given", "moment", unit="SI", frame=BODY)
    after: Array = about("simulated, with the effects", "moment", unit="SI", frame=BODY)


@result
class ResidualChange:
    """Gap of each held-out window, before and after."""

    time: Array = about("middle of each held-out window, on the clock of its flight", "window", unit="s")
    flight: IntArray = about("index of its flight", "window")
    before: Array = about("gap of the model as given, N m and N", "window", "6", unit="SI", frame=BODY, gaps=True)
    parameters: Array = about("gap with only its numbers refitted", "window", "6", unit="SI", frame=BODY, gaps=True)
    after: Array = about("gap with the effects", "window", "6", unit="SI", frame=BODY, gaps=True)


@result
class EndError:
    """How far off a signal is at the longest horizon."""

    SHOWN: ClassVar = ("worse",)

    before: float = about("mean error of the model as given")
    after: float = about("mean error of the model with the effects")
    rival: str = about("what knows no model and is best over all horizons: nothing-moves, rate-stays or rate-fades")
    without_model: float = about("its mean error")

    @property
    def worse(self) -> bool:
        """Whether the model with the effects is no better than none."""
        return self.after >= self.without_model


@result
class PlaybackChange(AlongFlights):
    """Held-out flights played back with the model as given and with the effects."""

    SHOWN: ClassVar = ("at_end",)

    @classmethod
    def of_pairs(cls, flights: Sequence[PlayedPair], replayed: Replay) -> Self:
        """Sum up a replay without its windows."""
        names = {MODEL: AFTER, STATED: BEFORE}
        return cls(**vars(replayed.along(flights, {name: names.get(name, name) for name in replayed.models})))

    @property
    def at_end(self) -> dict[str, EndError]:
        """Errors at the longest horizon by signal, of those that move."""
        ends = {}
        for signal in (name for name in self.signals if self.of(NOTHING_MOVES, name).sum > 0):
            rival = self.rival(signal)
            before, after, other = (float(self.of(each, signal).mae[-1]) for each in (BEFORE, AFTER, rival))
            ends[signal] = EndError(before=before, after=after, rival=rival, without_model=other)
        return ends


@dataclass(frozen=True)
class BeforeAfter:
    """Errors of the model as given and of the model with effects on held-out flights."""

    playback: PlaybackChange
    residual: ResidualChange
    stretches: tuple[GapStretch, ...]  # Of the model as given, largest gap first.
    picture: WorstWindows
    run: FreeRuns
    repeatability_before: Repeatability | None  # Of training flights too; None where no flight repeats another.
    repeatability_after: Repeatability | None  # The same.


def before_after(
    training: Sequence[Signals],
    held: Sequence[Signals],
    unseen: HeldOut,
    model: ExtendedModel,
    settings: GapSettings,
    base: VehicleModel | None = None,
) -> BeforeAfter:
    """Compare a model with effects with the model as given on held-out flights.

    `training`, `held`: flights that the effects were found in, and that they are judged on.
    `unseen`: their residuals.
    `base`: a vehicle with effects of its own that the model comes on top of; of that as given, the base of `model` is
    part.
    """
    windows = common_windows([*training, *held], settings)
    centres = [windows.centres(flight.time) for flight in held]
    index = np.repeat(np.arange(len(held)), [len(each) for each in centres])
    stated = held[0].vehicle
    with_effects, given = (whole_vehicle(each, stated) for each in (model, plain(model.base)))
    if base is not None:
        with_effects, given = on_top_of(base, with_effects), on_top_of(base, given)
    played = played_pairs(held, with_effects, given, rates_fade(training, settings.horizon_s))
    in_floors = unseen.before * unseen.known / unseen.floor
    found = stretches(in_floors, np.concatenate(centres), index, level=0.0)
    left = {"before": unseen.before, "parameters": unseen.parameters, "after": unseen.after}
    known = {name: np.where(unseen.known, rows, np.nan) for name, rows in left.items()}
    return BeforeAfter(
        PlaybackChange.of_pairs(played, errors_by_horizon(played, settings.horizon_s)),
        ResidualChange(time=np.concatenate(centres), flight=index, **known),
        found,
        _picture(held, found[0], windows, model, settings),
        worst_stretch(played, held, settings.horizon_s, settings.block_s),
        *_again(training, held, model, settings),
    )


def _again(
    training: Sequence[Signals], held: Sequence[Signals], model: ExtendedModel, settings: GapSettings
) -> tuple[Repeatability | None, Repeatability | None]:
    """Split the gap of the model as given, of signals as logged, and of the model with effects where paths repeat."""
    flights = [*training, *held]
    repeated = RepeatedRuns.of(flights, len(held))
    if repeated is None or model.audit is None:
        return None, None
    prepared = Preparation(common_windows(flights, settings), model.base, settings, model.audit)
    given, known = plain(model.base), system(prepared.repaired(flights), model.chosen)
    before = repeated.split(given.system(prepared.logged(flights)), given.linear)
    return before, repeated.split(known, model.linear)


def _picture(
    held: Sequence[Signals], stretch: GapStretch, windows: Windows, model: ExtendedModel, settings: GapSettings
) -> WorstWindows:
    channel = CHANNELS.index(stretch.channel)
    close = dense(windows)
    flight = held[stretch.flight]
    raw, repaired = (
        weak_flight(signals, close, model.base, settings.force, settings.axes)
        for signals in (flight, model.repaired(flight))
    )
    time = close.centres(flight.time)
    middle, half = 0.5 * (stretch.start_s + stretch.end_s), 0.5 * max(settings.block_s, stretch.end_s - stretch.start_s)
    shown = np.abs(time - middle) <= half
    measured = repaired.motion[shown, channel]
    logged = close.average(raw.signals.wrench)[shown, channel]
    after = measured - model.residual([repaired])[shown, channel]
    return WorstWindows(
        flight=flight.name, channel=stretch.channel, time=time[shown], measured=measured, before=logged, after=after
    )
