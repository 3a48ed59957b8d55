"""Missions, and the flight that comes next."""

import csv
import json
import shlex

import numpy as np
import pytest

from cpfls_cli.config.study import parse_yaml, to_yaml
from cpfls_cli.flightlog.results import Flight
from cpfls_cli.flights.path import PlannedPath
from cpfls_cli.pages.gap_words import WHAT_TO_FLY
from cpfls_cli.store import read
from tests.builders.studies import VEHICLE

HOVER = ("--hover", "8", "--excite", "roll,pitch", "--band", "0.7,3", "--size", "2", "--repeat", "4")
SMALL = ("--duration", "10", "--box", "5,4,3", "--height", "3")
FEW = ("--set", "trajectory.next_flight.starts=2", "--set", "trajectory.next_flight.iterations=3")
PAIR = ("--separate", "com_offset,torque_bias")


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    path = tmp_path_factory.mktemp("mission") / "study.yaml"
    path.write_text(
        "trajectory: {sample_time_s: 0.02, repeat_pause_s: 4.0}\n"
        "simulation: {closed_loop: {integration_rate_hz: 200.0}}\n" + VEHICLE
    )
    return path


@pytest.fixture(scope="module")
def mission(cpfls, config, tmp_path_factory):
    output = tmp_path_factory.mktemp("planned") / "mission.h5"
    return output, cpfls.summary("trajectory", config, *HOVER, "-o", output)


def test_the_summary_shows_runs_and_excitation(mission):
    output, summary = mission
    assert [run["begin"] for run in summary["runs"]] == pytest.approx([0.0, 12.0, 24.0, 36.0])
    assert summary["duration_s"] == pytest.approx(44.0)
    assert summary["excited"]["axes"] == ["roll", "pitch"]
    assert summary["excited"]["band_hz"] == [0.7, 3.0]
    assert summary["excited"]["size_rad"] == pytest.approx([np.radians(2.0)] * 2)
    assert summary["files"] == [str(output.with_name("mission-waypoints.csv"))]
    assert len(output.with_name("mission-waypoints.csv").read_text().splitlines()) == 2202


def test_runs_flown_in_closed_loop_are_found_equal(cpfls, config, mission, tmp_path):
    flight = cpfls.made("simulate", config, mission[0], "--mode", "closed-loop", at=tmp_path / "flight.h5")
    planned, flown = read(mission[0], PlannedPath)[0], read(flight, Flight)[0]
    firsts = [round(run.begin / planned.time[1]) for run in planned.runs]
    length = round(planned.runs[0].end / planned.time[1]) + 1
    for name in ("attitude", "body_rate", "rotor_speed", "velocity"):
        runs = np.array([getattr(flown, name)[first : first + length] for first in firsts])
        assert np.abs(runs - runs.mean(axis=0)).max() < 1e-3 * np.ptp(runs)
    # Not because nothing happens.
    assert np.ptp(flown.attitude[:, :2], axis=0).min() > np.radians(2.0)


def test_a_repeated_path_says_how_long_it_takes_and_why(cpfls, config, tmp_path):
    result = cpfls.done("trajectory", config, "--repeat", "3", "-o", tmp_path / "m.h5", "-v")
    assert "The path is flown 3 times, each run the same from rest to rest: 54.86 s each" in result.stdout
    assert "each is an instrument for the others" in result.stdout
    cpfls.done("report", config, tmp_path / "m.h5", "-o", tmp_path / "m.md")
    assert "The path is flown 3 times" in (tmp_path / "m.md").read_text()


def test_an_excitation_is_made_smaller_with_the_limit_that_it_reaches(cpfls, config, tmp_path):
    assert (
        "roll and pitch: excited less than asked for, because more would pass the limit on rotor speed ("
        in cpfls.done("trajectory", config, *HOVER, "--size", "20", "-o", tmp_path / "m.h5").stderr
    )


def test_files_for_autopilots_stand_next_to_the_path(cpfls, config, tmp_path):
    home = ("--format", "px4", "--format", "csv", "--home", "47.3977,8.5456,10")
    cpfls.done("trajectory", config, "--repeat", "2", *home, "-o", tmp_path / "m.h5", "--json")
    items = json.loads((tmp_path / "m.plan").read_text())["mission"]["items"]
    assert [item["command"] for item in items].count(16) == 8
    cpfls.done("trajectory", config, *HOVER, "--format", "ardupilot", "-o", tmp_path / "s.h5", "--json")
    files = sorted(path.name for path in tmp_path.iterdir())
    assert files == ["m-waypoints.csv", "m.h5", "m.plan", "s-sid-pitch.param", "s-sid-roll.param", "s.h5"]
    again = cpfls("trajectory", config, *HOVER, "--format", "ardupilot", "-o", tmp_path / "s.h5")
    assert again.exit_code == 2
    (tmp_path / "s.h5").unlink()
    again = cpfls("trajectory", config, *HOVER, "--format", "ardupilot", "-o", tmp_path / "s.h5")
    assert "s-sid-" in again.stderr


def test_a_next_flight_is_repeated_too(cpfls, config, tmp_path):
    few = ("--set", "trajectory.next_flight.starts=2", "--set", "trajectory.next_flight.iterations=1")
    words = ("--separate", "com_offset,torque_bias", "--duration", "10", "--box", "5,4,3", "--height", "3", *few)
    cpfls.done("trajectory", config, *words, "--repeat", "2", "-o", tmp_path / "n.h5")
    record = read(tmp_path / "n.h5", PlannedPath)[0]
    np.testing.assert_allclose([run.begin for run in record.runs], [0.0, 14.0])
    length = round(10.0 / 0.02) + 1
    np.testing.assert_allclose(record.position[700 : 700 + length], record.position[:length], atol=1e-9)


def test_what_flights_that_show_the_loop_advise_is_planned_for_numbers_that_nobody_knows(cpfls, tmp_path, monkeypatch):
    """The command that `cpfls vehicle` prints, pasted, with a config that leaves open what was looked for."""
    vehicle = parse_yaml(VEHICLE, "vehicle")
    vehicle["vehicle"]["inertia_kg_m2"] = None
    (tmp_path / "study.yaml").write_text(to_yaml(vehicle))
    monkeypatch.chdir(tmp_path)
    program, *words = shlex.split(WHAT_TO_FLY.replace("CONFIG", "study.yaml"))
    result = cpfls(*words)
    assert program == "cpfls"
    assert result.exit_code == 0, result.output
    assert len(read(tmp_path / "mission.h5", PlannedPath)[0].runs) == 4
    assert "inertia: null in the config; what the path asks of the rotors was checked with guesses" in result.stderr


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--repeat", "0"), "trajectory.repeat = 0: must be greater than or equal to 1"),
        (("--excite", "rol"), 'trajectory.excite.axes.0 = "rol": must be'),
        (("--excite", "roll", "--band", "3"), "trajectory.excite.band_hz"),
        (("--excite", "roll", "--band", "1,20"), "lower it to 0.005 or less"),
        (("--excite", "roll", "--size", "50"), "trajectory.excite.size_rad"),
        (("--band", "1,2"), "--band 1,2: describes an excitation; say which axes with --excite AXES"),
        (("--signal", "multisine"), "--signal multisine: describes an excitation"),
        (("--hover", "9", "--duration", "8"), "--hover 9: stays at one place for so long; leave out --duration 8"),
        (("--hover", "9", "--separate", "inflow"), "leave out --separate and --for"),
        (("--format", "px4"), "add --home LAT,LON,HEIGHT"),
        (("--format", "px4", "--home", "91,0,1"), "--home 91,0,1: give latitude and longitude"),
        (("--format", "px4", "--home", "a,b,c"), "--home a,b,c: give latitude and longitude"),
        (("--home", "1,2,3"), "--home 1,2,3: is the place of a mission; add --format px4"),
        (("--format", "ardupilot"), "say which axes with --excite AXES"),
        ((*HOVER, "--format", "px4", "--home", "1,2,3"), "a mission of waypoints holds no excitation"),
        (("--format", "csv", "--set", "trajectory.path=full-rotation"), "turns a held vehicle; no autopilot flies it"),
        (("--excite", "roll", "--set", "trajectory.yaw_turn_rad=1"), "trajectory.yaw_turn_rad = 1.0: turns the path"),
        (("--separate", "inflow", "--format", "px4", "--home", "1,2,3"), "only a CSV holds it"),
    ],
)
def test_what_makes_no_sense_is_refused(refuse, config, tmp_path, words, complaint):
    assert complaint in "\n".join(refuse("trajectory", config, *words, "-o", tmp_path / "x.h5"))


@pytest.mark.parametrize("words", [("--set", "trajectory.path=full-rotation"), ("--separate", "inflow,linear_damping")])
def test_guesses_choose_no_path(refuse, tmp_path, words):
    vehicle = parse_yaml(VEHICLE, "vehicle")
    vehicle["vehicle"]["inertia_kg_m2"] = None
    (tmp_path / "study.yaml").write_text(to_yaml(vehicle))
    (line,) = refuse("trajectory", tmp_path / "study.yaml", *words, "-o", tmp_path / "x.h5")
    assert "not known in this config, but `cpfls trajectory` needs what is null there" in line


@pytest.fixture(scope="module")
def next_config(tmp_path_factory):
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
def planned(cpfls, next_config, tmp_path_factory):
    output = tmp_path_factory.mktemp("planned") / "next.h5"
    return output, cpfls.summary("trajectory", next_config, *PAIR, *SMALL, *FEW, "-o", output)


def test_the_flight_keeps_to_the_box_and_starts_and_ends_at_rest(planned):
    record = read(planned[0], PlannedPath)[0]
    assert record.time[-1] == pytest.approx(10.0)
    assert (np.abs(record.position - [0, 0, 3]) <= np.array([2.5, 2.0, 1.5]) + 1e-6).all()
    for values in (record.velocity, record.acceleration, record.body_rate):
        np.testing.assert_allclose(values[[0, -1]], 0, atol=1e-6)


def test_each_question_is_answered_both_ways_and_next_to_other_flights(planned):
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


def test_the_same_seed_gives_the_same_bytes_and_another_seed_does_not(cpfls, next_config, planned, tmp_path):
    for seed, same in ((4, True), (5, False)):
        output = tmp_path / "next.h5"
        cpfls.done("trajectory", next_config, *PAIR, *SMALL, *FEW, "-o", output, "--force", "--seed", seed)
        assert (output.read_bytes() == planned[0].read_bytes()) is same


def test_it_flies_like_any_other_and_its_page_says_what_it_shows(cpfls, next_config, planned, tmp_path):
    cpfls.done("simulate", next_config, planned[0], "-o", tmp_path / "flight.h5")
    cpfls.done("report", next_config, planned[0], "-o", tmp_path / "page.md")
    text = (tmp_path / "page.md").read_text().replace("\\_", "_")
    assert "This flight separates offset of the centre of mass from constant torque" in text
    assert "If the diagnosis then names com_offset alone, it is com_offset and not torque_bias" in text


def test_a_single_effect_is_shown(cpfls, next_config, tmp_path):
    (row,) = cpfls.summary("trajectory", next_config, "--to-tell", "rotor_drag", *SMALL, *FEW, "-o", tmp_path / "n.h5")[
        "questions"
    ]
    assert (row["true"], row["rival"]) == ("rotor_drag", "")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--separate", "com_ofset,torque_bias"), "did you mean com_offset?"),
        (("--separate", "com_offset,gyro_bias"), "gyro_bias is a sensor fault"),
        (("--separate", "motor_lag,channel_delay"), "no single flight separates them"),
        (("--separate", "parameter_error"), "separate = [parameter_error]: nothing to separate"),
        (("--separate", ""), "nothing to separate; name effects with --separate A,B"),
        ((*PAIR, "--box", "0.4,4,3"), "trajectory.next_flight.box_m = [0.4, 4.0, 3.0]"),
        ((*PAIR, "--box", "4,4,9"), "would reach into the ground; raise it to 4.5"),
        ((*PAIR, "--box", "4,4"), "trajectory.next_flight.box_m"),
        ((*PAIR, "--set", "vehicle.rotor_speed_max_rad_s=350"), "leaves the rotors no room"),
        ((*PAIR, "--set", "trajectory.duration_s=null"), "path next-flight needs a duration"),
        ((*PAIR, "--waypoints", "points.csv"), "--separate and --for choose the path themselves"),
        (("--for", "nowhere.h5"), "nowhere.h5: no such file"),
    ],
)
def test_what_makes_no_sense_is_said(cpfls, next_config, tmp_path, options, message):
    result = cpfls("trajectory", next_config, *options, "-o", tmp_path / "n.h5")
    assert result.exit_code in (1, 2)
    assert message in result.stderr
    assert "Traceback" not in result.output
    assert list(tmp_path.iterdir()) == []


def test_waypoints_that_are_there_are_not_replaced(cpfls, next_config, tmp_path):
    (tmp_path / "n-waypoints.csv").write_text("mine\n")
    result = cpfls("trajectory", next_config, *PAIR, *SMALL, *FEW, "-o", tmp_path / "n.h5")
    assert result.exit_code != 0
    assert "n-waypoints.csv" in result.stderr
    assert (tmp_path / "n-waypoints.csv").read_text() == "mine\n"
