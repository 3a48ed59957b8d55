"""A wrong number in a simulator's own file, named and corrected from flights in gusts, and nothing else touched."""

import json
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from cpfls_cli.config.load import load_study
from cpfls_cli.flightlog.airframe import turns_by_rotors
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.simulators.formats import read_model
from cpfls_cli.simulators.inside import SIMULATORS
from tests.builders import command_line
from tests.builders.gusty_flights import GUSTS, SMALL, SPINS, Flight, gusty_flights
from tests.builders.simulator_files import mjcf_in_newtons, mjcf_of, rotorpy_of, sdf_of, write_log
from tests.builders.vehicle_models import vehicle_of, write_vehicle

TRUE = SMALL._replace(drag=0.0, damping=0.0)
FLIGHTS, SECONDS = 4, 30.0


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Four flights of the true vehicle in the gusts of real nano-drone flights, with their setpoints."""
    folder = tmp_path_factory.mktemp("gusts")
    asked = [Flight(TRUE, GUSTS, path=run, draw=run, reach=3.0, swing=0.3) for run in range(FLIGHTS)]
    paths = [folder / f"flight{run}.csv" for run in range(FLIGHTS)]
    for path, flight in zip(paths, gusty_flights(asked, SECONDS), strict=True):
        write_log(path, flight)
    return paths


@pytest.fixture(scope="module")
def few(logs):
    """Two to learn from, and the one that is held out: an inertia takes a third one to be known to 3 %."""
    return [*logs[:2], logs[-1]]


def corrected(folder, logs, text="", ending="sdf", **wrong):
    mine = folder / f"mine.{ending}"
    mine.write_text(text or sdf_of(TRUE, **wrong))
    before = mine.read_bytes()
    result = command_line.done(*("gap", mine, *logs[:-1], "--held-out", logs[-1], "-o", folder / "gap", "--json"))
    assert mine.read_bytes() == before
    return json.loads(result.stdout), read_model(folder / "gap" / mine.name)


def require_the_same_in(package, said):
    """What the simulator flies is as far off as what is played back, where its package is installed."""
    inside = said["in_simulator"]
    if find_spec(package) is None:
        assert "its package is not installed" in inside["why_not"]
        return
    for signal, end in said["flown"]["at_end"].items():
        there = inside["flown"]["at_end"][signal]
        for which in ("before", "after"):
            assert there[which] == pytest.approx(end[which], rel=0.15)


def test_a_thrust_17_percent_too_large(tmp_path, few):
    said, new = corrected(tmp_path, few, thrust=1 / 0.83)
    (change,) = said["corrected"]["changes"]
    assert said["verdict"] == "NAMED"
    assert (change["element"], said["effects"][0]["name"]) == ("motorConstant", "parameter_error")
    assert change["low"] < TRUE.thrust_factor < change["high"]
    assert change["sentence"].startswith("thrust of M1 to M4 is 1")
    # What flew is predicted better by the file as corrected, and far better than if nothing moved.
    ends = said["corrected"]["flown"]["at_end"]
    assert ends["velocity"]["after"] < 0.8 * ends["velocity"]["before"]
    assert ends["position"]["after"] < min(0.8 * ends["position"]["before"], ends["position"]["without_model"])
    assert [rotor.thrust.value for rotor in new.rotors] == [change["after"]] * 4
    np.testing.assert_allclose(np.diag(new.inertia), TRUE.inertia, rtol=1e-4)
    require_the_same_of_exports(tmp_path, change)
    np.testing.assert_allclose(np.diag(read_model(tmp_path / "of.sdf").inertia), TRUE.inertia, rtol=1e-4)


def require_the_same_of_exports(folder, change):
    """What is exported of the extended model has the arms as stated, and thrust as it was found."""
    model, mine = folder / "gap" / "extended.h5", read_model(folder / "mine.sdf")
    side = abs(mine.hubs[0, 0])
    for word, name in (("sdf", "of.sdf"), ("px4params", "of.params"), ("betaflight", "of.txt")):
        command_line.done("export", model, "--format", word, "-o", folder / name)
    again = read_model(folder / "of.sdf")
    np.testing.assert_allclose(again.hubs, mine.hubs, rtol=1e-9, atol=1e-12)
    factors = [rotor.thrust.value for rotor in again.rotors]
    assert change["low"] < factors[0] < change["high"]
    np.testing.assert_allclose(factors, factors[0], rtol=1e-12)
    # Yaw torque follows thrust, as the file states their ratio.
    np.testing.assert_allclose([r.ratio.value for r in again.rotors], TRUE.drag_factor / TRUE.thrust_factor, rtol=1e-9)
    lines = (line.split("\t") for line in (folder / "of.params").read_text().splitlines() if "CA_ROTOR" in line)
    stated = {name: float(value) for _, _, name, value, _ in lines}
    assert abs(stated["CA_ROTOR0_PX"]) == pytest.approx(side, rel=1e-6)
    assert stated["CA_ROTOR0_CT"] == pytest.approx(factors[0] * mine.speed_max.value**2, rel=1e-6)
    assert stated["CA_ROTOR0_KM"] == pytest.approx(-SPINS[0] * -TRUE.drag_factor / TRUE.thrust_factor, rel=1e-6)
    mixer = [line.split()[3:5] for line in (folder / "of.txt").read_text().splitlines() if line.startswith("mmix ")]
    assert all(abs(float(each)) == 1.0 for row in mixer if len(row) == 2 for each in row)


def test_thrust_and_inertia_that_are_both_wrong(tmp_path, logs):
    said, new = corrected(tmp_path, logs, thrust=1 / 0.83, inertia=(1 / 1.2, 1 / 1.2, 1.0))
    changes = {change["element"]: change for change in said["corrected"]["changes"]}
    assert list(changes) == ["motorConstant", "ixx", "iyy"]
    require_the_same_of_exports(tmp_path, changes["motorConstant"])
    moments = np.diag(read_model(tmp_path / "of.sdf").inertia)
    np.testing.assert_allclose(moments[:2], np.diag(new.inertia)[:2], rtol=0.01)
    np.testing.assert_allclose(moments, TRUE.inertia, rtol=0.03)


def test_an_inertia_20_percent_too_small(tmp_path, logs):
    said, new = corrected(tmp_path, logs, inertia=(1 / 1.2, 1 / 1.2, 1.0))
    changes = {change["element"]: change for change in said["corrected"]["changes"]}
    assert list(changes) == ["ixx", "iyy"]
    for change, true in zip(changes.values(), TRUE.inertia, strict=False):
        assert change["low"] < true < change["high"]
    np.testing.assert_allclose(np.diag(new.inertia)[:2], TRUE.inertia[:2], rtol=0.05)
    assert {rotor.thrust.value for rotor in new.rotors} == {TRUE.thrust_factor}


@pytest.mark.parametrize(("ending", "spins"), [("xml", (1, 1, -1, 1)), ("sdf", (1, -1, -1, 1))])
def test_rotors_that_turn_the_other_way(tmp_path, few, ending, spins):
    """One of them, or two of different spins, which roll and pitch would not show."""
    text = sdf_of(TRUE, spins=spins) if ending == "sdf" else mjcf_of(TRUE, spins)
    said, new = corrected(tmp_path, few, text, ending)
    turned = [index for index in range(4) if spins[index] != SPINS[index]]
    assert said["verdict"] == "NO_GAP"
    assert [change["element"] for change in said["corrected"]["changes"]] == [
        "turningDirection" if ending == "sdf" else "gear yaw"
    ] * len(turned)
    for index, change in zip(turned, said["corrected"]["changes"], strict=True):
        assert change["sentence"].startswith(f"M{index + 1} turns {'counter-' if SPINS[index] > 0 else ''}clockwise")
        assert change["after"] == -change["before"]
        # A share of the mean, which is 1 where all rotors are alike.
        assert change["low"] < change["after"] < change["high"]
    if ending == "xml":
        require_the_same_in("mujoco", said["corrected"])
    assert [rotor.spin for rotor in new.rotors] == list(SPINS)
    np.testing.assert_allclose([rotor.drag_factor for rotor in new.rotors], TRUE.drag_factor)


def test_a_file_that_is_right_stays(tmp_path, few):
    said, _ = corrected(tmp_path, few)
    assert said["corrected"]["changes"] == []
    assert (tmp_path / "gap" / "mine.sdf").read_bytes() == (tmp_path / "mine.sdf").read_bytes()


def test_a_thrust_17_percent_too_large_in_python(tmp_path, few, monkeypatch):
    """RotorPy's dictionary, whose other numbers and text stay as they are."""
    monkeypatch.setitem(SIMULATORS, "rotorpy", SIMULATORS["rotorpy"]._replace(samples=1_000))
    mine = tmp_path / "mine.py"
    mine.write_text(rotorpy_of(TRUE, thrust=1 / 0.83))
    result = command_line.done("gap", mine, *few[:-1], "--held-out", few[-1], "-o", tmp_path / "gap")
    said = json.loads((tmp_path / "gap" / "gap.json").read_text())["corrected"]
    (change,) = said["changes"]
    assert change["element"] == "quad_params.k_eta"
    require_the_same_in("rotorpy", said)
    # Why it is not flown there is no part of the answer.
    page, inside = (tmp_path / "gap" / "report.html").read_text(), said["in_simulator"]
    assert (f"In {inside['program']}  " in result.stdout) == (not inside["why_not"])
    assert ("Not flown in RotorPy" in page) == bool(inside["why_not"])
    assert "Not flown" not in result.stdout
    assert change["low"] < TRUE.thrust_factor < change["high"]
    before, after = mine.read_text().splitlines(), (tmp_path / "gap" / "mine.py").read_text().splitlines()
    assert after[1].startswith("# Corrected by cpfls gap; 95 % intervals, from flight0.csv")
    (differs,) = [pair for pair in zip(before[1:], after[3:], strict=True) if pair[0] != pair[1]]
    assert differs[1] == f"    'k_eta': {change['after']:.4g},  # from a data sheet"


def test_a_yaw_share_one_and_a_half_times_too_large_in_newtons(tmp_path, logs):
    """Where controls are thrusts, the thrust by speed is the model's, and the file has the yaw torque over thrust."""
    mine, study, vehicle = (tmp_path / name for name in ("mine.xml", "study.yaml", "vehicle.h5"))
    mine.write_text(mjcf_in_newtons(TRUE, SPINS, ratio=1.5))
    command_line.done("init", "--from", mine, logs[0], "-o", study)
    settings = load_study(study).vehicle
    factors = {"thrust_factor_n_s2": TRUE.thrust_factor, "drag_factor_n_m_s2": TRUE.drag_factor}
    rotors = tuple(replace(rotor, **factors) for rotor in settings.rotors)
    known = replace(settings, rotors=rotors, unknown=())
    write_vehicle(vehicle, vehicle_of(VehicleModel(vehicle=known)), config=study.read_text())
    words = ("gap", mine, *logs[:-1], "--held-out", logs[-1], "--model", vehicle, "-o", tmp_path / "gap", "--json")
    said, share = json.loads(command_line.done(*words).stdout)["corrected"], TRUE.drag_factor / TRUE.thrust_factor
    assert {change["element"] for change in said["changes"]} == {"gear yaw"}
    for change in said["changes"]:
        assert min(map(abs, (change["low"], change["high"]))) < share < max(map(abs, (change["low"], change["high"])))
        assert change["sentence"].endswith("by its ratio to the inertia about z")
    new = read_model(tmp_path / "gap" / "mine.xml")
    assert [rotor.spin for rotor in new.rotors] == list(SPINS)
    np.testing.assert_allclose(np.diag(new.inertia), TRUE.inertia)
    require_the_same_in("mujoco", said)


def test_turns_of_single_rotors_have_their_intervals():
    """Thirty times three flights in gusts: each rotor by itself is one of four that are alike."""
    asked = [Flight(TRUE, GUSTS, path=run, draw=run, reach=3.0, swing=0.3) for run in range(90)]
    flown = [(each.motion.rate, each.speed, 1 / each.motion.period, False) for each in gusty_flights(asked, 30.0)]
    turns, half = np.transpose([turns_by_rotors(flown[first : first + 3]) for first in range(0, 90, 3)], (1, 0, 2))
    # The body turns against its rotors.
    assert (-turns * SPINS > half).all()
    assert 0.9 <= (np.abs(-turns * SPINS - 1) < half).mean() <= 0.98
