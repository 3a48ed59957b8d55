"""Paths that are repeated and excited, through the command: files for autopilots, a flight of equal runs, messages."""

import json
import shlex

import numpy as np
import pytest

from cpfls_cli.config.study import parse_yaml, to_yaml
from cpfls_cli.flights.flight import Flight
from cpfls_cli.flights.path import PlannedPath
from cpfls_cli.pages.gap_words import WHAT_TO_FLY
from cpfls_cli.store import read
from tests.builders.studies import VEHICLE

HOVER = ("--hover", "8", "--excite", "roll,pitch", "--band", "0.7,3", "--size", "2", "--repeat", "4")


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
    return output, cpfls.told("trajectory", config, *HOVER, "-o", output)


def test_the_summary_tells_runs_and_excitation(mission):
    output, told = mission
    assert [run["begin"] for run in told["runs"]] == pytest.approx([0.0, 12.0, 24.0, 36.0])
    assert told["duration_s"] == pytest.approx(44.0)
    assert told["excited"]["axes"] == ["roll", "pitch"]
    assert told["excited"]["band_hz"] == [0.7, 3.0]
    assert told["excited"]["size_rad"] == pytest.approx([np.radians(2.0)] * 2)
    assert told["files"] == [str(output.with_name("mission-waypoints.csv"))]
    assert len(output.with_name("mission-waypoints.csv").read_text().splitlines()) == 2202


def test_runs_flown_in_closed_loop_are_found_equal(cpfls, config, mission, tmp_path):
    flight = tmp_path / "flight.h5"
    cpfls.done("simulate", config, mission[0], "--mode", "closed-loop", "-o", flight)
    planned, flown = read(mission[0], PlannedPath)[0], read(flight, Flight)[0]
    firsts = [round(run.begin / planned.time[1]) for run in planned.runs]
    length = round(planned.runs[0].end / planned.time[1]) + 1
    for name in ("attitude", "body_rate", "rotor_speed", "velocity"):
        runs = np.array([getattr(flown, name)[first : first + length] for first in firsts])
        spread = np.abs(runs - runs.mean(axis=0)).max()
        assert spread < 1e-3 * np.ptp(runs)
    # Not because nothing happens.
    assert np.ptp(flown.attitude[:, :2], axis=0).min() > np.radians(2.0)


def test_a_repeated_path_says_how_long_it_takes_and_why(cpfls, config, tmp_path):
    result = cpfls.done("trajectory", config, "--repeat", "3", "-o", tmp_path / "m.h5", "-v")
    assert "The path is flown 3 times, each run the same from rest to rest: 54.86 s each" in result.stdout
    assert "each is an instrument for the others" in result.stdout
    cpfls.done("report", config, tmp_path / "m.h5", "-o", tmp_path / "m.md")
    assert "The path is flown 3 times" in (tmp_path / "m.md").read_text()


def test_an_excitation_is_made_smaller_with_the_limit_that_it_reaches(cpfls, config, tmp_path):
    result = cpfls.done("trajectory", config, *HOVER, "--size", "20", "-o", tmp_path / "m.h5")
    assert (
        "roll and pitch: excited less than asked for, because more would pass the limit on rotor speed ("
        in result.stderr
    )


def test_files_for_autopilots_stand_beside_the_path(cpfls, config, tmp_path):
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
    words = ("--to-tell", "com_offset,torque_bias", "--duration", "10", "--box", "5,4,3", "--height", "3", *few)
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
        (("--hover", "9", "--to-tell", "inflow"), "leave out --to-tell and --for"),
        (("--format", "px4"), "add --home LAT,LON,HEIGHT"),
        (("--format", "px4", "--home", "91,0,1"), "--home 91,0,1: give latitude and longitude"),
        (("--format", "px4", "--home", "a,b,c"), "--home a,b,c: give latitude and longitude"),
        (("--home", "1,2,3"), "--home 1,2,3: is the place of a mission; add --format px4"),
        (("--format", "ardupilot"), "say which axes with --excite AXES"),
        ((*HOVER, "--format", "px4", "--home", "1,2,3"), "a mission of waypoints holds no excitation"),
        (("--format", "csv", "--set", "trajectory.path=full-rotation"), "turns a held vehicle; no autopilot flies it"),
        (("--excite", "roll", "--set", "trajectory.yaw_turn_rad=1"), "trajectory.yaw_turn_rad = 1.0: turns the path"),
        (("--to-tell", "inflow", "--format", "px4", "--home", "1,2,3"), "only a CSV holds it"),
    ],
)
def test_what_makes_no_sense_is_refused(refuse, config, tmp_path, words, complaint):
    assert complaint in "\n".join(refuse("trajectory", config, *words, "-o", tmp_path / "x.h5"))


@pytest.mark.parametrize("words", [("--set", "trajectory.path=full-rotation"), ("--to-tell", "inflow,linear_damping")])
def test_guesses_choose_no_path(refuse, tmp_path, words):
    vehicle = parse_yaml(VEHICLE, "vehicle")
    vehicle["vehicle"]["inertia_kg_m2"] = None
    (tmp_path / "study.yaml").write_text(to_yaml(vehicle))
    (line,) = refuse("trajectory", tmp_path / "study.yaml", *words, "-o", tmp_path / "x.h5")
    assert "not known in this config, but `cpfls trajectory` needs what is null there" in line
