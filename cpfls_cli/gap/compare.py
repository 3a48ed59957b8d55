"""Comparison of a model with flights: the gap by axis, time and state, and effects that were not excited."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.consistency.audit import Audit, audit
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.balance.balance_system import System, known_size
from cpfls_cli.gap.balance.weak_flight import CHANNELS, weak_flight
from cpfls_cli.gap.before_after import PlayedPair, errors_by_horizon, played_pairs
from cpfls_cli.gap.naming.leftover import not_excited
from cpfls_cli.gap.naming.ranking import best_floor, block_index
from cpfls_cli.gap.naming.results import NotExcited
from cpfls_cli.gap.residual.dependence import Dependence, joined_states, rank_dependence, state_signals
from cpfls_cli.gap.residual.repeated import ComesAgain, RepeatedRuns
from cpfls_cli.gap.residual.views import GapStretch, HeatMap, heat_map, stretches
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.gap.whole_vehicle import with_effects
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.replay import Replay
from cpfls_cli.weak_form.windows import Recording, common_windows


@dataclass(frozen=True)
class WorstChannel:
    """The channel with the largest gap, over the two signals that explain most of it.

    Attributes
    ----------
    heat_map : HeatMap
        Of the gap in N m or N.
    """

    channel: str
    signals: tuple[str, str]
    heat_map: HeatMap


@dataclass(frozen=True)
class Disagreement:
    """The gap between a model and flights.

    Attributes
    ----------
    rms, floor, activity : array, shape (6,), N m and N
        Of the gap, of noise, and of what moves the vehicle; NaN where unknown.
    residual : array, shape (window, 6), N m and N
        NaN where unknown.
    centres : array, shape (window,), s
    flight_index : array of int, shape (window,)
    states : mapping of str to array, shape (window,)
    worst : WorstChannel or None
        None where no two signals tell anything.
    played : list of PlayedPair
        The model alone.
    again : ComesAgain or None
        None where no flight repeats another.
    """

    audit: Audit
    rms: Array
    floor: Array
    activity: Array
    residual: Array
    centres: Array
    flight_index: IntArray
    states: dict[str, Array]
    stretches: tuple[GapStretch, ...]
    dependence: tuple[Dependence, ...]
    worst: WorstChannel | None
    not_excited: tuple[NotExcited, ...]
    played: list[PlayedPair]
    playback: Replay
    again: ComesAgain | None

    @property
    def floors(self) -> Array:
        """Gap of each channel in floors, shape (6,); NaN where unknown."""
        return np.asarray(self.rms / self.floor)


def compare(
    recordings: Sequence[Recording],
    model: VehicleModel,
    settings: GapSettings,
    rng: np.random.Generator,
    progress: Callable[[float, str], None] = lambda _done, _note: None,
    *,
    whole: Sequence[Recording] = (),
) -> Disagreement:
    """Compare a model with flights.

    Faults of the sensors are repaired where they are sure; the gap is that of the model with its own numbers.

    Parameters
    ----------
    model : VehicleModel
        Its rigid body is what `recordings` state as their vehicle, see `of_vehicle`.
    rng : numpy.random.Generator
        Of the shifts that say what chance explains.
    progress : callable
        Takes the share of the work that is done and a note.
    whole : sequence of Recording
        Flights that rotors and attitude are held against, where there are more than these, or longer ones.

    Raises
    ------
    InputError
        If the flights are too short or of different rates, or lack a signal that the model needs.
    """
    windows = common_windows(recordings, settings)
    progress(0.0, "sensor audit")
    extended = with_effects(model)
    own = [recording.signals for recording in recordings]
    audited = model.repairs or audit(own, windows, [recording.signals for recording in whole])
    flights = [
        weak_flight(r.name, audited.repaired(r.signals), windows, model.fuzzy, settings.force, settings.axes)
        for r in recordings
    ]
    progress(0.3, "noise floor")
    hypothesis = extended.system(flights)
    floor = best_floor(hypothesis)
    residual = hypothesis.left(extended.linear)
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
    played = played_pairs(recordings, repairing, repairing)
    repeated = RepeatedRuns.of(recordings)
    return Disagreement(
        audited,
        rms,
        np.where(known.any(axis=0), floor, np.nan),
        _activity(hypothesis, known),
        np.where(known, residual, np.nan),
        centres,
        index,
        states,
        stretches(residual / floor, centres, index),
        dependence,
        _worst(residual, rms / floor, dependence, states),
        not_excited(hypothesis, effects, floor),
        played,
        errors_by_horizon(played, settings.horizon_s),
        None if repeated is None else repeated.split(hypothesis, extended.linear),
    )


def _activity(hypothesis: System, known: BoolArray) -> Array:
    """Compute the root mean square of inertial or rotor wrench, whichever is larger."""
    taken = hypothesis.by_flight(lambda flight, _: flight.averaged(flight.inertial))
    given = hypothesis.by_flight(lambda flight, signals: flight.windows.average(signals.wrench))
    size = np.maximum(known_size(taken, known), known_size(given, known))
    # Sideways, too, a vehicle is moved by its thrust.
    return np.concatenate([size[:3], np.full(3, np.sqrt((size[3:] ** 2).sum()))])


def _worst(
    residual: Array, floors: Array, dependence: Sequence[Dependence], states: dict[str, Array]
) -> WorstChannel | None:
    channel = int(np.nanargmax(floors))
    names = [entry.signal for entry in dependence if entry.channel == CHANNELS[channel]][:2]
    if len(names) < 2:
        return None
    first, second = names
    mean = heat_map(residual[:, channel], states[first], states[second])
    return WorstChannel(CHANNELS[channel], (first, second), mean)
