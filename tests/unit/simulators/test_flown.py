"""The vehicle of a simulator's file flown as the simulator flies it, and a file read again as corrected."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.export.holding import probe_flight
from cpfls_cli.export.registry import exported
from cpfls_cli.playback.model import ModelEffect
from cpfls_cli.playback.player import Course, free_runs, player_of
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulators.formats import read_model
from cpfls_cli.simulators.study import as_corrected, of_log, vehicle_of
from tests.builders.exported_vehicles import sheet_of_vehicle
from tests.builders.flown_exports import fly_sdf
from tests.builders.playback_flights import STATED, truth

PARENT = """<sdf version="1.9"><model name="x"><include merge="true"><uri>model://base</uri></include></model></sdf>"""


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
    whole = replace(model(), effects=truth().effects)
    made = exported(sheet_of_vehicle(whole), "rotorpy", "v.py")
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
    assert flies.vehicle.rotors == STATED.rotors
    assert flies.vehicle.mass_kg == 1.5


def test_a_frame_of_ardupilot_flies_the_thrust_that_is_corrected(tmp_path):
    frame = """{"mass": 1.5, "diagonal_size": 0.45, "hoverThrOut": HOVER, "propExpo": 0.5, "num_motors": 4}"""
    models = []
    for name, hover in (("a", 0.3), ("b", 0.36)):
        (tmp_path / f"{name}.json").write_text(frame.replace("HOVER", str(hover)))
        models.append(of_log(read_model(tmp_path / f"{name}.json"), None, None))
    given, new = models
    before, after = (vehicle_of(each, given, STATED).vehicle.rotors[0] for each in (given, new))
    assert after.thrust_factor_n_s2 == pytest.approx(before.thrust_factor_n_s2 * 0.3 / 0.36, rel=1e-9)
