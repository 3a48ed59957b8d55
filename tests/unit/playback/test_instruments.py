"""What moves flights apart from their gusts: runs of one path, found and aligned, and setpoints from outside."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.playback.flight import MeasuredMotion, PlaybackFlight
from cpfls_cli.playback.instruments import instruments

PERIOD = 0.01


def _flown(path, late=0.0, drift=1.0, seconds=30.0, **given):
    """Fly a path of sines that begins so many seconds late, by a clock that runs so much faster."""
    rng = np.random.default_rng(path)
    turns, size, phase = rng.uniform(0.5, 6.0, (3, 5)), rng.uniform(0.5, 1.0, (3, 5)), rng.uniform(0, 6.0, (3, 5))
    time = drift * np.arange(round(seconds / PERIOD)) * PERIOD + late
    angle = turns * time[:, None, None] + phase
    velocity, rate = (size * np.sin(angle)).sum(axis=2), (size * turns * np.cos(angle)).sum(axis=2)
    count = len(time)
    motion = MeasuredMotion(velocity, velocity, np.tile(np.eye(3), (count, 1, 1)), rate, PERIOD)
    whole = (slice(0, count),)
    return PlaybackFlight(
        name=f"path-{path}", motion=motion, speed=np.ones((count, 4)), hold="linear", stretches=whole, **given
    )


@pytest.mark.parametrize("has_velocity", [True, False])
def test_runs_of_a_path_are_found_however_late_they_begin(has_velocity):
    flights = [
        _flown(1, has_velocity=has_velocity),
        _flown(2, has_velocity=has_velocity),
        _flown(1, late=3.217, has_velocity=has_velocity),
        _flown(2, late=-1.5, has_velocity=has_velocity),
    ]
    found = instruments(flights)
    assert found.kind == "repeats"
    assert found.repeats.paths() == ((0, 2), (1, 3))
    assert min(found.repeats.likeness.values()) > 0.95


def test_runs_are_aligned_though_their_clocks_drift():
    first, second = _flown(1), _flown(1, late=1.0, drift=1.002)
    place = instruments([first, second]).repeats.places[0][1]
    known = np.isfinite(place)
    # The same place of the path by both clocks: t = 1.002 t' + 1.
    assert place[known] * PERIOD == pytest.approx((np.arange(3000)[known] * PERIOD - 1.0) / 1.002, abs=0.02)
    assert known.mean() > 0.9


def test_a_flight_that_is_asked_its_path_again_is_cut_into_its_runs():
    """One log holds all runs of a mission; each is an instrument for the others, and for the flight."""
    whole = _flown(1, seconds=60.0)
    motion = whole.motion
    # From the last place of a run back to the first, as fast as a mission would.
    again = [np.concatenate([values[:1500]] * 4) for values in motion[:-1]]
    flight = replace(whole, motion=MeasuredMotion(*again, PERIOD), setpoints={"position": again[0]})
    found = instruments([flight, _flown(2)])
    assert [run.flight for run in found.runs] == [0, 0, 0, 0, 1]
    assert [run.part.start for run in found.runs[:4]] == pytest.approx([0, 1500, 3000, 4500], abs=10)
    assert found.repeats.paths() == ((0, 1, 2, 3),)
    assert found.flights == {0}
    beside, none = found.by_flight([flight.motion.rate[:, 0], motion.rate[:, 0]])
    assert none is None
    known = np.isfinite(beside[:, 0])
    assert known.mean() > 0.9
    assert np.corrcoef(beside[known, 0], flight.motion.rate[known, 0])[0, 1] > 0.95


def test_what_other_runs_have_at_the_same_place_is_averaged():
    flights = [_flown(1), _flown(1, late=0.5), _flown(1, late=1.25)]
    repeats = instruments(flights).repeats
    others = repeats.others(0, [flight.motion.rate for flight in flights])
    known = np.isfinite(others).all(axis=1)
    assert others[known] == pytest.approx(flights[0].motion.rate[known], abs=0.2)
    assert np.isnan(repeats.others(0, [flight.motion.rate for flight in [flights[0], *flights[1:]]])[:40]).all()


def test_runs_that_are_too_short_to_look_alike_are_said_by_what_was_asked_of_them():
    """Of six seconds chance makes unlike paths alike; nobody is asked the same place by chance."""
    asked = {late: _flown(1, late=late, seconds=6.0).motion.position for late in (0.0, 0.4)}
    asked[3.0] = 0.7 * asked[0.0]
    short = [replace(_flown(1, late=late, seconds=6.0), setpoints={"position": own}) for late, own in asked.items()]
    assert instruments([replace(flight, setpoints={}) for flight in short]).kind == "none"
    found = instruments(short)
    # The last is asked the same path, and smaller.
    assert found.repeats.paths() == ((0, 1),)
    place = found.repeats.places[0][1]
    known = np.isfinite(place)
    assert place[known] == pytest.approx(np.arange(600)[known] - 40, abs=3)
    still = [replace(flight, setpoints={"position": np.ones((600, 3))}) for flight in short]
    assert instruments(still).kind == "none"


def test_paths_that_differ_repeat_nothing():
    found = instruments([_flown(path) for path in range(6)])
    assert found.kind == "none"
    assert found.by_flight([flight.motion.rate[:, 0] for flight in [_flown(path) for path in range(6)]]) == [None] * 6


def test_setpoints_from_outside_of_the_loops_are_instruments_and_others_are_none():
    flight = _flown(1)
    position, still = flight.motion.position, np.zeros((len(flight), 3))
    asked = {"position": position, "velocity": position, "attitude": position, "body_rate": position}
    assert instruments([replace(flight, setpoints=asked)]).names == ("position",)
    assert instruments([replace(flight, setpoints=asked | {"position": still})]).names == ("velocity",)
    # What does not move shows nothing, and loops ask for attitude and thrust.
    for others in ({"position": still}, {"attitude": position, "thrust": position[:, :1]}):
        assert instruments([replace(flight, setpoints=others)]).kind == "none"
    found = instruments([replace(flight, setpoints={"sticks": position}), _flown(2)])
    assert found.kind == "setpoints"
    assert found.setpoints[1] is None


def test_flights_that_log_other_setpoints_than_most_have_none():
    """One answer is predicted of all: four sticks and three places cannot stand in one column."""
    flights = [_flown(path) for path in (1, 2, 3)]
    asked = [{"position": flight.motion.position} for flight in flights[:2]]
    asked.append({"sticks": np.hstack([flights[2].motion.position, flights[2].motion.position[:, :1]])})
    found = instruments([replace(flight, setpoints=own) for flight, own in zip(flights, asked, strict=True)])
    assert found.names == ("position",)
    assert [each is None for each in found.setpoints] == [False, False, True]
    # Sticks that lie still in one flight are left out of both.
    still = {"sticks": np.zeros((len(flights[0]), 4))}
    moves = {"sticks": np.hstack([flights[1].motion.position, flights[1].motion.position[:, :1]])}
    both = [replace(flights[0], setpoints=asked[0] | still), replace(flights[1], setpoints=asked[1] | moves)]
    found = instruments(both)
    assert found.names == ("position",)
    assert [each.shape[1] for each in found.setpoints] == [3, 3]
