"""Bounds on the inertia of a vehicle whose autopilot answers gusts: the truth lies between them."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.playback.loop import loop_and_plain, loop_bounds
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.parameters import blocks_of
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.vehicle import find_vehicle
from tests.builders.gusty_flights import CALM, GUSTS, LARGE, SMALL, STORM, Flight, gusty_flights

TRUTHS = {"45 g": SMALL, "1.5 kg": LARGE}
BANDWIDTHS = (6.0, 12.0, 25.0)
SETS = [(name, gusts, bandwidth) for name in TRUTHS for gusts in (CALM, GUSTS, STORM) for bandwidth in BANDWIDTHS]


@pytest.fixture(scope="module")
def flights():
    """Two flights of 20 s of each set, by vehicle, gusts and bandwidth of the attitude loop in rad/s."""
    flown = gusty_flights(
        [
            Flight(TRUTHS[key[0]], key[1], path=2 * place + k, bandwidth=key[2])
            for place, key in enumerate(SETS)
            for k in (0, 1)
        ],
        seconds=20.0,
    )
    pairs = iter(flown)
    return {key: [next(pairs), next(pairs)] for key in SETS}


@pytest.fixture(scope="module")
def bounds(flights):
    """Bounds next to the true model."""
    return {key: loop_bounds(VehicleModel(vehicle=TRUTHS[key[0]].vehicle), flown) for key, flown in flights.items()}


def test_in_still_air_bounds_meet_at_the_truth(bounds):
    """About roll and pitch, which are excited; noise of gyroscope and rotor speeds is in the flights."""
    for (_, gusts, *_), found in bounds.items():
        if gusts == CALM:
            assert found.low[:2] == pytest.approx(1.0, abs=0.1)
            assert found.high[:2] == pytest.approx(1.0, abs=0.1)
            assert found.explained[:2].min() > 0.95


def test_in_gusts_the_truth_lies_between_the_bounds(bounds):
    """About every axis of every set; half a per cent is what numerical integration of the flights leaves."""
    for (_, gusts, *_), found in bounds.items():
        if gusts != CALM:
            assert (np.fmin(found.low, 1.0) <= 1.005).all()
            assert (np.fmax(found.high, 1.0) >= 0.995).all()
            assert (found.low < 1.005).all()
            assert (found.high > 0.995).all()


def test_gusts_of_real_flights_leave_inertia_open_by_more_than_a_factor_of_two(bounds):
    for (_, gusts, bandwidth), found in bounds.items():
        if gusts == GUSTS and bandwidth < 20:
            assert (found.high[:2] / found.low[:2]).min() > 2
            assert found.explained[:2].max() < 0.9


def test_a_body_that_is_found_too_heavy_is_bounded_by_its_truth(flights):
    """Three times the inertia: still air says so to a few per cent, gusts leave it possible."""
    heavy = replace(SMALL.vehicle, inertia_kg_m2=tuple(3 * value for value in SMALL.vehicle.inertia_kg_m2))
    still, gusty = (loop_bounds(VehicleModel(vehicle=heavy), flights["45 g", gusts, 12.0]) for gusts in (CALM, GUSTS))
    assert still.low[:2] == pytest.approx(1 / 3, rel=0.1)
    assert still.high[:2] == pytest.approx(1 / 3, rel=0.1)
    assert (gusty.low < 1 / 3).all()
    assert (gusty.high > 1 / 3).all()


def test_a_torque_that_fades_by_itself_explains_no_answered_gust(flights, bounds):
    """A fit takes slow actuation for what an autopilot does; the bounds of a body stay those of the rotors' torque."""
    key = ("45 g", GUSTS, 12.0)
    model = VehicleModel(vehicle=SMALL.vehicle)
    fading = replace(model, response=replace(model.response, slow_roll_pitch=-1.5, slow_s=0.45))
    for found, expected in zip(loop_bounds(fading, flights[key]), bounds[key], strict=True):
        np.testing.assert_array_equal(found, expected)


def test_a_model_that_explains_nothing_is_not_taken_for_the_loop(flights, bounds):
    """In still air the rotors alone explain what a model with a wrong lag does not; in gusts nothing explains more."""
    wrong = VehicleModel(vehicle=SMALL.vehicle, response=RotorResponse(lag_s=0.8))
    still = flights["45 g", CALM, 12.0]
    assert loop_bounds(wrong, still).shows_loop
    found = loop_and_plain(wrong, SMALL.vehicle, still)
    assert (found.misses, found.shows_loop, found.unexplained) == (True, False, True)
    assert found.explained[:2].min() > 0.95
    np.testing.assert_array_equal(found.missed, loop_bounds(wrong, still).explained)
    # Whatever the config guesses, its rotors alone enclose the body, and the yaw of one whose drag factor is known.
    truth = np.array(SMALL.vehicle.inertia_kg_m2[:3])
    for stated in (3 * truth, truth, 30 * truth, truth / 30, truth * [3, 1, 1]):
        found = loop_and_plain(wrong, replace(SMALL.vehicle, inertia_kg_m2=tuple(stated)), still)
        low, high = found.low * stated, found.high * stated
        assert ((low < truth) & (truth < high) & (high < 1.6 * low)).all()
    for bandwidth in BANDWIDTHS[:2]:
        key = ("45 g", GUSTS, bandwidth)
        gusty = loop_and_plain(VehicleModel(vehicle=SMALL.vehicle), SMALL.vehicle, flights[key])
        assert (gusty.misses, gusty.shows_loop) == (False, True)
        assert gusty.least >= bounds[key].least


def test_what_torque_explains_is_of_no_size(flights):
    """A vehicle a hundred times too heavy or light explains as much; bounds alone end at factors of ten."""
    flown, vehicle = flights["45 g", GUSTS, 12.0], TRUTHS["45 g"].vehicle
    right = loop_bounds(VehicleModel(vehicle=vehicle), flown)
    for factor in (0.01, 100.0):
        inertia = tuple(factor * moment for moment in vehicle.inertia_kg_m2)
        found = loop_bounds(VehicleModel(vehicle=replace(vehicle, inertia_kg_m2=inertia)), flown)
        np.testing.assert_allclose(found.explained[:2], right.explained[:2], rtol=0.02)


def test_a_band_that_the_rotors_are_logged_too_slowly_for_is_not_shown(bounds):
    found = next(iter(bounds.values()))
    found = found._replace(by_band=np.full_like(found.by_band, 0.5))
    slowly, fast = found.up_to(5.0), found.up_to(50.0)
    assert np.isnan(slowly.by_band[-1]).all()
    np.testing.assert_array_equal(slowly.by_band[:-1], found.by_band[:-1])
    np.testing.assert_array_equal(fast.by_band, found.by_band)
    assert found._replace(by_band=np.zeros((0, 3)), band_hz=np.zeros((0, 2))).up_to(5.0).by_band.shape == (0, 3)


@pytest.mark.parametrize("unknown", [("inertia",), ("drag_factor", "inertia", "thrust_factor")])
@pytest.mark.parametrize("share", [0.0, 0.3])
@pytest.mark.parametrize("truth", TRUTHS.values(), ids=TRUTHS)
def test_a_fit_that_explains_no_flight_leaves_a_body_by_bounds(truth, share, unknown):
    """Commands alone, rotors that lag, and no block by which a fit could lag: it finds another response, and a body."""
    late, gusts = truth._replace(lag_s=0.06), tuple(share * size for size in GUSTS)
    # Too short for instruments.
    flown = gusty_flights(
        [Flight(late, gusts, path=path, bandwidth=8.0, reach=3.0, commands=True) for path in range(4)], seconds=7.5
    )
    vehicle = replace(
        late.vehicle, unknown=unknown, inertia_kg_m2=tuple(3 * each for each in truth.vehicle.inertia_kg_m2)
    )
    left_out = tuple(block for block in blocks_of(vehicle) if block != "slow_actuation")
    settings = PlaybackSettings(leave_out=left_out, search_windows=40, folds=2, quick=True)
    found = find_vehicle(vehicle, [replace(each, setpoints={}) for each in flown], settings, lambda *_: None)
    assert found.by_bounds
    numbers = {number.name: number for number in found.numbers}
    assert set(numbers) == {*(f"inertia.{name}" for name in ("Ixx", "Iyy", "Izz")), *unknown} - {"inertia"}
    for name, true in zip(("Ixx", "Iyy"), truth.inertia, strict=False):
        own = numbers[f"inertia.{name}"]
        assert own.low < true < own.high < 1.6 * own.low
        assert own.determined
        assert own.value == pytest.approx(np.sqrt(own.low * own.high))
    np.testing.assert_allclose(np.diag(found.model.body.inertia)[:2], truth.inertia[:2], rtol=0.1)
    ratio = found.model.vehicle.rotors[0].drag_factor_n_m_s2 / found.model.vehicle.inertia_kg_m2[2]
    still = share == 0
    assert numbers["inertia.Izz"].determined == (still and "drag_factor" not in unknown)
    # About yaw still air shows the moment, or its ratio to a drag factor that is not known, and gusts neither.
    if still:
        assert ratio == pytest.approx(truth.drag_factor / truth.inertia[2], rel=0.1)
    assert bool(found.trades) == (still and "drag_factor" in unknown)
    assert [each.name for each in found.structures].count("free") == 1
    assert len(found.correlation) == len(found.numbers)


@pytest.mark.parametrize("truth", TRUTHS.values(), ids=TRUTHS)
def test_in_gusts_a_body_by_bounds_has_rotors_that_only_lag_and_the_fit_stays_a_forecast(truth):
    """What fits best takes an autopilot that answers gusts for rotors that are slow, and for a body."""
    flown = gusty_flights(
        [Flight(truth, GUSTS, path=path, bandwidth=12.0, commands=True) for path in range(4)], seconds=7.5
    )
    guessed = tuple(1.7 * each for each in truth.vehicle.inertia_kg_m2)
    vehicle = replace(truth.vehicle, unknown=("inertia",), inertia_kg_m2=guessed)
    named = ("lag", "delay", "slow_actuation", "linear_damping", "rotor_drag", "torque_bias")
    settings = PlaybackSettings(
        leave_out=tuple(block for block in blocks_of(vehicle) if block not in named),
        search_windows=60,
        folds=3,
        quick=True,
    )
    found = find_vehicle(vehicle, [replace(each, setpoints={}) for each in flown], settings, lambda *_: None)
    assert found.by_bounds
    assert found.forecast is not None
    assert [each.name for each in found.model.effects] == ["torque_bias"]
    assert 0.01 <= found.model.response.lag_s <= 0.05
    assert found.model.response.delay_s == 0
    numbers = {number.name: number for number in found.numbers}
    for name, true in zip(("Ixx", "Iyy"), truth.inertia, strict=False):
        own = numbers[f"inertia.{name}"]
        assert own.low < true < own.high
        assert not own.determined
        assert np.abs(np.log(own.value / true)) < np.log(1.6)
    lag = numbers["lag.time_constant_s"]
    assert lag.low <= truth.lag_s <= lag.high
    # It forecasts no better, as in gusts the true vehicle does not; how well is said.
    errors = {each.name: each.error for each in found.structures}
    assert errors["chosen"] < errors["held"]
