"""`cpfls changed` and `cpfls trend` on logs of today that are wrong, or of another vehicle: never a green answer."""

import json

import numpy as np
import pytest

from tests.builders.changed_flights import HEADER, flight_table, save, write_flights
from tests.builders.unknown_logs import ARM, MASS, flat_log, flight, named, ulog_of_flight, write_csv

RATE, FORCE, SPEED = ("gyro_x", "gyro_y", "gyro_z"), ("acc_x", "acc_y", "acc_z"), ("rpm1", "rpm2", "rpm3", "rpm4")
TODAY = flight(seed=11)
RPM = TODAY.speed * 60 / (2 * np.pi)
WRONG = {
    "gyroscope mirrored": ({"rate": named(TODAY.rate * [-1, 1, 1], *RATE)}, "gain roll"),
    "motors exchanged": ({"speed": named(RPM[:, [1, 0, 2, 3]], *SPEED)}, "judged by the motion, the rotors are"),
    "gyroscope dead": ({"rate": named(0 * TODAY.rate, *RATE)}, "barely agree"),
    "deg/s as rad/s": ({"rate": named(np.degrees(TODAY.rate), *RATE)}, "does the log give rates in deg/s"),
    "g as m/s^2": ({"force": named(TODAY.specific_force / 9.81, *FORCE)}, "the accelerometer is in g"),
    "rad/s as rpm": ({"speed": named(TODAY.speed, *SPEED)}, "rad/s? then it is"),
}


@pytest.fixture(scope="module")
def logs(tmp_path_factory, cpfls):
    """Four reference flights with attitude and motion, one of today like them, and the config of `init`."""
    folder = tmp_path_factory.mktemp("wrong")
    before = [write_csv(folder / f"before{seed}.csv", flat_log(flight(seed=seed))) for seed in (1, 2, 3, 4)]
    write_csv(folder / "same.csv", flat_log(TODAY))
    cpfls.done("init", *before, "-o", folder / "study.yaml", "--mass", MASS, "--arm", ARM)
    return folder


def changed(cpfls, folder, today, *options):
    since = sorted(folder.glob("before*"))
    words = ("changed", folder / "study.yaml", folder / today, "--since", *since, "-o", folder / "out", "--force")
    return cpfls(*words, "--fail-on-change", *options)


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_log_of_today_is_never_green(cpfls, logs, what):
    columns, words = WRONG[what]
    write_csv(logs / "wrong.csv", flat_log(TODAY, **columns))
    result = changed(cpfls, logs, "wrong.csv")
    assert result.exit_code in (1, 2, 3)
    assert not result.stdout.startswith("NO CHANGE")
    assert words.lower() in " ".join(result.output.split()).lower()
    if result.exit_code != 2:
        told = json.loads((logs / "out" / "changed.json").read_text())
        assert told["verdict"] == ("CHANGED" if result.exit_code == 1 else "CANNOT TELL")
        assert told["contradictions"]


def test_it_is_said_of_reference_flights_too(cpfls, logs):
    """Where all logs are read with a wrong unit numbers cancel, and the logs contradict themselves."""
    result = changed(cpfls, logs, "same.csv", "--set", "import.signals.body_rate.unit=deg/s")
    assert result.exit_code == 3
    assert result.stdout.startswith("CANNOT TELL: The log contradicts itself: ")
    assert "before1.csv: about body x" in " ".join(result.stdout.split())


@pytest.fixture(scope="module")
def by_torque(tmp_path_factory):
    """Logs without attitude: only how rotation follows torque shows that an axis is turned round."""
    folder = write_flights(tmp_path_factory.mktemp("torque"))
    table = flight_table(11)
    mirrored, exchanged = table.copy(), table.copy()
    mirrored[:, 1] *= -1
    exchanged[:, [7, 9]] = table[:, [9, 7]]
    save(folder / "mirrored.csv", mirrored, HEADER)
    save(folder / "exchanged.csv", exchanged, HEADER)
    return folder


@pytest.mark.parametrize(("today", "number"), [("mirrored.csv", "gain roll"), ("exchanged.csv", "gain pitch")])
def test_a_ratio_that_is_reversed_today_is_a_change(cpfls, by_torque, today, number):
    result = changed(cpfls, by_torque, today)
    assert result.exit_code == 1, result.output
    told = json.loads((by_torque / "out" / "changed.json").read_text())
    assert told["reversed"] == [number]
    assert "reversed, or nothing, and in no reference flight" in " ".join(result.stdout.split())


def test_a_gyroscope_that_never_moves_today_is_a_change(cpfls, by_torque):
    """Without attitude nothing else shows that it is dead."""
    dead = flight_table(11)
    dead[:, 1:4] = 0.0
    save(by_torque / "dead.csv", dead, HEADER)
    result = changed(cpfls, by_torque, "dead.csv")
    assert result.exit_code == 1, result.output
    assert "vibration gyroscope x" in json.loads((by_torque / "out" / "changed.json").read_text())["reversed"]
    assert "a gyroscope that is mirrored or dead" in " ".join(result.stdout.split())


def test_a_log_with_other_columns_is_said_in_a_line_and_compared_without_them_if_asked(cpfls, logs):
    write_csv(logs / "other.csv", flat_log(TODAY, position=None, velocity=None))
    refused = changed(cpfls, logs, "other.csv")
    assert refused.exit_code == 2
    (line,) = [line for line in refused.stderr.splitlines() if "error" in line]
    assert "other.csv: has other columns than the config reads for position and velocity: no x and 5 more" in line
    assert "give --anyway to compare without them" in line
    assert changed(cpfls, logs, "other.csv", "--anyway").exit_code == 0


@pytest.fixture(scope="module")
def stated(tmp_path_factory, cpfls):
    """Reference flights whose logs state numbers of their vehicle, and the config of `init`."""
    folder = tmp_path_factory.mktemp("stated")
    for seed, more in ((1, {}), (2, {}), (3, {}), (4, {"PWM_MIN": 1000})):
        (folder / f"before{seed}.ulg").write_bytes(ulog_of_flight(flight(seed=seed), MOT_POLE_COUNT=14, **more))
    logs = [folder / f"before{seed}.ulg" for seed in (4, 1, 2, 3)]
    cpfls.done("init", *logs, "-o", folder / "study.yaml", "--mass", MASS)
    return folder


def test_logs_of_different_vehicles_are_refused_before_their_columns(cpfls, stated):
    other = ulog_of_flight(TODAY, without="vehicle_local_position", MOT_POLE_COUNT=12)
    (stated / "lacks.ulg").write_bytes(other)
    (stated / "scaled.ulg").write_bytes(ulog_of_flight(TODAY, MOT_POLE_COUNT=14, PWM_MIN=1100))
    assert "of different vehicles (MOT_POLE_COUNT 14 and 12)" in changed(cpfls, stated, "lacks.ulg").stderr
    since = [stated / f"before{seed}.ulg" for seed in (4, 1, 2, 3)]
    words = (
        "changed",
        stated / "study.yaml",
        stated / "scaled.ulg",
        "--since",
        *since,
        "-o",
        stated / "out",
        "--force",
    )
    said = " ".join(cpfls(*words).stdout.split())
    assert not said.startswith("NO CHANGE:")
    assert (
        "The logs of before4.ulg and scaled.ulg state PWM_MIN 1000 and 1100: make sure that it is one vehicle." in said
    )
    assert "Commands of scaled.ulg are shares of another range" in said


def test_logs_of_different_vehicles_are_refused_unless_asked(cpfls, stated):
    (stated / "other.ulg").write_bytes(ulog_of_flight(TODAY, SYS_AUTOSTART=4601, MOT_POLE_COUNT=14))
    logs = [stated / f"before{seed}.ulg" for seed in (1, 2, 3, 4)]
    said = "before1.ulg and other.ulg are of different vehicles (SYS_AUTOSTART 4001 and 4601)"
    refused = changed(cpfls, stated, "other.ulg")
    assert refused.exit_code == 2
    assert f"{said}: compare flights of one vehicle, or give --anyway" in refused.stderr
    words = ("trend", stated / "study.yaml", *logs, stated / "other.ulg", "-o", stated / "trend")
    assert said in cpfls(*words).stderr
    asked = changed(cpfls, stated, "other.ulg", "--anyway")
    assert asked.exit_code in (0, 1, 3)
    assert f"{said}, and are compared anyway" in " ".join(asked.stderr.split())
    # What `import` makes of a log keeps what it says of its vehicle.
    cpfls.done("import", stated / "study.yaml", stated / "other.ulg", "-o", stated / "other.h5")
    assert "are of different vehicles" in changed(cpfls, stated, "other.h5").stderr


def test_without_attitude_gravity_tells_the_unit_of_the_accelerometer(cpfls, by_torque):
    result = changed(cpfls, by_torque, "same.csv", "--set", "import.signals.acceleration.unit=g")
    assert result.exit_code == 3, result.output
    said = " ".join(result.stdout.split())
    assert said.startswith("CANNOT TELL: The log contradicts itself: ")
    assert "its accelerometer feels 9" in said
    assert "where gravity alone is 9.81: check import.signals.acceleration, its unit and scale" in said
