"""Playback compared with another library, baselines with their formulas, windows with their stretches."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from cpfls_cli.dynamics import inertia_matrix, inertia_matrix_gradient, turning_law
from cpfls_cli.playback.errors import MODEL, NOTHING_MOVES, RATE_FADES, RATE_STAYS, STATED
from cpfls_cli.playback.flight import MeasuredMotion
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.playback.player import free_runs, player_of, rotation_vectors
from cpfls_cli.playback.replay import SIGNALS, Played, fading, replay, where_better
from cpfls_cli.regressor.regressor import InertiaValues
from cpfls_cli.rotations import cross, euler_angles
from cpfls_cli.vehicle.rotors import body_wrench
from tests.builders.playback_flights import mean_errors
from tests.builders.random_flights import VEHICLE, flight_of

INERTIA = np.array([[0.6, 0.02, -0.03], [0.02, 0.7, 0.01], [-0.03, 0.01, 1.2]])
DAMPING, DRAG = np.array([0.3, 0.2, 0.1]), 2e-4
EFFECTS = (ModelEffect("linear_damping", {}, DAMPING), ModelEffect("rotor_drag", {}, np.array([DRAG])))
HUBS = np.array([rotor.position_m for rotor in VEHICLE.rotors])
PLANE = np.array([1.0, 1.0, 0.0])


def integrated(flight, start, horizon, acceleration):
    """Integrate the state by scipy from a sample; `acceleration(rotation, air, rate, speed)` gives both derivatives."""
    motion, period = flight.motion, flight.motion.period
    time = period * np.arange(len(flight))

    def slope(at, state):
        speed = np.array([np.interp(at, time, rotor) for rotor in flight.speed.T])
        rotation, velocity, rate = state[6:15].reshape(3, 3), state[3:6], state[15:]
        linear, angular = acceleration(rotation, rotation.T @ velocity, rate, speed)
        return np.concatenate([velocity, linear, cross(rotation, rate[None]).ravel(), angular])

    first = [motion.position[start], motion.velocity[start], motion.rotation[start].ravel(), motion.rate[start]]
    ends = time[start], time[start + horizon]
    end = solve_ivp(slope, ends, np.concatenate(first), rtol=1e-10, atol=1e-12, max_step=period).y[:, -1]
    return end[:3], end[3:6], end[6:15].reshape(3, 3), end[15:]


def wrench_with_effects(air, rate, speed):
    """Rotors, damping, and drag of each rotor in its plane, written out."""
    rotors = body_wrench(VEHICLE, speed[None])
    pushes = -DRAG * speed[:, None] * (air + cross(rate, HUBS)) * PLANE
    torque = rotors.body_torque[0] - DAMPING * rate + cross(HUBS, pushes).sum(axis=0)
    return torque, np.array([0.0, 0.0, rotors.thrust[0]]) + pushes.sum(axis=0)


def of_rigid_body(rotation, air, rate, speed):
    torque, force = wrench_with_effects(air, rate, speed)
    return rotation @ force / 6.0 - [0, 0, 9.81], np.linalg.solve(INERTIA, torque - cross(rate, INERTIA @ rate))


def off(flight, start, horizon, model, acceleration):
    """How far a playback is from the integration, for each part of the state."""
    (errors,) = free_runs(player_of(model, flight), flight, np.array([start]), horizon).errors
    at, motion = start + horizon, flight.motion
    position, velocity, rotation, rate = integrated(flight, start, horizon, acceleration)
    position_error, velocity_error, rotation_error, rate_error = errors[-1]
    turned = motion.rotation[at] @ Rotation.from_rotvec(rotation_error).as_matrix()
    return np.array(
        [
            np.linalg.norm(motion.position[at] + position_error - position),
            np.linalg.norm(motion.velocity[at] + velocity_error - velocity),
            np.linalg.norm(rotation_vectors(rotation, turned)),
            np.linalg.norm(motion.rate[at] + rate_error - rate),
        ]
    )


def finer(flight, factor):
    """The same flight on a faster clock, its speeds straight lines as before; only its first sample counts."""
    time, period = flight.motion.period * np.arange(len(flight)), flight.motion.period / factor
    fine = period * np.arange((len(flight) - 1) * factor + 1)
    speed = np.column_stack([np.interp(fine, time, rotor) for rotor in flight.speed.T])
    index = np.minimum(np.arange(len(fine)) // factor, len(flight) - 1)
    motion = MeasuredMotion(*(values[index] for values in flight.motion[:4]), period)
    return replace(flight, motion=motion, speed=speed, stretches=(slice(0, len(fine)),))


def test_a_rigid_body_with_damping_and_rotor_drag_is_integrated_to_second_order():
    flight, model = flight_of(), VehicleModel(vehicle=VEHICLE, effects=EFFECTS)
    coarse = off(flight, 0, 50, model, of_rigid_body)
    fine = off(finer(flight, 4), 0, 200, model, of_rigid_body)
    assert coarse.max() < 2e-4
    assert np.all(fine < coarse / 10)


class Rigid:
    """The tensor of a rigid body as a model in Euler coordinates."""

    def inertia(self, attitude):
        return InertiaValues(inertia_matrix(attitude, INERTIA), inertia_matrix_gradient(attitude, INERTIA))


class Bent(Rigid):
    """A rigid body with 0.1 cos(roll) on top of D22."""

    def inertia(self, attitude):
        rigid = super().inertia(attitude)
        value, gradient = rigid.value.copy(), rigid.gradient.copy()
        value[:, 1, 1] += 0.1 * np.cos(attitude[:, 0])
        gradient[:, 0, 1, 1] -= 0.1 * np.sin(attitude[:, 0])
        return InertiaValues(value, gradient)


@pytest.mark.parametrize("known", [{}, {"has_velocity": False}], ids=["moving", "only rotation"])
def test_a_tensor_in_euler_coordinates_plays_like_the_rigid_body(known):
    flight, starts = flight_of(**known), np.arange(0, 30, 7)
    rigid = free_runs(player_of(VehicleModel(vehicle=VEHICLE, effects=EFFECTS), flight), flight, starts, 40)
    fuzzy = free_runs(
        player_of(VehicleModel(vehicle=VEHICLE, effects=EFFECTS, fuzzy=Rigid()), flight), flight, starts, 40
    )
    np.testing.assert_allclose(fuzzy.errors, rigid.errors, atol=1e-11)


def test_an_inertia_that_depends_on_the_attitude_is_integrated_to_second_order():
    turning = turning_law(Bent())

    def of_bent(rotation, air, rate, speed):
        torque, force = wrench_with_effects(air, rate, speed)
        (turned,) = turning(euler_angles(rotation[None]), rate[None]).acceleration(torque[None])
        return rotation @ force / 6.0 - [0, 0, 9.81], turned

    flight, model = flight_of(), VehicleModel(vehicle=VEHICLE, effects=EFFECTS, fuzzy=Bent())
    coarse = off(flight, 0, 40, model, of_bent)
    fine = off(finer(flight, 4), 0, 160, model, of_bent)
    assert coarse.max() < 3e-4
    assert np.all(fine < coarse / 10)


def played(flight, model=None):
    stated = VehicleModel(vehicle=VEHICLE)
    return Played(flight, player_of(model or stated, flight), player_of(stated, flight))


@pytest.mark.parametrize("prediction", [NOTHING_MOVES, RATE_STAYS, RATE_FADES])
def test_baselines_are_their_formulas(prediction):
    flight, horizon, fades_s = flight_of(), 20, 0.3
    motion, goes_on = flight.motion, prediction != NOTHING_MOVES
    runs = replace(played(flight), fading_s=fades_s).runs(prediction, np.array([3, 11]), horizon)
    assert np.all(runs.diverged == -1)
    for run, start in enumerate((3, 11)):
        for step in range(1, horizon + 1):
            gone, at = goes_on * step * 0.01, start + step
            left = np.exp(-gone / fades_s) if prediction == RATE_FADES else 1.0
            # The integral of the rate until then.
            as_long = fades_s * (1 - left) if prediction == RATE_FADES else gone
            turned = motion.rotation[start] @ Rotation.from_rotvec(as_long * motion.rate[start]).as_matrix()
            wanted = [
                motion.position[start] + gone * motion.velocity[start] - motion.position[at],
                motion.velocity[start] - motion.velocity[at],
                Rotation.from_matrix(motion.rotation[at].T @ turned).as_rotvec(),
                left * motion.rate[start] - motion.rate[at],
            ]
            np.testing.assert_allclose(runs.errors[run, step - 1], wanted, atol=1e-12)


def test_rates_fade_as_fast_as_those_of_the_flights_that_train():
    flight = flight_of(samples=200)
    kept = np.exp(-0.01 * np.arange(100) / 0.13)[:, None] * [3.0, -1.0, 0.5]
    fades = replace(
        flight,
        motion=flight.motion._replace(rate=np.concatenate([kept, -2 * kept])),
        stretches=(slice(0, 100), slice(100, 200)),
    )
    assert fading([fades], 20) == pytest.approx(0.13, rel=0.01)
    stays = replace(flight, motion=flight.motion._replace(rate=np.ones((200, 3))))
    assert fading([stays], 20) == pytest.approx(100 * 20 * 0.01)
    # A stretch that is shorter than the horizon shows what it can.
    assert fading([replace(fades, stretches=(slice(0, 5), slice(100, 104)))], 20) == pytest.approx(0.13, rel=0.01)


def test_chance_is_what_blocks_of_windows_tell_of_the_difference_from_the_model():
    flight = flight_of(samples=130)
    found = replay([played(flight, VehicleModel(vehicle=VEHICLE, effects=EFFECTS))], 10, 1)
    runs = [played(flight).runs(name, np.arange(120), 10).errors for name in (RATE_STAYS, NOTHING_MOVES)]
    sizes = [np.linalg.norm(errors[:, :, 3], axis=2) for errors in runs]
    assert np.all(found.models[MODEL].body_rate.chance == 0)
    stated = np.linalg.norm(played(flight).runs(STATED, np.arange(120), 10).errors[:, :, 3], axis=2)
    own = played(flight, VehicleModel(vehicle=VEHICLE, effects=EFFECTS)).runs(MODEL, np.arange(120), 10).errors
    apart = stated - np.linalg.norm(own[:, :, 3], axis=2)
    # Six blocks of two horizons; leaving out one of six is to leave the mean of five.
    error = apart.reshape(6, 20, 10).mean(axis=1).std(axis=0, ddof=1) / np.sqrt(6)
    np.testing.assert_allclose(found.models[STATED].body_rate.chance, 2.5706 * error, rtol=1e-4)
    np.testing.assert_allclose(sizes[0], sizes[1])
    assert replay([played(flight_of(samples=80))], 10, 1).models[MODEL].body_rate.chance is None


def test_errors_by_horizon_are_means_over_all_windows_of_all_flights():
    flights = [flight_of(seed=seed, samples=samples) for seed, samples in ((1, 60), (2, 45))]
    all_played = [played(flight, VehicleModel(vehicle=VEHICLE, effects=EFFECTS)) for flight in flights]
    found = replay(all_played, 10, 3)
    starts = [np.arange(0, samples - 10, 3) for samples in (60, 45)]
    for row, prediction in enumerate((MODEL, NOTHING_MOVES, RATE_STAYS, STATED)):
        pairs = zip(all_played, starts, strict=True)
        errors = np.concatenate([each.runs(prediction, own, 10).errors for each, own in pairs])
        for index, signal in enumerate(SIGNALS):
            own = errors[:, :, index]
            known = found.models[prediction].signals[signal]
            np.testing.assert_allclose(known.mae, np.linalg.norm(own, axis=2).mean(axis=0))
            np.testing.assert_allclose(known.rms_by_axis, np.sqrt((own**2).mean(axis=0)))
        np.testing.assert_allclose(found.size[row], np.linalg.norm(errors[:, :, 3], axis=2).mean(axis=1))
    assert found.flight.tolist() == [0] * 17 + [1] * 12


def test_batches_do_not_show(monkeypatch):
    flight = flight_of()
    whole = replay([played(flight)], 20, 1)
    monkeypatch.setattr("cpfls_cli.playback.replay._BATCH", 140)
    parts = replay([played(flight)], 20, 1)
    np.testing.assert_allclose(mean_errors(parts, "attitude"), mean_errors(whole, "attitude"), rtol=1e-12)
    np.testing.assert_array_equal(parts.start, whole.start)


def test_a_model_is_better_where_it_was_played_along_what_it_flies():
    """The rates of one flight are those of a body at rest, which nothing moves predicts to the end."""
    moving, still = flight_of(samples=120, seed=1), flight_of(samples=120, seed=2)
    model = VehicleModel(vehicle=VEHICLE)
    start = np.array([0])
    run = free_runs(player_of(model, moving), moving, start, 119).errors[0, :, 3]
    flown = moving.motion.rate.copy()
    flown[1:] += run
    moving = replace(moving, motion=moving.motion._replace(rate=flown))
    still = replace(still, motion=still.motion._replace(rate=np.zeros((120, 3))))
    all_played = [played(moving), played(still)]
    region = where_better(all_played, replay(all_played, 10, 1))
    assert 0.3 < region.share <= 0.5
    sizes = np.linalg.norm(flown[:110], axis=1)
    assert sizes.min() <= region.rate_rad_s[0] < region.rate_rad_s[1] <= sizes.max()
    assert region.speed_m_s is not None
    alone = [played(replace(moving, has_velocity=False))]
    assert where_better(alone, replay(alone, 10, 1)).speed_m_s is None


def test_a_signal_is_averaged_over_the_flights_that_know_it():
    found = replay([played(flight_of(has_velocity=False))], 10, 1)
    assert {tuple(own.signals) for own in found.models.values()} == {("body_rate", "attitude")}
    known, alone = flight_of(seed=1), flight_of(seed=2, has_attitude=False)
    both, one = replay([played(known), played(alone)], 10, 1), replay([played(known)], 10, 1)
    np.testing.assert_allclose(mean_errors(both, "velocity"), mean_errors(one, "velocity"))
    assert not np.allclose(mean_errors(both, "body_rate"), mean_errors(one, "body_rate"))


@pytest.mark.parametrize("fuzzy", [None, Rigid()], ids=["rigid", "fuzzy"])
def test_a_run_that_diverges_is_counted_and_bounded(fuzzy):
    driven = (ModelEffect("linear_damping", {}, np.full(3, -90.0)),)
    found = replay([played(flight_of(), VehicleModel(vehicle=VEHICLE, effects=driven, fuzzy=fuzzy))], 60, 5)
    assert (found.diverged >= 0).sum(axis=1).tolist() == [4, 0, 0, 0]
    assert all(np.isfinite(mean_errors(found, signal)).all() for signal in found.models[MODEL].signals)
    assert mean_errors(found, "body_rate").max() < 600


class Hollow(Rigid):
    """Has no inertia where the vehicle rolls far to the left."""

    def inertia(self, attitude):
        values = super().inertia(attitude)
        sign = np.where(attitude[:, 0] < -0.2, -1.0, 1.0)
        return InertiaValues(values.value * sign[:, None, None], values.gradient)


def test_a_run_stops_where_no_body_has_the_inertia():
    found = replay([played(flight_of(), VehicleModel(vehicle=VEHICLE, fuzzy=Hollow()))], 40, 1)
    lost = found.diverged[0]
    assert 0 < (lost >= 0).sum() < len(lost)
    assert np.isfinite(mean_errors(found, "attitude")).all()


def test_no_window_crosses_a_pause():
    flight = flight_of(stretches=(slice(0, 30), slice(30, 80)))
    assert replay([played(flight)], 20, 1).start.tolist() == [*range(10), *range(30, 60)]


def test_the_worst_windows_do_not_overlap():
    found = replay([played(flight_of(samples=200))], 20, 1)
    worst = found.worst(4)
    assert np.diff(np.sort(found.start[worst])).min() > 20
    assert worst[0] == found.size[0].argmax()
    assert np.all(np.diff(found.size[0, worst]) <= 0)


def test_a_typical_stretch_is_made_of_windows_one_after_another():
    found = replay([played(flight_of(samples=400))], 20, 3)
    typical = found.typical(4)
    assert len(typical) == 4
    assert np.diff(found.start[typical]).tolist() == [21, 21, 21]


def test_a_stated_wrench_drives_a_flight_without_speeds_late_by_the_response():
    flight = flight_of()
    rotors = body_wrench(VEHICLE, flight.speed)
    wrench = np.column_stack([rotors.body_torque, np.zeros((80, 2)), rotors.thrust])
    stated = replace(flight, speed=np.zeros_like(flight.speed), wrench=wrench, hold="previous")
    held = replace(flight, hold="previous")
    model, starts = VehicleModel(vehicle=VEHICLE), np.array([0, 9])
    errors = [free_runs(player_of(model, each), each, starts, 30).errors for each in (stated, held)]
    # A wrench held at once; a speed without lag is held too, but reaches it in the middle of the step.
    late = replace(stated, hold="linear")
    np.testing.assert_allclose(errors[0], free_runs(player_of(model, late), late, starts, 30).errors, atol=0.05)
    assert np.abs(errors[0] - errors[1]).max() < 0.05


@pytest.mark.parametrize(("effects", "feels"), [(EFFECTS[:1], False), (EFFECTS[1:], True)], ids=["damping", "drag"])
def test_a_model_that_needs_the_velocity_says_so(effects, feels):
    assert VehicleModel(vehicle=VEHICLE, effects=effects).feels_air is feels


def test_half_a_turn_is_pi():
    half = Rotation.from_rotvec([0, np.pi, 0]).as_matrix()
    assert np.linalg.norm(rotation_vectors(np.eye(3), half)) == pytest.approx(np.pi)
