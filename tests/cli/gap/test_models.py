"""Models in place of the vehicle: exported, flown, predicted with, and the gap workflow on them."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest

import cpfls_cli
from cpfls_cli.artifacts.diagnosis import Extended
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.config.load import load_study, stored_study
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.results import Flight
from cpfls_cli.gap.before_after import LeftOut
from cpfls_cli.inertia import six_parameters
from cpfls_cli.playback.model import ModelEffect
from cpfls_cli.store import read
from cpfls_cli.vehicle.rotors import body_wrench
from tests.builders.artifacts import read_result, with_fields
from tests.builders.exported_vehicles import on_numpy

PATH = {"legs": 1, "displacement_m": 1.0, "period_s": 0.18, "duration_s": 3.0, "yaw_turn_rad": 0.3}
CLOSED = ("--mode", "closed-loop", "--set", "simulation.closed_loop.integration_rate_hz=200")
COLUMNS = "t,wx,wy,wz,om1,om2,om3,om4,phi,theta,psi"


def test_an_extended_model_holds_the_vehicle_with_its_effects(extended):
    record = read(extended, Extended)[0]
    vehicle = record.model
    effects = {one.name: one.coefficients for one in vehicle.effects}
    # The height, which the thrust alone does not show, is left open.
    assert effects["com_offset"] == pytest.approx([0.008, -0.005, 0.0], rel=0.05)
    assert vehicle.unsimulated == ()
    np.testing.assert_allclose(six_parameters(vehicle.vehicle.inertia_kg_m2), record.inertia, rtol=1e-12)


def test_it_is_exported(cpfls, extended, tmp_path):
    output = tmp_path / "quad.py"
    result = cpfls.done("export", extended, "--format", "jax", "-o", output)
    assert "Effects: " in result.stdout
    assert "On held-out flights its largest gap is " in result.stdout
    names = on_numpy(output.read_text())
    # Where the centre of mass is off, equal rotors tilt the vehicle.
    wrench = names["wrench"](np.zeros(3), np.zeros(3), names["steady"](np.full(4, 350.0)))
    torque, force = wrench[:3], wrench[3:]
    effects = {one.name: one.coefficients for one in read(extended, Extended)[0].model.effects}
    offset = effects["com_offset"]
    thrust = 4 * 121.5e-6 * 350.0**2
    np.testing.assert_allclose(torque[:2], [-offset[1] * thrust, offset[0] * thrust], rtol=1e-9)
    assert force[2] == pytest.approx(thrust, rel=0.02)


def test_what_a_table_does_not_hold_is_said_with_numbers_and_size(cpfls, extended, tmp_path):
    record = read(extended, Extended)[0]
    size, ends = np.array([0.0, 0.4, 0.0, 0.0, 0.0, 0.0]), np.array([0.1, 0.2, 0.3, 0.4])
    sag = ModelEffect("battery_sag", {"exponent": 1.5}, np.zeros(0))
    outside = replace(record.model, effects=(*record.model.effects, sag))
    path, output = tmp_path / "outside.h5", tmp_path / "m.c"
    with_fields(extended, path, model=outside, left_out=(LeftOut("battery_sag", size, ends),))
    said = cpfls("export", path, "-o", output).stdout.splitlines()[-1]
    assert said.startswith("Not held, or only in part: battery sag (")
    floors = 0.4 / record.gap.floor[1]
    assert said.endswith(
        f"; exponent = 1.5): 0.4 N m and 0 N along its held-out flights, {floors:.3g} noise floors; half a second "
        "without it ends 0.4 rad/s, 17.2 degrees, 0.2 m/s and 0.1 m off."
    )
    assert "along its held-out flights" in " ".join(output.read_text().split())


def test_an_identified_inertia_under_effects(cpfls, extended, pipeline, tmp_path):
    record, identified = read(extended, Extended)[0], read(pipeline.model, IdentifiedModel)[0]
    path = tmp_path / "over.h5"
    with_fields(extended, path, model=replace(record.model, fuzzy=identified.functions))
    said = cpfls("export", path, "--format", "casadi", "-o", tmp_path / "over_casadi.py").stdout
    assert said.splitlines()[-1] == "CasADi holds all of it."
    cpfls.done("export", path, "-o", tmp_path / "over.json")
    document = json.loads((tmp_path / "over.json").read_text())
    assert document["inertia_kg_m2"] is None
    assert document["structure"] is not None


def test_an_identified_model_holds_the_stated_vehicle(pipeline):
    made, origin = read(pipeline.model, IdentifiedModel)
    assert made.model.vehicle == stored_study(origin.config, pipeline.model).vehicle
    assert made.model.effects == ()


def test_the_json_of_an_extended_model_says_what_it_is_good_for(cpfls, extended, tmp_path):
    cpfls.done("export", extended, "-o", tmp_path / "m.json")
    document = json.loads((tmp_path / "m.json").read_text())
    assert any(line.startswith("On held-out flights its largest gap is ") for line in document["usage"])
    assert "com_offset" in document["effects"]


@pytest.fixture(scope="module")
def path(cpfls, gap_config, tmp_path_factory):
    target = tmp_path_factory.mktemp("path") / "trajectory.h5"
    cpfls.done("trajectory", gap_config, "--set", f"trajectory={json.dumps(PATH)}", "-o", target)
    return target


@pytest.fixture
def fly(cpfls, gap_config, path, tmp_path):
    def call(name, *options):
        target = tmp_path / name
        result = cpfls.done("simulate", gap_config, path, *CLOSED, *options, "-o", target, "--json")
        with h5py.File(target) as file:
            return file["rotor_speed"][()], json.loads(result.stdout)["effects"]

    return call


def test_extended_model_flies_as_its_effects_do(fly, extended):
    plain, _ = fly("plain.h5")
    model, effects = fly("model.h5", "--model", extended)
    truth, _ = fly("truth.h5", "--effect", "com_offset=0.008,-0.005")
    # The rotors in front and behind balance what hangs off centre.
    assert np.abs(truth - plain).max() > 5
    assert np.abs(model - truth).max() < 0.05 * np.abs(truth - plain).max()
    assert effects["com_offset.c_x"] == pytest.approx(0.008, rel=0.02)
    # What the refit makes of the inertia stands in the vehicle.
    assert "parameter_error.inertia_x" not in effects


def test_effects_come_on_top_of_a_model(fly, extended):
    model, _ = fly("model.h5", "--model", extended)
    more, effects = fly("more.h5", "--model", extended, "--effect", "torque_bias.M_z=0.1")
    assert effects["torque_bias.M_z"] == 0.1
    assert np.abs(more - model).max() > 5


def test_identified_model_is_flown(cpfls, fly, gap_config, path, tmp_path):
    """A rigid body under a fuzzy part without weight flies as the vehicle whose inertia it found."""
    flight, model = tmp_path / "flight.h5", tmp_path / "model.h5"
    cpfls.done("simulate", gap_config, path, "-o", flight)
    off = "local_search: {enabled: false}, validation: {enabled: false}"
    words = ("--set", f"identification={{base: rigid-body, population: 10, generations: 1, {off}}}")
    cpfls.done("identify", gap_config, flight, *words, "-o", model)
    identified, effects = fly("identified.h5", "--model", model)
    plain, _ = fly("plain.h5")
    assert effects == {}
    assert np.abs(identified - plain).max() < 0.01 * plain.mean()


def test_a_file_that_is_no_model_is_refused(refuse, gap_config, path, tmp_path):
    (line,) = refuse("simulate", gap_config, path, *CLOSED, "--model", path, "-o", tmp_path / "x.h5")
    assert "is a cpfls/trajectory; this command needs a model (made by `cpfls identify`" in line


@pytest.fixture(scope="module")
def answer(cpfls, gap_config, pipeline, with_attitude, tmp_path_factory):
    folder = tmp_path_factory.mktemp("model") / "gap"
    return folder, cpfls.summary("gap", gap_config, *with_attitude, "--model", pipeline.model, "-o", folder)


def test_artifacts_carry_the_model(answer, pipeline):
    folder, _ = answer
    with h5py.File(folder / "diagnosis.h5") as file, h5py.File(pipeline.model) as model:
        assert (file["base/fuzzy/coefficients"][()] == model["model/fuzzy/coefficients"][()]).all()


def test_offset_is_found_next_to_the_model(answer):
    _, summary = answer
    effects = {effect["name"]: effect for effect in [*summary["effects"], *summary["closest"]]}
    assert effects["com_offset"]["coefficients"]["c_x"]["value"] == pytest.approx(0.008, rel=0.1)


def test_later_stages_need_no_model_again(cpfls, gap_config, answer, tmp_path):
    folder, _ = answer
    cpfls.done("diagnose", gap_config, folder / "disagreement.h5", "-o", tmp_path / "d.h5")
    assert (tmp_path / "d.h5").read_bytes() == (folder / "diagnosis.h5").read_bytes()


def test_a_flight_without_attitude_is_refused(refuse, gap_config, pipeline, shifted, tmp_path):
    (message,) = refuse("compare", gap_config, shifted[0], "--model", pipeline.model, "-o", tmp_path / "x.h5")
    assert "the model needs the attitude" in message


def test_extended_model_predicts_and_is_compared(cpfls, gap_config, answer, with_attitude, tmp_path):
    folder, summary = answer
    assert summary["extension"]["written"]
    cpfls.done("import", gap_config, with_attitude[1], "-o", tmp_path / "f.h5")
    extended = folder / "extended.h5"
    assert len(cpfls_cli.load_model(extended, gap_config).predict(tmp_path / "f.h5").time) == 2400
    words = ("compare", gap_config, with_attitude[1], "--model", extended, "-o", tmp_path / "d.h5", "--json")
    result = cpfls.done(*words)
    # What was held out for the diagnosis, seen again through the extended model.
    gap = json.loads(result.stdout)["gap"]["torque_n_m"]
    assert gap == pytest.approx(summary["gap_after"]["torque_n_m"], rel=1e-6)


@pytest.fixture(scope="module")
def flown(cpfls, gap_config, shifted, tmp_path_factory):
    """A flight that has an attitude too; level will do, for a prediction only turns torques by it."""
    folder = tmp_path_factory.mktemp("flown")
    data = np.loadtxt(shifted[2], delimiter=",", skiprows=1)
    # Without noise, which a prediction differentiates.
    smooth = np.array(
        [np.convolve(np.pad(c, 7, mode="edge"), np.hanning(15) / np.hanning(15).sum(), "valid") for c in data[:, 1:4].T]
    ).T
    table = np.column_stack([data[:, :1], smooth, data[:, 4:], np.zeros((len(data), 3))])
    np.savetxt(folder / "log.csv", table, delimiter=",", header=COLUMNS, comments="", fmt="%.12g")
    cpfls.done("import", gap_config, folder / "log.csv", "-o", folder / "flight.h5")
    return folder / "flight.h5"


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_error_is_the_gap_that_remains(gap_config, extended, flown):
    found = cpfls_cli.load_model(extended).predict(flown)
    error, measured, inertia = found.error[50:-50], found.measured_torque[50:-50], found.inertia[0]
    # The rotors balance the offset, 0.47 N m about y, so that their torque turns nothing, and the model knows.
    rotors = body_wrench(load_study(gap_config).vehicle, read(flown, Flight)[0].signals["rotor_speed"]).body_torque
    assert abs(rotors[50:-50, 1].mean()) > 0.4
    assert abs(measured[:, 1].mean()) < 0.01
    assert abs(error[:, 1].mean()) < 0.01
    assert error[:, :2].std(axis=0) == pytest.approx([0, 0], abs=0.15)
    assert np.diag(inertia) == pytest.approx([0.6, 0.6, 1.2], rel=0.02)


def test_without_attitude_nothing_is_predicted(cpfls, gap_config, extended, shifted, tmp_path):
    flight = cpfls.made("import", gap_config, shifted[0], at=tmp_path / "flight.h5")
    with pytest.raises(InputError, match="lacks the attitude"):
        cpfls_cli.load_model(extended).predict(flight)


@pytest.fixture(scope="module")
def two_models(cpfls, gap_config, pipeline, with_attitude, tmp_path_factory):
    """What is put into an identified model from the first two thirds of one flight."""
    folder = tmp_path_factory.mktemp("seen") / "gap"
    cpfls.done("gap", gap_config, with_attitude[0], "--model", pipeline.model, "-o", folder)
    return folder / "extended.h5"


def learned(path):
    return [(flight.name, flight.samples, flight.of) for flight in read_result(path).learned_from]


def test_the_file_says_what_the_effects_and_what_the_base_learned_from(extended, two_models, pipeline):
    assert learned(extended) == [("flight_1.csv", 2400, 2400), ("flight_2.csv", 2400, 2400)]
    (base,) = learned(pipeline.model)
    assert learned(two_models) == [("flight_4.csv", 1600, 2400), base]


def test_stages_hand_the_flights_on(cpfls, gap_config, two_models, tmp_path):
    """Another model to extend brings its own flights."""
    again = cpfls.made("extend", gap_config, two_models.with_name("diagnosis.h5"), at=tmp_path / "again.h5")
    assert learned(again) == learned(two_models)


def test_replay_and_compare_warn_of_flights_seen(
    cpfls, gap_config, two_models, extended, shifted, with_attitude, tmp_path
):
    fast = ("--every", "400")
    result = cpfls("replay", gap_config, extended, shifted[1], shifted[2], "-o", tmp_path / "r.h5", *fast)
    assert "flight_2.csv: extended.h5 has learned from it, so it says nothing about unseen flights" in result.stderr
    assert "flight_3.csv: extended.h5" not in result.stderr
    result = cpfls("compare", gap_config, *with_attitude, "--model", two_models, "-o", tmp_path / "d.h5", "--json")
    part = "flight_4.csv: extended.h5 has learned from its first 1600 of 2400 samples, so that says nothing"
    assert part in result.stdout
    assert "flight_5.csv: extended.h5" not in result.stdout
