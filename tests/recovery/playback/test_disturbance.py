"""Sizes and memories of gusts in flights of known truth, and in flights that are simulated with what was found."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.signals import Signals
from cpfls_cli.flightlog.results import MOTION
from cpfls_cli.playback.disturbance import find_gusts
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.instruments import Repeats, instruments
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.parameters import blocks_of
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.vehicle import find_vehicle
from cpfls_cli.simulation.inverse import measure
from cpfls_cli.simulation.settings import ClosedLoopSettings, SimulationSettings
from cpfls_cli.trajectory.planning import plan
from cpfls_cli.trajectory.settings import TrajectorySettings
from tests.builders.gusty_flights import CALM, GRAVITY, GUSTS, LARGE, MEMORY_S, SMALL, STORM, Flight, gusty_flights

RUNS, PATHS = 4, 3
SETS = {
    ("45 g", "repeats"): (SMALL, GUSTS),
    ("45 g", "setpoints"): (SMALL, GUSTS),
    ("1.5 kg", "repeats"): (LARGE, GUSTS),
    ("1.5 kg", "setpoints"): (LARGE, STORM),
    ("still", "setpoints"): (SMALL, CALM),
}
SHOVE, SHOVE_MEMORY_S = 0.06, 1.0
"""Of `gusty_flights`: acceleration by the largest gust, and its memory."""


def asked(truth, gusts, kind):
    if kind == "repeats":
        return [Flight(truth, gusts, path, RUNS * path + run) for path in (0, 1) for run in range(RUNS)]
    return [Flight(truth, gusts, path, 1, reach=5.0) for path in range(PATHS)]


def given(kind, flown):
    """Take as instruments what is to tell, and nothing else."""
    if kind == "repeats":
        return instruments([replace(flight, setpoints={}) for flight in flown])
    found = instruments(flown)
    return replace(found, repeats=Repeats(tuple({} for _ in found.runs), {}))


@pytest.fixture(scope="module")
def flights():
    """Instruments of the flights of each set, 40 s long."""
    each = {key: asked(*SETS[key], key[1]) for key in SETS}
    flown = gusty_flights([flight for flights in each.values() for flight in flights], 40.0)
    return {key: given(key[1], [next(flown) for _ in flights]) for key, flights in each.items()}


def bodies(truth):
    return np.array([*truth.inertia, *[truth.mass] * 3])


def simulated(model, number):
    """Fly to and fro, with an autopilot of the package in the gusts of a model; runs differ by their gusts alone."""
    legs = {"legs": 7, "displacement_m": 1.0, "period_s": 0.15, "duration_s": 20.0, "sample_time_s": 0.01}
    path = plan(TrajectorySettings(path="straight", direction=(1.0, -0.8, 0.3), yaw_turn_rad=0.0, **legs), GRAVITY)
    loop = ClosedLoopSettings(gusts=True, integration_rate_hz=100.0, rotor_time_constant_s=0.02)
    noise = {"body_rate": SMALL.gyro_noise, "rotor_speed": 2.0}
    settings = SimulationSettings(mode="closed-loop", closed_loop=loop, noise=noise)
    planned = {name: getattr(path, name) for name in (*MOTION, "position", "velocity", "acceleration")}
    rng = np.random.default_rng(number)
    signals = measure(path.time, planned, model.vehicle, settings, rng, model=model).signals
    names = ("body_rate", "attitude", "velocity", "position", "rotor_speed")
    logged = Signals(time=path.time, vehicle=model.vehicle, **{name: signals[name] for name in names})
    return LoggedFlight.of(replace(logged, name=f"simulated-{number}")).playback


@pytest.mark.parametrize("key", [key for key in SETS if key[0] != "still"])
def test_sizes_and_memories_are_those_of_the_truth(flights, key):
    """Of a vehicle whose body is known and whose damping and drag are not, which come again."""
    truth, gusts = SETS[key]
    found = find_gusts(VehicleModel(vehicle=truth.vehicle), flights[key])
    sizes = np.array([*gusts, *[SHOVE * max(gusts)] * 3])
    memories = np.array([*MEMORY_S, *[SHOVE_MEMORY_S] * 3])
    off = np.log(np.array([found.size / bodies(truth) / sizes, found.memory / memories]))
    half = 0.5 * np.log(np.array([found.high / found.low, found.memory_high / found.memory_low]))
    assert found.instrument_kind == key[1]
    assert np.abs(off[0]).max() < 0.25
    assert np.abs(off[1]).max() < 0.5
    # Of twelve intervals of 95 % some do not hold the truth at times.
    assert (np.abs(off) < 1.7 * half).all()
    assert (np.abs(off) < half).sum() >= 9


def test_many_runs_of_a_few_seconds_tell_them_as_well():
    """What was asked of them says that they fly the same paths."""
    found = instruments(list(gusty_flights(asked(SMALL, GUSTS, "repeats"), 6.0)))
    assert found.kind == "repeats"
    gusts = find_gusts(VehicleModel(vehicle=SMALL.vehicle), found)
    sizes = bodies(SMALL)[:3] * GUSTS
    assert np.abs(np.log(gusts.size[:3] / sizes)).max() < 0.4
    assert ((gusts.low[:3] < sizes) & (sizes < gusts.high[:3])).sum() >= 2


def test_in_still_air_torques_of_gusts_have_a_bound(flights):
    found = find_gusts(VehicleModel(vehicle=SMALL.vehicle), flights["still", "setpoints"])
    assert not np.isfinite(found.size[:3]).any()
    assert (found.low[:3] == 0).all()
    assert (found.high[:3] / bodies(SMALL)[:3] < 0.2).all()
    assert found.gusts is None or not found.gusts.size[:3].any()


def alone(known):
    """Forget what was asked, and that paths come again."""
    nothing = Repeats(tuple({} for _ in known.runs), {})
    return replace(known, setpoints=tuple(None for _ in known.runs), names=(), repeats=nothing)


def test_without_instruments_what_was_before_shows_them(flights):
    """What the model lacks of the motion goes on as it was, and is no gust."""
    known, model = flights["45 g", "setpoints"], VehicleModel(vehicle=SMALL.vehicle)
    found, result = find_gusts(model, alone(known)), find_gusts(model, known)
    assert found.instrument_kind == "past"
    assert np.abs(np.log(found.size[:3] / bodies(SMALL)[:3] / GUSTS)).max() < 0.25
    assert np.abs(np.log(found.memory[:3] / MEMORY_S)).max() < 0.5
    assert found.lack is None
    assert result.lack is not None
    # Nor are they asked where nothing told the body.
    bound = find_gusts(model, known, identified=False)
    assert bound.instrument_kind == "none"
    assert bound.gusts is None
    assert (bound.high[:3] > found.size[:3]).all()


def test_without_instruments_nothing_is_said_in_still_air(flights):
    found = find_gusts(VehicleModel(vehicle=SMALL.vehicle), alone(flights["still", "setpoints"]))
    assert found.instrument_kind == "none"
    assert found.gusts is None


def test_next_to_a_body_that_is_not_known_nothing_is(flights):
    found = find_gusts(
        VehicleModel(vehicle=SMALL.vehicle), flights["45 g", "setpoints"], {"inertia.Ixx": True, "inertia.Izz": False}
    )
    assert np.isfinite(found.size).tolist() == [True, True, False, True, True, True]
    assert np.isnan(found.high[2])
    assert found.gusts.size[2] == 0
    assert found.gusts.white[2] == 0
    assert np.isfinite(found.lack.rest).tolist() == [True, True, False, True, True, True]


def test_flights_that_are_short_or_of_several_rates_tell_nothing(flights):
    known, model = flights["45 g", "setpoints"], VehicleModel(vehicle=SMALL.vehicle)
    first, *rest = known.flown
    other = replace(first, motion=first.motion._replace(period=0.02))
    assert find_gusts(model, replace(known, flown=(other, *rest))) is None
    short = tuple(replace(flight, stretches=(slice(0, 500),)) for flight in known.flown)
    assert find_gusts(model, replace(known, flown=short)) is None


def test_a_vehicle_simulated_in_its_own_gusts_shows_the_same(flights):
    """Found in gusts, flown by an autopilot of the package in these gusts, and found again: within the intervals."""
    model = VehicleModel(vehicle=SMALL.vehicle)
    before = find_gusts(model, flights["45 g", "repeats"])
    flown = [simulated(replace(model, gusts=before.gusts), number) for number in range(4)]
    after = find_gusts(model, instruments(flown))
    assert after.instrument_kind == "repeats"
    played = np.log([before.size, before.memory])
    low, high = np.log([after.low, after.memory_low]), np.log([after.high, after.memory_high])
    assert ((low < played) & (played < high)).sum() >= 9
    assert (np.abs(played - 0.5 * (low + high)) < 1.7 * 0.5 * (high - low)).all()


@pytest.mark.parametrize(("runs", "instrument_kind"), [("repeats", "repeats"), ("alone", "past")])
def test_a_vehicle_holds_the_gusts_of_its_flights(flights, runs, instrument_kind):
    """Two runs of two paths tell the body by what was before, and the gusts too. All but the inertia is known."""
    flown = [replace(flight, setpoints={}) for flight in flights["1.5 kg", "repeats"].flown]
    vehicle = replace(LARGE.vehicle, unknown=("inertia",))
    settings = PlaybackSettings(leave_out=tuple(blocks_of(vehicle)), search_windows=20, folds=2)
    known = flown if runs == "repeats" else [flown[0], flown[RUNS]]
    found = find_vehicle(vehicle, known, settings, lambda *_: None)
    assert found.loop.shows_loop
    assert found.instruments.kind == instrument_kind
    assert np.diag(found.model.body.inertia)[:2] == pytest.approx(LARGE.inertia[:2], rel=0.15)
    assert found.disturbance.instrument_kind == instrument_kind
    assert found.model.gusts.size[:2] / LARGE.inertia[:2] == pytest.approx(GUSTS[:2], rel=0.25)
