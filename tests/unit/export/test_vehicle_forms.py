"""Exported vehicles compute what the library computes: wrench, acting rotors, accelerations, one step."""

import json
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.dynamics import turning_law
from cpfls_cli.export.json_form import json_text
from cpfls_cli.export.points import part_sizes, parts_along, reference_points, reference_run
from cpfls_cli.export.source import c_source
from cpfls_cli.playback.flight import MeasuredMotion, State
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import one_step
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.playback.windows import Runs, Steps, errors_of_runs
from cpfls_cli.rotations import rotation_matrix
from tests.builders.compiled_c import build, require_gcc, written
from tests.builders.exported_models import CASES, model_of
from tests.builders.exported_vehicles import FORMS, InC, flat, sheet_of_vehicle
from tests.builders.vehicle_models import HEXA, QUAD, RESPONSE, accelerations, polynomial_effects, remainder, whole

MODELS = {
    "harmonic": whole(),
    "seesaw, six rotors": whole(HEXA, order=0),
    # To find the polynomials of all effects takes a second or more.
    "one rule": whole(HEXA, effects=(), remainder=remainder(3, breakpoints=(0.0,), rows=(0, 1, 2, 3, 4, 5))),
    "two functions": whole(effects=(), remainder=remainder(1, breakpoints=(0.0, 1.0), rows=(1,))),
    "some effects": whole(effects=polynomial_effects(QUAD)[3:5], remainder=None),
    "rotors alone": VehicleModel(vehicle=QUAD),
}
ALLOWED = 1e-12
PERIOD = 0.01
NOT_FINITE, HISTORY_END = 2, 8


@pytest.fixture(scope="module")
def exports(tmp_path_factory):
    """Each model in each form, made once."""
    made = {}

    def of(name, form):
        if form == "c":
            require_gcc()
        if (name, form) not in made:
            made[name, form] = FORMS[form](tmp_path_factory.mktemp("vehicle"), MODELS[name])
        return made[name, form]

    return of


def count(form):
    """Many for compiled code; one by one, for each way that such states differ in."""
    return {"json": 16, "jax": 40}.get(form, 3000)


def states_of(samples, seed=1):
    """States in all attitudes, some of them without any motion."""
    rng = np.random.default_rng(seed)
    velocity, rate = rng.normal(0, 4, (2, samples, 3))
    velocity[::7, :2] = 0.0
    rate[::5] *= 1e-3
    return State(rng.normal(0, 3, (samples, 3)), velocity, rotation_matrix(rng.uniform(-3, 3, (samples, 3))), rate)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", MODELS)
def test_torque_and_force_are_those_of_the_library(exports, name, form):
    points = reference_points(MODELS[name], np.random.default_rng(5), count(form))
    found = exports(name, form).wrench(points.air, points.rate, points.rotor)
    assert np.max(np.abs(found - points.wrench) / points.scale) < ALLOWED


def sizes_of(model, state, rotor):
    """Sizes of the terms of the accelerations."""
    parts = parts_along(model, np.einsum("nji,nj->ni", state.rotation, state.velocity), state.rate, rotor).values()
    sizes, rate = part_sizes(model, parts), np.abs(state.rate).max(axis=1, keepdims=True)
    torque = sizes[:, :3].max(axis=1, keepdims=True) + np.abs(model.body.inertia).max() * rate**2
    linear = sizes[:, 3:].max(axis=1, keepdims=True) / model.body.mass + model.body.gravity
    return np.hstack([np.repeat(linear, 3, axis=1), np.repeat(np.abs(model.body.inverse).max() * torque, 3, axis=1)])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", MODELS)
def test_accelerations_and_a_step_are_those_of_the_library(exports, name, form):
    model, samples = MODELS[name], count(form)
    state, rotor = states_of(samples), reference_points(model, np.random.default_rng(6), samples).rotor
    found, moved = exports(name, form).motion(state, rotor, PERIOD)
    sizes = sizes_of(model, state, rotor)
    assert np.max(np.abs(found - accelerations(model, state, rotor)) / sizes) < ALLOWED
    size = np.max(np.abs(flat(state)), axis=1, keepdims=True) + PERIOD * sizes.max(axis=1, keepdims=True)
    assert np.max(np.abs(moved - flat(one_step(model, state, rotor, PERIOD))) / size) < ALLOWED


def over_attitude(name):
    """A whole vehicle whose inertia depends on the attitude, everywhere that of a body."""
    fuzzy = model_of(CASES[name])
    size = 0.02 * np.mean(QUAD.inertia_kg_m2[:3]) / np.abs(fuzzy.coefficients).max()
    fuzzy = replace(fuzzy, coefficients=size * fuzzy.coefficients, rigid_body=np.array(QUAD.inertia_kg_m2))
    return whole(effects=(), fuzzy=fuzzy)


@pytest.mark.parametrize("form", ["c", "jax"])
@pytest.mark.parametrize("name", ["paper", "rigid body, rules", "harmonic, data-range"])
def test_a_step_under_an_inertia_over_attitude_is_that_of_the_library(name, form, tmp_path):
    """Accelerations as by Lagrange's equations on Euler angles, steps as in free runs."""
    if form == "c":
        require_gcc()
    model, rng, samples = over_attitude(name), np.random.default_rng(9), count(form)
    attitude, velocity, rate = rng.uniform(-1.0, 1.0, (3, samples, 3))
    state = State(np.zeros((samples, 3)), velocity, rotation_matrix(attitude), rate)
    rotor = reference_points(model, rng, samples).rotor
    found, moved = FORMS[form](tmp_path, model).motion(state, rotor, PERIOD)
    wanted = flat(one_step(model, state, rotor, PERIOD))
    constant = flat(one_step(replace(model, fuzzy=None), state, rotor, PERIOD))
    assert np.max(np.abs(moved - wanted)) < ALLOWED * np.abs(wanted).max()
    assert np.max(np.abs(constant - wanted)) > 1e-5
    torque = sum(parts_along(model, np.einsum("nji,nj->ni", state.rotation, velocity), rate, rotor).values())[:, :3]
    turning = turning_law(model.fuzzy)(attitude, rate)
    for own, wanted, inertia, direct in zip(found[:, 3:], torque, *turning, strict=True):
        left = inertia @ own + direct - wanted
        assert np.abs(left).max() < ALLOWED * (np.abs(wanted).max() + np.abs(direct).max())


def test_a_step_under_the_inertia_of_no_body_is_refused_by_c(tmp_path):
    require_gcc()
    fuzzy = model_of(CASES["paper"])
    model = whole(effects=(), remainder=None, fuzzy=replace(fuzzy, coefficients=-np.abs(fuzzy.coefficients)))
    state, rotor = states_of(3), reference_points(model, np.random.default_rng(1), 3).rotor
    exported = InC(tmp_path, model)
    rows = np.hstack([flat(state), rotor])
    out = exported.statuses("s", rows, 26, repr(PERIOD))
    assert out[:, 24:].tolist() == [[NOT_FINITE] * 2] * 3
    np.testing.assert_array_equal(out[:, 6:24], rows[:, :18])


RESPONSES = {
    "all": RESPONSE,
    "nothing": RotorResponse(),
    "lag": RotorResponse(lag_s=0.05),
    "delay of whole samples": RotorResponse(delay_s=0.03),
    "short times": RotorResponse(delay_s=0.001, lag_s=2e-5, slow_yaw=1.0, slow_s=1e-3),
    "shorter than any": RotorResponse(lag_s=0.9e-5, slow_yaw=1.0, slow_s=0.9e-5),
    "long times": RotorResponse(delay_s=0.21, lag_s=0.7, slow_yaw=0.2, slow_s=20.0),
}


@pytest.mark.parametrize("response", RESPONSES)
def test_acting_rotors_are_those_of_the_library(response, tmp_path):
    require_gcc()
    model = whole(response=RESPONSES[response], effects=(), remainder=None)
    speed = np.random.default_rng(7).uniform(500, 1500, (120, 4))
    size = np.repeat([1.0, 1.0, 1500.0, 1 / PERIOD, 1500.0], [1, 4, 4, 4, 4]) * 1500.0
    for form in ("c", "jax"):
        exported = FORMS[form](tmp_path, model)
        for hold in ("linear", "previous"):
            for period in (0.01, 0.0025, 0.0371):
                # What comes after the last sample nobody knows, and no step of a flight begins there.
                found = exported.rotor_terms(speed, period, hold)[:-1]
                wanted = model.response.terms_by_step(speed, period, hold)[:-1]
                assert np.max(np.abs(found - wanted) / size) < ALLOWED * max(1.0, PERIOD / period), (form, hold, period)


@pytest.mark.parametrize("form", ["c", "jax"])
@pytest.mark.parametrize("name", ["harmonic", "seesaw, six rotors"])
def test_steps_along_a_flight_are_those_of_playback(exports, name, form):
    """Each sample of a flight is taken one step further; what the library predicts lies there."""
    model = MODELS[name]
    run = reference_run(model, np.random.default_rng(8), "linear", 80)
    exported, rotor = exports(name, form), exports(name, form).rotor_terms(run.speed, PERIOD, "linear")
    path = run.states
    _, moved = exported.motion(State(*(part[:-1] for part in path)), rotor[:-1], PERIOD)
    terms = model.response.terms_by_step(run.speed, PERIOD, "linear")
    size = max(np.abs(part).max() for part in path)
    position, velocity, rotation, rate = np.split(moved, [3, 6, 15], axis=1)
    after = (position, velocity, rotation.reshape(-1, 3, 3), rate)
    # Each sample is followed by what it was taken to: a run of one step.
    pairs = (
        np.stack([part[:-1], own], axis=1).reshape(-1, *own.shape[1:]) for part, own in zip(path, after, strict=True)
    )
    runs = Runs(MeasuredMotion(*pairs, PERIOD), 2 * np.arange(len(moved)), translates=True)
    errors, _ = errors_of_runs(model.flown, runs, Steps(terms[None, : len(moved)]))
    assert errors.shape[0] == len(moved) == len(path.rate) - 1
    assert np.abs(errors).max() < ALLOWED * size


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("flags", [(), ("-DCPFLS_FLOAT",)], ids=["double", "float"])
def test_the_self_test_of_c_passes(tmp_path, name, flags):
    require_gcc()
    written(tmp_path, "vehicle", c_source(sheet_of_vehicle(MODELS[name]), "vehicle"))
    program = build(tmp_path, ["vehicle.c"], "-DCPFLS_SELF_TEST", *flags)
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert done.stdout.startswith("vehicle: largest relative error ")


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("slowness = R(0.45)", "slowness = R(0.4500001)"),
        ("1_thrust_factor = R(", "1_thrust_factor = R(1e-15 + "),
        ("* falling", ""),
    ],
    ids=["slow actuation", "number", "nothing"],
)
def test_the_self_test_of_c_fails_where_the_code_was_changed(tmp_path, before, after):
    require_gcc()
    source = c_source(sheet_of_vehicle(MODELS["harmonic"]), "vehicle")
    changed = source.source.replace(before, after)
    (tmp_path / "vehicle.c").write_text(changed)
    (tmp_path / "vehicle.h").write_text(source.header)
    program = build(tmp_path, ["vehicle.c"], "-DCPFLS_SELF_TEST")
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert done.returncode == int(changed != source.source), done.stdout


def test_the_comparison_would_notice_a_wrong_weight(exports):
    model = MODELS["harmonic"]
    first, *others = model.effects
    wrong = replace(model, effects=(first._replace(coefficients=first.coefficients * (1 + 1e-6)), *others))
    points = reference_points(wrong, np.random.default_rng(5), 100)
    found = exports("harmonic", "jax").wrench(points.air, points.rate, points.rotor)
    assert np.max(np.abs(found - points.wrench) / points.scale) > ALLOWED


def test_references_of_json_are_what_it_says(exports):
    exported = exports("harmonic", "json")
    for point in exported.document["reference_wrenches"]:
        air, rate, rotor, wanted, scale = (
            np.array(point[name]) for name in ("air", "rate", "rotor", "wrench", "scale")
        )
        assert np.max(np.abs(exported.wrench(air[None], rate[None], rotor[None])[0] - wanted) / scale) < ALLOWED
    run = exported.document["reference_runs"][0]
    response, period = MODELS["harmonic"].response, exported.document["period_s"]
    found = response.terms_by_step(np.array(run["speed"]), period, "linear")[-2]
    np.testing.assert_allclose(found, run["rotor"], rtol=0, atol=1e-9)


def test_json_is_the_same_each_time_and_strict():
    sheet = sheet_of_vehicle(MODELS["harmonic"], usage=("caf\u00e9", "\ud800"))
    text = json_text(sheet)
    assert text == json_text(sheet)
    assert text.isascii()
    assert json.loads(text)["usage"] == ["caf\u00e9", "?"]


def test_numbers_and_terms_have_names(exports):
    document = exports("some effects", "json").document
    (effect, *_) = MODELS["some effects"].effects
    value = {"value": effect.coefficients[0], "unit": effect.known.coefficients[0].unit}
    assert document["numbers"][f"{effect.name}_{effect.known.coefficients[0].name}"] == value
    assert document["terms_of_rotors"][:3] == ["1", "w1", "w2"]
    assert document["terms_of_rotors"][-1] == "z4 - w4^2"


def test_what_is_not_finite_is_flagged_by_c(exports):
    require_gcc()
    points, state = reference_points(MODELS["harmonic"], np.random.default_rng(1), 6), states_of(6)
    given = np.hstack([points.air, points.rate, points.rotor])
    given[np.arange(3), [0, 4, 9]] = [np.nan, np.inf, -np.inf]
    given[3, 0] = 1e200
    compiled = exports("harmonic", "c")
    out = compiled.statuses("w", given, 7, "0")
    assert out[:, 6].tolist() == [NOT_FINITE] * 4 + [0, 0]
    assert not out[:4, :6].any()
    rows = np.hstack([flat(state), points.rotor])
    rows[np.arange(3), [1, 10, 20]] = np.nan
    out = compiled.statuses("s", rows, 26, "0.01")
    assert out[:3, 25].tolist() == [NOT_FINITE] * 3
    np.testing.assert_array_equal(out[:3, 6:24], rows[:3, :18])


def test_a_delay_longer_than_the_history_is_flagged(tmp_path):
    require_gcc()
    model = whole(response=RotorResponse(delay_s=0.05), effects=(), remainder=None)
    speed = np.random.default_rng(0).uniform(900, 1100, (200, 8))
    compiled = InC(tmp_path, model)
    assert set(compiled.statuses("r", speed, 18, "0.001")[:, -1]) == {0}
    assert set(compiled.statuses("r", speed, 18, "0.0005")[:, -1]) == {HISTORY_END}
    assert set(InC(tmp_path, model, "-DVEHICLE_HISTORY=102").statuses("r", speed, 18, "0.0005")[:, -1]) == {0}
    broken = speed.copy()
    broken[3, 1] = np.nan
    assert np.flatnonzero(compiled.statuses("r", broken, 18, "0.01")[:, -1]).tolist() == [3]
