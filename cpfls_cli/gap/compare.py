"""Comparison of a model with flights: the gap by axis, time and state, and effects that were not excited."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.consistency.check import Audit, audit
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.balance_system import System, known_size
from cpfls_cli.gap.balance.weak_flight import CHANNELS, weak_flight
from cpfls_cli.gap.before_after import errors_by_horizon, played_pairs
from cpfls_cli.gap.naming.open_questions import not_excited
from cpfls_cli.gap.naming.ranking import best_floor, block_index
from cpfls_cli.gap.naming.results import BODY, GapSize, NotExcited
from cpfls_cli.gap.residual.dependence import (
    Dependence,
    GapStretch,
    HeatMap,
    heat_map,
    joined_states,
    rank_dependence,
    state_signals,
    stretches,
)
from cpfls_cli.gap.residual.repeated import Repeatability, RepeatedRuns
from cpfls_cli.gap.settings import CLEAR, GapSettings
from cpfls_cli.gap.whole_vehicle import with_effects
from cpfls_cli.playback.errors import STATED, AlongFlights
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.result import about, part, result
from cpfls_cli.weak_form.windows import common_windows


@result
class ResidualWindows:
    """Gap of each window."""

    time: Array = about("middle of each window, on the clock of its flight", "window", unit="s")
    flight: IntArray = about("index of its flight", "window")
    value: Array = about(
        "residual of inertial and rotor wrench, N m and N", "window", "6", unit="SI", frame=BODY, gaps=True
    )


@result
class ChannelGaps:
    """Gap of each channel: torque about the body axes x, y, z, then force along them; NaN where unknown."""

    rms: Array = about("root mean square over windows, N m and N", "6", unit="SI", frame=BODY, gaps=True)
    floor: Array = about("noise floor of the same windows, N m and N", "6", unit="SI", frame=BODY, gaps=True)
    floors: Array = about("gap over floor", "6", frame=BODY, gaps=True)
    share: Array = about("gap over the torque or force that moves the vehicle", "6", frame=BODY, gaps=True)

    @property
    def known(self) -> list[int]:
        """Indices of the channels whose gap is known."""
        return np.flatnonzero(np.isfinite(self.floors)).tolist()

    @property
    def above_noise(self) -> list[int]:
        """Indices of the channels with a gap above noise."""
        return np.flatnonzero(self.floors > CLEAR).tolist()

    @property
    def largest(self) -> int | None:
        """Index of the channel with the largest gap in floors; None where no gap is known."""
        return int(np.nanargmax(self.floors)) if self.known else None


@result
class Comparison:
    """The gap between a model and flights."""

    sizes: ChannelGaps = part(brief=False)
    repeatability: Repeatability | None = part(None)
    worst: tuple[GapStretch, ...] = part(brief=False)
    dependence: tuple[Dependence, ...] = part()
    heat_map: HeatMap | None = part(None)
    not_excited: tuple[NotExcited, ...] = part()
    audit: Audit = part()
    residual: ResidualWindows = part(brief=False)
    playback: AlongFlights | None = part(None)

    @property
    def floors(self) -> Array:
        """Gap of each channel in floors, shape (6,); NaN where unknown."""
        return self.sizes.floors

    @property
    def gap(self) -> dict[str, Any]:
        """Gap of each channel for machines: lists over x, y, z."""
        return GapSize(self.sizes.rms, self.floors).as_summary | {"share": self.sizes.share}

    def followed(self, channel: str) -> list[tuple[str, float]]:
        """List the signals that the gap of a channel surely follows, with their shares, best first."""
        return [(each.signal, each.r2) for each in self.dependence if each.channel == channel and each.sure]

    @property
    def followed_channels(self) -> list[str]:
        """Channels above noise of which it is known what they follow: those below follow chance."""
        judged = {each.channel for each in self.dependence}
        return [CHANNELS[index] for index in self.sizes.above_noise if CHANNELS[index] in judged]


def compare(
    given: Sequence[Signals],
    model: VehicleModel,
    settings: GapSettings,
    rng: np.random.Generator,
    progress: Callable[[float, str], None] = lambda _done, _note: None,
    *,
    whole: Sequence[Signals] = (),
) -> Comparison:
    """Compare a model with flights.

    Faults of the sensors are repaired where they are sure; the gap is that of the model with its own numbers.

    `model`: its rigid body is what `given` state as their vehicle, see `of_vehicle`.
    `rng`: of the shifts that say what chance explains.
    `progress`: takes the share of the work that is done and a note.
    `whole`: flights that rotors and attitude are held against, where there are more than these, or longer ones.
    Raises InputError if the flights are too short or of different rates, or lack a signal that the model needs.
    """
    windows = common_windows(given, settings)
    progress(0.0, "sensor audit")
    extended = with_effects(model)
    audited = model.repairs or audit(given, windows, whole)
    flights = [
        weak_flight(audited.repaired(each), windows, model.fuzzy, settings.force, settings.axes) for each in given
    ]
    progress(0.3, "noise floor")
    hypothesis = extended.system(flights)
    floor = best_floor(hypothesis)
    residual = hypothesis.residual_at(extended.linear)
    progress(0.5, "what the gap depends on")
    states = joined_states([state_signals(f, s) for f, s in zip(flights, hypothesis.signals, strict=True)])
    block = block_index(hypothesis, settings)
    centres = np.concatenate([windows.centres(flight.signals.time) for flight in flights])
    index = hypothesis.flight_index
    dependence = rank_dependence(residual / floor, index, block, states, settings.shifts, rng)
    known = hypothesis.known
    rms = known_size(residual, known)
    effects = [effect for name, effect in CATALOGUE.items() if name not in settings.ignore]
    repairing = replace(model, repairs=audited)
    played = played_pairs(given, repairing, repairing)
    repeated = RepeatedRuns.of(given)
    replayed = errors_by_horizon(played, settings.horizon_s)
    return Comparison(
        sizes=ChannelGaps(
            rms=rms,
            floor=np.where(known.any(axis=0), floor, np.nan),
            floors=np.where(known.any(axis=0), rms / floor, np.nan),
            share=rms / _activity(hypothesis, known),
        ),
        repeatability=None if repeated is None else repeated.split(hypothesis, extended.linear),
        worst=stretches(residual / floor, centres, index),
        dependence=dependence,
        heat_map=_worst(residual, rms / floor, dependence, states),
        not_excited=not_excited(hypothesis, effects, floor),
        audit=audited,
        residual=ResidualWindows(time=centres, flight=index, value=np.where(known, residual, np.nan)),
        playback=replayed.along(played, {name: name for name in replayed.models if name != STATED}),
    )


def _activity(hypothesis: System, known: BoolArray) -> Array:
    """Compute the root mean square of inertial or rotor wrench, whichever is larger."""
    taken = hypothesis.by_flight(lambda flight, _: flight.motion)
    given = hypothesis.by_flight(lambda flight, signals: flight.windows.average(signals.wrench))
    size = np.maximum(known_size(taken, known), known_size(given, known))
    # Sideways, too, a vehicle is moved by its thrust.
    return np.concatenate([size[:3], np.full(3, np.sqrt((size[3:] ** 2).sum()))])


def _worst(
    residual: Array, floors: Array, dependence: Sequence[Dependence], states: dict[str, Array]
) -> HeatMap | None:
    channel = int(np.nanargmax(floors))
    names = [entry.signal for entry in dependence if entry.channel == CHANNELS[channel]][:2]
    if len(names) < 2:
        return None
    return heat_map(CHANNELS[channel], residual[:, channel], (names[0], names[1]), states)
