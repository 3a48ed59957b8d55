"""Constants from flights of RotorPy in gusty wind, under its own controller: moments over the true ones.

RotorPy's Crazyflie and Hummingbird on two paths with sines of up to 5 Hz, each flown four times for 40 s, or three
paths once, with the position setpoint or without, at 250 Hz, in wind that wanders by 1.5 m/s. The Crazyflie
has flapping rotors here, for the wind turns no other; noise is in what the controller sees of the rates and in the
logged speeds. Equations, rotors and controller are RotorPy's. Needs rotorpy.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from itertools import islice, product
from typing import Any, NamedTuple

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from benchmarks.shared.gusty_sets import KINDS, MOMENTS, PATHS, REPEATED, RUNS, cells_of_moments
from benchmarks.shared.measure import program, progress, table
from cpfls_cli.arrays import Array
from cpfls_cli.playback.flight import MeasuredMotion, PlaybackFlight
from cpfls_cli.playback.loop import loop_bounds
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings
from tests.builders.gusty_flights import SMALL, Flight, path_of
from tests.builders.gusty_flights import STEP_S as PATH_STEP_S

STRIDE, EVERY, SECONDS = 2, 2, 40.0
"""Steps of a path that RotorPy steps over at once, and how often it is logged: at 250 and 125 Hz."""
STEP_S = STRIDE * PATH_STEP_S
WIND_M_S, MEMORY_S = 1.5, 0.7
RATE_NOISE, SPEED_NOISE = 0.02, 1e-3
"""rad/s, in the loop, and of the mean speed, in the log."""
FLAPPING = 8e-9
"""Of the Crazyflie, for which RotorPy states none, N m per rad/s and m/s: a gust of 1 m/s turns it by 4 rad/s^2."""


class Asked(NamedTuple):
    """Which vehicle flies which path in which wind, and whether setpoints are logged."""

    vehicle: str
    setpoints: bool
    path: int
    draw: int


def main(draws: int = 4) -> None:
    rows = []
    with ProcessPoolExecutor(2) as pool:
        for name in ("Crazyflie", "Hummingbird"):
            for kind in KINDS:
                paths, runs = (REPEATED, RUNS) if kind == "repeats" else (PATHS, 1)
                each = product(range(draws), range(paths), range(runs))
                own = name, kind == "setpoints"
                asked = [Asked(*own, paths * draw + path, runs * draw + run) for draw, path, run in each]
                flown, vehicle = pool.map(_flown, asked), _settings(_parameters(name))
                sets = [list(islice(flown, paths * runs)) for _ in range(draws)]
                rows.append([name, kind, *cells_of_moments(vehicle, kind, sets), *_bounds(vehicle, sets)])
                progress(rows[-1])
    table("rotorpy_gusts", f"vehicle | instrument | {MOMENTS} | bounds without: Ixx | Iyy", rows)


def _bounds(vehicle: VehicleSettings, sets: list[list[PlaybackFlight]]) -> Iterator[str]:
    """Give what the loop leaves open: means of bounds by regression both ways with the true model of the body."""
    bounds = [loop_bounds(VehicleModel(vehicle=vehicle), flights) for flights in sets]
    for axis in range(2):
        low, high = (np.mean([each[axis] for each in pair]) for pair in zip(*(b[:2] for b in bounds), strict=True))
        yield f"{low:.2f} to {high:.2f}"


class _Asks:
    """A path as RotorPy asks for it."""

    def __init__(self, path: Array) -> None:
        self.path = path

    def update(self, time: float) -> dict[str, Any]:
        """Give what is asked for at a time."""
        position, velocity, acceleration = np.split(self.path[min(round(time / STEP_S), len(self.path) - 1), :9], 3)
        none = dict.fromkeys(("x_dddot", "x_ddddot"), np.zeros(3))
        return {"x": position, "x_dot": velocity, "x_ddot": acceleration, "yaw": 0.0, "yaw_dot": 0.0, **none}


def _parameters(name: str) -> dict[str, Any]:
    from rotorpy.vehicles import crazyflie_params, hummingbird_params

    given = {"Crazyflie": crazyflie_params, "Hummingbird": hummingbird_params}[name].quad_params
    return {**given, "k_flap": given["k_flap"] or FLAPPING}


def _settings(numbers: Mapping[str, Any]) -> VehicleSettings:
    """State RotorPy's vehicle; its direction of a rotor is that of the torque on the body."""
    factors = {"thrust_factor_n_s2": float(numbers["k_eta"]), "drag_factor_n_m_s2": float(numbers["k_m"])}
    rotors = tuple(
        RotorSettings(position_m=tuple(float(x) for x in place), spin=-int(direction), **factors)
        for place, direction in zip(numbers["rotor_pos"].values(), numbers["rotor_directions"], strict=True)
    )
    inertia = tuple(float(numbers[name]) for name in ("Ixx", "Iyy", "Izz"))
    known = {"mass_kg": float(numbers["mass"]), "rotor_speed_max_rad_s": float(numbers["rotor_speed_max"])}
    return VehicleSettings(inertia_kg_m2=(*inertia, 0.0, 0.0, 0.0), rotors=rotors, **known)


def _flown(asked: Asked) -> PlaybackFlight:
    """Fly a path under RotorPy's controller, which sees noisy rates, and log every second step."""
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.vehicles.multirotor import Multirotor

    numbers = _parameters(asked.vehicle)
    samples = round(SECONDS / STEP_S)
    rng = np.random.default_rng([2000, asked.path, asked.draw])
    path = path_of(Flight(SMALL, path=asked.path, reach=5.0), STRIDE * samples)[::STRIDE]
    keep = np.exp(-STEP_S / MEMORY_S)
    drawn = WIND_M_S * np.sqrt(1 - keep**2) * rng.standard_normal((samples, 3))
    wind, noise = lfilter([1.0], [1.0, -keep], drawn, axis=0), RATE_NOISE * rng.standard_normal((samples, 3))
    hover = np.full(4, np.sqrt(numbers["mass"] * 9.81 / (4 * numbers["k_eta"])))
    state = {"x": path[0, :3], "v": path[0, 3:6], "w": np.zeros(3), "q": np.array([0.0, 0.0, 0.0, 1.0])}
    state |= {"wind": wind[0], "rotor_speeds": hover}
    vehicle = Multirotor(numbers, initial_state=state, control_abstraction="cmd_motor_speeds", enable_ground=False)
    control, asks, logs = SE3Control(numbers), _Asks(path), []
    for now in range(samples):
        seen = {**state, "w": state["w"] + noise[now]}
        if now % EVERY == 0:
            logs.append(np.concatenate([seen[name] for name in ("x", "v", "q", "w", "rotor_speeds")]))
        state = {**state, "wind": wind[now]}
        state = vehicle.step(state, control.update(STEP_S * now, seen, asks.update(STEP_S * now)), STEP_S)
    position, velocity, turned, rate, speed = np.split(np.array(logs), [3, 6, 10, 13], axis=1)
    speed = speed + SPEED_NOISE * hover.mean() * rng.standard_normal(speed.shape)
    motion = MeasuredMotion(position, velocity, Rotation.from_quat(turned).as_matrix(), rate, STEP_S * EVERY)
    setpoints = {"position": path[::EVERY, :3], "velocity": path[::EVERY, 3:6]} if asked.setpoints else {}
    return PlaybackFlight(
        name=f"rotorpy-{asked.path}-{asked.draw}", motion=motion, speed=speed, hold="linear",
        stretches=(slice(0, len(speed)),), setpoints=setpoints,
    )  # fmt: skip


if __name__ == "__main__":
    program(main)
