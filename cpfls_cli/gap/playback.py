"""A model with effects played back along flights: what is a polynomial is simulated, the rest acts along the flight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.dynamics.equations_of_motion import InertiaModel
from cpfls_cli.dynamics.rigid_body import inertia_tensor
from cpfls_cli.effects.effect import Columns
from cpfls_cli.effects.polynomial import STATE_TERMS, Probe, polynomial
from cpfls_cli.effects.registry import VEHICLE_NUMBERS
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.gap.balance.balance_system import is_free
from cpfls_cli.gap.balance.weak_flight import Candidate, actuated, columns_of
from cpfls_cli.gap.extended import Corrected, ExtendedModel, FittedEffect, instantaneous
from cpfls_cli.playback.flight import PlaybackFlight, playback_flight
from cpfls_cli.playback.model import ModelEffect, VehicleModel, body_of, lever_weights, rotor_weights
from cpfls_cli.playback.player import Player, Runs, apart, free_runs, rotor_terms_along, stated_along
from cpfls_cli.playback.replay import MODEL, STATED, Played, Replay, drawn_runs, replay
from cpfls_cli.playback.rotors import Hold, RotorResponse
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import Recording

# Samples between starts of free runs, which are alike.
_EVERY = 5
# Shown: two free runs of a second, which is when they part; an effect left out is measured where errors still add up.
_STRETCH_S, _RUN_S, _LEFT_S = 2.0, 1.0, 0.5
_ROUNDING = 1e-9
_COUPLED = ("qr", "pr", "pq")
_PRODUCTS = tuple(STATE_TERMS.index(name) for name in _COUPLED)


@dataclass(frozen=True)
class _Parts:
    """Effects by the way in which they are played back.

    Attributes
    ----------
    table : array, shape (6, terms, 1 + 4 rotors)
        Of the rotors, the effects that are polynomials, the vehicle's own numbers, and the levers of all these forces.
    inertia : array, shape (3, 3), kg m^2
        Of the effects that are nothing else.
    along : list of FittedEffect
        That are evaluated along the measured motion.
    centre : array, shape (3,), m
        Of mass, from where all forces have their levers from.
    """

    table: Array
    inertia: Array
    along: list[FittedEffect]
    centre: Array


def extended_player(
    model: ExtendedModel, name: str, parts: Sequence[Signals], hold: Hold
) -> tuple[PlaybackFlight, Player]:
    """Make a model with effects ready for a flight.

    Lag and delay act on the rotors as logged; effects that are polynomials of motion and rotor speeds are simulated
    with the state, in the wind; all others, such as a payload, are evaluated along the measured motion.

    Parameters
    ----------
    name : str
        Of the flight.
    parts : sequence of Signals
        Stretches of the flight, with the faults of sensors taken out.
    hold : {"linear", "previous"}
        What a logged speed is between samples; what a lag leaves of it is a straight line.

    Raises
    ------
    InputError
        If the flight lacks a signal that an effect needs.
    """
    for candidate, part in product(model.chosen, parts):
        _require(candidate, part, name)
    moved = [actuated(part, model.chosen) for part in parts]
    late = any(now is not part for now, part in zip(moved, parts, strict=True))
    flight = playback_flight(name, moved, "linear" if late else hold)
    vehicle, response = moved[0].vehicle, RotorResponse()
    by_kind = _sorted(model, vehicle, speeds=flight.wrench is None)
    along = _along(by_kind.along, moved)
    stated = stated_along(flight, response)
    if stated is not None:
        stated[:, 5] *= 1.0 + _number(model, "thrust_scale")
    tensor, fuzzy = _inertia(model, vehicle, by_kind.inertia)
    player = Player(
        table=by_kind.table,
        rotor=rotor_terms_along(flight, response),
        body=body_of(vehicle, tensor),
        along=_sum(along, stated, by_kind.centre),
        fuzzy=fuzzy,
        wind=moved[0].steady_wind,
    )
    return flight, player


def _require(candidate: Candidate, signals: Signals, name: str) -> None:
    """Refuse a flight that lacks what an effect needs; measured speeds do not lag, so a lag may lack its command."""
    actuator = candidate.effect.kind == "actuator"
    missing = [each for each in candidate.effect.missing(signals) if not (actuator and each == "command")]
    if missing:
        lacking = ", ".join(each.replace("_", " ") for each in missing)
        raise InputError(f"{name}: lacks {lacking}, which the model's effect {candidate.effect.name} needs")


def _coefficients(fitted: FittedEffect) -> Array:
    return fitted.linear if is_free(fitted.candidate) else np.ones(1)


def _number(model: ExtendedModel, name: str) -> float:
    names = [coefficient.name for coefficient in VEHICLE_NUMBERS.coefficients]
    return float(model.parameters[names.index(name)])


def _sorted(model: ExtendedModel, vehicle: VehicleSettings, *, speeds: bool) -> _Parts:
    table = VehicleModel(vehicle=vehicle).weights.copy()
    table[5, 0] += _number(model, "thrust_scale") * rotor_weights(vehicle, 0.0, RotorResponse())[5]
    moments = np.array(vehicle.inertia_kg_m2[:3])
    for axis, term in enumerate(_PRODUCTS):
        # What multiplies the coupling of two rates is the mean of their moments; see the catalogue.
        mean = 0.5 * (moments.sum() - moments[axis])
        table[axis, term, 0] -= _number(model, f"coupling_{'xyz'[axis]}") * mean
    probe, inertia, along, centre = Probe.of(vehicle), np.zeros((3, 3)), [], np.zeros(3)
    for fitted in (each.in_still_air for each in model.effects):
        effect, shape = fitted.candidate
        if effect.kind != "wrench":
            continue
        if ModelEffect(effect.name, shape, fitted.linear).is_lever:
            centre = fitted.linear
            continue
        if effect.carried is not None:
            # It has a state of its own: the random motions of the probe, a second apart, may make it diverge.
            along.append(fitted)
            continue
        added = _as_inertia(fitted, probe)
        weights = polynomial(effect, probe, shape)
        # Without rotor speeds the terms of the rotors are 0, and the thrust is what the log states.
        if weights is not None and (speeds or not weights[..., 1:].any()):
            width = weights.shape[3]
            table[:, : len(STATE_TERMS), :width] += np.tensordot(_coefficients(fitted), weights, axes=1)
        elif added is not None:
            inertia += added
        else:
            along.append(fitted)
    return _Parts(table + lever_weights(centre, table), inertia, along, centre)


def _as_inertia(fitted: FittedEffect, probe: Probe) -> Array | None:
    """Read the inertia that an effect is, ``M = -(d/dt (dI omega) + omega x dI omega)``; None for another effect."""
    if fitted.candidate.effect.missing(probe.signals):
        return None
    columns, coefficients = columns_of(fitted.candidate, probe.signals), _coefficients(fitted)
    if columns.momentum is None:
        return None
    direct, momentum = columns.direct @ coefficients, columns.momentum @ coefficients
    rate = probe.signals.body_rate
    added = -np.asarray(np.linalg.lstsq(rate, momentum[:, :3], rcond=None)[0])
    wanted = Columns(
        np.hstack([-np.cross(rate, rate @ added), np.zeros_like(rate)]),
        np.hstack([-rate @ added, np.zeros_like(rate)]),
    )
    size = max(np.abs(momentum).max(initial=0.0), np.abs(direct).max(initial=0.0))
    assert wanted.momentum is not None, "just made"
    off = max(np.abs(wanted.direct - direct).max(), np.abs(wanted.momentum - momentum).max())
    return added if off <= _ROUNDING * size else None


def _inertia(model: ExtendedModel, vehicle: VehicleSettings, added: Array) -> tuple[Array, InertiaModel | None]:
    """Give the tensor of the rigid body, and the model that stands in its place."""
    correction = np.diag(model.parameters[:3] * np.array(vehicle.inertia_kg_m2[:3])) + added
    tensor = inertia_tensor(vehicle) + correction
    return tensor, None if model.base is None else Corrected(model.base, correction)


def _along(effects: Sequence[FittedEffect], parts: Sequence[Signals]) -> Array | None:
    """Evaluate effects along the measured motion, over each step, shape (time, 6)."""
    if not effects:
        return None
    return np.concatenate([_by_step(np.sum([_wrench(fitted, part) for fitted in effects], axis=0)) for part in parts])


def _wrench(fitted: FittedEffect, signals: Signals) -> Array:
    return instantaneous(columns_of(fitted.candidate, signals), _coefficients(fitted), signals.time)


def _by_step(values: Array) -> Array:
    """Take the mean over each step, shape (time, 6); the last one has no end."""
    return np.asarray(0.5 * (values + np.concatenate([values[1:], values[-1:]])))


def _sum(first: Array | None, second: Array | None, centre: Array) -> Array | None:
    known = [values for values in (first, second) if values is not None]
    if not known:
        return None
    total = np.asarray(sum(known))
    return np.asarray(total + lever_weights(centre, total.T).T)


@dataclass(frozen=True)
class PlayedPair(Played):
    """A flight, a model with effects, and the model as given, which takes the log as it is.

    Attributes
    ----------
    logged : PlaybackFlight
        With the faults of the sensors, so that a fault shows.
    """

    logged: PlaybackFlight

    def runs(self, prediction: str, starts: IntArray, horizon: int) -> Runs:
        """Predict from samples of the flight."""
        if prediction == STATED:
            return free_runs(self.stated, self.logged, starts, horizon)
        return super().runs(prediction, starts, horizon)

    @property
    def as_given(self) -> Played:
        """The flight as logged and the model as given."""
        return Played(self.logged, self.stated, self.stated)


def played_pairs(recordings: Sequence[Recording], model: ExtendedModel, given: ExtendedModel) -> list[PlayedPair]:
    """Make flights, a model with effects and the model as given ready for playback.

    Raises
    ------
    InputError
        If a flight lacks a signal that an effect needs.
    """
    return [_pair(recording.name, recording.signals, model, given) for recording in recordings]


def _pair(name: str, signals: Signals, model: ExtendedModel, given: ExtendedModel) -> PlayedPair:
    hold: Hold = "previous" if signals.commanded else "linear"
    flight, player = extended_player(model, name, [model.repaired(signals)], hold)
    if given is model:
        return PlayedPair(flight, player, player, flight)
    logged, stated = extended_player(given, name, [given.repaired(signals)], hold)
    return PlayedPair(flight, player, stated, logged)


class LeftOut(NamedTuple):
    """What one effect of a model does along flights.

    Attributes
    ----------
    name : str
    wrench : array, shape (6,), N m and N
        Root mean square.
    ends : array, shape (4,)
        How far half a second of playback ends off without it: means of the norms of position, velocity, attitude and
        rate, SI; NaN for what a flight does not show.
    """

    name: str
    wrench: Array
    ends: Array


def left_out(model: ExtendedModel, names: Sequence[str], recordings: Sequence[Recording]) -> list[LeftOut]:
    """Play a model back along flights, as it is and without single effects.

    Parameters
    ----------
    names : sequence of str
        Of effects.

    Raises
    ------
    InputError
        If a flight lacks a signal that an effect needs.
    """
    return [_left_out(model, name, recordings) for name in names]


def _left_out(model: ExtendedModel, name: str, recordings: Sequence[Recording]) -> LeftOut:
    others = tuple(fitted for fitted in model.effects if fitted.candidate.effect.name != name)
    squares, ends, runs, samples = np.zeros(6), np.zeros(4), 0, 0
    for pair in played_pairs(recordings, model, replace(model, effects=others)):
        difference = pair.model.wrench(pair.flight) - pair.stated.wrench(pair.logged)
        squares, samples = squares + (difference**2).sum(axis=0), samples + len(difference)
        horizon = min(max(1, round(_LEFT_S / pair.flight.motion.period)), len(pair.flight) - 1)
        starts = pair.flight.starts(horizon, _EVERY)
        both = [pair.runs(prediction, starts, horizon) for prediction in (MODEL, STATED)]
        off = np.where(pair.flight.shown, apart(*both), np.nan)
        ends, runs = ends + len(starts) * off, runs + len(starts)
    return LeftOut(name, np.sqrt(squares / samples), ends / runs)


def errors_by_horizon(pairs: Sequence[PlayedPair], horizon_s: float) -> Replay:
    """Play back from every fifth sample of the flights.

    Parameters
    ----------
    pairs : sequence of PlayedPair
        Of one rate.
    horizon_s : float, s
        At most; one sample at least.
    """
    asked = max(1, round(horizon_s / pairs[0].flight.motion.period))
    longest = min(asked, *(len(pair.flight) - 1 - _EVERY for pair in pairs))
    return replay(pairs, longest, _EVERY)


@dataclass(frozen=True)
class WorstStretch:
    """Measured and simulated body rates over the stretch of flights in which the model as given is farthest off.

    Attributes
    ----------
    flight : int
        Number of the flight.
    first : int
        Sample of the flight at which it begins.
    measured, before, after : array, shape (run, sample, 3), rad/s, body frame
        Each run starts from the measured rates.
    axis : int
        Body axis on which the model as given is worst.
    """

    flight: int
    first: int
    measured: Array
    before: Array
    after: Array
    axis: int


def worst_stretch(pairs: Sequence[PlayedPair]) -> WorstStretch:
    """Find where free runs of the model as given, one second each and one after another, are farthest off.

    Raises
    ------
    InputError
        If a flight is shorter than one run.
    """
    samples = max(2, round(_RUN_S / pairs[0].flight.motion.period))
    found = [_worst(index, pair, samples) for index, pair in enumerate(pairs)]
    return max(found, key=lambda stretch: float(((stretch.before - stretch.measured) ** 2).mean()))


def _worst(index: int, pair: PlayedPair, samples: int) -> WorstStretch:
    starts = pair.flight.starts(samples - 1, samples)
    before = drawn_runs(pair.as_given, starts, samples - 1).model
    after = drawn_runs(pair, starts, samples - 1)
    square = ((before - after.measured) ** 2).sum(axis=1)
    joined = min(len(starts), round(_STRETCH_S / _RUN_S))
    begin = int(np.convolve(square.sum(axis=1), np.ones(joined), mode="valid").argmax())
    runs = slice(begin, begin + joined)
    axis = int(square[runs].sum(axis=0).argmax())
    return WorstStretch(index, int(starts[begin]), after.measured[runs], before[runs], after.model[runs], axis)
