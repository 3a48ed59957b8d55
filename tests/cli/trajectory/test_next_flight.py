"""The flight that tells rivals apart: planned, written with waypoints, the same by seed; what makes no sense."""

import csv

import numpy as np
import pytest

from cpfls_cli.flights.path import PlannedPath
from cpfls_cli.store import read
from tests.builders.studies import VEHICLE

SMALL = ("--duration", "10", "--box", "5,4,3", "--height", "3")
FEW = ("--set", "trajectory.next_flight.starts=2", "--set", "trajectory.next_flight.iterations=3")
PAIR = ("--to-tell", "com_offset,torque_bias")


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    path = tmp_path_factory.mktemp("next-flight") / "study.yaml"
    path.write_text(
        "seed: 4\n"
        "trajectory: {sample_time_s: 0.02}\n"
        "simulation:\n"
        "  mode: closed-loop\n"
        "  noise: {attitude: 0.003, body_rate: 0.005, acceleration: 0.1, rotor_speed: 1.0}\n"
        "  closed_loop: {integration_rate_hz: 200.0}\n" + VEHICLE
    )
    return path


@pytest.fixture(scope="module")
def planned(cpfls, config, tmp_path_factory):
    output = tmp_path_factory.mktemp("planned") / "next.h5"
    return output, cpfls.told("trajectory", config, *PAIR, *SMALL, *FEW, "-o", output)


def test_the_flight_keeps_to_the_box_and_starts_and_ends_at_rest(planned):
    record = read(planned[0], PlannedPath)[0]
    assert record.time[-1] == pytest.approx(10.0)
    assert (np.abs(record.position - [0, 0, 3]) <= np.array([2.5, 2.0, 1.5]) + 1e-6).all()
    for values in (record.velocity, record.acceleration, record.body_rate):
        np.testing.assert_allclose(values[[0, -1]], 0, atol=1e-6)


def test_each_question_is_answered_both_ways_and_beside_other_flights(planned):
    first, second = planned[1]["questions"]
    assert (first["true"], first["rival"]) == ("com_offset", "torque_bias") == (second["rival"], second["true"])
    for row in (first, second):
        assert row["sure"] > 0.97
        assert row["flown"] > 0.97
        assert row["likely"] < 0.01
        assert row["again"] is None
        assert 0 < row["least"] < 0.5
        assert "change the thrust" in row["advice"]


def test_waypoints_are_the_path(planned):
    record = read(planned[0], PlannedPath)[0]
    with open(planned[1]["files"][0], newline="") as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    assert len(rows) == 101
    for row in rows[::20]:
        sample = round(row["time_s"] / 0.02)
        np.testing.assert_allclose([row["x_m"], row["y_m"], row["z_m"]], record.position[sample], atol=1e-4)
        np.testing.assert_allclose([row["vx_m_s"], row["vy_m_s"], row["vz_m_s"]], record.velocity[sample], atol=1e-4)
        assert row["yaw_rad"] == pytest.approx(record.yaw[sample], abs=1e-4)


def test_the_same_seed_gives_the_same_bytes_and_another_seed_does_not(cpfls, config, planned, tmp_path):
    for seed, same in ((4, True), (5, False)):
        output = tmp_path / "next.h5"
        cpfls.done("trajectory", config, *PAIR, *SMALL, *FEW, "-o", output, "--force", "--seed", seed)
        assert (output.read_bytes() == planned[0].read_bytes()) is same


def test_it_flies_like_any_other_and_its_page_says_what_it_tells(cpfls, config, planned, tmp_path):
    cpfls.done("simulate", config, planned[0], "-o", tmp_path / "flight.h5")
    cpfls.done("report", config, planned[0], "-o", tmp_path / "page.md")
    text = (tmp_path / "page.md").read_text().replace("\\_", "_")
    assert "This flight separates offset of the centre of mass from constant torque" in text
    assert "If the diagnosis then names com_offset alone, it is com_offset and not torque_bias" in text


def test_a_single_effect_is_shown(cpfls, config, tmp_path):
    (row,) = cpfls.told("trajectory", config, "--to-tell", "rotor_drag", *SMALL, *FEW, "-o", tmp_path / "n.h5")[
        "questions"
    ]
    assert (row["true"], row["rival"]) == ("rotor_drag", "")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--to-tell", "com_ofset,torque_bias"), "did you mean com_offset?"),
        (("--to-tell", "com_offset,gyro_bias"), "gyro_bias is a sensor fault"),
        (("--to-tell", "motor_lag,channel_delay"), "no single flight separates them"),
        (("--to-tell", "parameter_error"), "to_tell = [parameter_error]: nothing to separate"),
        (("--to-tell", ""), "nothing to separate; name effects with --to-tell A,B"),
        ((*PAIR, "--box", "0.4,4,3"), "trajectory.next_flight.box_m = [0.4, 4.0, 3.0]"),
        ((*PAIR, "--box", "4,4,9"), "would reach into the ground; raise it to 4.5"),
        ((*PAIR, "--box", "4,4"), "trajectory.next_flight.box_m"),
        ((*PAIR, "--set", "vehicle.rotor_speed_max_rad_s=350"), "leaves the rotors no room"),
        ((*PAIR, "--set", "trajectory.duration_s=null"), "path next-flight needs a duration"),
        ((*PAIR, "--waypoints", "points.csv"), "--to-tell and --for choose the path themselves"),
        (("--for", "nowhere.h5"), "nowhere.h5: no such file"),
    ],
)
def test_what_makes_no_sense_is_said(cpfls, config, tmp_path, options, message):
    result = cpfls("trajectory", config, *options, "-o", tmp_path / "n.h5")
    assert result.exit_code in (1, 2)
    assert message in result.stderr
    assert "Traceback" not in result.output
    assert list(tmp_path.iterdir()) == []


def test_waypoints_that_are_there_are_not_replaced(cpfls, config, tmp_path):
    (tmp_path / "n-waypoints.csv").write_text("mine\n")
    result = cpfls("trajectory", config, *PAIR, *SMALL, *FEW, "-o", tmp_path / "n.h5")
    assert result.exit_code != 0
    assert "n-waypoints.csv" in result.stderr
    assert (tmp_path / "n-waypoints.csv").read_text() == "mine\n"
