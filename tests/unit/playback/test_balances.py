"""Balances of torque and force, and what moves flights apart from their gusts: runs of one path, and setpoints."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.playback.balances import Balances, PastBalances
from cpfls_cli.playback.evaluation import ParameterPoint
from cpfls_cli.playback.flight import MeasuredMotion, PlaybackFlight
from cpfls_cli.playback.instruments import instruments
from cpfls_cli.playback.parameters import LEARNED, FreeNumbers, Rules, blocks_of
from cpfls_cli.rotations import rotation_matrix
from tests.builders.playback_flights import STATED, flown, truth

FREE = FreeNumbers(STATED, blocks_of(STATED), Rules(1, 0))
NAMED = replace(FREE, chosen=tuple(block for block in FREE.chosen if block not in LEARNED))
PERIOD = 0.01


@pytest.fixture(scope="module")
def flights():
    """Two runs of a path with other noise, and a flight that was asked where to be."""
    run, other = flown(truth(), ("multisine", "steps"), duration_s=12.0, seed=5)
    rng = np.random.default_rng(0)
    again = replace(run, speed=run.speed + rng.normal(0.0, 3.0, run.speed.shape))
    asked = {"position": other.motion.position + 0.1 * rng.standard_normal((len(other), 3))}
    return [run, again, replace(other, setpoints=asked, stretches=(slice(0, 500), slice(500, len(other))))]


def somewhere(seed=0, free=FREE):
    """Numbers near the stated ones, none of them where its derivative could vanish."""
    start, scale, low, high = np.array([(each.start, each.scale, each.low, each.high) for each in free.numbers]).T
    return np.clip(start + 0.05 * scale * np.random.default_rng(seed).standard_normal(len(start)), low, high)


def balances_of(flights, kind=Balances):
    given = instruments(flights)
    return kind(given.flown, given)


def squares(sums):
    """The residual's own products, ZtX, XtX and ZtZ, shape (3, block, band, axis)."""
    return np.stack([own[..., 0, 0] for own in sums[:3]])


def test_slopes_are_difference_quotients_for_every_number(flights):
    balances, values, step = balances_of(flights), somewhere(free=NAMED), 1e-4
    here = balances.sums(NAMED, values)
    for place, number in enumerate(NAMED.numbers):
        moved = step * number.scale * np.eye(len(values))[place]
        ahead, behind = (squares(balances.sums(NAMED, each)) for each in (values + moved, values - moved))
        # A product's slope has that of either factor.
        slopes = np.stack([own[..., 0, 1 + place] + own[..., 1 + place, 0] for own in here[:3]])
        own = np.stack([each[..., 1 + place, 1 + place] for each in here[:3]])
        # Some averages over a band are rounding: that of what stays the same.
        size = np.sqrt(np.abs(squares(here) * own)).max(axis=(1, 3), keepdims=True) + 1e-9 * np.abs(squares(here)).max()
        assert (np.abs((ahead - behind) / (2 * step) - slopes) <= 1e-5 * size).all(), number.name


@pytest.mark.parametrize("kind", [Balances, PastBalances])
def test_what_follows_from_an_evaluation_is_what_another_gives(flights, kind):
    """Of other numbers, and of fewer: a vehicle is evaluated again only where its rotors respond otherwise."""
    balances = balances_of(flights, kind)
    balances.sums(FREE, somewhere(1))
    fewer = replace(FREE, chosen=("inertia", "drag_factor", "rotor_mismatch", "linear_damping"))
    values = somewhere(2)
    for name, place in FREE.index.items():
        if name.split(".")[0] in ("lag", "delay", "slow_actuation"):
            values[place] = somewhere(1)[place]
    for free, own in ((FREE, values), (fewer, np.array([values[FREE.index[name]] for name in fewer.index]))):
        found, fresh = balances.sums(free, own), balances_of(flights, kind).sums(free, own)
        for one, other in zip(found, fresh, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11 * np.abs(other).max())


@pytest.mark.parametrize("kind", [Balances, PastBalances])
def test_a_stretch_shorter_than_a_window_adds_nothing(flights, kind):
    *others, last = flights
    long = slice(0, 500), slice(520, len(last))
    without, added = (replace(last, stretches=each) for each in (long, (long[0], slice(505, 515), long[1])))
    of_each = (balances_of([*others, each], kind).sums(NAMED, somewhere(free=NAMED)) for each in (without, added))
    for one, other in zip(*of_each, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11 * np.abs(other).max())


@pytest.mark.parametrize("kind", [Balances, PastBalances])
def test_flights_of_which_one_has_no_velocity_are_balanced_in_rotation(flights, kind):
    none = [replace(each, has_velocity=False) for each in flights]
    mixed = (balances_of(each, kind) for each in ([none[0], *flights[1:]], none))
    for one, other in zip(*(each.sums(NAMED, somewhere(free=NAMED)) for each in mixed), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11 * np.abs(other).max())


def test_the_residual_is_what_the_model_leaves_of_the_motion(flights):
    """By the model of the numbers, flight by flight and window by window."""
    balances, values = balances_of(flights[2:]), somewhere(3)
    sums = balances.sums(FREE, values)
    at, (flight,) = ParameterPoint(FREE, values), balances.flights
    motion, model, stretches = flight.motion, at.model, flight.stretches
    terms = np.concatenate(
        [model.response.terms_at_samples(flight.speed[part], motion.period, flight.hold) for part in stretches]
    )
    wrench = model.wrench(np.einsum("tji,tj->ti", motion.rotation, motion.velocity), motion.rate, terms)
    momentum = motion.rate @ at.inertia
    torque = np.cross(motion.rate, momentum) - wrench[:, :3]
    force = np.array([0.0, 0.0, STATED.gravity_m_s2 * STATED.mass_kg]) - np.einsum(
        "tij,tj->ti", motion.rotation, wrench[:, 3:]
    )
    bands = len(balances.bands_hz)
    for number, band in enumerate(balances.bands):
        changing, acting = (momentum, torque) if number < bands else (STATED.mass_kg * motion.velocity, force)
        residual = band.balance(acting, changing, stretches)
        assert sums.xtx[:, number, :, 0, 0].sum(axis=0) == pytest.approx((residual**2).sum(axis=0), rel=1e-9)


def test_effects_of_motion_and_rotors_are_the_blocks_that_are_tried():
    of_air = {"inflow", "parasitic_drag", "rotor_drag", "translational_lift"}
    of_motion = {"flapping_moment", "linear_damping", "quadratic_damping", "rolling_moment", "rotor_plane_damping"}
    of_rotors = {"rotor_acceleration", "rotor_gyroscopic", "rotor_mismatch", "com_offset", "torque_bias"}
    of_rotors |= {"rotor_tilt", "thrust_slope"}
    assert set(blocks_of(STATED)) & set(CATALOGUE) == of_air | of_motion | of_rotors


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
    assert (found.kind, found.repeats.paths()) == ("repeats", ((0, 2), (1, 3)))
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
    assert (found.repeats.paths(), found.flights) == (((0, 1, 2, 3),), {0})
    beside, none = found.by_flight([flight.motion.rate[:, 0], motion.rate[:, 0]])
    assert none is None
    known = np.isfinite(beside[:, 0])
    assert known.mean() > 0.9
    assert np.corrcoef(beside[known, 0], flight.motion.rate[known, 0])[0, 1] > 0.95


def _turned(flight, heading):
    """Turn a flight about the vertical, shape (time,), as the same place of its path flown with another heading."""
    none = np.zeros_like(heading)
    turn = rotation_matrix(np.column_stack([none, none, heading]))
    rate = np.einsum("tji,tj->ti", turn, flight.motion.rate)
    return replace(flight, motion=flight.motion._replace(rotation=turn @ flight.motion.rotation, rate=rate))


def _in_turn(heading):
    """A flight that is asked for its path of 15 s four times."""
    whole = _flown(1, seconds=60.0)
    motion = MeasuredMotion(*(np.concatenate([values[:1500]] * 4) for values in whole.motion[:-1]), PERIOD)
    return _turned(replace(whole, motion=motion, setpoints={"position": motion.position}), heading)


@pytest.mark.parametrize("begin", [0.0, 3.1])
def test_a_path_flown_again_with_another_heading_is_no_run_of_it(begin):
    """About its own axes a body moves otherwise then, and what its model lacks in yaw is not repeatable there."""
    assert len(instruments([_in_turn(begin + np.linspace(0.0, 8.0 * np.pi / 3.0, 6000))]).runs) == 1


@pytest.mark.parametrize("heading", [0.0, 3.1])
def test_a_heading_that_gusts_move_makes_no_other_path(heading):
    """In storms it swings by half a radian, also about the half turn where its angle jumps."""
    swings = 0.7 * np.sin(np.pi / 6.0 * np.arange(6000) * PERIOD) + heading
    assert len(instruments([_in_turn(swings)]).runs) == 4


def test_a_heading_that_is_not_known_makes_no_other_path():
    """What a flight without attitude has for one is no rotation, which says nothing against its own later one."""
    assert len(instruments([replace(_in_turn(np.linspace(0.0, 8.4, 6000)), has_attitude=False)]).runs) == 4


@pytest.mark.parametrize("place", [1.0, 0.1, -2.3])
def test_a_flight_that_holds_its_place_repeats_nothing(place):
    """The mean of equal numbers is not that number everywhere, and what rounding leaves is no path."""
    flights = [replace(_flown(path), setpoints={"position": np.full((3000, 3), place)}) for path in (1, 2)]
    found = instruments(flights)
    assert (len(found.runs), found.kind) == (2, "none")


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
