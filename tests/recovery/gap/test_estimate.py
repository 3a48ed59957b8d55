"""Numbers and their intervals: the truth lies in a 95 % interval in about 95 % of the flights."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.effect import Columns, hub_wrench, stack
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.balance import refine
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.refine import equations, fit
from cpfls_cli.gap.diagnose import diagnose
from cpfls_cli.gap.naming.estimate import earned, estimates, fitted
from cpfls_cli.gap.naming.open_questions import with_unnamed
from cpfls_cli.gap.naming.ranking import best_floor, block_index, rank_effects
from cpfls_cli.gap.naming.search import forward_selection
from cpfls_cli.gap.settings import GapSettings
from tests.builders.closed_loop_flights import flown, signals_of
from tests.builders.gap_flights import VEHICLE, candidate, fly, weak

SETTINGS = GapSettings()
WEIGHT = np.ones(6)
OFFSET, DAMPING = [0.004, -0.003], [0.1, 0.1, 0.05]
TRUTH = [(candidate("com_offset"), OFFSET), (candidate("linear_damping"), DAMPING)]


def estimated(signals, chosen):
    hypothesis = system([weak(each) for each in signals], chosen)
    return estimates(hypothesis, WEIGHT, block_index(hypothesis, SETTINGS))


def refit(signals, chosen, **given):
    """All named effects together, from a start that need not be near."""
    flights = [weak(each, **given) for each in signals]
    return fitted(flights, chosen, best_floor(system(flights, chosen)), SETTINGS)


def numbers_of(found):
    pairs = zip(found.hypothesis.chosen, found.estimates.effects, strict=True)
    return {one.effect.name: {number.name: number.value for number in numbers} for one, numbers in pairs}


def noisy(signals, rng, gyro=0.005, rotor=1.0):
    return replace(
        signals,
        body_rate=signals.body_rate + gyro * rng.standard_normal(signals.body_rate.shape),
        rotor_speed=signals.speed + rotor * rng.standard_normal(signals.speed.shape),
    )


def test_intervals_cover_the_truth_about_as_often_as_they_say():
    """Noise of 60 draws on two flights of 24 s; eight numbers each."""
    clean = [fly(seed, TRUTH) for seed in (1, 2)]
    chosen = [found for found, _ in TRUTH]
    rng = np.random.default_rng(0)
    covered = []
    for _ in range(60):
        found = estimated([noisy(each, rng) for each in clean], chosen)
        numbers = [*found.effects[0], *found.effects[1], *found.parameters[:3]]
        truth = [*OFFSET, *DAMPING, 0.0, 0.0, 0.0]
        covered.append([number.low <= true <= number.high for number, true in zip(numbers, truth, strict=True)])
    assert 0.88 < np.mean(covered) < 0.99
    assert (np.mean(covered, axis=0) > 0.8).all()


def test_exact_flights_give_exact_numbers():
    found = estimated([fly(seed, TRUTH) for seed in (1, 2)], [one for one, _ in TRUTH])
    values = [number.value for effect in found.effects for number in effect]
    np.testing.assert_allclose(values, [*OFFSET, *DAMPING], rtol=2e-3)
    assert [number.name for number in found.effects[0]] == ["c_x", "c_y"]
    np.testing.assert_allclose(np.concatenate(found.of_effect), values)
    assert len(found.parameters) == 10
    assert all(abs(number.value) < 2e-3 for number in found.parameters[:6])


def test_longer_flights_narrow_the_intervals_as_the_root_of_their_length():
    rng, widths = np.random.default_rng(3), []
    for seconds in (24.0, 96.0):
        clean = fly(1, TRUTH[:1], seconds=seconds)
        runs = [estimated([noisy(clean, rng)], [TRUTH[0][0]]).effects[0] for _ in range(15)]
        widths.append(np.mean([number.high - number.low for run in runs for number in run]))
    assert widths[0] / widths[1] == pytest.approx(2, rel=0.3)


@pytest.mark.parametrize("wrong", ["mass", "thrust"])
def test_an_offset_under_a_wrong_mass_or_thrust_is_where_it_is(wrong):
    """Either way the measured force is not that of the rotors as stated, whose torque the offset is known over."""

    def misstated(signals):
        rotors = tuple(
            replace(
                each, thrust_factor_n_s2=each.thrust_factor_n_s2 / 1.2, drag_factor_n_m_s2=each.drag_factor_n_m_s2 / 1.2
            )
            for each in VEHICLE.rotors
        )
        given = {"mass_kg": 1.2 * VEHICLE.mass_kg} if wrong == "mass" else {"rotors": rotors}
        return replace(signals, vehicle=replace(VEHICLE, **given))

    at = (0.012, -0.009)
    flights = [noisy(fly(seed, [(candidate("com_offset"), at)]), np.random.default_rng(seed)) for seed in (1, 2, 3)]
    found = diagnose(*_held_last(map(misstated, flights)), SETTINGS, np.random.default_rng(1)).diagnosis
    offset, numbers = found.effects
    assert (offset.name, numbers.name) == ("com_offset", "parameter_error")
    assert "thrust_scale" in numbers.coefficients
    for name, true in zip(("c_x", "c_y"), at, strict=True):
        assert offset.coefficients[name].low < true < offset.coefficients[name].high
        assert offset.coefficients[name].value == pytest.approx(true, rel=0.03)


@pytest.mark.parametrize("share", [2 / 3, 0.87], ids=["a gap is left", "the thrust would close the gap"])
def test_a_thrust_that_does_not_carry_the_weight_is_not_named(share):
    """What lowers every change of the force, and not its mean, is no thrust, and stays a gap."""

    def damped(signals):
        force = signals.specific_force - [0.0, 0.0, 9.81]
        return replace(signals, specific_force=[0.0, 0.0, 9.81] + force * [1.0, 1.0, share])

    flights = [damped(noisy(fly(seed), np.random.default_rng(seed))) for seed in (1, 2, 3)]
    found = diagnose(*_held_last(flights), SETTINGS, np.random.default_rng(1))
    scale = next(each for each in found.estimates.parameters if each.name == "thrust_scale")
    assert scale.high < -0.1
    assert not any("thrust_scale" in each.coefficients for each in found.diagnosis.effects)
    assert found.diagnosis.verdict == "UNEXPLAINED"


@pytest.mark.parametrize("off", [-0.5, 0.3])
def test_a_wrong_mass_is_named_under_an_accelerometer_that_is_off(off):
    """By more than is usual along z, but by less than the weight that the rotors as stated do not carry."""
    heavy = replace(VEHICLE, mass_kg=1.2 * VEHICLE.mass_kg)
    flights = [noisy(fly(seed), np.random.default_rng(seed)) for seed in (1, 2, 3)]
    along_z = np.array([0.0, 0.0, off])
    logged = [replace(each, vehicle=heavy, specific_force=each.specific_force + along_z) for each in flights]
    found = diagnose(*_held_last(logged), SETTINGS, np.random.default_rng(1)).diagnosis
    assert found.verdict == "NAMED"
    assert found.effects[0].coefficients["thrust_scale"].value == pytest.approx(0.2, abs=0.01)


def _held_last(flights):
    *learned, last = flights
    return learned, [last]


def test_shapes_and_coefficients_of_unit_stand_in_their_places():
    """A delay between two free effects: the order of numbers and their places in the fit must not shift."""
    chosen = [candidate("com_offset"), candidate("channel_delay", delay_s=0.02), candidate("linear_damping")]
    clean = fly(1, TRUTH)
    early = np.column_stack([np.interp(clean.time + 0.02, clean.time, channel) for channel in clean.speed.T])
    found = estimated([noisy(replace(clean, rotor_speed=early), np.random.default_rng(0))], chosen)
    (offset, delay, damping) = found.effects
    np.testing.assert_allclose([number.value for number in offset], OFFSET, rtol=0.1)
    np.testing.assert_allclose([number.value for number in damping], DAMPING, atol=0.02)
    assert (delay[0].name, delay[0].unit, delay[0].value) == ("delay_s", "s", 0.02)
    assert delay[0].low < 0.02 < delay[0].high
    assert delay[0].high - delay[0].low < 0.01
    assert [len(own) for own in found.of_effect] == [2, 0, 3]


def test_wind_is_said_as_wind_with_an_interval_of_its_own():
    drag = 1.5e-3
    truth = [(candidate("wind"), [drag, 4.0 * drag, -3.0 * drag])]
    found = estimated([noisy(fly(seed, truth), np.random.default_rng(seed)) for seed in (1, 2)], [truth[0][0]])
    k_d, x, y = found.effects[0]
    assert (k_d.name, x.unit) == ("k_d", "m/s")
    assert k_d.value == pytest.approx(drag, rel=0.15)
    assert x.low < 4.0 < x.high
    assert y.low < -3.0 < y.high
    assert x.high - x.low < 4
    np.testing.assert_allclose(x.value, found.of_effect[0][1] / found.of_effect[0][0])


def moments_and_coupling(linear):
    """Moments of inertia that rates show about each axis, and how strongly the two other rates couple into it."""
    stated = np.array(VEHICLE.inertia_kg_m2[:3])
    moments = stated * (1 + linear[:3])
    after, later = [1, 2, 0], [2, 0, 1]
    return moments, moments[later] - moments[after] + linear[3:6] * (stated[after] + stated[later]) / 2


def of_vehicle(values):
    known = [coefficient.name for coefficient in CATALOGUE["parameter_error"].coefficients]
    return (candidate("parameter_error"), [values.get(name, 0.0) for name in known])


def test_what_a_vehicle_can_have_is_found_as_it_is():
    hypothesis = system([weak(fly(seed, [of_vehicle({"inertia_x": 0.3, "coupling_y": -0.2})])) for seed in (1, 2)])
    linear = estimates(hypothesis, WEIGHT, block_index(hypothesis, SETTINGS)).linear
    np.testing.assert_array_equal(linear, equations(hypothesis, WEIGHT).solve())
    np.testing.assert_allclose(linear[[0, 4]], [0.3, -0.2], atol=1e-3)


@pytest.mark.parametrize(("axis", "name"), [*enumerate("xyz")])
def test_no_coupling_is_larger_than_three_moments_of_inertia_allow(axis, name):
    """Two moments differ by no more than the third; what couples more has no name among the vehicle's numbers."""
    flights = [fly(seed, [of_vehicle({f"coupling_{name}": 4.0})]) for seed in (1, 2)]
    hypothesis = system([weak(each) for each in flights])
    free, bounded = fit(hypothesis, WEIGHT), estimated(flights, []).linear
    moments, coupling = moments_and_coupling(free)
    assert coupling[axis] > 2 * moments[axis]
    moments, coupling = moments_and_coupling(bounded)
    assert (moments >= 0.1 * np.array(VEHICLE.inertia_kg_m2[:3])).all()
    assert (np.abs(coupling) <= moments * (1 + 1e-9)).all()
    assert coupling[axis] == pytest.approx(moments[axis])


def test_a_log_with_reversed_yaw_is_said_and_not_built_into_the_model():
    rotors = tuple(replace(rotor, spin=-rotor.spin) for rotor in VEHICLE.rotors)
    reversed_yaw = replace(VEHICLE, rotors=rotors)
    found = estimated([replace(fly(seed), vehicle=reversed_yaw) for seed in (1, 2)], [])
    numbers = {number.name: number for number in found.parameters}
    assert numbers["inertia_z"].impossible
    assert not numbers["inertia_x"].impossible
    assert found.linear[2] == pytest.approx(-0.9)


@pytest.mark.parametrize(("slow", "accused"), [("", True), ("the rotors are logged 10 times a second", False)])
def test_rotors_that_are_logged_rarely_accuse_no_log_of_reversed_yaw(slow, accused):
    """Commands that are held between rare samples turn nothing, whatever their signs."""
    reversed_yaw = replace(VEHICLE, rotors=tuple(replace(rotor, spin=-rotor.spin) for rotor in VEHICLE.rotors))
    flights = [noisy(fly(seed), np.random.default_rng(seed)) for seed in (1, 2, 3)]
    recordings = [
        replace(each, vehicle=reversed_yaw, name=f"flight {number}", slow_rotors=slow)
        for number, each in enumerate(flights)
    ]
    found = diagnose(recordings[:2], recordings[2:], GapSettings(shifts=39), np.random.default_rng(1)).diagnosis
    assert any("inertia about z" in each for each in found.contradictions) is accused


def test_a_lag_moves_when_a_damping_comes_next_to_it():
    """Alone the lag takes what the damping does; a shape that stays there would halve it."""
    flight = signals_of(flown(8.0, effects={"motor_lag": [0.05], "linear_damping": [0.1, 0.1, 0.05]}))
    found = refit([flight], [candidate("motor_lag", time_constant_s=0.04), candidate("linear_damping")], force=True)
    numbers = numbers_of(found)
    assert numbers["motor_lag"]["time_constant_s"] == pytest.approx(0.05, rel=0.01)
    np.testing.assert_allclose(list(numbers["linear_damping"].values()), [0.1, 0.1, 0.05], rtol=0.05)


AIR = {
    "wind": [1.5e-3, 4.0, -3.0],
    "inflow": [2e-3],
    "parasitic_drag": {"c_x": 0.05, "c_y": 0.04, "c_z": 0.06, "cr_z": -0.002},
}


def test_wind_blows_on_all_that_the_air_acts_on():
    """Rotor drag, inflow and fuselage in one wind: with still air for the last two, floors of a gap stay."""
    chosen = [candidate(name) for name in AIR]
    noise = {"body_rate": 0.002, "velocity": 0.01, "acceleration": 0.02, "rotor_speed": 0.3}
    found = refit([signals_of(flown(8.0, noise=noise, effects=AIR))], chosen, force=True)
    for effect, numbers in zip(AIR.values(), found.estimates.effects, strict=True):
        true = effect if isinstance(effect, dict) else {n.name: v for n, v in zip(numbers, effect, strict=True)}
        for number in numbers:
            # Twice the half width is nearly four standard errors.
            assert abs(number.value - true.get(number.name, 0.0)) < number.high - number.low
    wind = numbers_of(found)["wind"]
    assert (wind["W_x"], wind["W_y"]) == (pytest.approx(4.0, rel=0.05), pytest.approx(-3.0, rel=0.05))
    there = found.hypothesis
    floor = best_floor(there)
    still = system(there.flights, chosen)
    left = still.residual - still.base @ fit(still, floor), there.residual - there.base @ found.estimates.linear
    before, after = (np.sqrt(np.mean((each / floor) ** 2, axis=0)).max() for each in left)
    assert after < 1.5 < before


HIGH = {"c_x": 0.004, "c_y": -0.003, "c_z": 0.01}


def of_the_centre_of_mass(effect):
    """An offset to all sides, with a drag that has a lever by it."""
    noise = {"body_rate": 0.001, "velocity": 0.01, "acceleration": 0.02, "rotor_speed": 0.3}
    flight = signals_of(flown(8.0, noise=noise, effects={"com_offset": HIGH, "rotor_drag": [1.5e-3]}))
    flights, names = [weak(flight, force=True)], ("rotor_drag", "flapping_moment")
    effects = [*(CATALOGUE[name] for name in names), effect]
    chosen, _ = forward_selection(flights, effects, SETTINGS, np.random.default_rng(0))
    found, refusals = earned(flights, chosen, best_floor(system(flights, chosen)), SETTINGS)
    assert not refusals
    return numbers_of(found)


def test_the_height_of_the_centre_of_mass_is_no_flapping():
    """Nothing is left for a moment of the hubs."""
    numbers = of_the_centre_of_mass(CATALOGUE["com_offset"])
    assert numbers.keys() == {"rotor_drag", "com_offset"}
    assert numbers["com_offset"] == pytest.approx(HIGH, rel=0.1)


def test_a_height_that_ends_on_its_bound_takes_no_offset_with_it(monkeypatch):
    """In gusts the loop gives the centre of mass any height; it is where it is to the front and to the side."""
    effect = CATALOGUE["com_offset"]
    *aside, height = effect.exact.coefficients
    exact = replace(effect.exact, coefficients=(*aside, replace(height, low=-0.02, high=0.02)))
    bounded = replace(effect, exact=exact)
    monkeypatch.setattr(refine, "CATALOGUE", {bounded.name: bounded})
    numbers = of_the_centre_of_mass(bounded)
    assert numbers["com_offset"] == pytest.approx({name: HIGH[name] for name in ("c_x", "c_y")}, rel=0.1)


def test_noise_of_the_height_does_not_weaken_the_ground():
    """The thrust is curved in the height: on a noisy one its mean is more than that of the height itself."""
    rng = np.random.default_rng(5)
    flight = fly(1)
    turn = 2 * np.pi * 0.3
    position, velocity = flight.position.copy(), flight.velocity.copy()
    position[:, 2] = 0.3 + 0.15 * np.sin(turn * flight.time)
    velocity[:, 2] = 0.15 * turn * np.cos(turn * flight.time)
    low = replace(flight, position=position, velocity=velocity)
    ground = candidate("ground_effect", G=3.0)
    pull = ground.effect.columns(low, ground.shape).direct[:, 3:, 0] / low.vehicle.mass_kg
    felt = replace(low, specific_force=low.specific_force + pull)
    noise = {name: getattr(felt, name) + size * rng.standard_normal((len(felt), 3)) for name, size in NOISE.items()}
    found = refit([replace(felt, **noise)], [ground], force=True).estimates.effects[0][0]
    assert found.low < 3.0 < found.high
    assert found.value == pytest.approx(3.0, rel=0.02)


NOISE = {"position": 0.05, "velocity": 0.05, "specific_force": 0.05}


def test_noise_of_rates_and_rotors_shrinks_no_inertia():
    """Least squares of columns as noisy as these make Izz 2.6 % and Ixx 0.7 % too small."""
    truth = [(candidate("rotor_acceleration"), [5e-5])]
    clean = [fly(seed, truth, yaw=0.3) for seed in (1, 2)]
    rng = np.random.default_rng(5)
    found = [
        estimated([noisy(each, rng, gyro=0.05, rotor=6.0) for each in clean], [truth[0][0]]).parameters[:3]
        for _ in range(20)
    ]
    errors = np.array([[number.value for number in numbers] for numbers in found])
    assert np.all(np.abs(errors.mean(axis=0)) < 3 * errors.std(axis=0) / np.sqrt(len(errors)))


def widened(hidden, named):
    """Fit a named effect to flights with what is hidden, and widen its intervals by what else is there."""
    flights = [weak(fly(seed, hidden, gyro=0.002, rotor=1.0), force=True) for seed in (1, 2)]
    effects = [CATALOGUE[name] for name in ("rotor_drag", "parasitic_drag", "inflow", "com_offset", "torque_bias")]
    last = rank_effects(flights, [named], effects, SETTINGS, np.random.default_rng(0))
    found = fitted(flights, [named], last.floor, SETTINGS)
    return found, with_unnamed(found, last, effects, frozenset(), np.random.default_rng(0))


def test_intervals_leave_room_for_what_is_too_small_for_a_name():
    drag, body = candidate("rotor_drag"), candidate("parasitic_drag")
    found, (wider, unnamed, _) = widened([(drag, [1.3e-3]), (body, [0.01, 0.01, 0.01, 0.0, 0.0, 0.0])], drag)
    (alone,), (there,) = found.estimates.effects[0], wider.effects[0]
    assert unnamed == ("parasitic drag of the fuselage",)
    assert alone.low > 1.3e-3
    assert there.low <= 1.3e-3 <= there.high
    assert (there.value, there.high) == (alone.value, alone.high)


def logged_early(seed):
    flown = fly(seed, [(candidate("linear_damping"), DAMPING)], gyro=0.005)
    early = [np.interp(flown.time + 0.004, flown.time, channel) for channel in flown.speed.T]
    return replace(flown, rotor_speed=np.column_stack(early))


def off_and_biased(seed):
    there = [(candidate("com_offset"), [0.0, 0.001]), (candidate("torque_bias"), [0.3, 0.0, 0.0])]
    return fly(seed, there, gyro=0.002)


@pytest.mark.parametrize(
    ("named", "true", "other", "logged"),
    [("linear_damping", DAMPING[0], "channel_delay", logged_early), ("torque_bias", 0.3, "com_offset", off_and_biased)],
    ids=["lag", "rival"],
)
def test_intervals_hold_an_unnamed_lag_or_rival_as_it_is(named, true, other, logged):
    """Neither has a usual size to be small by: rotors that are 4 ms early take a third of a damping."""
    flights, effects = [weak(logged(seed)) for seed in (1, 2)], [CATALOGUE[named], CATALOGUE[other]]
    last = rank_effects(flights, [candidate(named)], effects, SETTINGS, np.random.default_rng(0))
    found = fitted(flights, [candidate(named)], last.floor, SETTINGS)
    wider, unnamed, _ = with_unnamed(found, last, effects, {other}, np.random.default_rng(0))
    assert unnamed == (CATALOGUE[other].title,)
    (alone, *_), (there, *_) = found.estimates.effects[0], wider.effects[0]
    assert not alone.low <= true <= alone.high
    assert there.low <= true <= there.high
    assert (there.low <= alone.low, alone.high <= there.high) == (True, True)


def test_where_nothing_else_is_there_intervals_stay_what_they_are():
    drag = candidate("rotor_drag")
    found, (wider, unnamed, _) = widened([(drag, [1.3e-3])], drag)
    (alone,), (there,) = found.estimates.effects[0], wider.effects[0]
    assert unnamed == ()
    assert there.value == alone.value
    assert there.high - there.low == pytest.approx(alone.high - alone.low, rel=0.1)


def growing(effect):
    """Make an effect grow from nothing at the lowest point of a flight to itself at the highest one."""

    def columns(signals, shape):
        height = signals.position[:, 2]
        share = (height - height.min()) / np.ptp(height)
        return Columns(effect.columns(signals, shape).direct * share[:, None, None])

    return replace(effect, columns=columns)


@pytest.mark.parametrize("over", ["height", ""], ids=["over height", "as it says"])
def test_a_formula_that_bends_by_a_part_that_counts_is_another_one(over):
    drag = candidate("rotor_drag")
    hidden = drag._replace(effect=growing(drag.effect)) if over else drag
    _, (_, _, counting) = widened([(hidden, [1.3e-3])], drag)
    assert ("a bend of rotor drag (H-force) over height" in counting) == bool(over)


def glauert(signals, _shape):
    """Thrust that grows as a rotor's own air speed falls, per k_h: v^2 at first, and less and less of it."""
    hover = 3.0
    squared = (signals.hub_velocity[..., :2] ** 2).sum(axis=-1)
    thrust = 4 * hover * (hover - np.sqrt((np.sqrt(squared**2 + 4 * hover**4) - squared) / 2))
    return Columns(stack(hub_wrench(signals.hubs, thrust[..., None] * np.array([0.0, 0.0, 1.0]))))


def test_an_interval_holds_the_number_of_slow_flight_where_a_formula_bends():
    lift = candidate("translational_lift")
    bending = lift._replace(effect=replace(lift.effect, columns=glauert))
    found, (wider, unnamed, _) = widened([(bending, [0.05])], lift)
    (alone,), (there,) = found.estimates.effects[0], wider.effects[0]
    assert "a bend of translational lift over speed" in unnamed
    assert alone.high < 0.05
    assert there.low <= 0.05 <= there.high
