"""What the gap workflow refuses, and what it says then."""

import os
import re

import numpy as np
import pytest

from tests.builders.artifacts import edited
from tests.builders.shifted_flights import save


def column(path, *names):
    """Copy a log without some of its columns."""
    header = path.read_text().splitlines()[0].split(",")
    kept = [place for place, name in enumerate(header) if name not in names]
    return np.loadtxt(path, delimiter=",", skiprows=1)[:, kept], ",".join(header[place] for place in kept)


def test_output_that_is_a_file(refuse, gap_config, shifted, tmp_path):
    (tmp_path / "file").write_text("mine")
    (message,) = refuse("gap", gap_config, *shifted, "-o", tmp_path / "file", "--force")
    assert message.endswith("is a file; -o names a folder")


def test_a_folder_in_the_place_of_a_file(refuse, gap_config, shifted, tmp_path):
    (tmp_path / "out" / "report.html").mkdir(parents=True)
    (message,) = refuse("gap", gap_config, *shifted, "-o", tmp_path / "out", "--force")
    assert message.endswith("report.html: is a folder, but a file of this name must be written; move it away")


@pytest.mark.parametrize("made", [True, False])
def test_a_folder_that_cannot_be_written_is_found_before_the_work(
    refuse, gap_config, shifted, tmp_path, monkeypatch, made
):
    # Root may write anywhere, so the answer of the system is put in its place.
    monkeypatch.setattr("os.access", lambda _path, mode, **_: not mode & os.W_OK)
    out = tmp_path / "out"
    if made:
        out.mkdir()
    (message,) = refuse("gap", gap_config, *shifted, "-o", out, "--dry-run")
    assert message == f"{out}: cannot write into the folder {tmp_path}; change its permissions"


def test_unknown_effect_to_ignore(refuse, gap_config, shifted, tmp_path):
    (message,) = refuse("gap", gap_config, *shifted, "-o", tmp_path / "x", "--set", "gap.ignore=[com_ofset]")
    assert message == "gap.ignore = com_ofset: no such effect (did you mean com_offset?)"


def test_flight_too_short_to_split(refuse, gap_config, shifted, tmp_path):
    data, header = column(shifted[0])
    (message,) = refuse("gap", gap_config, save(tmp_path / "short.csv", data[:900], header), "-o", tmp_path / "x")
    assert message.startswith("short.csv: the only flight is too short to hold out a third of it")
    assert "--held-out" in message
    assert "gap.window_s = 0.4" in message


def test_log_without_actuation(refuse, gap_config, shifted, tmp_path):
    data, header = column(shifted[0], "om1", "om2", "om3", "om4")
    (message,) = refuse("compare", gap_config, save(tmp_path / "still.csv", data, header), "-o", tmp_path / "x.h5")
    assert "has no rotor_speed, rotor_command or body_torque" in message


@pytest.fixture(scope="module")
def other_config(gap_config, tmp_path_factory):
    path = tmp_path_factory.mktemp("other") / "study.yaml"
    path.write_text(gap_config.read_text().replace('"mass_kg": 6.0', '"mass_kg": 7.0'))
    return path


def test_disagreement_of_another_vehicle(cpfls, refuse, gap_config, other_config, shifted, tmp_path):
    source = cpfls.made("compare", other_config, *shifted[:2], at=tmp_path / "disagreement.h5")
    (message,) = refuse("diagnose", gap_config, source, "-o", tmp_path / "x.h5")
    assert "vehicle.mass_kg" in message


def test_commands_stand_in_where_speeds_are_missing(cpfls, gap_config, shifted, tmp_path):
    data, header = column(shifted[0])
    commanded = save(tmp_path / "commanded.csv", data, header.replace("om", "cmd"))
    words = "import.signals.rotor_command={columns: [cmd1, cmd2, cmd3, cmd4], unit: rad/s}"
    result = cpfls.done("compare", gap_config, commanded, "-o", tmp_path / "x.h5", "--set", words, "-v")
    unseen = result.stdout[result.stdout.index("what these flights cannot show") :]
    assert re.search(r"\bchannel_delay\b.* The flights lack", unseen)
    assert "motor_lag" not in result.stdout


def test_a_flight_that_is_learned_from_is_not_held_out(cpfls, refuse, gap_config, shifted, tmp_path):
    said = "flight_1.csv: is both learned from and held out, so nothing would be judged; leave it out of one of them"
    for given in (("--held-out", shifted[0]), (shifted[0],)):
        (message,) = refuse("gap", gap_config, shifted[0], *given, "-o", tmp_path / "x")
        assert message.startswith(said)
    # The same through the stages, where the first one has the flights.
    cpfls.done("compare", gap_config, shifted[0], shifted[0], "-o", tmp_path / "d.h5")
    words = ("diagnose", gap_config, tmp_path / "d.h5", "-o", tmp_path / "n.h5")
    (message,) = refuse(*words, "--held-out", shifted[0])
    assert message.startswith(said)
    assert "flight_1.csv: is given twice, also as flight_1.csv" in cpfls(*words).stderr
    # A file of an older version does not hold the files of its flights.
    with edited(tmp_path / "d.h5") as older:
        del older["files"]
    (message,) = refuse(*words, "--held-out", shifted[0], "--force")
    assert message.startswith(said)


def test_all_numbers_that_differ_are_named_and_the_first_with_both_values(refuse, gap_config, pipeline, tmp_path):
    words = ("--set", "vehicle.mass_kg=5.5", "--set", "vehicle.rotor_speed_max_rad_s=900")
    (message,) = refuse("compare", gap_config, pipeline.flight, *words, "-o", tmp_path / "x.h5")
    assert "vehicle.mass_kg (6.0 there, 5.5 in the config), vehicle." in message
