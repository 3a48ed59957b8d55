"""From an ambiguous diagnosis to the flight that settles it, and a diagnosis that leaves nothing to settle."""

import pytest

from tests.builders.studies import VEHICLE

CONFIG = """
trajectory: {path: straight, displacement_m: 4.0, legs: 2, period_s: 0.4, yaw_turn_rad: 0.5, duration_s: 16.0}
simulation:
  mode: closed-loop
  noise: {attitude: 0.003, body_rate: 0.005, velocity: 0.05, acceleration: 0.1, rotor_speed: 1.0}
  closed_loop: {integration_rate_hz: 200.0, effects: {com_offset: [0.002, -0.0015]}}
gap: {shifts: 39, horizon_s: 0.1, ignore: [payload]}
"""


def searched(starts, iterations):
    room = {"starts": starts, "iterations": iterations}
    settings = [word for key, value in room.items() for word in ("--set", f"trajectory.next_flight.{key}={value}")]
    return ("--duration", "12", *settings)


@pytest.fixture(scope="module")
def folder(cpfls, tmp_path_factory):
    """Gentle flights of one thrust, and their diagnosis."""
    folder = tmp_path_factory.mktemp("open")
    (folder / "study.yaml").write_text(CONFIG + VEHICLE)
    for number, direction in ((1, "[1.0,0.0,0.0]"), (2, "[1.0,0.4,0.0]")):
        path = folder / f"path-{number}.h5"
        run(cpfls, folder, "trajectory", "-o", path, "--set", f"trajectory.direction={direction}")
        run(cpfls, folder, "simulate", path, "-o", folder / f"flight-{number}.h5", "--seed", number)
    diagnosed(cpfls, folder, "open", "flight-1.h5")
    return folder


def run(cpfls, folder, command, *options):
    return cpfls.summary(command, folder / "study.yaml", *options)


def diagnosed(cpfls, folder, name, *training):
    compared, diagnosis = folder / f"compared-{name}.h5", folder / f"{name}.h5"
    run(cpfls, folder, "compare", *(folder / each for each in training), "-o", compared)
    return run(cpfls, folder, "diagnose", compared, "--held-out", folder / "flight-2.h5", "-o", diagnosis)


@pytest.mark.decides
def test_the_next_flight_settles_what_the_first_left_open(cpfls, folder):
    planned = run(cpfls, folder, "trajectory", "--for", folder / "open.h5", *searched(3, 5), "-o", folder / "next.h5")
    rows = [row for row in planned["questions"] if {row["true"], row["rival"]} == {"com_offset", "torque_bias"}]
    assert len(rows) == 2
    for row in rows:
        assert row["sure"] > 0.9 > 0.1 > row["again"]
    run(cpfls, folder, "simulate", folder / "next.h5", "-o", folder / "flight-3.h5", "--seed", 3)
    settled = diagnosed(cpfls, folder, "settled", "flight-1.h5", "flight-3.h5")
    assert (settled["verdict"], [effect["name"] for effect in settled["effects"]]) == ("NAMED", ["com_offset"])
    result = cpfls("trajectory", folder / "study.yaml", "--for", folder / "settled.h5", "-o", folder / "none.h5")
    assert result.exit_code != 0
    assert "settled.h5: its verdict is NAMED, and it leaves nothing to separate" in result.stderr
    assert not (folder / "none.h5").exists()


def test_named_effects_come_before_what_the_diagnosis_leaves(cpfls, folder):
    options = ("--for", folder / "open.h5", "--separate", "rotor_drag,linear_damping", *searched(1, 1))
    planned = run(cpfls, folder, "trajectory", *options, "-o", folder / "other.h5")
    assert [(row["true"], row["rival"]) for row in planned["questions"]] == [
        ("rotor_drag", "linear_damping"),
        ("linear_damping", "rotor_drag"),
    ]
    # The flights that are there know something of it.
    assert all(row["again"] is not None for row in planned["questions"])


def test_another_vehicle_is_refused(cpfls, folder):
    options = ("--for", folder / "open.h5", "--set", "vehicle.mass_kg=5.0", "-o", folder / "none.h5")
    result = cpfls("trajectory", folder / "study.yaml", *options)
    assert result.exit_code != 0
    assert "vehicle" in result.stderr
