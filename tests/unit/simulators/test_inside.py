"""A simulator's file flown in the simulator itself: what a playback by other code says of the same file and flight.

Both hold what drives the rotors from sample to sample, so that they differ by their integrators alone: a playback takes
one step of second order from sample to sample, RotorPy and MuJoCo's RK4 many of fourth order or more, MuJoCo's Euler
and PyBullet steps of first order, whose error halves with them.
"""

import re
import tomllib
from dataclasses import replace
from functools import partial
from importlib.machinery import ModuleSpec
from importlib.metadata import PackageNotFoundError
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from cpfls_cli.export.registry import exported
from cpfls_cli.export.simulators.urdf import order_of
from cpfls_cli.gap.before_after import PlaybackChange, errors_by_horizon
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.page import TEMPLATES, environment
from cpfls_cli.playback.flight import State
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.playback.player import Course, free_runs, player_of
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulators import in_pybullet, inside
from cpfls_cli.simulators.formats import read_model
from cpfls_cli.simulators.results import Corrected, InSimulator
from cpfls_cli.simulators.study import of_log, played, vehicle_of
from tests.builders.exported_vehicles import sheet_of_vehicle
from tests.builders.gusty_flights import GUSTS, SMALL, SPINS, Flight, gusty_flights, logged
from tests.builders.simulator_files import mjcf_of, rotorpy_of, sdf_of

TRUE = SMALL._replace(drag=0.0, damping=0.0)
HORIZON = 50
AGREE = 0.005
"""Share of the errors after half a second: of a step of second order as long as a sample, 0.2 to 0.3 %."""
PACKAGES = {"xml": "mujoco", "py": "rotorpy", "urdf": "pybullet"}
MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def require(ending):
    if find_spec(PACKAGES[ending]) is None:
        pytest.skip(f"needs the package {PACKAGES[ending]}, of the extra simulators")


def flight_of(seconds, **more):
    return next(iter(gusty_flights([Flight(TRUE, GUSTS, reach=3.0, swing=0.3, **more)], seconds)))


@pytest.fixture(scope="module")
def flight():
    return flight_of(6.0)


@pytest.fixture(scope="module")
def commanded():
    return replace(flight_of(6.0, commands=True), hold="previous")


def given(folder, ending, text=""):
    """A file of what flies, with its rotors as in the flight."""
    order = (0, 1, 2, 3)
    if ending == "urdf":
        text = exported(sheet_of_vehicle(VehicleModel(vehicle=TRUE.vehicle)), "urdf", "v.urdf").text
        order = tuple(np.argsort(order_of(TRUE.vehicle)).tolist())
    file = folder / f"v.{ending}"
    file.write_text(text or {"xml": mjcf_of(TRUE, SPINS, integrator="RK4"), "py": rotorpy_of(TRUE)}[ending])
    return replace(of_log(read_model(file), None, None), order=order, spins=tuple(SPINS.tolist()))


def starts(flight):
    return np.arange(0, len(flight) - HORIZON, 50)


def flies_of(of, thrusts):
    known = inside.SIMULATORS[of.model.format]
    loaded = known.load(of.model.file, of)
    return known.flies(loaded, loaded, of, thrusts)


def flown(of, flight, lags=False):
    """Errors of the playback and of the simulator, shape (run, horizon, 4, 3)."""
    model = vehicle_of(of, of, TRUE.vehicle)
    model = model if lags else replace(model, response=RotorResponse())
    course = Course(flight, starts(flight), HORIZON)
    own = free_runs(player_of(model, flight), flight, course.starts, HORIZON).errors
    flies = flies_of(of, np.full(4, TRUE.thrust_factor))
    turned = replace(course, flight=replace(flight, speed=flight.speed[:, np.argsort(of.order)]))
    return own, inside.runs_of(turned, flies(turned, lags)).errors


def apart(own, theirs):
    """How far runs are from each other at most, as shares of the largest errors, shape (4,)."""
    return np.abs(theirs - own).max(axis=(0, 1, 3)) / np.abs(own).max(axis=(0, 1, 3))


@pytest.mark.parametrize("ending", ["xml", "py"])
def test_a_simulator_says_what_a_playback_says(tmp_path, flight, ending):
    require(ending)
    assert (apart(*flown(given(tmp_path, ending), flight)) < AGREE).all()


def test_two_simulators_agree_where_their_steps_are_short(tmp_path, flight):
    """MuJoCo and RotorPy know nothing of each other: what is left is their tolerance."""
    require("xml")
    require("py")
    (_, one), (_, other) = (flown(given(tmp_path, ending), flight) for ending in ("xml", "py"))
    assert (apart(one, other) < 1e-5).all()


def test_the_error_of_first_order_steps_halves_with_them(tmp_path, flight):
    require("xml")
    found = []
    for step in (0.002, 0.001):
        own, theirs = flown(given(tmp_path, "xml", mjcf_of(TRUE, SPINS, step=step)), flight)
        _, exact = flown(given(tmp_path, "xml"), flight)
        found.append(apart(exact, theirs))
        assert (apart(own, theirs) < 0.05).all()
    np.testing.assert_allclose(found[0] / found[1], 2.0, rtol=0.05)


def test_pybullet_says_what_a_playback_says(tmp_path, flight, monkeypatch):
    """Without its damping, which no file states; its gravity of 9.8 m/s^2 is 5 mm/s off after half a second."""
    require("urdf")
    of, found = given(tmp_path, "urdf"), []
    own, damped = flown(of, flight)
    monkeypatch.setattr(inside, "fly_pybullet", partial(in_pybullet.fly_pybullet, damping=0.0))
    # Three and ten steps from sample to sample.
    for step in (1 / 240, 1 / 1000):
        monkeypatch.setattr(in_pybullet, "_STEP_S", step)
        found.append(apart(own, flown(of, flight)[1]))
    np.testing.assert_allclose(found[0] / found[1], 10 / 3, rtol=0.1)
    assert (found[1] < 0.02).all()
    assert (apart(own, damped) > found[0]).all()


def test_rotors_lag_behind_commands(tmp_path, commanded):
    require("py")
    of = given(tmp_path, "py")
    own, theirs = flown(of, commanded, lags=True)
    assert (apart(own, theirs) < AGREE).all()
    assert (apart(own, flown(of, commanded)[1]) > 0.3).all()


def test_filters_of_actuators_lag_behind_commands(tmp_path, commanded):
    """They filter the squared speed, a playback the speed."""
    require("xml")
    text = mjcf_of(TRUE, SPINS, integrator="RK4").replace("<motor", '<general dyntype="filterexact" dynprm="0.02"')
    of = given(tmp_path, "xml", text)
    own, theirs = flown(of, commanded, lags=True)
    assert (apart(own, theirs) < 0.05).all()
    assert (apart(own, flown(of, commanded)[1]) > 0.3).all()
    # Measured speeds have the lag already.
    assert (apart(*flown(of, replace(commanded, hold="linear"))) < AGREE).all()


def newtons(file, *, top=None, shift=(0.0, 0.0, 0.0), flipped=False):
    """The same vehicle with thrusts for controls, its centre of mass elsewhere, and its sites upside down."""
    text = mjcf_of(TRUE, SPINS, integrator="RK4")
    text = re.sub(r"<custom>.*?</custom>", "", text)
    moved = np.array(shift)
    text = re.sub(
        'pos="([^"]*)"', lambda own: 'pos="{} {} {}"'.format(*(np.array(own[1].split(), dtype=float) + moved)), text
    )
    ratio, sign = TRUE.drag_factor / TRUE.thrust_factor, -1 if flipped else 1
    limit = f' ctrllimited="true" ctrlrange="0 {top}"' if top else ""
    for index, spin in enumerate(SPINS):
        text = re.sub(
            rf'name="m{index}" site="s{index}" gear="[^"]*"',
            f'site="s{index}" gear="0 0 {sign * 2:g} 0 0 {-sign * spin * 2 * ratio:.12g}"{limit}',
            text,
        )
    file.write_text(text.replace("<site ", '<site quat="0 1 0 0" ') if flipped else text)
    return replace(of_log(read_model(file), None, None), spins=tuple(SPINS.tolist()))


@pytest.mark.parametrize("changed", [{}, {"shift": (0.05, -0.02, 0.03)}, {"flipped": True}], ids=str)
def test_controls_are_thrusts_where_the_file_says_nothing_else(tmp_path, flight, changed):
    """Wherever the frame of the body is, a flight is of its centre of mass."""
    require("xml")
    _, squared = flown(given(tmp_path, "xml"), flight)
    _, thrusts = flown(newtons(tmp_path / "n.xml", **changed), flight)
    assert (apart(squared, thrusts) < 1e-6).all()


def test_limits_of_controls_hold(tmp_path, flight):
    require("xml")
    hover = TRUE.mass * 9.81 / 4
    free, limited = (flown(newtons(tmp_path / "n.xml", top=top), flight)[1] for top in (None, 0.52 * hover))
    assert apart(free, limited)[3] > 0.05


def test_limits_hold_where_filters_begin(tmp_path, commanded):
    """A file whose controls are far out of its limits flies as one whose speeds are at the limit."""
    require("xml")
    filtered = '<general dyntype="filterexact" dynprm="0.1" ctrllimited="true" ctrlrange="{} 1e9"'
    lowest = commanded.speed.max() * 1.1
    text = mjcf_of(TRUE, SPINS).replace("<motor", filtered.format(lowest**2))
    limited = flown(given(tmp_path, "xml", text), commanded, lags=True)[1]
    held = replace(commanded, speed=np.full_like(commanded.speed, lowest))
    free = flown(given(tmp_path, "xml", text.replace('"true"', '"false"')), held, lags=True)[1]
    np.testing.assert_allclose(limited, free, atol=1e-9)


@pytest.mark.parametrize("lags", [False, True])
def test_limits_of_speeds_hold(tmp_path, commanded, lags):
    """Of a state that is given, too, which RotorPy limits after each step alone."""
    require("py")
    lowest = commanded.speed.max() * 1.1
    text = re.sub(r"('rotor_speed_min': *)[^,]*", rf"\g<1>{lowest}", rotorpy_of(TRUE))
    limited = flown(given(tmp_path, "py", text), commanded, lags=lags)[1]
    held = replace(commanded, speed=np.full_like(commanded.speed, lowest))
    np.testing.assert_allclose(limited, flown(given(tmp_path, "py"), held, lags=lags)[1], atol=1e-9)


def test_a_second_flight_has_the_steps_of_the_file(tmp_path, flight):
    """Flights of other rates before it leave no step behind."""
    require("xml")
    flies = flies_of(given(tmp_path, "xml", mjcf_of(TRUE, SPINS, step=0.008)), np.ones(4))
    course = Course(flight, starts(flight), 4)
    first = flies(course, False).rate
    flies(replace(course, flight=flight, finer=4), False)
    np.testing.assert_array_equal(flies(course, False).rate, first)


def test_steps_are_those_of_a_clock_that_is_a_little_off(flight):
    course = Course(flight, np.array([0]), 1)
    period = course.period
    assert [course.steps(period / 5 * (1 + off)) for off in (-5e-4, 5e-4, -5e-3)] == [5, 5, 6]
    assert course.steps(2 * period) == 1


def test_versions_asked_for_are_those_of_the_extra():
    extras = tomllib.loads(Path("pyproject.toml").read_text())["project"]["optional-dependencies"]
    asked = {line.split(";")[0] for line in extras["simulators"]}
    assert asked >= {f"{own.package}>={own.oldest}" for own in inside.SIMULATORS.values()}


def test_what_an_export_says_of_controls_holds(tmp_path, flight):
    """All actuators, and rotors in the order of the log."""
    require("xml")
    model = VehicleModel(vehicle=TRUE.vehicle, effects=(ModelEffect("rotor_drag", {}, np.array([1e-5])),))
    (tmp_path / "v.xml").write_text(exported(sheet_of_vehicle(model), "mjcf", "v.xml").text)
    order = (2, 0, 3, 1)
    of = replace(of_log(read_model(tmp_path / "v.xml"), None, None), order=order)
    own = free_runs(player_of(model, flight), flight, starts(flight), HORIZON).errors
    _, theirs = flown(of, replace(flight, speed=flight.speed[:, order]))
    assert (apart(own, theirs) < AGREE).all()


@pytest.fixture(scope="module")
def held():
    (signals,) = logged(flight_of(2.0), TRUE.vehicle).parts
    return [replace(signals, name="held.csv")]


def both(of, held, texts, horizon_s=0.3):
    """Playback and simulator along held-out flights, the file as given and as corrected."""
    pairs = played(of, texts, TRUE.vehicle, held, held, GapSettings(horizon_s=horizon_s))
    replayed = PlaybackChange.of_pairs(pairs, errors_by_horizon(pairs, horizon_s))
    return replayed, inside.in_simulator(of, texts, TRUE.vehicle, held, pairs, horizon_s)


@pytest.mark.parametrize("ending", ["xml", "py"])
def test_a_file_is_flown_as_given_and_as_corrected(tmp_path, held, ending, monkeypatch):
    """With meshes that are next to the file and not next to its copy."""
    require(ending)
    made = {
        "xml": lambda thrust: mjcf_of(TRUE, SPINS, thrust=thrust),
        "py": lambda thrust: rotorpy_of(TRUE, thrust=thrust),
    }
    wrong, right = (made[ending](thrust) for thrust in (1.2, 1.0))
    if ending == "xml":
        (tmp_path / "parts").mkdir()
        (tmp_path / "parts" / "m.obj").write_text(MESH)
        seen = ("<worldbody>", '<asset><mesh file="m.obj"/></asset><worldbody><geom type="mesh" mesh="m"/>')
        wrong, right = (
            text.replace("<option", '<compiler meshdir="parts"/><option').replace(*seen) for text in (wrong, right)
        )
    monkeypatch.chdir(tmp_path)
    played_back, found = both(given(Path(), ending, wrong), held, {f"v.{ending}": right.encode()})
    assert found.program.startswith({"xml": "MuJoCo ", "py": "RotorPy "}[ending])
    assert found.why_not == ""
    for name in ("before", "after"):
        own, theirs = (each.models[name] for each in (played_back, found.flown))
        for signal, errors in own.signals.items():
            # Of other windows, and by MuJoCo's own step.
            assert theirs.signals[signal].mae[-1] == pytest.approx(errors.mae[-1], rel=0.15)
    assert found.flown.at_end["velocity"].after < 0.8 * found.flown.at_end["velocity"].before
    assert found.flown.windows <= played_back.windows


def test_a_run_that_ran_away_stays_as_it_was(flight):
    course = Course(flight, np.array([3, 40]), 4)
    begins = [State(*(part[run] for part in course.start)) for run in (0, 1)]
    away = begins[0]._replace(rate=np.array([1e4, 0.0, 0.0]))
    runs = inside.runs_of(course, course.collected([[begins[0], begins[0], away, begins[1]], [begins[1]] * 4]))
    np.testing.assert_array_equal(runs.diverged, [2, -1])
    stays = course.errors(State(*(np.repeat(begin[:, None], 4, axis=1) for begin in course.start)))
    np.testing.assert_array_equal(runs.errors, stays)


def test_what_runs_away_in_mujoco_writes_nothing(tmp_path, flight, monkeypatch, capfd):
    require("xml")
    monkeypatch.chdir(tmp_path)
    flies = flies_of(given(tmp_path, "xml", mjcf_of(TRUE, SPINS, thrust=1e12)), np.ones(4))
    course = Course(flight, np.array([3, 40]), 4)
    assert (inside.runs_of(course, flies(course, False)).diverged >= 0).all()
    assert [path.name for path in tmp_path.iterdir()] == ["v.xml"]
    assert capfd.readouterr() == ("", "")


LOOSE = """<link name="loose"/>
<joint name="j" type="fixed"><parent link="base_link"/><child link="loose"/></joint></robot>"""


def test_pybullet_prints_nothing(tmp_path, flight, capfd):
    """It warns of a link without inertia, and says by itself when it was built."""
    require("urdf")
    of = given(tmp_path, "urdf")
    of.model.file.write_text(of.model.file.read_text().replace("</robot>", LOOSE))
    flown(of, flight)
    assert capfd.readouterr() == ("", "")


def test_pybullet_leaves_no_client_of_a_refused_file(flight):
    require("urdf")
    import pybullet

    with pytest.raises(pybullet.error):
        in_pybullet.fly_pybullet(b"<robot/>", None, Course(flight, np.array([0]), 1))
    assert not pybullet.isConnected(0)


def test_why_a_file_is_not_flown(tmp_path, held, monkeypatch):
    require("xml")
    body = """<mujoco><worldbody><body name="b"><freejoint/><inertial pos="0 0 0" mass="0.045"
        diaginertia="3.7e-5 4.2e-5 6.6e-5"/></body></worldbody></mujoco>"""
    without = replace(given(tmp_path, "xml", body), order=(), spins=())
    assert both(without, held, {})[1].why_not == "v.xml states no rotors"
    of = given(tmp_path, "xml", mjcf_of(TRUE, SPINS).replace("<body ", '<body colour="red" '))
    _, refused = both(of, held, {})
    # All lines of it: the element is named in the last one.
    assert refused.why_not.startswith("it refuses v.xml as given: XML Error: ")
    assert "colour" in refused.why_not
    assert "Element 'body', line" in refused.why_not
    assert refused.flown is None
    assert refused.refused
    right = given(tmp_path, "xml", mjcf_of(TRUE, SPINS))
    pairs = played(right, {}, TRUE.vehicle, held, held, GapSettings(horizon_s=0.3))

    def why(texts):
        found = inside.in_simulator(right, texts, TRUE.vehicle, held, pairs, 0.3)
        return found.program, found.why_not, found.refused

    broken = mjcf_of(TRUE, SPINS).replace("<body ", '<body colour="red" ').encode()
    assert why({"v.xml": broken})[1].startswith("it refuses v.xml as corrected: XML Error: ")
    oldest = inside.SIMULATORS["mjcf"]
    with monkeypatch.context() as own:
        own.setitem(inside.SIMULATORS, "mjcf", oldest._replace(flies=lambda *_: lambda *_: [][0]))
        assert why({})[1:] == ("the file as corrected could not be flown: IndexError: list index out of range", True)
        own.setitem(inside.SIMULATORS, "mjcf", oldest._replace(flies=lambda *_: {}["control"]))
        assert why({})[1:] == ("v.xml could not be flown: KeyError: 'control'", True)
    with monkeypatch.context() as own:
        own.setattr(inside, "version", lambda _: "3.2.6")
        sentence = "MuJoCo 3.2.6 is too old; it needs 3.2.7 or later: pip install -U mujoco"
        assert why({}) == ("MuJoCo", sentence, False)
        own.setattr(inside, "version", lambda _: "3.10.0")
        assert why({}) == ("MuJoCo 3.10.0", "", False)

        def lost(package):
            raise PackageNotFoundError(package)

        own.setattr(inside, "version", lost)
        assert why({}) == ("MuJoCo", "", False)
    missing = ("MuJoCo", 'its package is not installed; pip install "cpfls[simulators]" does', False)
    for spec in (None, ModuleSpec("mujoco", None, is_package=True)):
        monkeypatch.setattr(inside, "find_spec", lambda _, spec=spec: spec)
        assert why({}) == missing
    (tmp_path / "v.sdf").write_text(sdf_of(TRUE))
    assert both(of_log(read_model(tmp_path / "v.sdf"), None, None), held, {})[1] is None


@pytest.mark.parametrize("refused", [True, False])
def test_what_a_simulator_refuses_is_part_of_the_answer(refused):
    """And that it is not installed is in the details alone."""
    why = InSimulator(program="MuJoCo 4.0.0", why_not="it refuses v.xml as given: no", refused=refused, flown=None)
    said = Corrected(files=("v.xml",), changes=(), unchanged=(), elsewhere=(), diff="", in_simulator=why)
    page = environment(TEMPLATES, {}).get_template("corrected.md.j2").render(r={"corrected": said})
    answer, details = page.split(":::", 1)
    assert ("- **In MuJoCo 4.0.0**: Not flown: it refuses v.xml as given: no." in answer) == refused
    assert ("Not flown in MuJoCo" in details) == (not refused)
