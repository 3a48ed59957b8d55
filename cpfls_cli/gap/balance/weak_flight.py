"""A flight as rows of the torque and force balance, six for each window, with inertia in momentum form."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import toeplitz

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.consistency.check import Audit
from cpfls_cli.consistency.motion import OFFSET_M_S2
from cpfls_cli.dynamics import InertiaModel, momentum_form
from cpfls_cli.effects.catalogue.parameter_error import shown, with_thrust
from cpfls_cli.effects.effect import Columns, Effect
from cpfls_cli.effects.registry import VEHICLE_NUMBERS
from cpfls_cli.effects.signals import Signals, as_slow_as_rotors
from cpfls_cli.errors import InputError
from cpfls_cli.gap.balance.noise_floor import channel_cut_offs, negligible, noise_floor
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.inertia import symmetric
from cpfls_cli.playback.innovations import PER_WINDOW
from cpfls_cli.weak_form.windows import Windows

TURNING = 4.0  # Inertial torque in floors from which on noise shrinks an inertia by less than a sixteenth.
CHANNELS = ("torque x", "torque y", "torque z", "force x", "force y", "force z")
"""Rows of the balance in each window, body axes, N m and N."""


CandidateKey = tuple[Hashable, ...]


class Candidate(NamedTuple):
    """An effect with a value for each of its shapes."""

    effect: Effect
    shape: Mapping[str, float]

    @property
    def key(self) -> CandidateKey:
        """What its columns depend on: formula and form of the effect, which one name may have several of, and shape."""
        effect = self.effect
        return effect.name, effect.columns, len(effect.coefficients), tuple(self.shape.values())

    def at(self, values: Mapping[str, float]) -> Candidate:
        """Give some shapes other values."""
        return self._replace(shape={**self.shape, **values})

    def following(self, linear: Sequence[float] | Array, of_vehicle: Mapping[str, float]) -> dict[str, float]:
        """Give what its coefficients and those of the vehicle, by name, say of its shapes, within their bounds, if any.

        Of a load whose mass is 0 nothing says how deep its hook is.
        """
        own = dict(zip((each.name for each in self.effect.coefficients), linear, strict=False))
        known = {**of_vehicle, **own}
        pairs = ((each, each.follows(known)) for each in self.effect.shapes if each.follows is not None)
        return {
            each.name: float(np.clip(value, each.grid[0], each.grid[-1]))
            for each, value in pairs
            if not np.isnan(value)
        }


@dataclass(frozen=True, eq=False)
class WeakFlight:
    """A flight with its inertial torque and force."""

    signals: Signals
    windows: Windows
    # Momentum and direct terms of inertial torque and force of the model, shape (time, 6); 0 where unknown.
    inertial: Columns
    known: BoolArray  # Shape (6,): channels that the flight has.
    # Shape (parameter,): 1 for numbers of the vehicle that the flight can show, 0 for the inertia about axes that
    # hardly turn.
    turns: Array
    # Shape (6,), Hz: of the filters that the signals of each channel went through before they were logged; infinite for
    # none.
    cut_off: Array = field(default_factory=lambda: np.full(6, np.inf))
    # Shape (6,), N m and N: standard deviation that gusts and noise give averages over the windows; 0 where no gusts
    # are known.
    air: Array = field(default_factory=lambda: np.zeros(6))
    # Shape (6, window): correlation of both by how many windows apart they are, while they last; empty without gusts.
    lasting: Array = field(default_factory=lambda: np.zeros((6, 0)))
    # Shape (6,): share of their mean over the flight that rows are reduced by, which may be an accelerometer's offset.
    offset_share: Array = field(default_factory=lambda: np.zeros(6))
    # Shape (6, window, window): takes the first rows to what of each those before do not predict, the last one also all
    # that follow; None for rows as averaged.
    whitening: Array | None = None
    # Rows of candidates on the signals as they are, by effect and shape, so that no search computes them twice.
    seen: dict[CandidateKey, Array] = field(default_factory=dict, repr=False)
    # The same on windows that follow each other closely.
    seen_closely: dict[CandidateKey, Array] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        return self.windows.count(len(self.signals))

    @property
    def name(self) -> str:
        """Name of the flight."""
        return self.signals.name

    def residual(self, signals: Signals) -> Columns:
        """Subtract what the rotors do from the inertial side.

        `signals`: as they are, or with actuator effects applied; Result: shape (time, 6), N m and N.
        """
        return Columns((self.inertial.direct - signals.wrench) * self.known, self.inertial.momentum)

    def rows(self, candidate: Candidate, signals: Signals) -> Array:
        """Average the columns of a candidate over the windows, shape (window, 6, coefficient).

        `candidate`: of an effect with columns; `signals`: as they are, or with actuator effects applied.
        """
        of_vehicle, as_logged = candidate.effect.kind == "parameter", signals is self.signals
        if not (as_logged or of_vehicle):
            return self.averaged(columns_of(candidate, signals))
        if candidate.key not in self.seen:
            self.seen[candidate.key] = self.averaged(columns_of(candidate, self.signals))
        rows = self.seen[candidate.key]
        # Of the vehicle's numbers only the scale of the thrust meets what the rotors do; the motion stays.
        return rows if as_logged else with_thrust(rows, self.averaged(Columns(signals.wrench))[:, 5])

    def noise(self, columns: Columns) -> Array:
        """Give noise as large as that in the rows of columns, or of a residual, and without their motion.

        Only what is differentiated has noise that counts: averages smooth it.

        Result: shape (window, 6, ...); zero unless the noise of the signals is white: what a filter took off it shows
        nowhere.
        """
        if columns.momentum is None:
            return np.zeros((len(self), *columns.direct.shape[1:]))
        return self.of_channels(self.windows.alternating().derivative(columns.momentum))

    def as_stated(self, axes: BoolArray) -> WeakFlight:
        """Hold the inertia about some body axes, shape (3,), at what the config states."""
        return replace(self, turns=self.turns * shown(~axes))

    def averaged(self, columns: Columns) -> Array:
        """Average columns, or a residual, over the windows, shape (window, 6, ...)."""
        return self.of_channels(self.windows.balance(columns.direct, columns.momentum))

    @property
    def motion(self) -> Array:
        """Average the inertial torque and force over the windows, shape (window, 6), with an accelerometer's offset."""
        return replace(self, offset_share=np.zeros(6)).averaged(self.inertial)

    @cached_property
    def innovations(self) -> WeakFlight:
        """Take of each row what the rows before do not predict: of gusts and noise these are alike and independent.

        Rows further back than gusts last predict nothing more.
        Reference: Aitken 1936 (generalised least squares).
        """
        lasting = np.array([toeplitz(each) for each in self.lasting])
        white = replace(self, whitening=np.linalg.inv(np.linalg.cholesky(lasting)))
        seen = {key: white.of_channels(rows) for key, rows in self.seen.items()}
        return replace(white, seen=seen, seen_closely={})

    @property
    def closely(self) -> WeakFlight:
        """Average over windows so close that what they see can be followed in time."""
        return replace(self, windows=dense(self.windows), seen=self.seen_closely, seen_closely={})

    def of_channels(self, rows: Array) -> Array:
        """Give rows, shape (window, 6, ...), of the channels that the flight has, whitened where that is asked for."""
        shape = (-1, *[1] * (rows.ndim - 2))
        rows = (rows - self.offset_share.reshape(shape) * rows.mean(axis=0)) * self.known.reshape(shape)
        if self.whitening is not None:
            rows = np.stack([_whitened(each, rows[:, at]) for at, each in enumerate(self.whitening)], axis=1)
        return np.asarray(rows)


def _whitened(whitening: Array, rows: Array) -> Array:
    from scipy.signal import lfilter

    white = lfilter(whitening[-1, ::-1], [1.0], rows, axis=0)
    white[: len(whitening)] = whitening @ rows[: len(whitening)]
    return np.asarray(white)


def weak_flight(
    signals: Signals,
    windows: Windows,
    model: InertiaModel | None,
    force: bool,
    axes: Sequence[str] = "xyz",
    floor: Array | None = None,
) -> WeakFlight:
    """Compute the inertial torque and force of a flight.

    `force`: whether to use the force balance where the flight allows it.
    `axes`: body axes of which the torque balance is used.
    `floor`, shape (6,), N m and N: noise of a flight that is planned; None: as its residual shows it.
    """
    with_force = force and signals.has_force

    def make() -> WeakFlight:
        own = as_slow_as_rotors(signals)
        nothing = np.zeros((len(own), 3))
        sides = rotation_balance(own, model), translation_balance(own) if with_force else Columns(nothing)
        momenta = [nothing if side.momentum is None else side.momentum for side in sides]
        inertial = Columns(np.concatenate([side.direct for side in sides], axis=1), np.concatenate(momenta, axis=1))
        known = np.array([signals.torque is not None and axis in axes for axis in "xyz"] + [with_force] * 3)
        everything = np.ones(len(nuisance().effect.coefficients))
        cut_off = channel_cut_offs(signals, model is not None)
        flight = WeakFlight(own, windows, inertial, known, everything, cut_off)
        noise = noise_floor(flight.residual(own), windows, cut_off) if floor is None else floor
        # Where the inertial torque of an axis hardly leaves the noise, a fit would shrink its inertia to lose the noise
        # of the gyroscope, which is not what anybody asked.
        turning = flight.motion[:, :3].std(axis=0) > TURNING * noise[:3]
        return replace(flight, turns=shown(turning), offset_share=_offset_share(flight, noise))

    # Each stage rebuilds its model, and a flight is planned once.
    shared = model is None and floor is None
    return signals.once((weak_flight, windows, force, tuple(axes)), make) if shared else make()


def _offset_share(flight: WeakFlight, noise: Array) -> Array:
    """Give the share of their mean that rows of a random constant and of noise are reduced by to be independent.

    The constant is the offset of an accelerometer, which is another in each flight.

    `noise`, shape (6,), N m and N: of averages over windows.
    Reference: Fuller and Battese 1974 (random effects).
    """
    share = np.zeros(6)
    if flight.signals.specific_force is not None:
        noise = np.maximum(noise, negligible(np.mean(flight.motion**2, axis=0)))[3:]
        share[3:] = 1 - noise / np.hypot(noise, np.sqrt(len(flight)) * OFFSET_M_S2 * flight.signals.vehicle.mass_kg)
    return share


@lru_cache(maxsize=64)
def dense(windows: Windows) -> Windows:
    """Let windows follow each other so closely that what they see can be followed in time."""
    return replace(windows, hop=max(1, len(windows.weight) // PER_WINDOW))


def columns_of(candidate: Candidate, signals: Signals) -> Columns:
    """Evaluate the columns of an effect.

    `candidate`: of an effect with columns; Result: shape (time, 6, coefficient).
    """
    assert candidate.effect.columns is not None, "only effects with columns are candidates"
    columns = candidate.effect.columns(signals, candidate.shape)
    by_force = [place for place, each in enumerate(candidate.effect.coefficients) if each.by_force]
    if by_force and signals.specific_force is None:
        columns.direct[:, :3, by_force] = 0.0
    return columns


def nuisance() -> Candidate:
    """Give the parameters of the vehicle that stay free in every fit."""
    return Candidate(VEHICLE_NUMBERS, {})


def actuated(signals: Signals, chosen: Iterable[Candidate]) -> Signals:
    """Apply the effects among those chosen that change what all others meet: actuation, and the air.

    `chosen`: those that need a signal which the flight lacks leave it as it is: measured speeds, say, do not lag.
    """
    for candidate in chosen:
        effect = candidate.effect
        if effect.apply is not None and effect.kind != "sensor" and not effect.missing(signals):
            signals = effect.apply(signals, candidate.shape)
    return signals


def rotation_balance(signals: Signals, model: InertiaModel | None = None) -> Columns:
    """Compute the inertial body torque in momentum form.

    A rigid body: momentum ``I omega``, direct ``omega x I omega``. A model in Euler coordinates: ``W^-T (d/dt (J qd) -
    1/2 grad (qd^T J qd))``, with W^-T taken under the derivative.

    `model`: None for the rigid body of the vehicle.
    Result: shape (time, 3), N m s and N m, body axes.
    Raises InputError if the model needs an attitude that the flight lacks.
    """
    if model is None:
        momentum = signals.body_rate @ symmetric(signals.vehicle.inertia_kg_m2)
        return Columns(rotations.cross(signals.body_rate, momentum), momentum)
    attitude = signals.attitude
    if attitude is None:
        raise InputError("the model needs the attitude, which the flight lacks")
    momentum, direct = momentum_form(attitude, signals.body_rate, model.inertia(attitude))
    return Columns(direct, momentum)


def translation_balance(signals: Signals) -> Columns:
    """Compute mass times specific force in momentum form, body axes.

    From the accelerometer, else from the acceleration, else from the velocity: ``d/dt (m v_b) + m omega x v_b +
    m g R^T e_z``.

    `signals`: with `has_force`.
    Result: shape (time, 3), N s and N, body axes; without momentum unless from the velocity.
    """
    mass, gravity = signals.vehicle.mass_kg, signals.vehicle.gravity_m_s2
    if signals.specific_force is not None:
        return Columns(mass * signals.specific_force)
    weight = mass * gravity * signals.rotation[:, 2]
    if signals.acceleration is not None:
        felt = np.einsum("tji,tj->ti", signals.rotation, signals.acceleration)
        return Columns(mass * felt + weight)
    momentum = mass * signals.ground_velocity
    return Columns(rotations.cross(signals.body_rate, momentum) + weight, momentum)


@dataclass(frozen=True)
class Preparation:
    """Windows, model, settings and sensor repair that all flights of a diagnosis share."""

    windows: Windows
    model: InertiaModel | None  # None for the rigid body of the vehicle.
    settings: GapSettings
    audit: Audit  # Faults that are repaired.

    def logged(self, flights: Sequence[Signals]) -> list[WeakFlight]:
        """Prepare flights with the faults of their sensors, but with channels that belong together."""
        return [self._weak(self.audit.consistent(each)) for each in flights]

    def repaired(self, flights: Sequence[Signals]) -> list[WeakFlight]:
        """Prepare flights with the named faults of their sensors repaired."""
        return [self._weak(self.audit.repaired(each)) for each in flights]

    def _weak(self, signals: Signals) -> WeakFlight:
        return weak_flight(signals, self.windows, self.model, self.settings.force, self.settings.axes)
