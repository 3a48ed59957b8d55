"""Torques, thrust and rotor speeds that a planned motion asks for, room for control, and the plan as measured."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics import body_torque
from cpfls_cli.effects.hooks import TrueMotion
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.inertia import symmetric
from cpfls_cli.simulation.autopilot import GyroscopeNoise, asked
from cpfls_cli.simulation.closed_loop import ClosedLoop, SimulatedMotion, clock_of, fly
from cpfls_cli.simulation.model import (
    Simulated,
    SimulatedEffects,
    Tracking,
    in_table,
    played_gusts,
    simulated_effects,
    values_of,
    with_effects,
)
from cpfls_cli.simulation.settings import SimulationSettings
from cpfls_cli.trajectory.excited import AddedMotion
from cpfls_cli.trajectory.planning import Trajectory
from cpfls_cli.trajectory.settings import TrajectorySettings
from cpfls_cli.vehicle.motion import ATTITUDE, BODY_RATE, POSITION, VELOCITY
from cpfls_cli.vehicle.rotors import Infeasible, body_wrench, rotor_demand, violations
from cpfls_cli.vehicle.settings import VehicleSettings

if TYPE_CHECKING:
    from cpfls_cli.playback.model import VehicleModel


def measure(
    time: Array,
    planned: Mapping[str, Array],
    vehicle: VehicleSettings,
    settings: SimulationSettings,
    rng: np.random.Generator,
    progress: Callable[[float, int], None] = lambda _done, _total: None,
    model: VehicleModel | None = None,
) -> Simulated:
    """Simulate a planned motion in closed loop and log it.

    Parameters
    ----------
    time : array, shape (time,), s
        Uniform.
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration`, `position`, `velocity`, `acceleration`, shape
        (time, 3) each.
    vehicle : VehicleSettings
        As its model has it.
    rng : numpy.random.Generator
        Source of gusts, then of noise.
    progress : callable
        Takes steps done and steps in all.
    model : VehicleModel or None
        In place of the vehicle; effects of the settings come on top of its own.

    Raises
    ------
    InputError
        If there is no such effect.
    SettingError
        If an effect has values that are missing or impossible, or gusts are asked for that no model holds.
    ComputationError
        If the plan is not sampled uniformly, or the vehicle leaves the path or overturns.
    """
    given = simulated_effects(settings.closed_loop.effects, vehicle)
    held, effects = with_effects(model, given)
    gusts, push = played_gusts(model, settings.closed_loop.gusts), None
    if gusts is not None:
        clock = clock_of(time, settings.closed_loop)
        push = gusts.drawn(rng, clock.step, clock.steps)
    felt = {str(name): std for name, std in settings.noise.items()}.get("body_rate", 0.0)
    # The gyroscope of the loop and that of the log are two, so that a log's noise is the same whoever flies.
    noise = None if settings.closed_loop.law is None or not felt else GyroscopeNoise(felt, rng.spawn(1)[0])
    loop = ClosedLoop(vehicle, settings.closed_loop, held, effects)
    motion = fly(loop, time, planned, progress, push, noise)
    signals, noise_std = _logged(time, motion, vehicle, settings, effects, rng)
    setpoints = asked(planned, vehicle, settings.closed_loop, motion.state)
    signals |= {f"setpoint_{name}": values for name, values in setpoints.items()}
    flown = effects if held is None else SimulatedEffects((*in_table(held).listed, *effects.listed))
    tracking = Tracking.of(
        motion.state[:, POSITION] - planned["position"], motion.state[:, ATTITUDE] - planned["attitude"]
    )
    beyond = violations(motion.demand, vehicle.rotor_speed_max_rad_s, time)
    return Simulated.of(time, signals, noise_std, beyond, effects=values_of(flown), tracking=tracking)


_AT_LIMITS, _BEYOND_PLAN, _ONE_FREQUENCY, _BAND, _PERIODS = 0.1, 3.0, 0.5, 1.25, 4
"""Of a limit cycle, at least: share of samples that ask too much of a rotor, body rate off the plan over that of the
plan, share of its variance within a factor of one frequency, and periods of that; a plan that is hard to fly leaves far
less."""


class LimitCycle(NamedTuple):
    """An axis that oscillates at the limits of the rotors.

    `off`, `planned`: root mean square of the body rate less that of the plan, and of the plan, rad/s; `limited`: share
    of samples at which one rotor is asked for what it cannot do.
    """

    axis: int
    frequency_hz: float
    off: float
    planned: float
    limited: float


def limit_cycle(flight: Simulated, planned: Mapping[str, Array]) -> LimitCycle | None:
    """Find the axis that oscillates most, not as planned, while rotors are asked for what they cannot do.

    Parameters
    ----------
    planned : mapping of str to array
        `attitude` and `attitude_rate`, shape (time, 3) each, at the samples of the flight.

    Returns
    -------
    LimitCycle or None
        None where the loop does not oscillate at its limits.
    """
    limited = max((one.samples for one in flight.infeasible), default=0) / flight.samples
    if limited < _AT_LIMITS or flight.body_rate is None:
        return None
    plan = rotations.body_rate(planned["attitude"], planned["attitude_rate"])
    off = flight.body_rate - plan
    sizes = off.std(axis=0)
    axis = int(np.argmax(sizes))
    power = np.abs(np.fft.rfft(off[:, axis] - off[:, axis].mean())) ** 2
    frequency = np.fft.rfftfreq(flight.samples, float(np.median(np.diff(flight.time))))
    peak = float(frequency[np.argmax(power)])
    near = (frequency >= peak / _BAND) & (frequency <= peak * _BAND)
    most, asked_for = float(sizes[axis]), float(plan[:, axis].std())
    alike = power[near].sum() >= _ONE_FREQUENCY * power.sum()
    lasting = peak * (flight.time[-1] - flight.time[0]) >= _PERIODS
    if most < _BEYOND_PLAN * asked_for or not (alike and lasting):
        return None
    return LimitCycle(axis, peak, most, asked_for, limited)


def _logged(
    time: Array,
    motion: SimulatedMotion,
    vehicle: VehicleSettings,
    settings: SimulationSettings,
    effects: SimulatedEffects,
    rng: np.random.Generator,
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Log a flight: signals, and the standard deviation of the noise of those that have some.

    Torques are those that the model gives the logged rotor speeds, or the logged commands where the speeds are
    hidden.
    """
    exact = {**_motion(motion), **_actuation(motion, effects)}
    signals, noise_std = noisy(_as_logged(exact, time, motion, effects), settings, rng)
    speed = signals["rotor_command" if effects.hides_rotor_speed else "rotor_speed"]
    torque = rotations.generalised_torque(signals["attitude"], body_wrench(vehicle, speed).body_torque)
    stated, stated_std = noisy({"torque": torque}, settings, rng)
    signals |= {**stated, "body_torque": rotations.body_torque(signals["attitude"], stated["torque"])}
    return signals, noise_std | stated_std


def _motion(motion: SimulatedMotion) -> dict[str, Array]:
    attitude, body_rate = motion.state[:, ATTITUDE], motion.state[:, BODY_RATE]
    return {
        "attitude": attitude,
        "attitude_rate": rotations.attitude_rate(attitude, body_rate),
        "attitude_acceleration": rotations.attitude_acceleration(attitude, body_rate, motion.change[:, BODY_RATE]),
        "position": motion.state[:, POSITION],
        "velocity": motion.state[:, VELOCITY],
        "acceleration": motion.change[:, VELOCITY],
        "body_rate": body_rate,
    }


def _actuation(motion: SimulatedMotion, effects: SimulatedEffects) -> dict[str, Array]:
    """Log rotor speeds, or the command where effects hide them.

    Where no effect replaces the lag of the rotors, a hidden flight logs the command after it, so that the effects are
    all that is left between log and rotors.
    """
    if not effects.hides_rotor_speed:
        return {"rotor_speed": motion.speed, "rotor_command": motion.command}
    acting = [one.effect.actuation for one in effects.listed if one.effect.actuation is not None]
    voltage = {"voltage": motion.voltage} if any(each.supply is not None for each in acting) else {}
    lag = any(each.lag is not None for each in acting)
    return {"rotor_command": motion.command if lag else motion.lagged, **voltage}


def _as_logged(
    signals: dict[str, Array], time: Array, motion: SimulatedMotion, effects: SimulatedEffects
) -> dict[str, Array]:
    """Apply the effects on the log, the last of the catalogue first."""
    truth = TrueMotion(
        time,
        rotations.rotation_matrix(motion.state[:, ATTITUDE]),
        motion.state[:, BODY_RATE],
        motion.change[:, BODY_RATE],
    )
    for one in reversed(effects.ordered):
        if one.effect.log is not None:
            signals = signals | one.effect.log.change(signals, truth, one.values)
    return signals


def noise_std(name: str, values: Array, settings: SimulationSettings) -> Array:
    """Combine absolute and relative noise of each channel, independent of each other, to its standard deviation."""
    absolute = {str(key): value for key, value in settings.noise.items()}.get(name, 0.0)
    relative = {str(key): value for key, value in settings.relative_noise.items()}.get(name, 0.0)
    if relative == 0.0:
        return np.full(values.shape[1:], absolute)
    known = [channel[np.isfinite(channel)] for channel in values.reshape(len(values), -1).T]
    spread = np.array([float(np.std(channel)) if len(channel) else 0.0 for channel in known])
    return np.hypot(absolute, relative * spread.reshape(values.shape[1:]))


def noisy(
    exact: Mapping[str, Array], settings: SimulationSettings, rng: np.random.Generator
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Add white noise to signals.

    Parameters
    ----------
    exact : mapping of str to array
        By name; time is the first axis.

    Returns
    -------
    signals : dict of str to array
    std : dict of str to array
        Standard deviation of each channel, of the signals that have noise.
    """
    std = {name: deviation for name in exact if np.any(deviation := noise_std(name, exact[name], settings))}
    signals = {
        name: values + std[name] * rng.standard_normal(values.shape) if name in std else values
        for name, values in exact.items()
    }
    return signals, std


def simulate(
    time: Array,
    planned: Mapping[str, Array],
    vehicle: VehicleSettings,
    settings: SimulationSettings,
    rng: np.random.Generator,
) -> Simulated:
    """Compute the torques and rotor speeds that fly a planned motion.

    Parameters
    ----------
    time : array, shape (time,), s
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration`, `position`, `velocity`, `acceleration`, shape
        (time, 3) each; without the last three the vehicle is held at its centre of mass and only turns.
    rng : numpy.random.Generator
        Source of the noise.

    Raises
    ------
    SettingError
        If a signal that a held vehicle does not have is to be noisy.
    ComputationError
        If the rotors cannot produce thrust, roll, pitch and yaw independently.

    References
    ----------
    Equations (1) and (2); method.md sections 1 and 2.
    """
    about_body, thrust = needed_wrench(planned, vehicle)
    demand = rotor_demand(vehicle, thrust, about_body)
    generalised = rotations.generalised_torque(planned["attitude"], about_body)
    exact = {**planned, "torque": generalised, "body_torque": about_body, "rotor_speed": demand.speed}
    _refuse_noise_of_nothing(exact, settings)
    signals, noise_std = noisy(exact, settings, rng)
    signals["torque"], signals["body_torque"] = _torques(signals, frozenset(noise_std))
    signals["body_rate"] = rotations.body_rate(signals["attitude"], signals["attitude_rate"])
    return Simulated.of(time, signals, noise_std, violations(demand.squared_speed, vehicle.rotor_speed_max_rad_s, time))


@dataclass(frozen=True)
class TooMuch:
    """A demand of a motion beyond its limit.

    Attributes
    ----------
    what : str
        Thrust or tilt, with its unit.
    first, at, count : int
        Indices of the first sample beyond the limit and of the worst, and the number of samples beyond it.
    """

    what: str
    limit: float
    worst: float
    first: int
    at: int
    count: int


@dataclass(frozen=True)
class Flyability:
    """Demands of a motion on a vehicle.

    Attributes
    ----------
    thrust : array, shape (time,), N
    tilt : array, shape (time,), rad
        Angle between thrust and vertical.
    too_much : tuple of TooMuch
        Empty where thrust and tilt stay within their limits.
    rotors : tuple of Infeasible
        Empty where every rotor can do what is asked.
    """

    thrust: Array
    tilt: Array
    too_much: tuple[TooMuch, ...]
    rotors: tuple[Infeasible, ...]


def flyability(planned: Mapping[str, Array], vehicle: VehicleSettings, tilt_max: float | None) -> Flyability:
    """Check a planned motion against a vehicle.

    Parameters
    ----------
    planned : mapping of str to array
        `time`, shape (time,); `attitude`, `attitude_rate`, `attitude_acceleration` and, unless the vehicle is held at
        its centre of mass, `acceleration`, shape (time, 3) each.
    tilt_max : float or None, rad
        Largest tilt allowed; None for any.

    Raises
    ------
    ComputationError
        If the rotors cannot produce thrust, roll, pitch and yaw independently.

    References
    ----------
    Section 2 of the paper; method.md sections 2 and 3.
    """
    about_body, thrust = needed_wrench(planned, vehicle)
    tilt = tilt_of(planned["attitude"])
    most = sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors) * vehicle.rotor_speed_max_rad_s**2
    limits = [("thrust, N", thrust, most)] + ([("tilt, rad", tilt, tilt_max)] if tilt_max else [])
    excesses = [too_much for name, values, limit in limits for too_much in _beyond(name, values, limit)]
    squared = rotor_demand(vehicle, thrust, about_body).squared_speed
    beyond = violations(squared, vehicle.rotor_speed_max_rad_s, planned["time"])
    return Flyability(thrust, tilt, tuple(excesses), beyond)


def tilt_of(attitude: Array) -> Array:
    """Compute the angle between thrust and vertical, shape (time,), rad, of attitudes, shape (time, 3), rad."""
    (sr, cr), (sp, cp) = ((np.sin(angle), np.cos(angle)) for angle in attitude.T[:2])
    # The arc cosine of the vertical component of body z would lose small angles.
    return np.asarray(np.arctan2(np.hypot(sp * cr, sr), cr * cp))


def needed_wrench(planned: Mapping[str, Array], vehicle: VehicleSettings) -> tuple[Array, Array]:
    """Compute the body torque, shape (time, 3), N m, and the thrust, shape (time,), N, that a motion needs."""
    rotation = planned["attitude"], planned["attitude_rate"], planned["attitude_acceleration"]
    about_body = body_torque(*rotation, symmetric(vehicle.inertia_kg_m2))
    return about_body, collective_thrust(vehicle, about_body, planned.get("acceleration"))


def single_axis_torque(vehicle: VehicleSettings) -> Array:
    """Compute the largest torque about each axis alone, in either direction, of a held vehicle, shape (3,), N m."""
    both = np.concatenate([np.eye(3), -np.eye(3)])
    needed = rotor_demand(vehicle, collective_thrust(vehicle, both, None), both).squared_speed.max(axis=1)
    return np.asarray(vehicle.rotor_speed_max_rad_s**2 / np.maximum(needed[:3], needed[3:]))


def collective_thrust(vehicle: VehicleSettings, body_torque: Array, acceleration: Array | None) -> Array:
    """Compute the total thrust along body z, N, from body torque and acceleration in the world, None where it is held.

    In flight it is ``m |a + g e3|``. A vehicle that is held at its centre of mass has it free: it is then the smallest
    at which the torque asks no rotor to turn backwards, as every rotor of a lone thrust turns forwards.
    `ComputationError` where the rotors cannot produce thrust, roll, pitch and yaw independently, or a torque is not
    finite.
    """
    if acceleration is not None:
        specific_force = acceleration + np.array([0.0, 0.0, vehicle.gravity_m_s2])
        return np.asarray(vehicle.mass_kg * np.linalg.norm(specific_force, axis=1))
    none = np.zeros(len(body_torque))
    by_torque = rotor_demand(vehicle, none, body_torque).squared_speed
    by_thrust = rotor_demand(vehicle, np.ones(1), np.zeros((1, 3))).squared_speed[0]
    turning = by_thrust > 0
    least = np.maximum(-by_torque[:, turning] / by_thrust[turning], 0.0)
    return np.asarray(least.max(axis=1, initial=0.0))


def _refuse_noise_of_nothing(exact: Mapping[str, Array], settings: SimulationSettings) -> None:
    for key in ("noise", "relative_noise"):
        missing = sorted({str(name) for name in getattr(settings, key)} - exact.keys())
        if missing:
            raise SettingError(key, f"{', '.join(missing)}: a vehicle held at its centre of mass has none")


def _torques(signals: Mapping[str, Array], noised: frozenset[str]) -> tuple[Array, Array]:
    """Compute generalised and body torque; one without noise of its own follows from the other."""
    if "body_torque" in noised:
        return rotations.generalised_torque(signals["attitude"], signals["body_torque"]), signals["body_torque"]
    if noised & {"torque", "attitude"}:
        return signals["torque"], rotations.body_torque(signals["attitude"], signals["torque"])
    return signals["torque"], signals["body_torque"]


def _beyond(what: str, values: Array, limit: float) -> Iterator[TooMuch]:
    beyond: BoolArray = values > limit * (1 + 1e-12)
    if beyond.any():
        at = int(np.argmax(values))
        yield TooMuch(what, limit, float(values[at]), int(np.argmax(beyond)), at, int(beyond.sum()))


ROTOR_SHARE = 0.85
"""Of the largest speed of a rotor, and of the way down from hovering to rest, in squares: the rest is for control."""

_HALVINGS = 12
"""Of a bisection, to a four-thousandth of the size."""

_LEAST_SHARE = 0.02
"""Of the size asked for: less is refused."""


def squared_speeds(planned: Mapping[str, Array], vehicle: VehicleSettings) -> Array:
    """Compute the squared rotor speeds that a motion in space asks for.

    Parameters
    ----------
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration`, `acceleration`, shape (time, 3) each.

    Returns
    -------
    array, shape (time, rotor), rad^2/s^2
        Negative where no rotor can.
    """
    about_body, thrust = needed_wrench(planned, vehicle)
    squared: Array = rotor_demand(vehicle, thrust, about_body).squared_speed
    return squared


def hover_squared(vehicle: VehicleSettings) -> Array:
    """Compute the squared rotor speeds of hovering, shape (rotor,), rad^2/s^2."""
    weight = np.array([vehicle.mass_kg * vehicle.gravity_m_s2])
    squared: Array = rotor_demand(vehicle, weight, np.zeros((1, 3))).squared_speed[0]
    return squared


@dataclass(frozen=True)
class RotorLoad:
    """Largest shares that a motion takes of what rotors may do besides control, which is `ROTOR_SHARE` of all.

    `fast`: of the square of the largest speed; `slow`: of the way down from the squared speed of hovering to rest.
    """

    fast: float
    slow: float


def rotor_load(planned: Mapping[str, Array], vehicle: VehicleSettings) -> RotorLoad:
    """Compute what a motion in space takes of the rotors; `planned` as in `squared_speeds`."""
    squared, hover = squared_speeds(planned, vehicle), hover_squared(vehicle)
    fast = float((squared / (ROTOR_SHARE * vehicle.rotor_speed_max_rad_s**2)).max())
    return RotorLoad(fast, float(((hover - squared) / (ROTOR_SHARE * hover)).max()))


@dataclass(frozen=True)
class RoomLeft:
    """Excitation that fits on top of its path, and what limits it.

    Attributes
    ----------
    added : AddedMotion
        Of the size asked for, or smaller.
    limits : tuple of str
        The limit that more of each axis would break, with its key; empty where all fits.
    """

    added: AddedMotion
    limits: tuple[str, ...]


def room_left(path: Trajectory, added: AddedMotion, settings: TrajectorySettings, vehicle: VehicleSettings) -> RoomLeft:
    """Find the largest sizes of an excitation, up to its own, that keep tilt, rotors and velocity within limits.

    First of each axis alone, then of all together, by one factor. Rotors keep some of what they have for control,
    unless the path alone already takes more.

    Parameters
    ----------
    path : Trajectory
        One run, without excitation.

    Raises
    ------
    SettingError
        If next to nothing of an axis fits; it names the key.
    """
    load = rotor_load(vars(path), vehicle)

    def exceeded(sizes: Array) -> str:
        return _exceeded(path, added.of_sizes(sizes), settings, vehicle, load)

    alone = [_largest(added.sizes * one, exceeded) for one in np.eye(len(added.axes))]
    together, shared = _largest(np.sum([sizes for sizes, _ in alone], axis=0), exceeded)
    limits = tuple(shared or limit for _, limit in alone)
    for axis, size, wanted, limit in zip(added.axes, together, added.sizes, limits, strict=True):
        if size < _LEAST_SHARE * wanted:
            raise SettingError(
                "excite.size_rad",
                f"there is room for only {np.degrees(size):.2g} degrees of {axis}: {limit}; lower the top of "
                f"excite.band_hz, leave {axis} out, fly a gentler path, or lower this",
            )
    return RoomLeft(added.of_sizes(together), limits)


def _largest(sizes: Array, exceeded: Callable[[Array], str]) -> tuple[Array, str]:
    """Find the largest share of sizes that exceeds nothing, by bisection, and the limit that more would."""
    limit = exceeded(sizes)
    if not limit:
        return sizes, ""
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        broken = exceeded(middle * sizes)
        low, high, limit = (low, middle, broken) if broken else (middle, high, limit)
    return low * sizes, limit


def _exceeded(
    path: Trajectory, added: AddedMotion, settings: TrajectorySettings, vehicle: VehicleSettings, alone: RotorLoad
) -> str:
    """Name the limit that path and excitation together exceed; empty where they keep all."""
    velocity = float(np.linalg.norm(added.motion[1], axis=1).max())
    if velocity > settings.excite.velocity_max_m_s:
        return f"the velocity that it adds (trajectory.excite.velocity_max_m_s = {settings.excite.velocity_max_m_s:g})"
    try:
        flown = vars(added.onto(path, vehicle.gravity_m_s2))
    except ComputationError:
        return "thrust, which must not vanish"
    most = settings.tilt_max_rad
    if most is not None and tilt_of(flown["attitude"]).max() > most:
        return f"tilt (trajectory.tilt_max_rad = {most:g})"
    load = rotor_load(flown, vehicle)
    if load.fast > max(1.0, alone.fast):
        share = f"{100 * ROTOR_SHARE:.0f} % of the square of vehicle.rotor_speed_max_rad_s"
        return f"rotor speed ({share} = {vehicle.rotor_speed_max_rad_s:g})"
    return (
        f"rotor speed (each rotor keeps {100 * (1 - ROTOR_SHARE):.0f} % of its thrust in hover)"
        if load.slow > max(1.0, alone.slow)
        else ""
    )
