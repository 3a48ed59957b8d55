"""Flights under an autopilot's own law along setpoints of the attitude, in gusts and noise, to be flown again."""

from dataclasses import replace

import numpy as np

from cpfls_cli.effects.signals import Signals
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.gusts import Gusts
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.settings import VEHICLE
from cpfls_cli.simulation.autopilot import GyroscopeNoise
from cpfls_cli.simulation.closed_loop import ClosedLoop, Setpoints, clock_of, fly_setpoints
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.simulation.twin import CHANNELS, ChannelInGusts, InGusts, TwinGains, asked_of, fly_twin, twin_of
from tests.builders.autopilots import CROSS

LOOP = ClosedLoopSettings(autopilot="px4", rotor_time_constant_s=0.03, integration_rate_hz=400.0)
PERIOD = 0.02
NOISE = 0.01
HOVER = 0.36
GUSTS = Gusts(np.array([0.02, 0.02, 0.005, 0.3, 0.3, 0.3]), np.full(6, 0.4))


def flown(seconds=12.0, seed=3, gusts=True, inertia_x=1.0):
    """Fly steps of the attitude with a body that turns so much harder about x; what is measured is noisy."""
    rng = np.random.default_rng(seed)
    time = PERIOD * np.arange(round(seconds / PERIOD) + 1)
    steps = rng.uniform(-1, 1, (round(seconds / 0.4) + 2, 3)) * [0.25, 0.25, 0.4]
    attitude, thrust = steps[(time / 0.4).astype(int)], np.full(len(time), HOVER)
    clock = clock_of(time, LOOP)
    push = GUSTS.drawn(rng, clock.step, clock.steps) if gusts else None
    noise = GyroscopeNoise(NOISE, rng.spawn(1)[0]) if gusts else None
    asked = Setpoints(attitude, None, thrust)
    x, *others = CROSS.inertia_kg_m2
    body = VehicleModel(vehicle=replace(CROSS, inertia_kg_m2=(inertia_x * x, *others)))
    model = None if inertia_x == 1.0 else body
    motion = fly_setpoints(ClosedLoop(CROSS, LOOP, model), time, asked, np.zeros(12), push, noise)
    scatter = NOISE * rng.standard_normal((2, len(time), 3)) * gusts
    signals = Signals(
        time=time,
        body_rate=motion.state[:, 9:12] + scatter[0],
        attitude=motion.state[:, 6:9] + 0.2 * scatter[1],
        velocity=motion.state[:, 3:6],
        position=motion.state[:, :3],
        acceleration=motion.change[:, 3:6],
        rotor_speed=motion.speed,
        vehicle=CROSS,
        setpoints={"attitude": attitude, "thrust": thrust[:, None]},
    )
    return LoggedFlight.of(replace(signals, name="flight"))


def twin_found():
    """A flight compared with a vehicle with rotors that are too slow, and with the one that flew."""
    flight = flown(6.0)
    asked = asked_of(flight, LOOP, CROSS, share=True)
    loops = {VEHICLE: replace(LOOP, rotor_time_constant_s=0.1), "found.h5": LOOP}
    twins = {name: fly_twin(ClosedLoop(CROSS, loop), flight, asked) for name, loop in loops.items()}
    gains = TwinGains(source="defaults", name=("MC_ROLLRATE_P",), value=np.array([0.15]))
    return twin_of(flight, asked, twins, LOOP, gains, ["the gains are guessed"], blown(twins["found.h5"]))


def blown(twin):
    """Vehicles in gusts, as if they had flown the same setpoints: nearer than the flight in roll rate alone."""
    channels = {
        CHANNELS[at]: ChannelInGusts(
            rms=0.05,
            drawn=np.array(each),
            noise=0.0,
            inside_share=0.5,
            beyond=at == 0,
            low=twin.simulated[:, at] - 0.1,
            high=twin.simulated[:, at] + 0.1,
        )
        for at, each in {0: [0.001, 0.002, 0.003], 2: [0.1, 0.2, 0.3], 6: [0.5, 0.6, 2.0]}.items()
    }
    return InGusts(vehicle="found.h5", flights=3, lost=1, channels=channels)
