"""The whole workflow on flights whose only secret is a centre of mass that is off, and on flights without any."""

import json
import re
import shutil
from types import SimpleNamespace

import h5py
import pytest

OFFSET = (0.008, -0.005)
FILES = {"disagreement.h5", "diagnosis.h5", "extended.h5", "report.html", "gap.json"}


@pytest.fixture
def found(offset_answer):
    return offset_answer


@pytest.fixture(scope="module")
def none(cpfls, gap_config, exact, offset_answer, tmp_path_factory):
    """Flights without a secret, in a folder with the files of others before and one of the user."""
    folder = tmp_path_factory.mktemp("none") / "gap"
    shutil.copytree(offset_answer.folder, folder)
    (folder / "notes.txt").write_text("mine")
    return SimpleNamespace(folder=folder, summary=cpfls.summary("gap", gap_config, *exact, "-o", folder, "--force"))


@pytest.mark.decides
def test_offset_is_named_with_its_size(found):
    assert found.summary["verdict"] == "NAMED"
    assert [effect["name"] for effect in found.summary["effects"]] == ["com_offset"]
    coefficients = found.summary["effects"][0]["coefficients"]
    for name, true in zip(("c_x", "c_y"), OFFSET, strict=True):
        assert coefficients[name]["value"] == pytest.approx(true, rel=0.02)
        assert coefficients[name]["low"] < coefficients[name]["value"] < coefficients[name]["high"]
        assert coefficients[name]["unit"] == "m"
    assert found.summary["effects"][0]["p_value"] < 0.01


def test_unseen_gap_shrinks_to_the_noise_where_the_offset_acts(found):
    before, after = found.summary["gap_before"], found.summary["gap_after"]
    # Thrust of 59 N times the offset.
    assert before["torque_n_m"][:2] == pytest.approx([0.3, 0.48], rel=0.05)
    assert all(b > 10 * a for b, a in zip(before["torque_n_m"][:2], after["torque_n_m"][:2], strict=True))
    assert max(after["floors"]) < 1.5
    assert before["force_n"] == after["force_n"] == [None] * 3


def test_json_has_every_promised_key(found):
    promised = {"verdict", "effects", "alternatives", "unexplained", "not_excited", "gap_before", "gap_after", "audit"}
    assert promised <= set(found.summary)
    assert {"where", "playback", "contradictions", "warnings"} <= set(found.summary)
    assert found.summary["where"]["channels"] == ["torque y", "torque x"]
    assert {"parameters", "split", "extension", "disagreement"} <= set(found.summary)
    assert set(found.summary["effects"][0]) == {
        "name", "coefficients", "identified", "p_value", "share", "sentence",
    }  # fmt: skip
    assert {"findings", "warnings"} <= set(found.summary["audit"])


def test_effects_without_their_signals_are_listed(found):
    unseen = {each["name"]: each["reason"] for each in found.summary["not_excited"]}
    assert "velocity" in unseen["rotor_drag"]
    assert "voltage" in unseen["battery_sag"]


def test_folder_holds_good_artifacts(cpfls, found):
    assert {path.name for path in found.folder.iterdir()} == FILES
    for name in ("disagreement", "diagnosis", "extended"):
        cpfls.done("check", found.folder / f"{name}.h5")


def test_last_third_of_the_flights_is_held_out(found):
    assert found.summary["split"].endswith(": flight_3.csv")
    with h5py.File(found.folder / "diagnosis.h5") as file:
        roles = [file[f"recorded/flight-{number}/role"][()].decode() for number in (1, 2, 3)]
        assert roles == ["training", "training", "held-out"]


def test_one_command_says_what_three_say(cpfls, gap_config, shifted, found, tmp_path):
    names = [tmp_path / f"{name}.h5" for name in ("disagreement", "diagnosis", "extended")]
    cpfls.done("compare", gap_config, *shifted, "-o", names[0])
    said = cpfls("diagnose", gap_config, names[0], "-o", names[1], "--json")
    cpfls.done("extend", gap_config, names[1], "-o", names[2])
    summary = json.loads(said.stdout)
    assert summary == {key: found.summary[key] for key in summary}
    for path in names:
        assert path.read_bytes() == (found.folder / path.name).read_bytes()


def test_held_out_by_name(cpfls, gap_config, shifted, tmp_path):
    words = ("gap", gap_config, *shifted[:1], "--held-out", shifted[1], "-o", tmp_path / "x", "--json")
    summary = json.loads(cpfls(*words).stdout)
    assert summary["split"] == "held out as asked: flight_2.csv"
    assert summary["disagreement"]["flights"] == ["flight_1.csv"]
    assert [effect["name"] for effect in summary["effects"]] == ["com_offset"]


def test_one_flight_is_split_in_time(cpfls, gap_config, shifted, tmp_path):
    summary = cpfls.summary("gap", gap_config, shifted[0], "-o", tmp_path / "x")
    assert summary["split"].endswith("flight_1.csv (last third)")
    with h5py.File(tmp_path / "x" / "diagnosis.h5") as file:
        assert len(file["recorded/flight-1/time"]) == 1600
        assert file["recorded/flight-2/time"][0] == pytest.approx(16.0)


def test_people_read_the_verdict_first(found, shifted):
    lines = found.stdout.splitlines()
    assert lines[0] == "NAMED: What the model misses is offset of the centre of mass."
    assert lines[1].startswith("  Offset of the centre of mass (com_offset): c_x = 0.0079")
    assert [line.split("  ")[0] for line in lines[2:6]] == ["Gap", "How sure", "Where", "Next"]
    assert re.fullmatch(
        r"Gap +Held out, in noise floors: roll torque \d+ → [01]\.\d+, pitch torque \d+ → [01]\.\d+\.", lines[2]
    )
    assert re.fullmatch(
        r"Where +Torque about y \(pitch\), above the noise 100 % of the time, most from [\d.]+ to [\d.]+ s of "
        r"flight_3\.csv; also torque x\.",
        lines[4],
    )
    rows = [line for line in lines[6:16] if line.startswith(("gap, ", "playback, "))]
    assert re.match(r"gap, roll torque +N\sm +0\.\d+ +0\.0\d+ +0\.0\d+ +\d+ → [01]\.\d+ floors", rows[0])
    assert re.match(r"playback, body rate +rad/s +0\.\d+ +0\.0\d+ +0\.\d+ +better than “rate fades”", rows[2])
    assert any(line.startswith("The gap in the torque about y (pitch) follows thrust") for line in lines)
    assert any(line.endswith("extended.h5: the model with offset of the centre of mass.") for line in lines)
    folder, words = found.folder, lines[-1].split()
    assert lines[-2] == "next:"
    assert words[:2] == ["cpfls", "replay"]
    assert words[3:5] == [str(folder / "extended.h5"), str(shifted[0])]


def test_a_rival_that_could_not_be_tried_is_said_with_the_signal_that_is_missing(cpfls, gap_config, shifted, tmp_path):
    said = cpfls("gap", gap_config, *shifted, "-o", tmp_path / "x", "--set", "gap.ignore=[]").stdout
    assert "AMBIGUOUS: These flights cannot separate offset of the centre of mass from steady wind." in said
    assert "To separate steady wind from offset of the centre of mass: log attitude and velocity" in said


def test_nothing_hidden_nothing_named(none):
    assert none.summary["verdict"] == "NO_GAP"
    assert none.summary["effects"] == []
    assert none.summary["extension"]["written"] is False
    assert "NO_GAP" in none.summary["extension"]["reason"]
    assert max(none.summary["gap_before"]["floors"]) < 1.5
    assert json.loads((none.folder / "gap.json").read_text()) == none.summary


def test_a_later_run_leaves_no_file_of_an_earlier_one(none):
    assert {path.name for path in none.folder.iterdir()} == (FILES - {"extended.h5"}) | {"notes.txt"}


def test_playback_of_measured_rotors_gets_better(found):
    # The logs hold neither attitude nor velocity.
    assert set(found.summary["playback"]["at_end"]) == {"body_rate"}
    rate = found.summary["playback"]["at_end"]["body_rate"]
    assert rate["after"] < 0.1 * rate["before"]
    assert (rate["worse"], rate["rival"]) == (False, "rate-fades")
    assert found.summary["playback"]["fading_s"] > 0
    models = found.summary["playback"]["models"]
    assert len(models["after"]["body_rate"]["mae"]) == 10
    assert rate["after"] == models["after"]["body_rate"]["mae"][-1]
    assert rate["without_model"] == models["rate-fades"]["body_rate"]["mae"][-1]


def test_playback_is_that_of_the_command_for_it(cpfls, gap_config, found, shifted, tmp_path):
    asked = ("replay", gap_config, found.folder / "extended.h5", shifted[2], "--horizon", "0.1", "--every", "5")
    played = cpfls.summary(*asked, "-o", tmp_path / "replay.h5")["models"]
    ours = found.summary["playback"]["models"]
    for name, again in {"after": "model", "before": "stated", "rate-fades": "rate-fades"}.items():
        # The extended model is refitted once more.
        assert ours[name]["body_rate"]["mae"] == pytest.approx(played[again]["body_rate"]["mae"], rel=1e-3), name
