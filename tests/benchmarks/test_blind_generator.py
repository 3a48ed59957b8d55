"""The flights must obey mechanics, repeat from their seed, and know nothing of the package they judge."""

import ast
import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from benchmarks.blind import generator, measure
from benchmarks.blind.cases import cases, in_air, make
from benchmarks.blind.drive import Notch
from benchmarks.blind.gusts import gusts
from benchmarks.blind.measure import ATTACKS, attacked, places
from benchmarks.blind.missions import mission
from benchmarks.blind.plant import nominal
from benchmarks.blind.simulate import DT, Fleet, FlightPlan
from benchmarks.blind.strengths import CATALOGUE, FORMS, OTHERS, OUTSIDE
from benchmarks.blind.vehicles import CRAZYFLIE, SIXKG, VEHICLES

EFFECTS = ("com_offset", "euler_axis_torque", "ground_effect", "wind", "payload", "battery_sag", "gyro_bias")


class StillRotors:
    """Stands in for a drive whose rotors do not turn."""

    def __init__(self, flights):
        self.speed = np.zeros((4, flights))

    def rate(self, _target):
        return np.zeros_like(self.speed)

    def half_step(self, _target):
        pass


@pytest.fixture(scope="module")
def flown():
    rng = np.random.default_rng(4)
    hidden = [make(f"none-{name}", "none", name, (), rng) for name in VEHICLES]
    hidden += [make(effect, "single", "sixkg", (effect,), rng, level=0.5) for effect in EFFECTS]
    return {group.case.name: group for group in generator.simulate_many(hidden, 7, duration=2.0, lead_in=1.0)}


def alone(vehicle, plant, hidden):
    path = mission("hover", vehicle, 1.0, np.random.default_rng(1))
    return Fleet([FlightPlan(vehicle, plant, path, hidden, np.zeros(3), (1,))])


def falling(hidden, seconds, inertia=None):
    """Let one tumbling craft fall without thrust; return the fleet and its energies over time."""
    plant = nominal(SIXKG)
    plant.inertia = plant.inertia if inertia is None else inertia
    fleet = alone(SIXKG, plant, hidden)
    fleet.y[10:13] = [[1.2], [-0.7], [0.5]]
    drive = StillRotors(1)
    trail = []
    for step in range(round(seconds / DT)):
        first, _ = fleet.rates(step * DT, fleet.y, drive.speed, drive.speed)
        trail.append((fleet.y.copy(), [term.state.copy() for term in fleet.with_state]))
        fleet.advance(step * DT, drive, drive.speed, first)
    return fleet, trail


def turned(y):
    return Rotation.from_quat(y[[7, 8, 9, 6], 0])


def rigid_energy(fleet, y):
    return 3.0 * (y[3:6] ** 2).sum() + 0.5 * y[10:13, 0] @ fleet.inertia[:, :, 0] @ y[10:13, 0] + 6 * 9.81 * y[2, 0]


def test_generator_does_not_import_the_package_it_judges():
    for path in Path(generator.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not [name for name in names if name.startswith("cpfls")], path.name


def test_tumbling_craft_keeps_energy_and_angular_momentum():
    inertia = np.array([[0.6, 0.05, -0.03], [0.05, 0.7, 0.04], [-0.03, 0.04, 1.1]])
    fleet, trail = falling({}, 2.0, inertia)
    momentum = [turned(y).apply(inertia @ y[10:13, 0]) for y, _ in (trail[0], trail[-1])]
    np.testing.assert_allclose(momentum[1], momentum[0], atol=1e-5)
    energy = [rigid_energy(fleet, y) for y, _ in (trail[0], trail[-1])]
    assert energy[1] == pytest.approx(energy[0], rel=1e-7)


def test_payload_and_craft_keep_their_energy_and_momentum_together():
    point, mass, length = np.array([0.02, -0.01, -0.1]), 1.5, 0.8
    hidden = {"payload": {"mass": mass, "point": point.tolist(), "length": length, "damping": 0.0}}
    fleet, trail = falling(hidden, 2.0)

    def total(y, cable):
        turn = turned(y)
        velocity = y[3:6, 0] + turn.apply(np.cross(y[10:13, 0], point)) + length * cable[3:, 0]
        height = y[2, 0] + turn.apply(point)[2] + length * cable[2, 0]
        energy = rigid_energy(fleet, y) + 0.5 * mass * velocity @ velocity + mass * 9.81 * height
        return energy, 6 * y[3:6, 0] + mass * velocity

    (before, push), (after, end_push) = (total(y, states[0]) for y, states in (trail[0], trail[-1]))
    fallen = np.array([0, 0, -9.81 * (6 + mass) * DT * (len(trail) - 1)])
    assert after == pytest.approx(before, rel=2e-6)
    np.testing.assert_allclose(end_push - push, fallen, atol=2e-3)


@pytest.mark.parametrize("name", VEHICLES)
def test_rotor_torque_alone_turns_a_craft_that_hides_nothing(flown, name):
    group = flown[f"none-{name}"]
    inertia = np.array(group.vehicle.inertia)
    for flight in group.flights:
        time, speed, rate = flight.table[:, 0], flight.table[:, places(flight.table)["rotor"]], flight.table[:, 4:7]
        torque = speed**2 @ group.vehicle.allocation()[1:].T - np.cross(rate, rate * inertia)
        turned_by = CubicSpline(time, torque / inertia).antiderivative()(time)
        # Rotors get a new speed every 4 ms, so a spline through 100 Hz samples is good to about 1e-3 rad/s.
        np.testing.assert_allclose(rate - rate[0], turned_by, atol=2e-3)


@pytest.fixture(scope="module")
def gusty():
    still = make("none-xquad-0", "none", "xquad", (), np.random.default_rng(4))
    return generator.simulate_many([in_air(still, 2, "repeats", 7)], 7, duration=1.0, lead_in=0.5)[0]


def test_gusts_are_all_that_is_left_of_a_craft_that_hides_nothing(gusty):
    craft = gusty.vehicle
    for flight in gusty.flights:
        truth, gust = flight.truth, flight.gusts
        left = generator.residual(flight, gusty.case)
        assert gust[:, :3].std(axis=0) == pytest.approx(left.std(axis=0), rel=0.2)
        np.testing.assert_allclose(left[5:-5], gust[5:-5, :3], atol=0.15 * np.abs(gust[:, :3]).max())
        thrust = (truth["speed"] ** 2 @ craft.thrust_factors)[:, None] * [0.0, 0.0, 1.0]
        force = Rotation.from_quat(truth["q"][:, [1, 2, 3, 0]]).inv().apply(truth["a"] + [0.0, 0.0, 9.81]) * craft.mass
        np.testing.assert_allclose(force - thrust, gust[:, 3:], atol=1e-9)


def test_a_path_flown_again_meets_other_gusts(gusty):
    for first, again in ((0, 3), (2, 5), (6, 9)):
        one, other = gusty.flights[first], gusty.flights[again]
        assert one.role == other.role
        np.testing.assert_array_equal(one.asked["sticks"], other.asked["sticks"])
        assert abs(np.corrcoef(one.gusts[:, 0], other.gusts[:, 0])[0, 1]) < 0.95
        assert np.abs(one.truth["x"] - other.truth["x"]).max() < 1.0
    assert not np.array_equal(gusty.flights[0].asked["sticks"], gusty.flights[6].asked["sticks"])


def test_gusts_turn_a_craft_less_the_longer_its_arms_are():
    small = replace(SIXKG, rotors=tuple((0.16 / 0.3 * x, 0.16 / 0.3 * y, z) for x, y, z in SIXKG.rotors))
    turned_by = [
        np.array(gusts(craft, level, np.random.default_rng(2))["size"][:3]) / craft.inertia
        for craft, level in ((small, 1), (small, 2), (SIXKG, 1))
    ]
    np.testing.assert_allclose(turned_by[0], np.array([3.4, 5.1, 2.0]) * CRAZYFLIE.arm / 0.16, rtol=0.25)
    np.testing.assert_allclose(turned_by[1], 2 * turned_by[0])
    np.testing.assert_allclose(turned_by[2], turned_by[0] * 0.16 / SIXKG.arm)


def test_what_was_asked_stands_in_the_log_where_it_is_the_instrument(gusty, tmp_path):
    asked, there = gusty.flights[-1].asked, {"setpoints": {"zd"}, "sticks": {"zd", "pitch"}, "repeats": set()}
    for instruments, columns in there.items():
        flights = replace(gusty, case=replace(gusty.case, instruments=instruments))
        *_, path = generator.write(flights, tmp_path / instruments, "low", "white", np.random.default_rng(1))
        heads, first, *_ = path.read_text().splitlines()
        row = dict(zip(heads.split(","), map(float, first.split(",")), strict=True))
        assert {"zd", "pitch"} & {*row} == columns
        assert row.get("zd", 0.0) in (0.0, pytest.approx(asked["setpoint_position"][0, 2]))
        assert row.get("pitch", 0.0) in (0.0, pytest.approx(asked["sticks"][0, 1]))
    key = json.loads(generator.write_key(gusty, tmp_path / "keys").read_text())
    assert key["air"] == gusty.case.air
    assert max(key["residual_rms_n_m"]["train_1"]) < 0.2 * max(key["gusts_averaged_n_m"]["train_1"])


def test_offset_centre_of_mass_leaves_the_torque_of_the_thrust(flown):
    group = flown["com_offset"]
    offset = np.array(group.case.hidden["com_offset"]["offset"])
    for flight in group.flights:
        thrust = (flight.table[:, 16:20] ** 2).sum(1) * SIXKG.thrust_factor
        expected = np.outer(thrust, [-offset[1], offset[0], 0.0])
        inner = slice(20, -20)
        np.testing.assert_allclose(generator.residual(flight, group.case)[inner], expected[inner], atol=0.03)


def test_logged_acceleration_differentiates_the_logged_velocity(flown):
    for group in flown.values():
        for flight in group.flights:
            time = flight.table[:, 0]
            moved = CubicSpline(time, flight.table[:, 13:16]).antiderivative()(time)
            np.testing.assert_allclose(flight.table[:, 10:13] - flight.table[0, 10:13], moved, atol=3e-3)


def test_torque_along_euler_axes_differs_by_the_inverse_transpose(flown):
    group = flown["euler_axis_torque"]
    flight = group.flights[0]
    roll, pitch = flight.table[:, 1], flight.table[:, 2]
    s, c = np.sin(roll), np.cos(roll)
    zero, one = np.zeros_like(s), np.ones_like(s)
    W = np.array([[one, zero, -np.sin(pitch)], [zero, c, s * np.cos(pitch)], [zero, -s, c * np.cos(pitch)]])
    nominal_torque = flight.table[:, 16:20] ** 2 @ SIXKG.allocation()[1:].T
    true_torque = np.linalg.solve(np.moveaxis(W, 2, 0).transpose(0, 2, 1), nominal_torque[:, :, None])[:, :, 0]
    inner = slice(20, -20)
    expected = (true_torque - nominal_torque)[inner]
    np.testing.assert_allclose(generator.residual(flight, group.case)[inner], expected, atol=0.03)


def test_a_case_flies_the_same_in_other_company(flown):
    alone = generator.simulate_many([flown["payload"].case], 7, duration=2.0, lead_in=1.0)[0]
    for one, other in zip(alone.flights, flown["payload"].flights, strict=True):
        np.testing.assert_allclose(one.table, other.table, atol=1e-9)


def test_study_repeats_from_its_seed_and_covers_every_effect():
    study = cases(5)
    assert [case.key() for case in study] == [case.key() for case in cases(5)]
    assert [case.key() for case in study] != [case.key() for case in cases(6)]
    assert len({case.name for case in study}) == len(study)
    hidden = {effect for case in study for effect in case.hidden}
    assert hidden == {*CATALOGUE, *OUTSIDE, *FORMS, *OTHERS}


def test_controller_speed_hides_only_the_voltage():
    case = make("sag", "single", "sixkg", ("battery_sag",), np.random.default_rng(1), esc_speed=True)
    assert case.truth == ("battery_sag",)
    flight = generator.simulate_many([case], 3, duration=1.0, lead_in=1.0)[0].flights[0]
    exponent = case.hidden["battery_sag"]["exponent"]
    np.testing.assert_allclose(flight.table[:, 16:20] * flight.table[:, 24:] ** exponent, flight.truth["speed"])


@pytest.mark.parametrize("kind", measure.KINDS)
def test_noise_has_its_stated_size(flown, kind):
    long = np.tile(flown["none-sixkg"].flights[0].table, (40, 1))
    noisy = generator.disturb(long, SIXKG, "mid", kind, np.random.default_rng(2))
    spread = (noisy - long)[:, [1, 4, 7, 10, 13, 16]].std(axis=0)
    np.testing.assert_allclose(spread, [np.radians(0.2), 0.005, 0.02, 0.05, 0.05, 1.0], rtol=0.1)


def test_written_logs_hold_no_key(flown, tmp_path):
    group = flown["battery_sag"]
    paths = generator.write(group, tmp_path / "logs", "low", "white", np.random.default_rng(1))
    key = json.loads(generator.write_key(group, tmp_path / "keys").read_text())
    with paths[0].open() as file:
        rows = list(csv.DictReader(file))
    assert len(paths) == 6
    assert len(rows) == 201
    assert "om1" not in rows[0]
    assert float(rows[5]["omcmd2"]) > 0
    assert key["truth"] == ["battery_sag", "motor_lag"]
    assert "battery_sag" not in "".join(p.read_text() for p in (tmp_path / "logs").iterdir())


def test_arms_on_springs_keep_the_angular_momentum():
    fleet = alone(SIXKG, nominal(SIXKG), {"flexible_arm": {"share": 0.3, "frequency": 3.0, "damping": 0.05}})
    # About one axis: the turning of the arms is written for small angles.
    fleet.y[12], fleet.with_state[0].state[2] = 0.8, 0.1
    drive, momentum, angle = StillRotors(1), [], []
    for step in range(500):
        first, _ = fleet.rates(step * DT, fleet.y, drive.speed, drive.speed)
        swing = fleet.with_state[0].state
        momentum.append(1.2 * (fleet.y[12, 0] + 0.3 * swing[5, 0]))
        angle.append(swing[2, 0])
        fleet.advance(step * DT, drive, drive.speed, first)
    np.testing.assert_allclose(momentum, 1.2 * 0.8, rtol=1e-9)
    assert min(angle) < -0.02


def test_notch_takes_its_band_out_and_leaves_the_rest():
    time = np.arange(0, 20, 0.004)
    notch = Notch([None, (5.0, 0.7)], np.array([300.0, 300.0]), 4, 0.004)
    waves = 300 + np.sin(2 * np.pi * 5 * time) + np.sin(2 * np.pi * 0.2 * time)
    out = np.array([notch.passed(np.full((4, 2), value)) for value in waves])
    np.testing.assert_array_equal(out[:, 0, 0], waves)
    slow = 300 + np.sin(2 * np.pi * 0.2 * time)
    np.testing.assert_allclose(out[1000:, 2, 1], slow[1000:], atol=0.07)


@pytest.mark.parametrize(("attack", "touched"), [(name, name.split("_")[0]) for name in ATTACKS])
def test_an_attack_touches_its_own_channel(flown, attack, touched):
    table = generator.disturb(flown["com_offset"].flights[0].table, SIXKG, "mid", "white", np.random.default_rng(1))
    hit = attacked(table, attack)
    for group, own in places(table).items():
        same = np.array_equal(hit[:, own], table[:, own])
        assert same != (group == touched or (touched == "log" and group != "volt")), group
    np.testing.assert_array_equal(attacked(table, ""), table)


def test_an_effect_may_be_in_the_flights_of_one_role():
    case = make("turned", "differing", "sixkg", ("com_offset",), np.random.default_rng(1), level=0.6, only="held_out")
    group = generator.simulate_many([case], 3, duration=1.0, lead_in=1.0)[0]
    torque = {role: [] for role in generator.ROLES}
    for flight in group.flights:
        torque[flight.role].append(np.abs(generator.residual(flight, case)[20:-20]).mean())
    assert case.truth == ()
    assert max(torque["train"]) < 0.02
    assert min(torque["held_out"]) > 0.1


def test_physics_of_the_other_simulator_follow_their_formulas():
    case = make("drag", "pybullet", "cf2x", ("quick_rotors", "bullet_damping", "bullet_drag"), np.random.default_rng(1))
    flight = generator.simulate_many([case], 3, duration=4.0)[0].flights[0]
    own = places(flight.table)
    velocity, acceleration = flight.table[:, own["velocity"]], flight.table[:, own["acceleration"]]
    speed = flight.table[:, own["rotor"]]
    up = Rotation.from_quat(flight.truth["q"][:, [1, 2, 3, 0]]).apply([0.0, 0.0, 1.0])
    thrust = (speed**2).sum(axis=1, keepdims=True) * 3.16e-10 * (60 / (2 * np.pi)) ** 2
    drag = -np.array([9.1785e-7, 9.1785e-7, 10.311e-7]) * speed.sum(axis=1, keepdims=True) * velocity
    slowed = -0.04 * (1 + np.linalg.norm(velocity, axis=1, keepdims=True)) * velocity
    expected = (thrust * up + drag) / 0.027 + slowed - [0.0, 0.0, 9.81]
    assert np.abs(drag / 0.027).max() > 0.2
    np.testing.assert_allclose(acceleration, expected, atol=1e-9)
