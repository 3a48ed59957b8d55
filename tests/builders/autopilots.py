"""A quadrotor of a common size, flown by the control laws of autopilots, and what their loops do in flight."""

import json
from dataclasses import asdict

import numpy as np
from control import FRD, stability_margins

from cpfls_cli.artifacts.vehicle_model import ResponseMismatch
from cpfls_cli.autopilots.motors import Motors
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.playback.constants import ExplainedBand, Repeat, UsedInstruments
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.parameters import FoundNumber
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulation.autopilot import GyroscopeNoise
from cpfls_cli.simulation.closed_loop import ClosedLoop, Setpoints, clock_of, fly_setpoints
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.tuning.margins import StepAnswer
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.vehicle_models import vehicle_of
from tests.builders.vehicles import alike


def crossed(mass, arm, inertia, thrust, drag, speed_max):
    """An X quadrotor in the order of PX4: kg, m to each hub along x and y, kg m^2, N s^2, N m s^2, rad/s."""
    rotors = alike(((1, -1, 1), (-1, 1, 1), (1, 1, -1), (-1, -1, -1)), thrust, drag, arm)
    return VehicleSettings(mass_kg=mass, inertia_kg_m2=inertia, rotors=rotors, rotor_speed_max_rad_s=speed_max)


CROSS = crossed(1.2, 0.16, (0.011, 0.012, 0.02), 1.0e-5, 1.6e-7, 900.0)
"""An X of 450 mm: 1.2 kg, hovers at 0.36 of its full thrust."""


HIGHEST_HZ = 60.0
"""To which loops are measured in flight."""


def flown_step(autopilot, values, vehicle, lag, axis, *, gusts, noise, seed=1, steps=4, size=0.1, held_s=3.0):
    """Step the asked angle about one axis there and back, in gusts: the mean answer, in parts of the step."""
    law = AUTOPILOTS[autopilot].law(values)
    count, shown = round(held_s * law.rate_hz), round(1.2 * law.rate_hz)
    time = np.arange((2 * steps + 1) * count + 1) / law.rate_hz
    wanted = np.where((np.arange(len(time)) // count) % 2 == 1, size, 0.0)
    flight = _flown(autopilot, values, vehicle, lag, time, wanted[:, None] * np.eye(3)[axis], gusts, noise, seed)
    angle = flight.state[count:-1, 6 + axis].reshape(steps, 2, count)[..., :shown]
    # There and back are the same but for their sign.
    mean = 0.5 * (angle[:, 0] + size - angle[:, 1]).mean(axis=0)
    return StepAnswer(time[:shown], mean[:, None] / size)


def flown_margins(
    autopilot, values, vehicle, lag, axis, *, gusts, noise, lowest_hz, seed=1, periods=8, seconds=2.0, size=0.1
):
    """Measure the loop by sines that are added to its command in flight: gain margin upward, dB, and phase, degrees."""
    law = AUTOPILOTS[autopilot].law(values)
    count = round(seconds * law.rate_hz)
    bins = np.unique(np.geomspace(2, HIGHEST_HZ * seconds, 45).round().astype(int))
    phases = np.random.default_rng(0).uniform(0, 2 * np.pi, len(bins))
    one = np.cos(2 * np.pi * np.outer(np.arange(count), bins) / count + phases).sum(axis=1)
    one *= size / np.abs(one).max()
    time = np.arange((periods + 1) * count + 1) / law.rate_hz
    added = np.zeros((len(time), 3))
    added[:, axis] = np.resize(one, len(time))
    flight = _flown(autopilot, values, vehicle, lag, time, np.zeros((len(time), 3)), gusts, noise, seed, added)
    motors = Motors.of(law.mixer, law.curve, vehicle)
    sent = (np.linalg.pinv(motors.mix) @ motors.curve.thrust(flight.command / motors.speed_max).T)[1 + axis]
    # A command acts a step late and is logged as the mean of two: so is what was added.
    late = np.roll(one, 1)
    heard = 0.5 * (late + np.roll(late, 1))
    whole = sent[count : (periods + 1) * count].reshape(periods, count).mean(axis=0)
    total, put = np.fft.fft(whole)[bins], np.fft.fft(heard)[bins]
    loop = (put - total) / total
    # Below, gusts are larger than what was added, and the loop is far from -1.
    shown = bins / seconds >= lowest_hz
    _, phase, *_ = stability_margins(FRD(loop[shown], 2 * np.pi * bins[shown] / seconds))
    return upward_gain_db(bins[shown] / seconds, loop[shown]), abs(phase)


def upward_gain_db(frequency, loop):
    """By how much the gain of a loop may rise, up to `HIGHEST_HZ`, dB; NaN where no crossing says so."""
    gains, _, _, turns, *_ = stability_margins(FRD(loop, 2 * np.pi * frequency), returnall=True)
    upward = [gain for gain, turn in zip(gains, turns, strict=True) if gain > 1 and turn <= 2 * np.pi * HIGHEST_HZ]
    return 20 * np.log10(min(upward)) if upward else np.nan


def _flown(autopilot, values, vehicle, lag, time, attitude, gusts, noise, seed, added=None):
    rng = np.random.default_rng(seed)
    settings = ClosedLoopSettings(
        autopilot=autopilot, autopilot_parameters=values, rotor_time_constant_s=lag, integration_rate_hz=1.0
    )
    law = settings.law
    clock = clock_of(time, settings)
    push = gusts.drawn(rng, clock.step, clock.steps)
    motors = Motors.of(law.mixer, law.curve, vehicle)
    lift = sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors)
    share = motors.share_of(float(np.sqrt(vehicle.mass_kg * vehicle.gravity_m_s2 / lift)))
    setpoints = Setpoints(attitude, None, np.full(len(time), share))
    loop, heard = ClosedLoop(vehicle, settings), GyroscopeNoise(noise, rng)
    return fly_setpoints(loop, time, setpoints, np.zeros(12), push, heard, injected=added)


STUDY = f"vehicle: {json.dumps(asdict(CROSS))}\n"
"""Config of `CROSS`."""


def found_vehicle(vehicle=CROSS, *, commanded=True, instrumented=True):
    """A vehicle that is good for simulation and control, as if flights had identified it."""
    model = VehicleModel(vehicle=vehicle, response=RotorResponse(lag_s=0.03), commanded=commanded)
    names = ("inertia.Ixx", "inertia.Iyy", "inertia.Izz", "lag.time_constant_s")
    values = zip(names, (*vehicle.inertia_kg_m2, 0.03), (0.05, 0.05, 0.08, 0.1), strict=True)
    instruments = UsedInstruments(
        kind="repeats",
        repeats=(Repeat(0, 1, 0.95),),
        bands=(ExplainedBand(1.0, 4.0, np.full(3, 0.98), True),),
        explained=np.full(3, 0.98),
        explained_error=np.full(3, 0.01),
    )
    return vehicle_of(
        model,
        numbers=tuple(
            FoundNumber(
                name,
                "s" if "lag" in name else "kg m^2",
                value,
                value - share * value,
                value + share * value,
                np.nan if "lag" in name else value,
                True,
                False,
            )
            for name, value, share in values
        ),
        correlation=np.eye(len(names)),
        instruments=instruments if instrumented else None,
        responses=tuple(ResponseMismatch(name, 20.0, 1.0, 5.0) for name in ("roll", "pitch")),
    )
