"""What would be logged of a flight, planned or flown in closed loop, and the floors that its noise makes."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics import InertiaModel
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.balance_system import floors, system
from cpfls_cli.gap.balance.weak_flight import WeakFlight, weak_flight
from cpfls_cli.gap.next_flight.rivals import physical_values
from cpfls_cli.gap.next_flight.room import Room
from cpfls_cli.gap.next_flight.separation import Evidence, Question, SizedEffect, gathered
from cpfls_cli.gap.residual.air import Air
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.simulation.inverse import squared_speeds
from cpfls_cli.simulation.measured import measure, noisy
from cpfls_cli.simulation.settings import ClosedLoopSettings, SimulationSettings
from cpfls_cli.trajectory.planning import Trajectory
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import windows

_BATTERY_USE = 0.2  # Share of its voltage that the battery loses over the flight.
_OPTIONAL = ("attitude", "position", "velocity", "acceleration", "specific_force", "voltage")
_CARRIES = {
    "attitude": ("attitude",),
    "velocity": ("attitude", "velocity"),
    "height": ("attitude", "position"),
    "force": ("attitude", "acceleration"),
    "voltage": ("voltage",),
}
"""Signals that a log may lack, and those that carry what effects need."""


def needed_signals(effects: Iterable[Effect]) -> frozenset[str]:
    """List the signals that a log may lack and that effects need."""
    return frozenset(signal for effect in effects for need in effect.needs for signal in _CARRIES.get(need, ()))


def logged_signals(signals: Signals) -> frozenset[str]:
    """List the signals of a log that another may lack."""
    return frozenset(name for name in _OPTIONAL if getattr(signals, name) is not None)


@dataclass(frozen=True)
class Logging:
    """What will be logged, with which noise, and how it is looked at."""

    signals: frozenset[str]  # Of `attitude`, `position`, `velocity`, `acceleration`, `specific_force`, `voltage`.
    commanded: bool  # Whether commands are logged in place of rotor speeds.
    floor: Array  # Shape (6,), N m and N: standard deviation of window averages by noise.
    settings: GapSettings
    base: InertiaModel | None = None  # Of the model that misses something; None for the rigid body of the vehicle.
    off: float = 0.0  # What formulas are off by, see `formulas_off`.
    air: Air | None = None  # Gusts that are to be expected, in the floor too; None for still air.

    def gathered(self, question: Question, flights: Sequence[WeakFlight]) -> Evidence:
        """Gather what flights would say on a question."""
        return gathered(question, flights, self.floor, self.settings, self.off)

    def weak(self, signals: Signals) -> WeakFlight:
        """Arrange a flight for the balance."""
        settings = self.settings
        shared = windows(signals.period, settings.window_s, settings.overlap)
        flight = weak_flight(signals, shared, self.base, settings.force, settings.axes, self.floor)
        return flight if self.air is None else self.air.around([flight], self.floor)[0]


def planned_signals(planned: Trajectory, room: Room, logging: Logging) -> Signals:
    """Compute what would be logged along a plan by a vehicle without any effect and without noise."""
    speed = np.sqrt(np.maximum(squared_speeds(vars(planned), room.vehicle), 0.0))
    voltage = 1 - _BATTERY_USE * planned.time / planned.duration
    return _signals(planned.time, vars(planned), speed, voltage, room.vehicle, logging)


def _signals(
    time: Array,
    motion: Mapping[str, Array],
    rotor_speed: Array,
    voltage: Array | None,
    vehicle: VehicleSettings,
    logging: Logging,
) -> Signals:
    """Make signals of what will be logged, with what an ideal accelerometer senses."""
    signals = Signals(
        time=time,
        body_rate=motion["body_rate"],
        vehicle=vehicle,
        name="next flight",
        attitude=motion["attitude"],
        position=motion["position"],
        velocity=motion["velocity"],
        acceleration=motion["acceleration"],
        rotor_speed=rotor_speed,
        voltage=voltage,
        commanded=logging.commanded,
        ground_height_m=logging.settings.ground_height_m,
    )
    upward = np.array([0.0, 0.0, vehicle.gravity_m_s2])
    felt = np.einsum("tji,tj->ti", signals.rotation, motion["acceleration"] + upward)
    dropped = {name: None for name in _OPTIONAL if name not in logging.signals}
    return replace(signals, **{"specific_force": felt} | dropped)


def expected_floor(
    room: Room, logging: Logging, noise: SimulationSettings, period: float, rng: np.random.Generator
) -> Array:
    """Estimate the floors that noise of known size will have, along a random path, shape (6,), N m and N.

    `logging`: its floor is not used; `noise`: noise of each signal; `period`: of the log, s.
    """
    exact = planned_signals(room.planned(room.drawn(rng), period), room, logging)
    names = ("attitude", "body_rate", "position", "velocity", "acceleration", "rotor_speed")
    logged: dict[str, Any] = noisy(
        {name: values for name in names if (values := getattr(exact, name)) is not None}, noise, rng
    )[0]
    balance = system([logging.weak(replace(exact, specific_force=None, **logged))])
    return floors(balance, np.zeros(balance.base.shape[2]))


def flown_signals(
    planned: Trajectory,
    effects: Sequence[SizedEffect],
    vehicle: VehicleSettings,
    logging: Logging,
    settings: ClosedLoopSettings,
) -> Signals:
    """Fly a plan in closed loop and log it without noise.

    `effects`: that the flown vehicle has and the autopilot does not know.
    `settings`: their effects are not flown.
    Raises SettingError if an effect has values that no vehicle has.
    Raises ComputationError if the vehicle leaves the path or overturns.
    """
    hidden: dict[str, tuple[float, ...] | dict[str, float]] = {
        each.candidate.effect.name: dict(physical_values(each)) for each in effects
    }
    loop = SimulationSettings(mode="closed-loop", closed_loop=replace(settings, effects=hidden))
    # Without noise nothing is drawn.
    rng = np.random.default_rng(0)
    model = None if logging.base is None else VehicleModel(vehicle=vehicle, fuzzy=logging.base)
    flight = measure(planned.time, vars(planned), vehicle, loop, rng, model=model)
    logged = flight.signals
    speed = logged["rotor_command"] if "rotor_speed" not in logged else logged["rotor_speed"]
    return _signals(planned.time, logged, speed, logged.get("voltage"), vehicle, logging)
