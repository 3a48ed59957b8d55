"""Constants that no config states: where their fit begins, and what shows the scale."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from cpfls_cli.config.load import validate
from cpfls_cli.effects.signals import Signals
from cpfls_cli.playback.constants import Constants
from cpfls_cli.playback.fit import Fitted
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.loop import LoopBounds, _explained, _factors
from cpfls_cli.playback.parameters import LAG, FoundNumber, blocks_of
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.vehicle import bodily, find_vehicle, held_by_bounds, widened_by_loop, within_samples
from cpfls_cli.playback.weight import CommandedThrust, carrying_weight, commanded_thrust, widened_by_law
from cpfls_cli.stages.vehicle import supplied_alike
from tests.builders.playback_flights import MIDDLING, STATED, TRUE_BLOCKS, flown, truth

TRUE = truth()
OPEN = validate(
    {
        "vehicle": {
            "mass_kg": STATED.mass_kg,
            "inertia_kg_m2": None,
            "rotor_speed_max_rad_s": 1500.0,
            "rotors": [
                {"position_m": list(each.position_m), "spin": each.spin}
                | dict.fromkeys(("thrust_factor_n_s2", "drag_factor_n_m_s2"))
                for each in STATED.rotors
            ],
        }
    },
    "here",
).vehicle
SETTINGS = PlaybackSettings(
    search_windows=60, leave_out=tuple(block for block in blocks_of(STATED) if block not in TRUE_BLOCKS)
)
LOOP = LoopBounds(np.array([0.8, 0.5, np.nan]), np.array([1.1, 1.6, np.nan]), np.array([0.95, 0.6, np.nan]))


def found(flights):
    vehicle = find_vehicle(OPEN, flights, SETTINGS, lambda *_: None)
    return vehicle, {number.name: number for number in vehicle.numbers}


def test_guesses_are_of_the_right_size():
    assert set(OPEN.unknown) == {"thrust_factor", "drag_factor", "inertia"}
    guess, true = np.array(OPEN.inertia_kg_m2), np.array(TRUE.vehicle.inertia_kg_m2)
    assert ((guess / true < 3) & (guess / true > 1 / 3)).all()


def without_velocity(flights, accelerometer):
    """The same flights as a log without position and velocity has them."""
    gravity = np.array([0.0, 0.0, STATED.gravity_m_s2])
    changed = []
    for flight in flights:
        motion = flight.motion
        acceleration = np.gradient(motion.velocity, motion.period, axis=0)
        force = np.einsum("tji,tj->ti", motion.rotation, acceleration + gravity) if accelerometer else None
        changed.append(replace(flight, has_velocity=False, has_position=False, specific_force=force))
    return changed


def test_an_accelerometer_shows_thrust_where_velocity_is_not_known():
    # Without velocity nothing shows what the air does to a moving rotor, so this vehicle knows damping alone.
    flights = flown(replace(TRUE, effects=TRUE.effects[:1]), noise=MIDDLING, seed=2, hold="linear")
    vehicle, by_name = found(without_velocity(flights, accelerometer=True))
    factor = by_name["thrust_factor"]
    true = TRUE.vehicle.rotors[0].thrust_factor_n_s2
    assert factor.determined
    assert factor.value == pytest.approx(true, rel=0.03)
    assert by_name["inertia.Ixx"].value == pytest.approx(TRUE.vehicle.inertia_kg_m2[0], rel=0.1)
    assert vehicle.guessed == ()


def test_without_velocity_and_accelerometer_the_thrust_factor_stays_open():
    vehicle, by_name = found(without_velocity(flown(TRUE, noise=MIDDLING, seed=1, hold="linear"), accelerometer=False))
    assert vehicle.guessed == ("thrust_factor",)
    assert "thrust_factor" not in by_name


def noise_alone(force, lift):
    """What gives a thrust factor of next to nothing, with an interval of more than any number on either side."""
    drawn = np.random.default_rng(3).normal(0.0, 3.0, force.shape)
    return drawn - (lift @ drawn) / lift.sum() + 1e-9


@pytest.mark.parametrize(
    "sensed", [noise_alone, lambda force, _: -force, lambda force, _: 0.0 * force], ids=["noise", "upside down", "dead"]
)
def test_an_accelerometer_that_feels_no_lift_leaves_the_thrust_factor_open(sensed):
    flights = [
        replace(flight, specific_force=sensed(flight.specific_force, (flight.speed**2).sum(axis=1)))
        for flight in without_velocity(flown(TRUE, noise=MIDDLING, seed=1, hold="linear"), accelerometer=True)
    ]
    vehicle, result = carrying_weight(OPEN, flights)
    assert result == ()
    squares = np.concatenate([(flight.speed**2).sum(axis=1) for flight in flights])
    for rotor in vehicle.rotors:
        weight = STATED.mass_kg * STATED.gravity_m_s2
        assert rotor.thrust_factor_n_s2 * squares.mean() == pytest.approx(weight)


@pytest.mark.parametrize("off", [0.75, 1.3, 1.005])
def test_a_stated_thrust_factor_gives_way_to_an_accelerometer_that_contradicts_it(off):
    flights = without_velocity(flown(TRUE, noise=MIDDLING, seed=2, hold="linear"), accelerometer=True)
    true = TRUE.vehicle.rotors[0].thrust_factor_n_s2
    vehicle, sensed = carrying_weight(replace(TRUE.vehicle, rotors=with_thrust(off * true)), flights)
    if abs(off - 1) < 0.01:
        assert sensed == ()
    else:
        (number,) = sensed
        assert number.stated == pytest.approx(off * true)
        assert number.value == pytest.approx(true, rel=0.02)
    assert vehicle.rotors[0].thrust_factor_n_s2 == pytest.approx(off * true if sensed == () else true, rel=0.02)


def with_thrust(factor):
    return tuple(replace(rotor, thrust_factor_n_s2=factor) for rotor in TRUE.vehicle.rotors)


def memory(rng, size, seconds, period, samples):
    """Noise that is forgotten in so many seconds."""
    keep = np.exp(-period / seconds)
    return lfilter([size * np.sqrt(1 - keep**2)], [1.0, -keep], rng.standard_normal(samples))


def emptying(*, power=2.0, linear=0.3, gust=0.5, sensor="velocity", voltage=True, commanded=True, seed=0):
    """A vehicle that climbs and descends by commands while its battery empties, in gusts that its autopilot answers."""
    rng, period, samples = np.random.default_rng(seed), 0.02, 3000
    own = STATED.gravity_m_s2
    blown, asked = (memory(rng, size, 1.0, period, samples) for size in (gust, 0.8))
    answered = lfilter([0.05], [1.0, -0.95], blown)
    pulled = own + asked - 0.7 * answered
    volts = np.linspace(1.0, 0.88, samples)
    most = STATED.rotor_speed_max_rad_s
    # Of thrust that is linear and square in the command, at 40 % in hover; each rotor carries as much.
    share = pulled / own * (linear * 0.4 + (1 - linear) * 0.16)
    command = (-linear + np.sqrt(linear**2 + 4 * (1 - linear) * share)) / (2 * (1 - linear)) * volts ** (-power / 2)
    speed = most * command[:, None] * (1 + rng.normal(0.0, 0.003, (samples, 4)))
    climb = np.cumsum(asked + blown - 0.7 * answered) * period + rng.normal(0.0, 0.02, samples)
    zero = np.zeros((samples, 3))
    known = {"velocity": np.column_stack([zero[:, :2], climb]), "attitude": zero}
    if sensor == "accelerometer":
        # What a gust pushes is felt, too.
        known = {"specific_force": np.column_stack([zero[:, :2], pulled + blown + rng.normal(0.02, 0.3, samples)])}
    signals = Signals(
        time=period * np.arange(samples),
        body_rate=zero + rng.normal(0.0, 0.02, (samples, 3)),
        vehicle=STATED,
        rotor_speed=speed,
        commanded=commanded,
        voltage=volts + rng.normal(0.0, 0.002, samples) if voltage else None,
        **known,
    )
    return LoggedFlight.of(signals)


@pytest.mark.parametrize("sensor", ["velocity", "accelerometer"])
@pytest.mark.parametrize(("power", "gust"), [(1.6, 0.0), (2.0, 0.5), (2.4, 0.5)])
def test_what_carries_the_weight_shows_how_commands_go_with_the_voltage(power, gust, sensor):
    found = commanded_thrust([emptying(power=power, gust=gust, sensor=sensor)])
    (number,) = found.numbers
    assert number.low <= power <= number.high
    assert number.high - number.low < (0.1 if gust == 0.0 else 1.2)
    # A square that is 30 % linear, at 40 % of the largest command.
    low, high = found.rises
    assert low - 0.01 <= (0.5 * 0.3 + 0.7 * 0.4) / (0.3 + 0.7 * 0.4) <= high
    flight = emptying(power=power, gust=gust, sensor=sensor)
    full = flight.parts[0].voltage[:, None] ** (number.value / 2) * flight.playback.speed
    # Noise of the voltage does not turn the rotors.
    np.testing.assert_allclose(found.acting(flight).speed, full, rtol=0.02)
    # The thrust of a full battery is as open as the power over what the battery lost in the mean.
    assert found.full == pytest.approx(
        (0.94 ** (number.value - number.low), 0.94 ** (number.value - number.high)), rel=0.01
    )
    thrust = FoundNumber("thrust_factor", "", 1.0, 0.99, 1.01, np.nan, True, False)
    wide = next(widened_by_law([thrust], found))
    assert (wide.low, wide.high) == pytest.approx((0.99 * found.full[0], 1.01 * found.full[1]))


def loaded(flight, discharge, *, power=2.0, resistance=0.06, seed=0):
    """The same where what carries the weight also varies with what no log has, and a command draws the voltage down."""
    own, rng = flight.parts[0], np.random.default_rng(100 + seed)
    base = own.speed * np.sqrt(1 + memory(rng, 0.04, 4.0, own.period, len(own)))[:, None]
    speed, volts = base, np.ones(len(own))
    for _ in range(20):
        load = ((speed**2).sum(axis=1) / (base**2).sum(axis=1).mean()) ** 1.5
        volts = np.linspace(1.0, 1.0 - discharge, len(own)) - resistance * np.minimum(load, 2.0)
        speed = base * (volts / (1 - resistance))[:, None] ** (-power / 2)
    volts = volts + rng.normal(0.0, 0.002, len(own))
    return LoggedFlight.of(replace(own, rotor_speed=speed, voltage=volts / volts.max()))


@pytest.mark.parametrize("discharge", [0.0, 0.02, 0.1])
def test_a_voltage_that_a_command_draws_down_shows_no_power_but_that_of_the_discharge(discharge):
    for seed in range(4):
        found = commanded_thrust([loaded(emptying(power=0.0, seed=seed), discharge, seed=seed)])
        assert len(found.numbers) == 1 if discharge == 0.1 else len(found.numbers) <= 1
        for number in found.numbers:
            assert number.low <= 2.0 <= number.high
            assert number.determined == (number.high <= 2.0 * number.low)


def test_a_constant_voltage_shows_nothing_and_a_piece_on_the_ground_spoils_nothing():
    flight = emptying(power=0.0)
    part = flight.parts[0]
    constant = LoggedFlight.of(replace(part, voltage=np.full(len(part), 0.95)))
    assert commanded_thrust([constant]).numbers == ()
    stands = part.speed * (np.arange(len(part)) >= 200)[:, None]
    assert commanded_thrust([LoggedFlight.of(replace(part, rotor_speed=stands))]).rises != (1.0, 1.0)


def test_where_speeds_are_measured_or_no_voltage_is_known_commands_count_as_they_are():
    assert commanded_thrust([emptying(commanded=False)]) == CommandedThrust()
    assert commanded_thrust([emptying(voltage=False)]).numbers == ()
    assert commanded_thrust([emptying(power=0.0)]).numbers == ()


def test_a_voltage_is_used_of_all_flights_or_of_none():
    known, without = emptying(), emptying(voltage=False)
    assert supplied_alike([known, known]) == ([known, known], ())
    alike, (said,) = supplied_alike([known, without])
    assert said.startswith("the voltage of the battery is not used")
    assert all(part.voltage is None for flight in alike for part in flight.parts)
    measured = [emptying(commanded=False), emptying(voltage=False, commanded=False)]
    assert supplied_alike(measured) == (measured, ())


def test_an_inertia_of_commands_is_as_open_as_their_law():
    numbers = [FoundNumber(name, "", 1.0, 0.9, 1.1, np.nan, True, False) for name in ("inertia.Ixx", "thrust_factor")]
    inertia, thrust = widened_by_law(numbers, CommandedThrust((), (0.8, 1.0)))
    assert (inertia.low, inertia.high, inertia.determined) == (pytest.approx(0.72), 1.1, True)
    assert thrust == numbers[1]
    assert not next(widened_by_law(numbers, CommandedThrust((), (0.5, 1.0)))).determined
    drag = FoundNumber("drag_factor", "", 1.0, 0.9, 1.1, np.nan, True, False)
    wide = next(widened_by_law([drag], CommandedThrust((), (0.5, 1.0), (0.8, 1.2))))
    assert (wide.low, wide.high, wide.determined) == (pytest.approx(0.36), pytest.approx(1.32), False)
    law = FoundNumber("thrust_slope.linear", "", 0.3, 0.2, 0.4, np.nan, True, False)
    assert next(widened_by_law([*numbers, law], CommandedThrust((), (0.5, 1.0)))) == numbers[0]


def test_rotors_that_stand_or_turn_for_a_moment_tell_no_thrust():
    flights = without_velocity(flown(TRUE, noise=MIDDLING, seed=1, hold="linear"), accelerometer=True)
    assert carrying_weight(OPEN, [replace(flight, speed=0.0 * flight.speed) for flight in flights]) == (OPEN, ())
    brief = [replace(flight, speed=0.0 * flight.speed) for flight in flights]
    brief[0].speed[:3] = flights[0].speed[:3]
    _, result = carrying_weight(OPEN, brief)
    assert result == ()


@pytest.mark.parametrize(("heavier", "known"), [(1.0, True), (8.0, False)])
def test_with_a_moment_of_inertia_that_no_body_has_nothing_that_turns_it_is_determined(heavier, known):
    names = ("thrust_factor", "drag_factor", "inertia.Ixx", "products.Ixy", "rotor_drag.k_d")
    values = (1e-6, 1e-8, heavier * TRUE.vehicle.inertia_kg_m2[0], 1e-5, 1e-4)
    numbers = [
        FoundNumber(name, "", value, 0.0, 1.0, np.nan, True, False) for name, value in zip(names, values, strict=True)
    ]
    determined = [number.determined for number in bodily(TRUE.vehicle, numbers)]
    assert determined == [True, known, known, known, True]


def test_a_moment_that_is_more_than_the_others_together_is_not_determined_and_they_are():
    numbers = [
        FoundNumber(f"inertia.{name}", "", value, 0.0, 1.0, np.nan, True, False)
        for name, value in (("Ixx", 0.003), ("Izz", 0.009))
    ]
    vehicle = replace(TRUE.vehicle, inertia_kg_m2=(0.003, 0.004, 0.005))
    assert [number.determined for number in bodily(vehicle, numbers)] == [True, False]
    assert all(number.determined for number in bodily(replace(vehicle, inertia_kg_m2=(0.003, 0.006, 0.005)), numbers))


def test_no_vehicle_has_its_centre_of_mass_beyond_the_hubs_nor_a_damping_beyond_all_that_is_tried():
    size = TRUE.vehicle.inertia_kg_m2[0]
    values = {"com_offset.c_x": (0.05, -0.83), "linear_damping.d_x": (size, 1e3 * size)}
    for place, possible in enumerate((True, False)):
        numbers = [FoundNumber(name, "", own[place], 0, 1, np.nan, True, False) for name, own in values.items()]
        result = list(bodily(TRUE.vehicle, numbers))
        assert [(number.possible, number.determined) for number in result] == [(possible, possible)] * len(values)


def test_where_nothing_turns_no_factor_of_the_loop_overflows():
    """Warnings are errors here."""
    sums = np.array([[1e200, 1e200, 0.0, 0.0, 0.0], [0.0, 0.0, 1e200, 0.0, 0.0]])
    assert _factors(sums).tolist() == [[10.0, 0.1], [1.0, 1.0]]
    assert _explained(np.array([[0.0, 1e10, 0.0, 0.0, 0.0], [4.0, 1.0, 1.0, 0.0, 0.0]])) == pytest.approx([1, 0.25])
    assert Fitted(None, np.zeros(2), 0.0, np.diag([0.0, 1e300])).condition_number < 1e17


def test_intervals_hold_what_the_loop_leaves_open():
    names = ("thrust_factor", "drag_factor", "inertia.Ixx", "inertia.Iyy", "inertia.Izz", "rotor_drag.k_d")
    numbers = [FoundNumber(name, "", 1.0, 0.9, 1.1, np.nan, True, False) for name in names]
    wide = {number.name: number for number in widened_by_loop(numbers, replace_explained(LOOP, 0.95))}
    assert (wide["inertia.Ixx"].low, wide["inertia.Ixx"].high) == pytest.approx((0.72, 1.21))
    assert (wide["inertia.Iyy"].low, wide["inertia.Iyy"].high) == pytest.approx((0.45, 1.76))
    # Of yaw the flights say nothing by which a fit could have been misled.
    assert (wide["drag_factor"].low, wide["inertia.Izz"].high) == pytest.approx((0.9, 1.1))
    assert {name for name, number in wide.items() if not number.determined} == {"inertia.Iyy"}


def test_flights_that_show_the_loop_determine_what_carries_the_weight_alone():
    names = ("thrust_factor", "drag_factor", "inertia.Ixx", "lag.time_constant_s", "rotor_drag.k_d")
    numbers = [FoundNumber(name, "", 1.0, 0.9, 1.1, np.nan, True, False) for name in names]
    assert LOOP.shows_loop
    assert [number.name for number in widened_by_loop(numbers, LOOP) if number.determined] == ["thrust_factor"]
    # A curve found next to it answers with the loop, as every effect; the thrust factor carries the weight still.
    numbers.append(FoundNumber("thrust_slope.linear", "", -0.3, -0.4, -0.2, np.nan, True, False))
    assert [number.name for number in widened_by_loop(numbers, LOOP) if number.determined] == ["thrust_factor"]


def test_of_a_vehicle_whose_body_is_held_only_narrow_bounds_and_what_carries_the_weight_are_determined():
    names = ("thrust_factor", "inertia.Ixx", "inertia.Iyy", "lag.time_constant_s", "rotor_drag.k_d")
    numbers = [FoundNumber(name, "", 0.05, 0.05, 0.05, np.nan, True, False) for name in names]
    held = LOOP._replace(
        low=np.array([0.75, 0.6, np.nan]),
        high=np.array([1.3, 1.7, np.nan]),
        missed=np.full(3, 0.02),
        lags_s=np.array([0.02, 0.05, 0.1]),
    )
    found = {number.name: number for number in widened_by_loop(numbers, held)}
    assert [name for name, number in found.items() if number.determined] == ["thrust_factor", "inertia.Ixx"]
    assert (found["inertia.Ixx"].low, found["inertia.Ixx"].high) == pytest.approx((0.0375, 0.065))
    assert (found["lag.time_constant_s"].low, found["lag.time_constant_s"].high) == (0.02, 0.1)


@pytest.mark.parametrize("unknown", [(), ("drag_factor",)])
def test_a_body_that_is_moved_to_the_middle_of_bounds_stays_a_body(unknown):
    """A stated one, with its products; about yaw without bounds that of a flat one."""
    stated = replace(STATED, inertia_kg_m2=(0.03, 0.04, 0.09, 0.02, 0.0, 0.0), unknown=unknown)
    bounds = LOOP._replace(low=np.array([0.1, 0.1, np.nan]), high=np.array([0.3, 0.3, np.nan]), missed=np.zeros(3))
    held = held_by_bounds(stated, bounds, ())
    moments = held.vehicle.inertia_kg_m2
    assert moments[:2] == pytest.approx((0.03 * np.sqrt(0.03), 0.04 * np.sqrt(0.03)))
    assert moments[3] == pytest.approx(0.02 * np.sqrt(0.03))
    assert moments[2] < moments[0] + moments[1]
    found = {number.name: number for number in widened_by_loop(held.numbers, held.loop)}
    assert [name for name, number in found.items() if number.determined] == []
    assert (found["inertia.Ixx"].low, found["inertia.Ixx"].high) == pytest.approx((0.003, 0.009))


def test_a_stated_body_beyond_the_only_end_there_is_does_not_stay():
    bounds = LOOP._replace(low=np.full(3, np.nan), high=np.array([0.4, np.nan, 7.0]), missed=np.zeros(3))
    held = held_by_bounds(replace(STATED, unknown=()), bounds, ())
    assert [number.name for number in held.numbers] == ["inertia.Ixx", "inertia.Iyy", "inertia.Izz"]
    assert not np.isfinite([held.loop.low, held.loop.high]).any()
    assert not any(number.determined for number in widened_by_loop(held.numbers, held.loop))


def replace_explained(bounds, share):
    return bounds._replace(explained=np.full(3, share))


@pytest.mark.parametrize(("own", "contradicts"), [(1.0, False), (1.06, True), (1.09, False), (0.9, False)])
def test_a_body_that_torque_and_rotation_leave_to_no_vehicle_contradicts_no_fit(own, contradicts):
    """In still air one by setpoints, without the lag, was 9 % off, and took the place of a fit that was not."""
    inertia = np.diag([2e-3, 3e-3, 4e-3])
    fitted = SimpleNamespace(model=SimpleNamespace(body=SimpleNamespace(inertia=own * inertia)))
    found = SimpleNamespace(fitted=fitted, half=np.full(3, 0.02))
    assert Constants.contradict(found, inertia, np.full(3, 0.96), np.full(3, 1.05)) is contradicts


@pytest.mark.parametrize(("rotors_hz", "determined"), [(10.0, False), (50.0, True)])
def test_a_lag_between_two_samples_of_the_rotors_is_not_determined(rotors_hz, determined):
    numbers = [FoundNumber(name, "s", 0.046, 0.04, 0.05, np.nan, True, False) for name in (LAG, "delay_s")]
    assert [own.determined for own in within_samples(numbers, rotors_hz)] == [determined, True]
