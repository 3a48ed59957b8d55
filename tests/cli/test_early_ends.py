"""What ends a flight or its log before its time is said first, with the time, and cut by init and import alike."""

import pytest
import yaml

from tests.builders import ended_flights as ended
from tests.builders.unknown_logs import flat_log, flight, run_on, write_csv

VEHICLE = ("--mass", 0.8, "--arm", 0.16)


def proposed(cpfls, folder, contents):
    """Write a log and its config; give both with what init says."""
    log = write_csv(folder / "log.csv", contents)
    config = folder / "study.yaml"
    return log, config, cpfls("init", log, *VEHICLE, "-o", config)


def imported(cpfls, config, log, crop):
    data = yaml.safe_load(config.read_text())
    data["import"]["crop_s"] = crop
    config.write_text(yaml.safe_dump(data))
    return cpfls("import", config, log, "-o", config.with_name("flight.h5"), "--force").stderr


@pytest.fixture
def crashed():
    own = flight(ended.SECONDS)
    own.position[:, 2] += 30.0
    return flat_log(ended.hits(own))


def test_a_crash_is_said_first_and_cut(cpfls, tmp_path, crashed):
    log, config, result = proposed(cpfls, tmp_path, crashed)
    first, *more = result.stderr.splitlines()
    assert first.endswith("log.csv: impact at 40.0 s; the 40 s before it are used")
    assert "contradicts itself" not in "".join(more)
    assert yaml.safe_load(config.read_text())["import"]["crop_s"] == [0.0, pytest.approx(40.0, abs=0.1)]
    assert imported(cpfls, config, log, "flown").startswith(
        "cpfls: note: impact at 40.0 s; the 40 s before it are used"
    )
    assert imported(cpfls, config, log, None).startswith(
        "cpfls: note: impact at 40.0 s, and import.crop_s keeps what comes after; import.crop_s: flown"
    )


def test_a_crop_of_ones_own_is_warned_of_on_the_clock_of_the_log_and_only_if_flown_cuts_more(cpfls, tmp_path, crashed):
    log, config, _ = proposed(cpfls, tmp_path, crashed)
    first = imported(cpfls, config, log, [10.0, 45.0]).splitlines()[0]
    assert first.startswith("cpfls: note: impact at 40.0 s, and import.crop_s keeps what comes after")
    assert "import.crop_s: flown" not in imported(cpfls, config, log, [10.0, 40.2])


def test_columns_that_run_on_in_straight_lines_are_cut_where_their_source_ends(cpfls, tmp_path):
    log, config, result = proposed(cpfls, tmp_path, run_on(flat_log(flight(40.0)), 15.0, "gyro", "acc", "rpm"))
    first, *more = result.stderr.splitlines()
    assert "acceleration, body_rate and rotor_speed run in straight lines from 15.0 s on" in first
    assert first.endswith("the 15 s of flight in between are used")
    assert "contradicts itself" not in "".join(more)
    assert "rotor_speed" in result.stdout
    assert yaml.safe_load(config.read_text())["import"]["crop_s"] == [0.0, pytest.approx(15.0, abs=0.1)]
    assert "run in straight lines from 15.0 s on" in imported(cpfls, config, log, "flown").splitlines()[0]
