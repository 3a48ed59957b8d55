"""What a repeated test signal is for: in gusts the other runs tell the body, where a regression misses it."""

from dataclasses import replace

import numpy as np
from scipy.signal import butter, sosfiltfilt

from cpfls_cli.simulation.room_left import room_left
from cpfls_cli.trajectory.excited import added_motion
from cpfls_cli.trajectory.planning import plan, repeated
from cpfls_cli.trajectory.settings import ExciteSettings, TrajectorySettings
from tests.builders import gusty_flights
from tests.builders.gusty_flights import EVERY, GRAVITY, GUSTS, LARGE, MEMORY_S, SMALL, STEP_S, Flight

BAND_HZ = (0.5, 5.0)


def mission_of(truth, seconds=30.0, runs=4):
    """Plan the mission that the docs tell to fly: a multisine on roll and pitch in hover, again and again."""
    asked = ExciteSettings(axes=("roll", "pitch"), band_hz=BAND_HZ)
    settings = TrajectorySettings(path="hover", duration_s=seconds, repeat=runs, sample_time_s=STEP_S, excite=asked)
    run = plan(settings, GRAVITY)
    # What flies clips at four times the squared speed of hover.
    fastest = float(np.sqrt(truth.mass * GRAVITY / truth.thrust_factor))
    vehicle = replace(truth.vehicle, rotor_speed_max_rad_s=fastest)
    room = room_left(run, added_motion(asked, run, GRAVITY), settings, vehicle)
    return repeated(room.added.onto(run, GRAVITY), settings, GRAVITY)


def flown(mission, flights):
    """Fly a mission with each vehicle in its gusts; give its logged body rates and rotor speeds, (time, 3 and 4)."""
    heading = np.zeros((len(mission.position), 1))
    path = np.hstack([mission.position, mission.velocity, mission.acceleration, heading])
    rngs, samples = [np.random.default_rng([77, each.draw]) for each in flights], len(path)
    memory = gusty_flights._memory
    pushes = [memory(rng, samples, MEMORY_S) * each.gusts for rng, each in zip(rngs, flights, strict=True)]
    shoves = [memory(rng, samples, np.ones(3)) * 0.06 * max(e.gusts) for rng, e in zip(rngs, flights, strict=True)]
    noise = [e.truth.gyro_noise * rng.standard_normal((samples, 3)) for rng, e in zip(rngs, flights, strict=True)]
    paths = np.repeat(path[:, None], len(flights), axis=1)
    air = (np.stack(each, axis=1) for each in (pushes, shoves, noise))
    *_, rate, speed, _, _ = gusty_flights._flown(flights, paths, *air)
    for number, (rng, each) in enumerate(zip(rngs, flights, strict=True)):
        measured = each.truth.speed_noise * speed[:, number].mean() * rng.standard_normal(speed[:, number].shape)
        yield rate[:, number], speed[:, number] + measured


def factors(truth, mission, rate, speed):
    """Find the factor on Ixx and Iyy in the band: rotation on torque, torque on rotation, other runs as instrument."""
    step, inertia = STEP_S * EVERY, np.array(truth.inertia)
    torque = speed**2 @ truth.mixer[1:].T
    taken = inertia * np.gradient(rate, step, axis=0) + np.cross(rate, inertia * rate) + truth.damping * rate
    band = butter(4, BAND_HZ, btype="bandpass", fs=1 / step, output="sos")
    firsts, length = [round(begin / step) for begin, _ in mission.runs], round(mission.runs[0][1] / step)
    t, h = (
        np.array([values[first : first + length, :2] for first in firsts])
        for values in (sosfiltfilt(band, each, axis=0) for each in (torque, taken))
    )
    others = t.sum(axis=0) - t
    products = [(t * t, t * h), (t * h, h * h), (others * t, others * h)]
    return np.array([above.sum(axis=(0, 1)) / below.sum(axis=(0, 1)) for above, below in products])


def found(mission, flights):
    """Give the factors of each flight, all flown at once, shape (flight, 3, 2)."""
    logs = zip(flights, flown(mission, flights), strict=True)
    return np.array([factors(flight.truth, mission, *log) for flight, log in logs])


def test_runs_are_instruments_for_each_other():
    """Two vehicles of 45 g and 1.5 kg, which have room for all of the signal, two draws of gusts each."""
    mission = mission_of(SMALL, seconds=16.0)
    np.testing.assert_array_equal(mission.position, mission_of(LARGE, seconds=16.0).position)
    flights = [Flight(truth, GUSTS, draw=draw) for truth in (SMALL, LARGE) for draw in (0, 1)]
    by_torque, _, by_runs = np.moveaxis(found(mission, flights), 1, 0)
    assert (by_torque > 1.05).all()
    assert np.abs(by_runs - 1).max() < 0.04
