"""`cpfls simulate` along a flight: its own setpoints, an autopilot's law, and where simulator and flight part."""

import json
from dataclasses import asdict

import h5py
import numpy as np
import pytest
import yaml

from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import Study, resolved_yaml
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.simulation.settings import ClosedLoopSettings, SimulationSettings
from cpfls_cli.stages.twin import with_autopilot
from tests.builders import blackbox_logs, ulogs
from tests.builders.autopilots import CROSS
from tests.builders.spread_vehicles import found_record
from tests.builders.twins import LOOP, PERIOD, flown
from tests.builders.vehicle_models import write_vehicle

FIELDS = {"attitude": 3, "body_rate": 3, "rotor_speed": 4, "setpoint_attitude": 3, "setpoint_thrust": 1}
UNITS = {"attitude": "rad", "body_rate": "rad/s", "rotor_speed": "rad/s", "setpoint_attitude": "rad"}
GAINS = {"MC_ROLLRATE_P": 0.15, "MC_PITCHRATE_P": 0.15, "UNRELATED": 7.0}


@pytest.fixture(scope="module")
def logged(tmp_path_factory):
    """A log of PX4 that holds its parameters, and the study that describes it."""
    folder = tmp_path_factory.mktemp("twin")
    (part,) = flown(8.0).parts
    columns = np.hstack(
        [part.attitude, part.body_rate, part.rotor_speed, part.setpoints["attitude"], part.setpoints["thrust"]]
    )
    described = ";".join(f"float[{count}] {name}" for name, count in FIELDS.items())
    rows = [(round(1e6 * PERIOD * index), 0, row) for index, row in enumerate(columns)]
    (folder / "log.ulg").write_bytes(ulogs.ulog(rows, {"flight": f"uint64_t timestamp;{described}"}, GAINS))
    signals = {
        name: {"columns": [f"flight.{name}[{index}]" for index in range(count)], "unit": UNITS.get(name, "1")}
        for name, count in FIELDS.items()
    }
    loop = {"rotor_time_constant_s": LOOP.rotor_time_constant_s, "integration_rate_hz": LOOP.integration_rate_hz}
    study = {
        "vehicle": asdict(CROSS),
        "simulation": {"closed_loop": loop},
        "import": {"time_column": None, "torque_source": None, "signals": signals},
    }
    (folder / "study.yaml").write_text(yaml.safe_dump(study))
    return folder


@pytest.fixture(scope="module")
def twin(cpfls, logged):
    output = logged / "twin.h5"
    return cpfls.summary(
        "simulate", logged / "study.yaml", logged / "log.ulg", "--autopilot", "px4", "-o", output
    ), output


def test_a_log_is_flown_with_its_own_gains_on_its_own_clock(twin):
    said, output = twin
    assert (said["autopilot"], said["asked"], said["thrust_from"]) == ("px4", "attitude", "setpoint")
    assert said["gains"]["source"] == "log"
    assert said["gains"]["values"]["MC_ROLLRATE_P"] == pytest.approx(0.15)
    assert "UNRELATED" not in said["gains"]["values"]
    channels = said["vehicles"]["vehicle"]["channels"]
    assert channels["roll rate"]["word"] == channels["pitch rate"]["word"] == "good"
    assert not any(each["parts"] for each in channels.values())
    # The simulator is nearer than what knows no vehicle.
    assert said["rms"]["vehicle"]["roll"] < 0.3 * min(
        said["rms"][name]["roll"] for name in ("setpoint", "nothing-moves")
    )
    with h5py.File(output) as file:
        assert float(file["begins"][()]) == pytest.approx(1e-6 * ulogs.BEGIN)


def test_other_gains_part_and_the_answer_says_where(cpfls, logged):
    result = cpfls.done(
        *("simulate", logged / "study.yaml", logged / "log.ulg", "--autopilot", "px4", "-o", logged / "weak.h5"),
        *("--set", "simulation.closed_loop.autopilot_parameters={MC_ROLLRATE_P: 0.04}"),
    )
    assert result.stdout.startswith("TWIN: The vehicle of the config parts from log.ulg in roll rate")
    assert "Hz" in result.stdout
    assert "cpfls gap" in result.stdout
    assert all(len(line) <= 100 for line in result.stdout.splitlines() if line.startswith(("roll", "pitch", "Channel")))
    again = cpfls("info", logged / "weak.h5")
    assert result.stdout.splitlines()[0] in again.stdout


def test_an_imported_flight_is_flown_with_the_gains_of_its_log_and_by_another_law_with_usual_ones(cpfls, logged):
    flight = cpfls.made("import", logged / "study.yaml", logged / "log.ulg", at=logged / "flight.h5")
    words = ("simulate", logged / "study.yaml", flight, "--json", "--force", "-o", logged / "usual.h5")
    said = json.loads(cpfls(*words, "--autopilot", "px4").stdout)
    assert said["gains"]["source"] == "log"
    assert said["gains"]["values"]["MC_ROLLRATE_P"] == pytest.approx(0.15)
    said = json.loads(cpfls(*words, "--autopilot", "ardupilot").stdout)
    assert said["gains"]["source"] == "defaults"
    assert any("defaults of ArduPilot" in warning for warning in said["warnings"])


def test_what_cannot_be_flown_is_refused(refuse, logged, tmp_path):
    words = ("simulate", logged / "study.yaml", logged / "log.ulg", "-o", tmp_path / "twin.h5")
    (said,) = refuse(*words)
    assert "--autopilot px4, ardupilot, betaflight, crazyflie" in said
    (said,) = refuse(*words, "--autopilot", "px4", "--gusts")
    assert "no gusts are known; give --model a vehicle of `cpfls vehicle`" in said
    (said,) = refuse(*words, "--autopilot", "px4", "--mode", "inverse")
    assert "along a flight all is flown in closed loop" in said
    (said,) = refuse(*words, "--autopilot", "pixhawk")
    assert "pixhawk" in said


def test_in_gusts_of_a_model_the_answer_says_what_they_explain(cpfls, logged, monkeypatch):
    monkeypatch.setattr("cpfls_cli.stages.twin.DRAWS", 3)
    model = VehicleModel(vehicle=CROSS, effects=(ModelEffect("linear_damping", {}, np.full(3, 0.01)),))
    found = found_record(model, lack=[0.3, 0.2])
    write_vehicle(logged / "vehicle.h5", found, resolved_yaml(load_study(logged / "study.yaml")))

    def flown(name, *options):
        words = ("simulate", logged / "study.yaml", logged / "log.ulg", "--autopilot", "px4", "-o", logged / name)
        short = ("--set", "import.crop_s=[0.0, 2.0]")
        return cpfls.done(*words, "--model", logged / "vehicle.h5", *short, *options).stdout

    calm = flown("calm.h5")
    assert "--gusts plays them" in calm
    assert "In gusts" not in calm
    said = json.loads(flown("gusty.h5", "--gusts", "--json"))
    flown("again.h5", "--gusts")
    other = json.loads(flown("other.h5", "--gusts", "--json", "--set", "seed=2"))
    assert (logged / "gusty.h5").read_bytes() == (logged / "again.h5").read_bytes()
    assert said["vehicles"] == other["vehicles"]
    assert said["in_gusts"] != other["in_gusts"]
    assert (said["in_gusts"]["vehicle"], said["in_gusts"]["flights"]) == ("vehicle.h5", 3)
    # The log holds neither velocity nor acceleration.
    assert list(said["in_gusts"]["channels"]) == ["roll rate", "pitch rate", "yaw rate", "roll", "pitch", "yaw"]
    # These gusts are far larger than those of the flight.
    roll = said["in_gusts"]["channels"]["roll rate"]
    assert not roll["beyond"]
    assert roll["inside_share"] > 0.5
    assert roll["rms"] < roll["rms_in_gusts"][0]
    again = cpfls("info", logged / "gusty.h5").stdout
    assert "No farther off than 3 flights in the gusts of vehicle.h5" in again
    assert "In gusts" in again


def test_it_is_looked_at_in_other_programs(cpfls, twin, tmp_path):
    _, output = twin
    cpfls.done("export", output, "-o", tmp_path / "twin.csv")
    header, first = (tmp_path / "twin.csv").read_text().splitlines()[:2]
    cells = dict(zip(header.split(","), first.split(","), strict=True))
    assert float(cells["__time"]) == pytest.approx(1e-6 * ulogs.BEGIN)
    gap = float(cells["roll/measured"]) - float(cells["roll/vehicle"])
    assert float(cells["roll/difference"]) == pytest.approx(gap, abs=1e-7)


def test_the_gains_of_a_blackbox_are_read_out_of_its_lines(tmp_path):
    path = tmp_path / "log.bbl"
    frames = b"".join(blackbox_logs.frames(blackbox_logs.flight(20)))
    path.write_bytes(blackbox_logs.header(rollPID="60,90,40", iterm_limit="400") + frames + blackbox_logs.END)
    study = Study(simulation=SimulationSettings(closed_loop=ClosedLoopSettings(autopilot="betaflight")))
    _, gains = with_autopilot(study, path)
    assert gains.source == "log"
    assert dict(zip(gains.name, gains.value, strict=True))["p_roll"] == 60


def test_a_flight_that_was_simulated_knows_its_autopilot(cpfls, tmp_path):
    loop = {"integration_rate_hz": 400.0, "rotor_time_constant_s": 0.03, "autopilot_parameters": {}}
    study = {
        "vehicle": asdict(CROSS),
        "trajectory": {"sample_time_s": 0.01},
        "simulation": {"mode": "closed-loop", "closed_loop": loop, "noise": {"body_rate": 0.01}},
    }
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(study))
    path, flight = tmp_path / "path.h5", tmp_path / "flight.h5"
    for words in (
        ("trajectory", tmp_path / "study.yaml", "--hover", "5", "--excite", "roll", "-o", path),
        ("simulate", tmp_path / "study.yaml", path, "--autopilot", "crazyflie", "-o", flight),
    ):
        cpfls.done(*words)
    said = cpfls.summary("simulate", tmp_path / "study.yaml", flight, "-o", tmp_path / "twin.h5")
    assert (said["autopilot"], said["gains"]["source"], said["thrust_from"]) == ("crazyflie", "simulation", "setpoint")
    assert not said["vehicles"]["vehicle"]["channels"]["roll rate"]["parts"]


def test_a_log_without_setpoints_says_what_it_lacks_and_what_to_type_instead(refuse, logged, tmp_path):
    data = yaml.safe_load((logged / "study.yaml").read_text())
    data["import"]["signals"].pop("setpoint_attitude")
    study, log = tmp_path / "without.yaml", logged / "log.ulg"
    study.write_text(yaml.safe_dump(data))
    (line,) = refuse("simulate", study, log, "--autopilot", "px4", "-o", tmp_path / "t.h5")
    assert line.startswith("log.ulg: the config maps no setpoints that this log holds throughout")
    assert f"Without setpoints `cpfls gap {study} {log} -o {tmp_path / 'gap'}` says where" in line
