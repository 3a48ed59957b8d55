"""Replays of a model, physical checks of it, and the verdict on it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.dynamics import InertiaFunctions, inertia_matrix
from cpfls_cli.fuzzy.basis import InputRange
from cpfls_cli.identification.data import TorqueData, joined
from cpfls_cli.inertia import symmetric
from cpfls_cli.playback.loop import LoopBounds
from cpfls_cli.regressor.regressor import uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.rotations import generalised_torque
from cpfls_cli.validation.bands import physical_sense
from cpfls_cli.validation.evidence import MODEL, Evidence
from cpfls_cli.validation.replay import NOTHING_MOVES, replay_steps
from cpfls_cli.validation.trust import Trust
from cpfls_cli.validation.verdict import Reason, Verdict, confirmed_axes, region_in_words, with_loop
from tests.builders.flights import rigid_torque, rotating_motion, still_flight

INERTIA = np.array([0.6, 0.8, 1.2, 0.0, 0.0, 0.0])
LOOP = LoopBounds(np.full(3, 0.5), np.full(3, 2.0), np.array([0.5, 0.8, 0.1]))
RANGE = InputRange(-1.0, 1.0)
BODY = np.array([0.6, 0.8, 1.2, 0.05, 0.0, -0.03])


def rotating_flight():
    time, motion = rotating_motion(71, samples=300, duration=6.0)
    return TorqueData(time, motion, rigid_torque(symmetric(INERTIA))(motion))


def level(samples):
    return still_flight(np.zeros((samples, 3)))


def test_nothing_moves_is_off_by_what_moved():
    """A steady roll: after k steps the attitude is off by its rate times the time, the rate by nothing."""
    data = level(60)
    motion = replace(data.motion, attitude=data.time[:, None] * [0.7, 0, 0], rate=np.tile([0.7, 0.0, 0.0], (60, 1)))
    found = replay_steps("x", replace(data, motion=motion), {"body": INERTIA}, 10, 20)
    assert found.model == ("body", NOTHING_MOVES)
    np.testing.assert_allclose(found.attitude[1], found.horizon[:, None] * [0.7, 0, 0], atol=1e-12)
    np.testing.assert_allclose(found.body_rate[1], 0.0, atol=1e-12)
    # A steady roll is what a body without torque does.
    np.testing.assert_allclose(found.attitude[0], 0.0, atol=1e-10)


def test_windows_are_evenly_spread_and_cross_no_pause():
    one, other = level(30), level(45)
    found = replay_steps("x", joined([one, other]), {"body": INERTIA}, 20, 1000)
    assert found.windows == (30 - 20) + (45 - 20)
    np.testing.assert_allclose(found.horizon, 0.01 * np.arange(1, 21))
    found = replay_steps("x", level(30), {"body": INERTIA}, 100, 1000)
    assert (len(found.samples), found.windows) == (25, 5)
    assert replay_steps("x", level(101), {"body": INERTIA}, 20, 10).windows == 10


def test_no_window_at_a_vertical_pitch():
    data = level(50)
    attitude = np.zeros((50, 3))
    attitude[20:] = [0.0, np.pi / 2, 0.0]
    steep = replace(data, motion=replace(data.motion, attitude=attitude))
    assert replay_steps("x", steep, {"body": INERTIA}, 4, 1000).windows == 16
    found = replay_steps("x", steep[20:], {"body": INERTIA}, 4, 1000)
    assert found.windows == 0
    assert np.isnan(found.attitude).all()
    assert (found.window_error.shape, len(found.start)) == ((2, 0, 3), 0)


@pytest.mark.parametrize("inertia", [[0.6, -0.8, 1.2, 0, 0, 0], [0.6, 0.8, 0.0, 0, 0, 0], [0.6, 0.8, 1.2, 0.9, 0, 0]])
def test_a_body_that_is_none_is_said_and_does_not_spoil_the_others(inertia):
    data = rotating_flight()
    found = replay_steps("x", data, {"none": np.array(inertia), "body": INERTIA}, 10, 20)
    np.testing.assert_array_equal(found.lost, np.repeat([[20], [0], [0]], 10, axis=1))
    assert np.isnan(found.attitude[0]).all()
    assert np.isnan(found.body_rate[0]).all()
    assert np.isnan(found.window_error[0]).all()
    np.testing.assert_array_equal(found.attitude[1:], replay_steps("x", data, {"body": INERTIA}, 10, 20).attitude)


def test_a_body_far_too_light_is_lost_and_nothing_overflows():
    found = replay_steps("x", rotating_flight(), {"light": 1e-9 * INERTIA}, 50, 20)
    assert found.lost[0, -1] == 20
    assert np.all(np.diff(found.lost[0]) >= 0)


def test_windows_are_the_same_read_at_once_or_one_by_one(monkeypatch):
    data = rotating_flight()
    at_once = replay_steps("x", data, {"body": 1.1 * INERTIA}, 12, 30)
    monkeypatch.setattr("cpfls_cli.validation.replay._SAMPLES_AT_ONCE", 13)
    by_one = replay_steps("x", data, {"body": 1.1 * INERTIA}, 12, 30)
    # Slower windows among themselves take fewer steps of integration.
    np.testing.assert_allclose(by_one.attitude, at_once.attitude, rtol=1e-3)
    np.testing.assert_allclose(by_one.window_error, at_once.window_error, rtol=1e-3)


def test_errors_by_window_and_by_horizon_are_the_same_errors():
    found = replay_steps("x", rotating_flight(), {"body": 1.1 * INERTIA}, 12, 30)
    by_window, by_horizon = np.mean(found.window_error, axis=1), np.mean(found.body_rate**2, axis=1)
    np.testing.assert_allclose(by_window, by_horizon)


def test_a_constant_torque_is_taken_off_what_was_measured():
    data, constant = rotating_flight(), np.array([0.3, -0.2, 0.1])
    pushed = replace(data, torque=data.torque + generalised_torque(data.motion.attitude, np.tile(constant, (300, 1))))
    plain = replay_steps("x", data, {"body": INERTIA, "other": 1.1 * INERTIA}, 12, 30)
    found = replay_steps("x", pushed, {"body": INERTIA, "other": 1.1 * INERTIA}, 12, 30, {"body": constant})
    np.testing.assert_allclose(found.body_rate[0], plain.body_rate[0], rtol=1e-6, atol=1e-9)
    assert np.mean(found.window_error[1]) > 1.5 * np.mean(plain.window_error[1])


def visited(roll, pitch):
    cells = np.zeros((72, 72), dtype=bool)
    cells[np.ix_(roll, pitch)] = True
    return cells


@pytest.mark.parametrize(
    ("roll", "pitch", "words"),
    [
        (range(32, 40), range(36, 37), "roll -20 to 20 degrees, pitch 0 to 5 degrees (0.154 %"),
        ([70, 71, 0, 1], range(72), "roll 170 to 190 degrees, pitch all round (5.56 %"),
        ([10, 20, 60], [71], "roll 120 to 285 degrees, pitch 175 to 180 degrees (0.0579 %"),
        (range(72), range(72), "roll all round, pitch all round (100 %"),
        ([], [], "roll nowhere, pitch nowhere (0 %"),
    ],
)
def test_ranges(roll, pitch, words):
    assert region_in_words(visited(list(roll), list(pitch))).startswith(words)


def evidence(model_error, still_error, r2=(0.95, 0.95, 0.95)):
    """What `confirmed_axes` asks of evidence, with the squared errors of replayed rates in one window."""
    steps = SimpleNamespace(model=(MODEL, NOTHING_MOVES), window_error=np.array([[model_error], [still_error]]))
    known = SimpleNamespace(replayed={"rest": steps}, r2_min=0.8, r2=lambda _: np.array(r2))
    known.predicts = lambda predictor: Evidence.predicts(known, predictor)
    return known


def test_torque_and_playback_have_to_confirm_an_axis_both():
    judged = evidence((1.0, 3.0, 1.0), (2.0, 2.0, 2.0))
    assert confirmed_axes(judged, MODEL).tolist() == [True, False, True]
    judged = evidence((1.0, 1.0, 1.0), (2.0, 2.0, 2.0), r2=(0.9, 0.5, 0.9))
    assert confirmed_axes(judged, MODEL).tolist() == [True, False, True]
    judged = evidence((np.nan,) * 3, (np.nan,) * 3)
    assert confirmed_axes(judged, MODEL).all()


@pytest.mark.parametrize("by_past", [False, True])
@pytest.mark.parametrize("label", [Trust.CONTROL, Trust.INSIDE, Trust.RIGID_BODY])
def test_no_model_of_flights_that_show_the_loop_is_good(label, by_past):
    found = with_loop(Verdict(label, "", (Reason("better", 1),)), LOOP, by_past=by_past)
    assert found.label == Trust.LOOP
    assert "50 % of roll, 80 % of pitch" in found.reasons[0].text
    assert ("The past identifies roll and pitch" in found.reasons[0].text) is by_past
    assert [each.speaks for each in found.reasons] == [-1, 1]


def test_a_loop_does_not_save_what_is_not_to_be_used():
    found = with_loop(Verdict(Trust.DO_NOT_USE, "", (Reason("no body", -1),)), LOOP)
    assert (found.label, found.reasons[0].text, len(found.reasons)) == (Trust.DO_NOT_USE, "no body", 2)


@pytest.mark.parametrize("loop", [None, LOOP._replace(explained=np.array([0.95, 0.95, 0.1]))])
def test_flights_that_explain_roll_and_pitch_leave_the_verdict(loop):
    found = Verdict(Trust.INSIDE, "", (Reason("better", 1),))
    assert with_loop(found, loop) is found


def model(rigid_body=BODY, visited=None, d11=0.0):
    structure = model_structure(StructureSettings())
    coefficients = np.zeros(structure.parameters)
    coefficients[0] = d11
    visited = np.ones((72, 72), dtype=bool) if visited is None else visited
    return InertiaFunctions(
        structure, (RANGE, RANGE), uniform_breakpoints(structure), coefficients, rigid_body, visited
    )


def examined(*args, **kwargs):
    return physical_sense(model(*args, **kwargs))


def test_a_body_is_one_everywhere():
    """Two columns of cells around either vertical are left out; the smallest eigenvalue is the body's own there."""
    found = examined()
    assert (found.cells, found.indefinite) == (72 * 68, 0)
    edges = np.radians(np.arange(72) * 5 - 177.5)
    roll, pitch = np.meshgrid(edges, edges[np.abs(np.cos(edges)) > 0.1], indexing="ij")
    attitude = np.stack([roll.ravel(), pitch.ravel(), 0 * roll.ravel()], axis=1)
    smallest = np.linalg.eigvalsh(inertia_matrix(attitude, symmetric(BODY)))[:, 0]
    assert found.smallest_eigenvalue == pytest.approx(smallest.min())
    assert abs(np.cos(found.worst_attitude[1])) == pytest.approx(np.cos(np.radians(82.5)))


def test_a_negative_moment_is_found_where_training_was():
    visited = np.zeros((72, 72), dtype=bool)
    visited[36:40, 36] = True
    found = examined(visited=visited, d11=-0.7)
    assert (found.cells, found.indefinite) == (4, 4)
    assert found.smallest_eigenvalue == pytest.approx(-0.1, abs=0.02)
    assert np.radians(0) < found.worst_attitude[0] < np.radians(20)
    assert found.worst_attitude[1] == pytest.approx(np.radians(2.5))


def test_no_cell_was_visited():
    found = examined(visited=np.zeros((72, 72), dtype=bool))
    assert (found.cells, found.indefinite) == (0, 0)
    assert np.isnan(found.smallest_eigenvalue)


def test_cells_that_training_did_not_visit_are_examined_too():
    """A D11 of -0.7 more is no body anywhere, wherever training was."""
    visited = np.zeros((72, 72), dtype=bool)
    visited[36, 36] = True
    found = examined(visited=visited, d11=-0.7)
    assert (found.indefinite_anywhere, found.every_cell) == (72 * 68, 72 * 68)
    assert examined(visited=visited).indefinite_anywhere == 0
    assert examined(visited=np.zeros((72, 72), dtype=bool), d11=-0.7).indefinite_anywhere == 72 * 68
