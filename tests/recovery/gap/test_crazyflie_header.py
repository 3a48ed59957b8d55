"""A wrong number in the header of a Crazyflie, found by its own logs and corrected, with all else as it was."""

import json

import numpy as np
import pytest

from cpfls_cli.config.load import load_study
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.simulators.formats import read_model
from tests.builders import command_line
from tests.builders.gusty_flights import GUSTS, SMALL, Flight, gusty_flights
from tests.builders.simulator_files import header_of, write_crazyflie_log
from tests.builders.vehicle_models import number_of, vehicle_of, write_vehicle

TRUE = SMALL._replace(drag=0.0, damping=0.0)
CURVE = [f"VMOTOR2THRUST{power}" for power in range(4)]


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Four flights in gusts with what motors get, the same with their speeds, and all speeds."""
    folder = tmp_path_factory.mktemp("crazyflie")
    asked = [Flight(TRUE, GUSTS, path=run, draw=run, reach=3.0, swing=0.3) for run in range(4)]
    shares, speeds, turned = [], [], []
    for run, flight in enumerate(gusty_flights(asked, 40.0)):
        shares.append(folder / f"shares{run}.csv")
        speeds.append(folder / f"speeds{run}.csv")
        write_crazyflie_log(speeds[-1], flight, speeds=True)
        turned.append(write_crazyflie_log(shares[-1], flight, speeds=False))
    return shares, speeds, np.concatenate(turned)


def gap(folder, logs, speed, **wrong):
    """Correct a header with wrong numbers, what it leaves open taken from what flies; give what is said, and both."""
    mine, study, vehicle = (folder / name for name in ("platform_defaults_mine.h", "study.yaml", "vehicle.h5"))
    mine.write_text(header_of(TRUE, speed, **wrong))
    before = mine.read_bytes()
    command_line.done("init", "--from", mine, logs[0], "-o", study)
    settings = load_study(study).vehicle
    factors = {"thrust_factor_n_s2": TRUE.thrust_factor, "drag_factor_n_m_s2": TRUE.drag_factor}
    rotors = tuple(type(rotor)(**(vars(rotor) | factors)) for rotor in settings.rotors)
    # Forward is to the right of what flies.
    inertia = tuple(TRUE.inertia[axis] for axis in (1, 0, 2))
    known = type(settings)(**(vars(settings) | {"inertia_kg_m2": inertia, "rotors": rotors, "unknown": ()}))
    numbers = (number_of("inertia.Ixx", inertia[0], 0.9 * inertia[0], 1.1 * inertia[0]),)
    write_vehicle(vehicle, vehicle_of(VehicleModel(vehicle=known), numbers=numbers), config=study.read_text())
    words = ("gap", mine, *logs[:-1], "--held-out", logs[-1], "--model", vehicle, "-o", folder / "gap", "--json")
    result = command_line.done(*words)
    assert mine.read_bytes() == before
    return json.loads(result.stdout), before.decode(), (folder / "gap" / mine.name).read_text()


def test_a_thrust_17_percent_too_large(tmp_path, flown):
    """The curve over volts is as wrong as the thrust that it states in hover: all of its coefficients change alike."""
    shares, _, speed = flown
    said, before, after = gap(tmp_path, [*shares[:2], shares[-1]], speed, thrust=1 / 0.83)
    changes = said["corrected"]["changes"]
    assert said["verdict"] == "NAMED"
    assert sorted(change["element"] for change in changes) == CURVE
    for change in changes:
        own, low, high = (change[name] / change["before"] for name in ("after", "low", "high"))
        assert min(low, high) < 0.83 < max(low, high)
        assert own == pytest.approx(0.83, rel=0.03)
    assert changes[0]["sentence"].startswith("thrust of M1 to M4 is 1")
    ends = said["corrected"]["flown"]["at_end"]
    assert ends["velocity"]["after"] < 0.8 * ends["velocity"]["before"]
    # All but the four numbers and the comment at the top is as it was.
    lines = after[after.index("*/\n") + 3 :].splitlines()
    differ = [pair for pair in zip(before.splitlines(), lines, strict=True) if pair[0] != pair[1]]
    assert [new.split()[1] for _, new in differ] == CURVE
    assert read_model(tmp_path / "gap" / "platform_defaults_mine.h").rotors[0].ratio.value == pytest.approx(0.006)


def test_a_yaw_torque_twice_as_large(tmp_path, flown):
    """With speeds the thrust is the model's, and the yaw torque is the header's share of it."""
    _, speeds, speed = flown
    said, _, _ = gap(tmp_path, speeds, speed, ratio=2.0)
    (change,) = said["corrected"]["changes"]
    assert change["element"] == "THRUST2TORQUE"
    assert change["low"] < TRUE.drag_factor / TRUE.thrust_factor < change["high"]


def test_a_header_that_is_right_stays(tmp_path, flown):
    shares, _, speed = flown
    said, before, after = gap(tmp_path, [*shares[:2], shares[-1]], speed)
    assert said["corrected"]["changes"] == []
    assert after == before


@pytest.mark.parametrize(("kind", "open_"), [(0, "inertia,"), (1, "inertia and thrust factor,")])
def test_what_a_header_leaves_open_is_said_once(tmp_path, flown, kind, open_):
    """With what motors get and volts it states thrust, with speeds it does not; yaw torque follows from thrust."""
    mine = tmp_path / "platform_defaults_mine.h"
    mine.write_text(header_of(TRUE, flown[2]))
    result = command_line.run("gap", mine, flown[kind][0], "-o", tmp_path / "gap")
    assert result.exit_code == 2
    (message,) = [line for line in result.stderr.splitlines() if "error" in line]
    assert f"{mine}: does not state {open_} which a gap needs: `cpfls init --from {mine} LOG..." in message
    assert "`cpfls vehicle study.yaml LOG... -o vehicle.h5`" in message
    assert not (tmp_path / "gap").exists()
