"""`cpfls export` for programs that draw: MCAP and columns, on the clock of the log, read back by their own readers."""

import csv
import io
import json
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import jsonschema
import numpy as np
import pytest
import yaml
from mcap.reader import make_reader

from cpfls_cli.export.viewed import view_of
from tests.builders.artifacts import edited
from tests.builders.studies import VEHICLE
from tests.builders.twins import twin_found

BEGIN_US = 1_700_000_000_123_456
TIME_US = BEGIN_US + 5_000 * np.arange(800)
SWING = 1e-6 * (TIME_US - BEGIN_US)
ATTITUDE = 0.2 * np.sin(np.outer(SWING, [2, 3, 4]))
RATE = 0.2 * np.array([2, 3, 4]) * np.cos(np.outer(SWING, [2, 3, 4]))
NAMES = ["roll", "pitch", "yaw", "p", "q", "r", "w1", "w2", "w3", "w4"]
SIGNALS = {"attitude": (NAMES[:3], "rad"), "body_rate": (NAMES[3:6], "rad/s"), "rotor_speed": (NAMES[6:], "rad/s")}


@pytest.fixture(scope="module")
def logged(cpfls, tmp_path_factory):
    """A log whose clock is no flight's, the study that describes it, its flight, and a replay of flight and log."""
    folder = tmp_path_factory.mktemp("viewers")
    rows = np.hstack([ATTITUDE, RATE, 348.0 + 0 * np.tile(SWING[:, None], 4)])
    text = "\n".join(f"{stamp},{','.join(map(repr, row))}" for stamp, row in zip(TIME_US, rows.tolist(), strict=True))
    (folder / "log.csv").write_text(f"stamp,{','.join(NAMES)}\n{text}\n")
    signals = {name: {"columns": columns, "unit": unit} for name, (columns, unit) in SIGNALS.items()} | {
        "setpoint_attitude": {"columns": NAMES[:3], "unit": "rad"}
    }
    read = {"time_column": "stamp", "time_unit": "us", "crop_s": [1.0, 3.0], "torque_source": None, "signals": signals}
    (folder / "study.yaml").write_text(VEHICLE + yaml.safe_dump({"import": read}))
    for words in (
        ("import", "study.yaml", "log.csv", "-o", "flight.h5"),
        ("replay", "study.yaml", "vehicle", "flight.h5", "log.csv", "-o", "replay.h5", "--every", "9"),
    ):
        cpfls.done(*(folder / word if "." in word else word for word in words))
    return folder


def exported(cpfls, artifact, output, *options):
    return cpfls.done("export", artifact, "-o", output, "--force", *options).stdout


def columns_of(path):
    header, *rows = csv.reader(io.StringIO(path.read_text()))
    values = np.array([[float(cell or "nan") for cell in row] for row in rows])
    return dict(zip(header, values.T, strict=True))


def messages_of(path):
    """Every message by topic, held against the schema of its channel."""
    found, schemas, units = {}, {}, {}
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            said = json.loads(message.data)
            schemas.setdefault(schema.id, jsonschema.Draft202012Validator(json.loads(schema.data))).validate(said)
            assert schema.encoding == "jsonschema"
            assert channel.message_encoding == "json"
            assert message.log_time == message.publish_time
            units[channel.topic] = (schema.name, channel.metadata)
            found.setdefault(channel.topic, []).append((message.log_time, said))
    return found, units


def test_columns_stand_next_to_the_log_at_its_own_stamps(cpfls, logged, tmp_path):
    said = exported(cpfls, logged / "flight.h5", tmp_path / "flight.csv")
    assert "on the clock of the log" in said
    assert "take the column stamp for the time" in said
    columns = columns_of(tmp_path / "flight.csv")
    own = np.isin(TIME_US, np.rint(columns["stamp"]).astype(np.int64))
    assert own.sum() == len(columns["__time"]) == 401
    # A stamp of this size in s is known to a quarter of a microsecond.
    np.testing.assert_allclose(columns["stamp"], TIME_US[own], atol=1.0)
    np.testing.assert_allclose(1e6 * columns["__time"], TIME_US[own], atol=1.0)
    for axis, name in enumerate(("roll", "pitch", "yaw")):
        np.testing.assert_allclose(columns[f"attitude/{name}/measured"], ATTITUDE[own, axis], atol=1e-8)
        np.testing.assert_allclose(columns[f"attitude/{name}/setpoint"], ATTITUDE[own, axis], atol=1e-8)


def test_mcap_is_read_back_at_the_stamps_of_the_log(cpfls, logged, tmp_path):
    exported(cpfls, logged / "flight.h5", tmp_path / "flight.mcap")
    found, about = messages_of(tmp_path / "flight.mcap")
    stamps = np.array([stamp for stamp, _ in found["/body_rate"]])
    own = np.isin(TIME_US, np.rint(stamps / 1e3).astype(np.int64))
    assert own.sum() == len(stamps) == 401
    assert np.abs(stamps - 1000 * TIME_US[own]).max() < 1000
    read = [said["y"]["measured"] for _, said in found["/body_rate"]]
    np.testing.assert_allclose(read, RATE[own, 1], atol=1e-8)
    assert about["/body_rate"][1] == {"unit": "rad/s", "frame": "body (FLU)", "description": "body rates p, q, r"}
    assert about["/pose"][0] == "foxglove.PoseInFrame"
    assert about["/tf/body"][0] == "foxglove.FrameTransform"
    stamp, pose = found["/pose"][7]
    assert pose["timestamp"] == {"sec": stamp // 10**9, "nsec": stamp % 10**9}
    half = np.array([pose["pose"]["orientation"][axis] for axis in "xyzw"])
    roll, pitch, yaw = ATTITUDE[own][7]
    # First about z, then y, then x.
    turn = np.cos(yaw / 2) * np.cos(pitch / 2) * np.cos(roll / 2) + np.sin(yaw / 2) * np.sin(pitch / 2) * np.sin(
        roll / 2
    )
    assert half @ half == pytest.approx(1.0)
    assert half[3] == pytest.approx(turn)
    assert 2 * (half[3] * half[1] - half[2] * half[0]) == pytest.approx(np.sin(pitch))


@pytest.mark.parametrize("form", ["csv", "mcap"])
def test_a_replay_shows_measured_model_and_difference_of_each_flight(cpfls, logged, tmp_path, form):
    exported(cpfls, logged / "replay.h5", tmp_path / f"replay.{form}")
    with h5py.File(logged / "replay.h5") as file:
        first, last = (1e-6 * float(TIME_US[index]) for index in (200, 600))
        np.testing.assert_allclose(file["flights/begins_s"], [first, first], atol=1e-6)
        period = float(file["horizon_s"][0])
    if form == "csv":
        columns = columns_of(tmp_path / "replay.csv")
        (name,) = {
            head.split("/")[0] for head in columns if head.endswith("/body_rate/x/model") and "worst" not in head
        }
        parts = {what: columns[f"{name}/body_rate/x/{what}"] for what in ("measured", "model", "difference")}
        known = np.isfinite(parts["model"])
        time = columns["__time"][known]
        measured, model, difference = (parts[what][known] for what in ("measured", "model", "difference"))
    else:
        found, _ = messages_of(tmp_path / "replay.mcap")
        (topic,) = (each for each in found if each.endswith("/body_rate") and "worst" not in each)
        time = np.array([stamp for stamp, _ in found[topic]]) / 1e9
        measured, model, difference = (
            np.array([said["x"][what] for _, said in found[topic]]) for what in ("measured", "model", "difference")
        )
        errors = found["/curves/error_body_rate"][0][1]
        assert errors["horizon_s"] == pytest.approx(period * np.arange(1, len(errors["model"]) + 1))
    assert first <= time[0] < time[-1] <= last
    np.testing.assert_allclose(measured, np.interp(time, 1e-6 * TIME_US, RATE[:, 0]), atol=1e-6)
    np.testing.assert_allclose(measured - model, difference, atol=1e-6)
    assert np.abs(difference).max() > 0.1


def test_what_has_nothing_over_time_is_refused(refuse, pipeline, tmp_path):
    (said,) = refuse("export", pipeline.model, "-o", tmp_path / "model.mcap")
    assert "holds nothing over time" in said
    (said,) = refuse("export", pipeline.flight, "-o", tmp_path / "flight.json", "--format", "csv")
    assert "ends in .csv" in said


def test_a_log_before_zero_has_no_stamp_in_mcap(cpfls, refuse, logged, tmp_path):
    shutil.copy(logged / "flight.h5", tmp_path / "flight.h5")
    with edited(tmp_path / "flight.h5") as file:
        file["begins"][()] = -5.0
    (said,) = refuse("export", tmp_path / "flight.h5", "-o", tmp_path / "flight.mcap")
    assert "no stamps before 0" in said
    exported(cpfls, tmp_path / "flight.h5", tmp_path / "flight.csv")
    assert columns_of(tmp_path / "flight.csv")["__time"][0] == -5.0


def test_a_model_that_is_called_as_the_vehicle_is_distinguished_from_it():
    found = twin_found()
    first, second = found.vehicles.values()
    view = view_of(Path("twin.h5"), replace(found, vehicles={"vehicle": first, "vehicle.h5": second}), VEHICLE)
    (roll,) = (track for track in view.tracks if track.name == "roll")
    assert list(roll.values) == ["measured", "setpoint", "vehicle", "vehicle_model", "difference"]
    assert [pose.child for pose in view.poses] == ["body", "vehicle", "vehicle_model"]
