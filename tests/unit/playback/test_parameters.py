"""Numbers of a vehicle: the model that they make, its derivatives, what people read; numbers of configurations."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.playback import vehicle
from cpfls_cli.playback.evaluation import Group, JointNumbers
from cpfls_cli.playback.fit import (
    Fitted,
    FitWindows,
    Uncertainty,
    WindowSet,
    fit,
    loss_of,
    rate_stays,
    uncertainty,
    windows_of,
)
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.parameters import Difference, FreeNumbers, Rules, blocks_of
from cpfls_cli.playback.player import free_runs, player_of
from cpfls_cli.playback.vehicle import differences
from cpfls_cli.playback.windows import Runs, Steps, errors_of_runs
from tests.builders.playback_flights import (
    ADDED_AT,
    ADDED_KG,
    KINDS,
    MIDDLING,
    STATED,
    TRUE_BLOCKS,
    flown,
    loaded,
    truth,
)

RULES = {"one rule": Rules(1, 2), "seesaw": Rules(3, 0)}


@pytest.fixture(scope="module")
def flight():
    return flown(truth(), ("multisine",), duration_s=3.0, seed=5)[0]


def numbers(*given):
    """The free numbers of one configuration."""
    return JointNumbers(FreeNumbers(*given))


def somewhere(free, seed=0):
    """Numbers near the stated ones, none of them where its derivative could vanish."""
    away = 0.05 * free.scales * np.random.default_rng(seed).standard_normal(len(free.numbers))
    return np.clip(free.starts + away, free.lows, free.highs)


@pytest.mark.parametrize(("rules", "every"), [*zip(RULES.values(), (1, 2), strict=True)], ids=RULES)
def test_the_gradient_is_the_difference_quotient_for_every_number(flight, rules, every):
    free = numbers(STATED, blocks_of(STATED), rules)
    values, scale = somewhere(free), free.scales
    starts, steps = flight.starts(20, 40), 20 // every
    windows = WindowSet((FitWindows(flight, starts, loss_of(flight, rate_stays(flight, starts, steps, every)), every),))
    (((gradient,), _),) = windows.derivatives(free, values, [np.zeros(len(starts), dtype=np.int64)])
    gradient = gradient * scale
    step = 1e-5
    for place, number in enumerate(free.numbers):
        moved = step * scale[place] * np.eye(len(values))[place]
        ahead, behind = (windows.errors(free, v)[0].sum() for v in (values + moved, values - moved))
        assert gradient[place] == pytest.approx((ahead - behind) / (2 * step), rel=1e-4, abs=1e-6), number.name


def test_what_acts_by_a_number_of_0_is_left_out_and_its_derivative_is_not(flight):
    free = numbers(STATED, blocks_of(STATED), RULES["one rule"])
    starts = flight.starts(20, 40)
    windows = WindowSet((FitWindows(flight, starts, loss_of(flight, rate_stays(flight, starts, 20))),))
    found, places = [], []
    for values in (free.starts, np.where(free.starts == 0, 1e-9 * free.scales, free.starts)):
        sums = windows.derivatives(free, values, [np.zeros(len(starts), dtype=np.int64)])
        found.append([windows.errors(free, values)[0], *(each * free.scales for each in sums[0])])
        places.append(len(free.at(values).slopes().places))
    assert places[0] < 0.8 * places[1]
    for left_out, whole in zip(*found, strict=True):
        assert left_out == pytest.approx(whole, rel=1e-5, abs=1e-5 * np.abs(whole).max())


def test_the_sum_of_the_loss_is_that_of_the_windows(flight):
    free = numbers(STATED, ("inertia", "linear_damping"), RULES["one rule"])
    (windows,) = windows_of([flight], 0.2, 0.3)
    ((by_group, _),) = WindowSet((windows,)).derivatives(free, free.starts, [np.arange(len(windows.starts))])
    fitted = fit(free, [windows], {}, 0, 1e-3)
    assert WindowSet((windows,)).errors(free, fitted.values)[0].mean() == pytest.approx(fitted.loss, rel=1e-12)
    assert len(by_group) == len(windows.starts)


@pytest.mark.parametrize("rules", RULES.values(), ids=RULES)
@pytest.mark.parametrize("pushed", [False, True], ids=["free", "pushed"])
def test_the_numbers_fly_in_one_function_as_their_model_does(flight, rules, pushed):
    free = numbers(STATED, blocks_of(STATED), rules)
    at, starts = free.at(somewhere(free, seed=1)), flight.starts(30, 50)
    push = np.random.default_rng(0).normal(0.0, 0.02, (30, len(starts), 6)) if pushed else None
    steps = Steps(at.rotor_terms(flight, starts + np.arange(30)[:, None]), push)
    flown = at.flown(flight.motion.period, translates=True, pushed=pushed)
    runs = Runs(flight.motion, starts, translates=True)
    found, expected = (errors_of_runs(each, runs, steps)[0] for each in (flown, at.model.flown))
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-11 * np.abs(expected).max())
    if not pushed:
        played = free_runs(player_of(at.model, flight), flight, starts, 30).errors
        assert played == pytest.approx(expected, rel=1e-9, abs=1e-11 * np.abs(expected).max())


def test_the_stated_numbers_make_the_stated_vehicle():
    free = numbers(STATED, ("inertia", "thrust_factor", "drag_factor", "products"), RULES["one rule"])
    model = free.at(free.starts).model
    assert model.vehicle.inertia_kg_m2[:3] == pytest.approx(STATED.inertia_kg_m2)
    assert (model.vehicle.rotors, model.effects) == (STATED.rotors, ())


def test_numbers_are_read_in_si():
    free = numbers(STATED, ("inertia", "thrust_factor", "slow_actuation"), RULES["one rule"])
    values = free.values({"inertia.log_Iyy": np.log(2.0), "thrust_factor.scale": 0.9, "slow_actuation.log_slow_s": 0.0})
    found = free.physical(values)
    assert found["inertia.Iyy"].value == pytest.approx(2 * STATED.inertia_kg_m2[1])
    assert found["thrust_factor"].value == pytest.approx(0.9 * STATED.rotors[0].thrust_factor_n_s2)
    assert found["slow_actuation.slow_s"].value == pytest.approx(1.0)


def test_a_number_that_the_flight_does_not_show_is_not_determined(flight):
    free = numbers(STATED, ("rotor_gyroscopic", "linear_damping"), RULES["one rule"])
    # Without any yaw effort the rotors' spins cancel, and nothing gyroscopic is left.
    still = flight.speed.mean(axis=1, keepdims=True) * np.ones(4)
    quiet = windows_of([replace(flight, speed=still)], 0.2, 0.2)
    assert uncertainty(fit(free, quiet, {}, 20, 1e-4), quiet).determined.tolist() == [False, True, True, True]


@pytest.mark.parametrize(("of_arm", "determined"), [(0.15, True), (0.3, False)])
def test_a_centre_of_mass_is_determined_where_its_interval_is_less_than_all_that_is_possible(of_arm, determined):
    """Of an arm it can be off by 0.4, whatever the natural size of its number is."""
    free = numbers(STATED, ("com_offset",), RULES["one rule"])
    error = of_arm * free.numbers[0].scale
    spread = Uncertainty(np.eye(2) * error**2, 12, np.ones(2, dtype=bool))
    fitted = Fitted(free, free.starts, 0.0, np.eye(2))
    assert [number.determined for number in vehicle.found_numbers(fitted, spread)] == [determined] * 2


def test_an_interval_ends_at_the_bound_on_which_its_number_sits():
    """Rotors that follow at once are asked for their lag, of which at least 1 ms is believed."""
    flights = flown(VehicleModel(vehicle=STATED), ("multisine", "steps"), duration_s=4.0, noise=MIDDLING, seed=1)
    windows = [own for each in flights for own in windows_of([each], 0.2, 0.2)]
    fitted = fit(numbers(STATED, ("lag", "inertia"), RULES["one rule"]), windows, {}, 30, 1e-5)
    lag, *inertia = vehicle.found_numbers(fitted, uncertainty(fitted, windows))
    assert (lag.value, lag.low, lag.at_bound) == (0.001, 0.001, True)
    assert 0.001 < lag.high < 0.003
    for number in inertia:
        assert number.low < number.value < number.high
        assert not number.at_bound


def test_a_vehicle_as_it_is_stated_has_no_numbers(flight):
    windows = windows_of([flight], 0.2, 0.2)
    fitted = fit(numbers(STATED, (), Rules(0, 0)), windows, {}, 20, 1e-4)
    assert list(vehicle.found_numbers(fitted, uncertainty(fitted, windows))) == []


NO_REMAINDER = Rules(0, 0)
JOINT = JointNumbers(
    FreeNumbers(STATED, TRUE_BLOCKS, NO_REMAINDER), (Group("payload", ("mass", "com_offset", "inertia")),)
)


@pytest.fixture(scope="module")
def flights():
    with_weight = flown(loaded(), KINDS, noise=MIDDLING, seed=51, hold="linear")
    return [
        *flown(truth(), KINDS, noise=MIDDLING, seed=1, hold="linear"),
        *(replace(flight, group="payload") for flight in with_weight),
    ]


@pytest.fixture(scope="module")
def found(flights):
    windows = windows_of(flights, 0.5, 0.6)
    fitted = fit(JOINT, windows, {}, 60, 3e-5)
    return fitted, uncertainty(fitted, windows)


def test_shared_numbers_stand_once_and_own_ones_next_to_them():
    names = [number.name for number in JOINT.numbers]
    assert len(set(names)) == len(names)
    assert names[: len(JOINT.base.numbers)] == [number.name for number in JOINT.base.numbers]
    own = {name.removeprefix("payload: ").split(".")[0] for name in names[len(JOINT.base.numbers) :]}
    assert own == {"mass", "com_offset", "inertia"}


def test_added_mass_and_its_place_are_found(found):
    by_name: dict[str, Difference] = {each.name: each for each in differences(*found)}
    mass = by_name["payload: added mass"]
    assert mass.low < ADDED_KG < mass.high
    assert mass.value == pytest.approx(ADDED_KG, rel=0.06)
    for axis, place in zip("xy", ADDED_AT, strict=True):
        where = by_name[f"payload: place of the added mass, {axis}"]
        assert where.value == pytest.approx(place, abs=0.003)
        assert where.low < place < where.high


def test_model_of_each_configuration_has_its_mass(found):
    fitted, _ = found
    assert fitted.model.vehicle.mass_kg == STATED.mass_kg
    loaded = JOINT.at(fitted.values, "payload").model
    assert loaded.vehicle.mass_kg == pytest.approx(STATED.mass_kg + ADDED_KG, rel=0.003)
    offset = next(each for each in loaded.effects if each.name == "com_offset")
    assert offset.coefficients == pytest.approx(ADDED_KG * ADDED_AT / (STATED.mass_kg + ADDED_KG), rel=0.03)


def test_effects_stay_what_they_are_where_the_inertia_differs():
    """Damping and flapping are torques of the air: a body that gains 2 % does not gain 2 % of them."""
    others = [replace(flight, group="payload") for flight in flown(loaded(), KINDS, seed=51, hold="linear")]
    found = fit(JOINT, windows_of([*flown(truth(), KINDS, seed=1, hold="linear"), *others], 0.5, 0.6), {}, 60, 3e-5)
    for group, flew in (("", truth()), ("payload", loaded())):
        model = JOINT.at(found.values, group).model
        assert model.vehicle.inertia_kg_m2[:3] == pytest.approx(flew.vehicle.inertia_kg_m2, rel=0.001)
        known = {effect.name: effect.coefficients for effect in flew.effects}
        for effect in model.effects:
            assert effect.coefficients == pytest.approx(known[effect.name], rel=0.002)


@pytest.mark.parametrize("blocks", [TRUE_BLOCKS, TRUE_BLOCKS[1:]], ids=["inertia of all", "of the group alone"])
def test_gradient_by_a_number_of_a_group_is_that_of_its_flights(flights, blocks):
    """Against difference quotients, for all numbers, shared ones and those of the group."""
    from cpfls_cli.playback.fit import WindowSet, WindowSums

    windows = windows_of([flights[0], flights[-1]], 0.2, 2.0)
    free = replace(JOINT, base=FreeNumbers(STATED, blocks, NO_REMAINDER))
    windows, values = WindowSet(tuple(windows)), free.starts + 0.1 * free.scales
    both = np.ones(2, dtype=bool)
    gradient = WindowSums(free, windows, values).mean(both).gradient
    for place, scale in enumerate(free.scales):
        step = np.zeros(len(values))
        step[place] = 1e-6 * scale
        ahead, behind = (WindowSums(free, windows, values + sign * step).mean(both).objective for sign in (1, -1))
        assert gradient[place] == pytest.approx((ahead - behind) / 2e-6, rel=2e-4, abs=2e-7)
