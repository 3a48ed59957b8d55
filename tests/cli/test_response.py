"""`cpfls response`: what it writes, prints and draws of flights, and what it refuses."""

import csv
import json

import numpy as np
import pytest
from scipy.signal import lfilter

from cpfls_cli import store
from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import resolved_yaml
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.response.flown import Responses
from tests.builders import vehicle_models
from tests.builders.shifted_flights import ALLOCATION, INERTIA
from tests.builders.studies import VEHICLE, put_file

CONFIG = """\
import:
  torque_source: null
  acceleration_frame: body-specific-force
  signals:
    body_rate: {columns: [p, q, r], unit: rad/s}
    rotor_speed: {columns: [w1, w2, w3, w4], unit: rad/s}
    rotor_command: {columns: [c1, c2, c3, c4], unit: rad/s, required: false}
    acceleration: {columns: [fx, fy, fz], unit: m/s^2, required: false}
    setpoint_body_rate: {columns: [ps, qs, rs], unit: rad/s, required: false}
"""
MASS, LAG_S = 6.0, 0.04


def flight_table(seed, scale=1.0, samples=3000):
    """Columns of a log in still air, of a body that is heavier than stated by a scale; rates are sums of sines."""
    rng, time = np.random.default_rng(seed), 0.01 * np.arange(samples)
    turns = 2 * np.pi * np.geomspace(0.2, 9.0, 40)
    phases = np.multiply.outer(time, turns)[:, None] + rng.uniform(0, 2 * np.pi, (3, 40))
    size = 0.02 * np.array([[1.0], [1.0], [0.3]]) / np.sqrt(turns)
    rate, slope = (size * np.sin(phases)).sum(axis=2), (size * turns * np.cos(phases)).sum(axis=2)
    torque = scale * (INERTIA * slope + np.cross(rate, INERTIA * rate))
    lift = 9.81 + 0.3 * np.sin(phases[:, 0]).sum(axis=1) / 4
    speed = np.sqrt(np.linalg.solve(ALLOCATION, np.column_stack([MASS * lift, torque]).T).T)
    command = speed + LAG_S * np.gradient(speed, 0.01, axis=0)
    asked = rate + 0.02 * slope
    columns = {"t": time, **dict(zip("pqr", rate.T, strict=True))}
    columns |= {f"w{n}": speed[:, n - 1] for n in range(1, 5)} | {f"c{n}": command[:, n - 1] for n in range(1, 5)}
    columns |= {"fx": 0 * time, "fy": 0 * time, "fz": lift}
    return columns | {"ps": asked[:, 0], "qs": asked[:, 1], "rs": asked[:, 2]}


def gusty_table(path, draw):
    """Columns of a log of one of the paths above in gusts of its own, which its rotors answer late."""
    still, rng = flight_table(path), np.random.default_rng([7, draw])
    samples = len(still["t"])
    gusts = lfilter([0.05], [1, -0.98], rng.standard_normal((samples, 3)), axis=0)
    answered = lfilter([0.1], [1, -0.9], gusts, axis=0)
    speed = np.column_stack([still[f"w{n}"] for n in range(1, 5)])
    torque = -INERTIA * answered * [1.0, 1.0, 0.1]
    squared = speed**2 + np.linalg.solve(ALLOCATION, np.column_stack([np.zeros(samples), torque]).T).T
    turned = 0.01 * np.cumsum((gusts - answered) * [1.0, 1.0, 0.1], axis=0)
    return (
        {name: still[name] for name in ("t", "fx", "fy", "fz")}
        | {name: still[name] + turned[:, axis] for axis, name in enumerate("pqr")}
        | {f"w{n}": np.sqrt(squared[:, n - 1]) for n in range(1, 5)}
    )


def save(path, columns):
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns), comments="")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("response")
    (folder / "study.yaml").write_text(CONFIG + VEHICLE)
    save(folder / "light.csv", flight_table(1))
    save(folder / "heavy.csv", flight_table(2, 2.0))
    return folder


@pytest.fixture(scope="module")
def summary(cpfls, folder):
    """What is printed for machines of two flights, with the files that are written."""

    def call(*words):
        output, table = folder / "response.h5", folder / "response.csv"
        result = cpfls.done(
            "response", folder / "study.yaml", *words, "-o", output, "--csv", table, "--json", "--force"
        )
        return json.loads(result.stdout), output, table

    return call


def test_json_shows_curves_and_costs(cpfls, summary, folder):
    answer, output, _ = summary(folder / "light.csv")
    assert answer["model"] == "vehicle"
    assert answer["flights"] == ["light.csv"]
    names = ["roll", "pitch", "yaw", "thrust", "rotor speed", "roll rate", "pitch rate", "yaw rate"]
    assert list(answer["responses"]) == names
    for name, gain in (("roll", 1 / 0.6), ("yaw", 1 / 1.2), ("thrust", 1 / MASS)):
        own = answer["responses"][name]
        low, high = own["band"]
        assert low < 0.6
        assert high > 8.0
        frequency = np.array(own["frequency"])
        inside = (frequency > low) & (frequency < 8.0)
        measured = np.array(own["magnitude_db"], dtype=float)[inside]
        assert measured == pytest.approx(20 * np.log10(gain) * np.ones(inside.sum()), abs=0.4)
        assert own["cost"] < 5.0
    speed = answer["responses"]["rotor speed"]
    frequency, lag = np.array(speed["frequency"]), np.array(speed["phase_deg"], dtype=float)
    expected = -np.degrees(np.arctan(2 * np.pi * frequency * LAG_S))
    assert np.abs(lag - expected)[(frequency > 0.6) & (frequency < 6.0)].max() < 4.0
    cpfls.done("check", output)
    assert json.loads(json.dumps(answer)) == answer
    assert list(store.read(output, Responses)[0].responses) == names


def test_a_body_that_is_heavier_than_stated(summary, folder):
    answer, _, _ = summary(folder / "heavy.csv")
    (only,) = answer["responses"]["roll"]["deviations"]
    assert not only["right"]
    assert only["gain"] == pytest.approx(2.0, rel=0.02)
    assert answer["responses"]["roll"]["cost"] > 100.0
    assert answer["responses"]["thrust"]["cost"] < 5.0


def test_the_table_holds_what_json_shows(summary, folder):
    answer, _, table = summary(folder / "light.csv")
    with table.open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0])[:4] == ["response", "frequency_hz", "magnitude_db", "phase_deg"]
    rolls = [float(row["magnitude_db"]) for row in rows if row["response"] == "roll"]
    known = [value for value in answer["responses"]["roll"]["magnitude_db"] if value is not None]
    assert rolls == pytest.approx(known, rel=1e-6)
    assert {row["model_magnitude_db"] for row in rows if row["response"] == "roll rate"} == {""}


def test_the_answer_begins_with_what_the_flights_tell(cpfls, folder, tmp_path):
    result = cpfls.done("response", folder / "study.yaml", folder / "light.csv", "-o", tmp_path / "r.h5", "-v")
    first = " ".join(result.stdout.split())
    assert first.startswith("RESPONSE: The vehicle of the config: not judged: these flights show the loop")
    assert "Rotor speed: 45° behind what is asked at" in first


@pytest.mark.usefixtures("sketched")
def test_a_report_shows_bode_plots(cpfls, summary, folder, tmp_path):
    _, output, _ = summary(folder / "light.csv")
    html = cpfls.made("report", folder / "study.yaml", output, at=tmp_path / "page.html").read_text()
    assert "How a vehicle answers its rotors" in html
    assert "Frequency responses" in html
    assert html.count("<svg") == 8


def test_equal_flights_give_equal_files(cpfls, folder, tmp_path):
    outputs = [tmp_path / "a.h5", tmp_path / "b.h5"]
    for output in outputs:
        cpfls.done(*("response", folder / "study.yaml", folder / "light.csv", folder / "heavy.csv", "-o", output))
    assert outputs[0].read_bytes() == outputs[1].read_bytes()


def test_what_is_refused(refuse, folder, tmp_path):
    config, log = folder / "study.yaml", folder / "light.csv"
    short = save(tmp_path / "short.csv", {name: own[:60] for name, own in flight_table(3).items()})
    (message,) = refuse("response", config, short, "-o", tmp_path / "r.h5")
    assert message.endswith("is 0.6 s, too short for a frequency response; give longer flights")
    (message,) = refuse("response", config, log, "-o", tmp_path / "r.h5", "--csv", tmp_path / "r.h5")
    assert "is what the command writes for -o" in message
    (message,) = refuse("response", config, log, "--model", log, "-o", tmp_path / "r.h5")
    assert "light.csv" in message
    (message,) = refuse("response", config, log, "-o", log)
    assert "light.csv" in message


def test_a_vehicle_of_unknown_numbers_needs_a_model(refuse, folder, tmp_path):
    config = put_file(tmp_path / "open.yaml", CONFIG + VEHICLE.replace("[0.6, 0.6, 1.2]", "null"))
    (message,) = refuse("response", config, folder / "light.csv", "-o", tmp_path / "r.h5")
    assert "vehicle.inertia_kg_m2: not known in this config, but `cpfls response` needs" in message


def test_an_identified_model_is_judged_with_its_inertia(cpfls, pipeline, study, tmp_path):
    words = ("response", study, pipeline.flight, "--model", pipeline.model, "-o", tmp_path / "r.h5", "--json")
    summary = json.loads(cpfls.done(*words).stdout)
    assert summary["model"] == "model.h5"
    assert list(summary["responses"])[:3] == ["roll", "pitch", "yaw"]
    assert any("model.h5" in warning and "learned" in warning for warning in summary["warnings"])


def test_air_that_a_flight_does_not_know_is_still(cpfls, folder, tmp_path):
    """A vehicle with drag along flights without velocity."""
    config = put_file(tmp_path / "study.yaml", CONFIG + VEHICLE)
    model = tmp_path / "vehicle.h5"
    drag = ModelEffect("rotor_drag", {}, np.array([1e-4]))
    whole = VehicleModel(vehicle=load_study(config).vehicle, effects=(drag,))
    vehicle_models.write_vehicle(model, vehicle_models.vehicle_of(whole), resolved_yaml(load_study(config)))
    summary = cpfls.summary("response", config, folder / "light.csv", "--model", model, "-o", tmp_path / "r.h5")
    assert "vehicle.h5 depends on the velocity through the air, which is taken as 0 in light.csv" in summary["warnings"]
    assert summary["responses"]["roll"]["cost"] < 5.0


def test_repeats_of_a_path_show_the_vehicle(cpfls, folder, tmp_path):
    """Gusts that are answered hide the body in each flight; what comes again in all of them does not."""
    logs = [save(tmp_path / f"run{draw}.csv", gusty_table(1, draw)) for draw in range(4)]
    words = ("response", folder / "study.yaml", "-o", tmp_path / "r.h5", "--json", "--force")
    alone = json.loads(cpfls(*words, logs[0]).stdout)
    assert alone["instruments"] == "none"
    summary = json.loads(cpfls.done(*words, *logs, folder / "heavy.csv").stdout)
    assert summary["instruments"] == "repeats"
    assert any(warning.startswith("heavy.csv: no other of these flights") for warning in summary["warnings"])
    for name in ("roll", "pitch"):
        own = summary["responses"][name]
        assert own["word"] == "good"
        assert own["cost"] < 0.2 * alone["responses"][name]["cost"]
