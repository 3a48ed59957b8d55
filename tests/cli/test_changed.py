"""`cpfls changed`: flights before and after a rotor became weak, and logs of today that are wrong."""

import json

import numpy as np
import pytest

from cpfls_cli.changes.results import Changed
from cpfls_cli.store import read
from tests.builders.changed_flights import HEADER, flight_table, save, write_flights
from tests.builders.studies import put_file
from tests.builders.unknown_logs import ARM, MASS, flat_log, flight, named, ulog_of_flight, write_csv


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_flights(tmp_path_factory.mktemp("changed"))


@pytest.fixture(scope="module")
def changed(cpfls, folder):
    """Run the command on flights of today by name; the numbers of all flights are kept in one folder."""

    def call(*today, before=(1, 2, 3, 4, 5), options=()):
        since = [folder / f"before{number}.csv" for number in before]
        words = ["changed", folder / "study.yaml", *(folder / name for name in today), "--since", *since]
        return cpfls(*words, "-o", folder / "out", "--force", *options)

    return call


def test_of_flights_as_before_nothing_is_named(changed):
    result = changed("same.csv", options=["--fail-on-change"])
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("NO CHANGE: ")
    assert "a rotor that pulls" in result.stdout.lower()
    assert " of the centre of mass" in result.stdout


def test_of_few_reference_flights_it_is_said_that_what_they_differ_by_is_assumed(changed, folder):
    result = changed("same.csv", before=(1, 2), options=["--fail-on-change"])
    assert result.exit_code == 0
    assert result.stdout.startswith("NO CHANGE SEEN: nothing beyond what is usual of vehicles")
    assert "2 reference flights are too few; give 1 more" in " ".join(result.stdout.split())
    summary = json.loads((folder / "out" / "changed.json").read_text())
    assert (summary["verdict"], summary["reference_flights_lacking"]) == ("NO CHANGE SEEN", 1)
    assert "NO CHANGE SEEN" in (folder / "out" / "report.html").read_text()


def test_where_no_load_could_be_detected_it_cannot_be_said(changed):
    """That far more vibration could have been detected says nothing of rotors and weights."""
    result = changed("same.csv", before=(1,), options=["--fail-on-change"])
    said = " ".join(result.stdout.split())
    assert result.exit_code == 3
    assert said.startswith("CANNOT TELL: no weak rotor, mass or centre of mass of any size that is looked for could")
    assert "1 reference flight is too few; give 2 more" in said
    assert "times the vibration" in said
    assert "a rotor that pulls" not in said.lower()


def test_a_weak_rotor_is_named_with_its_loss(changed, folder):
    result = changed("weak1.csv", "weak2.csv", options=["--json", "--fail-on-change"])
    assert result.exit_code == 1
    summary = json.loads(result.stdout)
    assert summary == json.loads((folder / "out" / "changed.json").read_text())
    (cause,) = summary["causes"]
    assert (summary["changed"], cause["name"], cause["named"]) == (True, "rotor M3", True)
    (size,) = cause["sizes"]
    assert size["low"] < 0.2 < size["high"]
    assert summary["since"] == "weak1.csv"
    # Of a cross each rotor carries a quarter alone.
    load = next(each for each in summary["numbers"] if each["name"] == "thrust M3")
    assert np.mean(load["today"]) - load["reference"] == pytest.approx(-np.log(0.8), abs=0.03)


def test_the_flight_that_it_began_with_is_said(changed, folder):
    # As weak that each flight shows it alone.
    for number in (3, 4, 5):
        save(folder / f"weak{number}.csv", flight_table(20 + number, (1.0, 1.0, 0.65, 1.0)), HEADER)
    result = changed("same.csv", *(f"weak{number}.csv" for number in (3, 4, 5)))
    assert "otor M3 pulls" in result.stdout.splitlines()[0]
    assert "weak3.csv, number 2 of 4: 3 of 4 flights show it alone" in result.stdout
    after = result.stdout.partition("next:\n")[2]
    assert "weak3.csv" in after
    assert "same.csv" not in after


def test_numbers_of_flights_are_kept(changed, folder, monkeypatch):
    changed("same.csv")
    kept = {path: path.read_bytes() for path in (folder / "out" / "flights").iterdir()}
    monkeypatch.setattr("cpfls_cli.stages._flight_numbers.read_alone", None)
    assert changed("same.csv").exit_code == 0
    monkeypatch.undo()
    # By other code they are others, and of another vehicle.
    monkeypatch.setattr("cpfls_cli.stages._flight_numbers.read_alone", None)
    monkeypatch.setattr("cpfls_cli.stages._flight_numbers.code_fingerprint", lambda: "other")
    with pytest.raises(TypeError):
        changed("same.csv")
    monkeypatch.undo()
    assert changed("same.csv", options=["--set", "vehicle.mass_kg=7"]).exit_code == 0
    assert any(path.read_bytes() != content for path, content in kept.items())


@pytest.mark.parametrize("setting", ["vehicle.mass_kg=60", "vehicle.mass_kg=1"])
def test_a_wrong_mass_cancels(changed, setting):
    """Though the thrust then lifts no vehicle, or many, it does so in all flights."""
    result = changed("same.csv", before=(1, 2, 3), options=["--set", setting, "-v"])
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("NO CHANGE: ")
    assert "times the weight" in result.stderr


def test_values_of_an_option_follow_one_another_or_it_is_repeated(cpfls, changed, folder):
    before = [folder / f"before{number}.csv" for number in (1, 2, 3)]
    repeated = [word for path in before for word in ("--since", path)]
    words = ("changed", folder / "study.yaml", *repeated, folder / "same.csv", "-o", folder / "out", "--force")
    # What follows the last belongs to it.
    assert cpfls(*words).exit_code == 2
    again = cpfls(*words[:2], folder / "same.csv", *repeated, *words[-3:])
    assert again.stdout == changed("same.csv", before=(1, 2, 3)).stdout


def test_what_the_comparison_lacks_is_said(changed, folder, tmp_path):
    slow = save(tmp_path / "slow.csv", flight_table(31, rate_hz=50.0), HEADER)
    speeds = save(tmp_path / "speeds.csv", flight_table(32), HEADER.replace("c1,c2,c3,c4,volts", "om1,om2,om3,om4,no"))
    short = save(tmp_path / "short.csv", flight_table(33, duration=2.0), HEADER)
    dead = save(tmp_path / "dead.csv", flight_table(34), HEADER.replace("volts", "no"))
    copy = put_file(tmp_path / "copy.csv", (folder / "same.csv").read_bytes())
    notes = changed(slow, short, dead, "same.csv", copy, options=["-v"]).stderr
    assert "without attitude: all flights; how any flight is flown is not known" in notes
    assert "another sampling rate than the usual one of the reference, 100 Hz: slow.csv (50 Hz)" in notes
    assert "note: left out: short.csv: flies for " in notes
    assert "not compared, for not all flights have it: vibration gyroscope x" in notes
    assert "without the battery's voltage: dead.csv; an emptier battery looks like a heavier vehicle" in notes
    assert "copy.csv: is given twice, also as same.csv; counted once" in notes
    # A flight that is not compared is said first, not behind "more notes".
    assert "note: left out: short.csv: flies for only 2 s" in changed(slow, short).stderr.splitlines()[0]
    notes = changed(speeds, options=["-v"]).stderr
    assert "speeds of rotors in speeds.csv, commands in before1.csv, " in notes


def test_what_a_user_gets_wrong_is_refused(cpfls, refuse, folder, tmp_path):
    study, same, before = folder / "study.yaml", folder / "same.csv", folder / "before1.csv"
    (message,) = refuse("changed", study, same, before, "--since", before, "-o", tmp_path / "out")
    assert message.endswith("is both a flight of today and one of the reference (--reference); leave it out of one")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes.txt").write_text("mine")
    (message,) = refuse("changed", study, same, "--since", before, "-o", tmp_path / "full")
    assert "exists already and is not empty" in message
    short = save(tmp_path / "short.csv", flight_table(33, duration=2.0), HEADER)
    result = cpfls("changed", study, short, "--since", before, "-o", tmp_path / "out")
    assert (result.exit_code, result.stdout) == (2, "")
    assert "short.csv: flies for" in result.stderr


def test_artifact_report_and_info_say_the_same(cpfls, changed, folder):
    first = changed("weak1.csv", "weak2.csv").stdout.splitlines()[0]
    made = folder / "out" / "changed.h5"
    found, _ = read(made, Changed)
    assert (found.changed, found.since) == (True, "weak1.csv")
    cpfls.done("check", made)
    assert first in cpfls("info", made).stdout
    assert first.partition(": ")[2].partition(";")[0] in (folder / "out" / "report.html").read_text()
    page = cpfls.made("report", folder / "study.yaml", made, "--force", at=folder / "page.md")
    assert all(name in page.read_text() for name in ("weak1.csv", "weak2.csv", "before1.csv", "before5.csv"))


RATE, FORCE, SPEED = ("gyro_x", "gyro_y", "gyro_z"), ("acc_x", "acc_y", "acc_z"), ("rpm1", "rpm2", "rpm3", "rpm4")
TODAY = flight(12.0, seed=11)
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
    before = [
        write_csv(folder / f"before{seed}.csv", flat_log(flight(seconds=12.0, seed=seed))) for seed in (1, 2, 3, 4)
    ]
    write_csv(folder / "same.csv", flat_log(TODAY))
    cpfls.done("init", *before, "-o", folder / "study.yaml", "--mass", MASS, "--arm", ARM)
    return folder


def compared(cpfls, folder, today, *options, before="before*"):
    since = sorted(folder.glob(before))
    words = ("changed", folder / "study.yaml", folder / today, "--since", *since, "-o", folder / "out", "--force")
    return cpfls(*words, "--fail-on-change", *options)


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_log_of_today_is_never_green(cpfls, logs, what):
    columns, words = WRONG[what]
    write_csv(logs / "wrong.csv", flat_log(TODAY, **columns))
    result = compared(cpfls, logs, "wrong.csv")
    assert result.exit_code in (1, 2, 3)
    assert not result.stdout.startswith("NO CHANGE")
    assert words.lower() in " ".join(result.output.split()).lower()
    if result.exit_code != 2:
        summary = json.loads((logs / "out" / "changed.json").read_text())
        assert summary["verdict"] == ("CHANGED" if result.exit_code == 1 else "CANNOT TELL")
        assert summary["contradictions"]


def test_it_is_said_of_reference_flights_too(cpfls, logs):
    """Where all logs are read with a wrong unit numbers cancel, and the logs contradict themselves."""
    result = compared(cpfls, logs, "same.csv", "--set", "import.signals.body_rate.unit=deg/s", before="before[12]*")
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
    result = compared(cpfls, by_torque, today)
    assert result.exit_code == 1, result.output
    assert json.loads((by_torque / "out" / "changed.json").read_text())["reversed"] == [number]
    assert "reversed, or nothing, and in no reference flight" in " ".join(result.stdout.split())


def test_a_gyroscope_that_never_moves_today_is_a_change(cpfls, by_torque):
    """Without attitude nothing else shows that it is dead."""
    dead = flight_table(11)
    dead[:, 1:4] = 0.0
    save(by_torque / "dead.csv", dead, HEADER)
    result = compared(cpfls, by_torque, "dead.csv")
    assert result.exit_code == 1, result.output
    assert "vibration gyroscope x" in json.loads((by_torque / "out" / "changed.json").read_text())["reversed"]
    assert "a gyroscope that is mirrored or dead" in " ".join(result.stdout.split())


def test_a_log_with_other_columns_is_said_in_a_line_and_compared_without_them_if_asked(cpfls, logs):
    write_csv(logs / "other.csv", flat_log(TODAY, position=None, velocity=None))
    refused = compared(cpfls, logs, "other.csv")
    assert refused.exit_code == 2
    (line,) = [line for line in refused.stderr.splitlines() if "error" in line]
    assert "other.csv: has other columns than the config reads for position and velocity: no x and 5 more" in line
    assert "give --anyway to compare without them" in line
    assert compared(cpfls, logs, "other.csv", "--anyway").exit_code == 0


@pytest.fixture(scope="module")
def stated(tmp_path_factory, cpfls):
    """Reference flights whose logs state numbers of their vehicle, and the config of `init`."""
    folder = tmp_path_factory.mktemp("stated")
    for seed, more in ((1, {}), (2, {}), (4, {"PWM_MIN": 1000})):
        (folder / f"before{seed}.ulg").write_bytes(
            ulog_of_flight(flight(seconds=12.0, seed=seed), MOT_POLE_COUNT=14, **more)
        )
    logs = [folder / f"before{seed}.ulg" for seed in (4, 1, 2)]
    cpfls.done("init", *logs, "-o", folder / "study.yaml", "--mass", MASS)
    return folder


def test_logs_of_different_vehicles_are_refused_before_their_columns(cpfls, stated):
    (stated / "lacks.ulg").write_bytes(ulog_of_flight(TODAY, without="vehicle_local_position", MOT_POLE_COUNT=12))
    (stated / "scaled.ulg").write_bytes(ulog_of_flight(TODAY, MOT_POLE_COUNT=14, PWM_MIN=1100))
    assert "of different vehicles (MOT_POLE_COUNT 14 and 12)" in compared(cpfls, stated, "lacks.ulg").stderr
    since = [stated / f"before{seed}.ulg" for seed in (4, 1, 2)]
    words = ("changed", stated / "study.yaml", stated / "scaled.ulg", "--since", *since)
    said = " ".join(cpfls(*words, "-o", stated / "out", "--force").stdout.split())
    assert not said.startswith("NO CHANGE:")
    assert (
        "The logs of before4.ulg and scaled.ulg state PWM_MIN 1000 and 1100: make sure that it is one vehicle." in said
    )
    assert "Commands of scaled.ulg are shares of another range" in said


def test_logs_of_different_vehicles_are_refused_unless_asked(cpfls, stated):
    (stated / "other.ulg").write_bytes(ulog_of_flight(TODAY, SYS_AUTOSTART=4601, MOT_POLE_COUNT=14))
    logs = [stated / f"before{seed}.ulg" for seed in (1, 2, 4)]
    said = "before1.ulg and other.ulg are of different vehicles (SYS_AUTOSTART 4001 and 4601)"
    refused = compared(cpfls, stated, "other.ulg")
    assert refused.exit_code == 2
    assert f"{said}: compare flights of one vehicle, or give --anyway" in refused.stderr
    words = ("trend", stated / "study.yaml", *logs, stated / "other.ulg", "-o", stated / "trend")
    assert said in cpfls(*words).stderr
    asked = compared(cpfls, stated, "other.ulg", "--anyway")
    assert asked.exit_code in (0, 1, 3)
    assert f"{said}, and are compared anyway" in " ".join(asked.stderr.split())
    # What `import` makes of a log keeps what it says of its vehicle.
    cpfls.done("import", stated / "study.yaml", stated / "other.ulg", "-o", stated / "other.h5")
    assert "are of different vehicles" in compared(cpfls, stated, "other.h5").stderr


def test_without_attitude_gravity_shows_the_unit_of_the_accelerometer(cpfls, by_torque):
    result = compared(cpfls, by_torque, "same.csv", "--set", "import.signals.acceleration.unit=g")
    assert result.exit_code == 3, result.output
    said = " ".join(result.stdout.split())
    assert said.startswith("CANNOT TELL: The log contradicts itself: ")
    assert "its accelerometer feels 9" in said
    assert "where gravity alone is 9.81: check import.signals.acceleration, its unit and scale" in said
