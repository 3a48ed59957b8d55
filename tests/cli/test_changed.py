"""`cpfls changed`: what it says of flights before and after a rotor became weak, what it keeps, and what it refuses."""

import json

import numpy as np
import pytest

from cpfls_cli.changes.results import Changed
from cpfls_cli.store import read
from tests.builders.changed_flights import HEADER, flight_table, save, write_flights


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
    told = json.loads((folder / "out" / "changed.json").read_text())
    assert (told["verdict"], told["reference_flights_lacking"]) == ("NO CHANGE SEEN", 1)
    assert "NO CHANGE SEEN" in (folder / "out" / "report.html").read_text()


def test_where_no_load_would_have_shown_it_cannot_be_told(changed):
    """That far more vibration would have shown says nothing of rotors and weights."""
    result = changed("same.csv", before=(1,), options=["--fail-on-change"])
    said = " ".join(result.stdout.split())
    assert result.exit_code == 3
    assert said.startswith("CANNOT TELL: no weak rotor, mass or centre of mass of any size that is looked for would")
    assert "1 reference flight is too few; give 2 more" in said
    assert "times the vibration" in said
    assert "a rotor that pulls" not in said.lower()


def test_a_weak_rotor_is_named_with_its_loss(changed, folder):
    result = changed("weak1.csv", "weak2.csv", options=["--json", "--fail-on-change"])
    assert result.exit_code == 1
    told = json.loads(result.stdout)
    assert told == json.loads((folder / "out" / "changed.json").read_text())
    (cause,) = told["causes"]
    assert (told["changed"], cause["name"], cause["named"]) == (True, "rotor M3", True)
    (size,) = cause["sizes"]
    assert size["low"] < 0.2 < size["high"]
    assert told["since"] == "weak1.csv"
    # Of a cross each rotor carries a quarter alone.
    load = next(each for each in told["numbers"] if each["name"] == "thrust M3")
    assert np.mean(load["today"]) - load["reference"] == pytest.approx(-np.log(0.8), abs=0.03)


def test_the_flight_that_it_began_with_is_told(changed, folder):
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
    result = changed("same.csv", options=["--set", setting, "-v"])
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
    copy = tmp_path / "copy.csv"
    copy.write_bytes((folder / "same.csv").read_bytes())
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
    page = folder / "page.md"
    cpfls.done("report", folder / "study.yaml", made, "-o", page, "--force")
    assert all(name in page.read_text() for name in ("weak1.csv", "weak2.csv", "before1.csv", "before5.csv"))
