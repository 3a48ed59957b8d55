"""A vehicle flown in MuJoCo comes back as a flight that its own model plays back: docs/simulators.md, shortened."""

import runpy
from pathlib import Path

import h5py
import numpy as np
import pytest

from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import resolved_yaml
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from tests.builders.vehicle_models import vehicle_of, write_vehicle

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "configs" / "simulators.yaml"


def test_a_flight_in_mujoco_comes_back(cpfls, tmp_path):
    pytest.importorskip("mujoco", reason="needs the package mujoco, of the extra simulators")
    study = load_study(CONFIG)
    offset = ModelEffect("com_offset", {}, np.array([0.01, -0.006]))
    vehicle = vehicle_of(VehicleModel(vehicle=study.vehicle, effects=(offset,)))
    model, uav, log, flight = (tmp_path / name for name in ("model.h5", "uav.xml", "log.h5", "flight.h5"))
    write_vehicle(model, vehicle, resolved_yaml(study))
    cpfls.done("export", model, "-o", uav)
    script = runpy.run_path(str(ROOT / "examples" / "fly_mujoco.py"))
    script["main"].__globals__.update(BEGIN_S=2.0, END_S=4.0)
    script["main"](str(uav), str(CONFIG), str(log))
    with h5py.File(log) as file:
        assert len(file["time"]) == 200
        assert np.abs(file["x"][:]).max() < 5.0
    cpfls.done("import", CONFIG, log, "-o", flight)
    sums = {
        name: each["body_rate"]["sum"]
        for name, each in cpfls.summary("replay", CONFIG, model, flight, "-o", tmp_path / "replay.h5")["models"].items()
    }
    assert sums["model"] < 0.1 * sums["stated"]
