"""The vehicle of a simulator's file in a study, and flown as the simulator flies it; a file read again as corrected."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.export.holding import probe_flight
from cpfls_cli.export.registry import exported
from cpfls_cli.flightlog.airframe import Airframe, RotorPlace
from cpfls_cli.playback.model import ModelEffect
from cpfls_cli.playback.player import Course, free_runs, player_of
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulators.formats import read_model
from cpfls_cli.simulators.study import as_corrected, of_log, vehicle_of
from tests.builders.exported_vehicles import sheet_of_vehicle
from tests.builders.flown_exports import fly_sdf
from tests.builders.gusty_flights import LARGE
from tests.builders.playback_flights import STATED, truth
from tests.builders.simulator_files import sdf_of
from tests.builders.studies import put_file

ARM = 0.12
X = [(ARM, -ARM), (-ARM, -ARM), (-ARM, ARM), (ARM, ARM)]
PARENT = """<sdf version="1.9"><model name="x"><include merge="true"><uri>model://base</uri></include></model></sdf>"""


class Coaxial(type(LARGE)):
    """Eight rotors, two on each arm."""

    places = np.repeat(X, 2, axis=0)


def of(folder, spins, logged, sure="stated", truth=LARGE):
    """Make the vehicle of a file, and of a log whose rotors are (x, y, spin)."""
    path = put_file(folder / "mine.sdf", sdf_of(truth, spins=spins))
    rotors = tuple(RotorPlace("", (x, y), spin) for x, y, spin in logged)
    airframe = Airframe(rotors, True, "parameters", sure)
    proposal = SimpleNamespace(airframe=airframe, rotors=len(rotors), speed_max=900.0, share_of_speed=False)
    return of_log(read_model(path), proposal, None)


def test_rotors_on_one_arm_are_distinguished_by_their_spin(tmp_path):
    logged = [(*place, spin) for spin in (1, -1) for place in X]
    vehicle = of(tmp_path, (-1, 1) * 4, logged, truth=Coaxial(*LARGE))
    assert vehicle.order == (1, 3, 5, 7, 0, 2, 4, 6)
    assert (vehicle.warnings, vehicle.turned) == ((), ())


def test_rotors_that_nothing_separates_are_said(tmp_path):
    logged = [(*place, 1) for place in X for _ in range(2)]
    vehicle = of(tmp_path, (1,) * 8, logged, truth=Coaxial(*LARGE))
    assert (
        "M1 and M2 lie in the same direction and turn the same way, so which is which is a guess" in vehicle.warnings[0]
    )


def test_places_that_do_not_fit_leave_the_order_of_the_file(tmp_path):
    vehicle = of(tmp_path, (-1, 1, -1, 1), [(1.0, -1.0, -1), (1.0, -1.1, 1), (1.0, -0.9, -1), (-1.0, 1.0, 1)])
    assert vehicle.order == (0, 1, 2, 3)
    assert "no order of its rotors fits that of the log" in vehicle.warnings[0]


@pytest.mark.parametrize(
    ("turned", "sure", "has_log"),
    [([3], "data", True), ([0, 1], "data", True), ([0, 1, 2, 3], "data", False), ([0, 1, 2, 3], "stated", True)],
)
def test_single_rotors_turn_as_the_log_has_them(tmp_path, turned, sure, has_log):
    """Where the motion has all of them turn the other way, the axes of the log may be mirrored."""
    true = [-1, 1, -1, 1]
    spins = [-spin if index in turned else spin for index, spin in enumerate(true)]
    vehicle = of(tmp_path, spins, [(*place, spin) for place, spin in zip(X, true, strict=True)], sure)
    assert list(vehicle.spins) == (true if has_log else spins)
    assert (list(vehicle.turned), len(vehicle.warnings)) == (turned if has_log else [], len(turned))


def test_a_largest_speed_that_a_log_let_one_guess_is_that_of_the_model(tmp_path):
    """Whose config was made with another log: what is guessed makes no other vehicle."""
    model = read_model(put_file(tmp_path / "mine.sdf", sdf_of(LARGE, spins=(-1, 1, -1, 1))))
    fast = 1.3 * model.speed_max.value
    proposal = SimpleNamespace(airframe=None, rotors=4, speed_max=fast, share_of_speed=False)
    like = replace(LARGE.vehicle, rotor_speed_max_rad_s=1.5 * model.speed_max.value)
    assert of_log(model, proposal, None).speed_max == fast
    assert of_log(model, proposal, None, like).speed_max == like.rotor_speed_max_rad_s


def model(lag_s=0.0, **effects):
    kept = tuple(ModelEffect(name, {}, np.array([value])) for name, value in effects.items())
    return replace(truth(), vehicle=STATED, effects=kept, response=RotorResponse(lag_s=lag_s), remainder=None)


@pytest.mark.parametrize(
    "has", [{}, {"rotor_drag": 2e-4}, {"rolling_moment": 2e-5}, {"lag_s": 0.03}, {"rotor_drag": 2e-4, "lag_s": 0.03}]
)
def test_a_file_of_gazebo_is_flown_by_the_equations_of_its_plugin(tmp_path, has):
    flies = model(**has)
    text = exported(sheet_of_vehicle(flies), "sdf", "v.sdf").text
    (tmp_path / "v.sdf").write_text(text)
    of = of_log(read_model(tmp_path / "v.sdf"), None, None)
    flight = probe_flight(flies)
    course = Course(flight, flight.starts(8, 3), 8, finer=40)
    published = course.errors(fly_sdf(text, course))

    def off(file_as):
        own = free_runs(player_of(file_as, flight), flight, course.starts, 8).errors
        return np.abs(own - published).max(axis=(0, 1, 3)) / np.abs(published).max(axis=(0, 1, 3))

    made = vehicle_of(of, of, STATED)
    # The playback takes the steps of the log, of second order.
    assert (off(made) < 0.005).all()
    without = off(replace(made, effects=(), response=RotorResponse()))
    if has:
        assert (without[2:] > 0.02).all()


def test_what_a_file_of_rotorpy_states_besides_flies_too(tmp_path):
    made = exported(sheet_of_vehicle(replace(model(), effects=truth().effects)), "rotorpy", "v.py")
    (tmp_path / "v.py").write_text(made.text)
    of = of_log(read_model(tmp_path / "v.py"), None, None)
    flies = {each.name: each.coefficients for each in vehicle_of(of, of, STATED).effects}
    assert "rotor_drag" in flies
    assert flies["rotor_drag"][0] == pytest.approx(made.held.numbers["k_d"], rel=1e-9)
    assert set(flies) > {"rotor_drag"}


def test_included_files_are_read_as_corrected(tmp_path):
    """Files stand next to each other as they did, and the user's own are left alone."""
    (tmp_path / "base").mkdir()
    base, parent = tmp_path / "base" / "model.sdf", tmp_path / "x" / "model.sdf"
    base.write_text(exported(sheet_of_vehicle(model()), "sdf", "v.sdf").text)
    parent.parent.mkdir()
    parent.write_text(PARENT.replace("model://base", "../base"))
    before = read_model(parent)
    stated = before.bodies[0].mass
    raw = base.read_bytes()
    span = stated.span
    new = as_corrected(before, {before.output_names[span.file]: raw[: span.start] + b"2.5" + raw[span.end :]})
    assert new.bodies[0].mass.value == 2.5
    assert base.read_bytes() == raw


def test_a_file_without_rotors_flies_those_of_the_log(tmp_path):
    body = """<mujoco><worldbody><body name="b"><freejoint/><inertial pos="0 0 0" mass="1.5"
        diaginertia="0.018 0.02 0.034"/></body></worldbody></mujoco>"""
    (tmp_path / "v.xml").write_text(body)
    of = of_log(read_model(tmp_path / "v.xml"), None, None)
    assert not of.model.rotors
    flies = vehicle_of(of, of, STATED)
    assert (flies.vehicle.rotors, flies.vehicle.mass_kg) == (STATED.rotors, 1.5)


def test_a_frame_of_ardupilot_flies_the_thrust_that_is_corrected(tmp_path):
    frame = """{"mass": 1.5, "diagonal_size": 0.45, "hoverThrOut": HOVER, "propExpo": 0.5, "num_motors": 4}"""
    models = []
    for name, hover in (("a", 0.3), ("b", 0.36)):
        (tmp_path / f"{name}.json").write_text(frame.replace("HOVER", str(hover)))
        models.append(of_log(read_model(tmp_path / f"{name}.json"), None, None))
    given, new = models
    before, after = (vehicle_of(each, given, STATED).vehicle.rotors[0] for each in (given, new))
    assert after.thrust_factor_n_s2 == pytest.approx(before.thrust_factor_n_s2 * 0.3 / 0.36, rel=1e-9)
