"""Vehicles exported for simulators and libraries, flown there: the equations are those that were exported."""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.errors import InputError
from cpfls_cli.export.holding import FUZZY, of_a_body, probe_flight
from cpfls_cli.export.registry import FORMS, exported
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import player_of
from cpfls_cli.playback.rotors import RotorResponse
from tests.builders.exported_models import CASES, model_of
from tests.builders.exported_vehicles import sheet_of_vehicle
from tests.builders.flown_exports import FLYING
from tests.builders.playback_flights import STATED, truth
from tests.builders.vehicle_models import HEXA, QUAD, thrust_curve, whole
from tests.builders.verified_exports import AGREES, verified

LIBRARIES = ("casadi", "jax")
SIMULATORS = [form for form in FLYING if form not in LIBRARIES]
# JAX compiles for seconds what CasADi does not; both are written by one template.
STRUCTURES = ["paper", "rigid body, rules", "classic, full-circle, tensor", "harmonic, data-range", "zero width"]


def require(form):
    if FLYING[form].package and find_spec(FLYING[form].package) is None:
        pytest.skip(f"needs the package {FLYING[form].package}, of the extra simulators")


def fly(form, model, horizon=8, windows=3, **changed):
    require(form)
    flight = replace(probe_flight(model), **changed)
    made = exported(sheet_of_vehicle(model), form, "vehicle.py")
    return made, verified(form, made, flight, (flight, player_of(model, flight)), horizon, windows)


@pytest.fixture(autouse=True)
def _coarse(monkeypatch):
    """Over eight samples steps of no length follow from long ones within 7e-8 in SI, less than a tenth of AGREES."""
    monkeypatch.setattr("tests.builders.verified_exports._FINE", 4)
    for form in {*SIMULATORS} - {"rotorpy"}:
        monkeypatch.setitem(FLYING, form, FLYING[form]._replace(levels=3))


@pytest.mark.parametrize("hold", ["linear", "previous"])
@pytest.mark.parametrize("form", LIBRARIES)
def test_a_library_holds_every_part(form, hold):
    made, found = fly(form, whole(), 20, hold=hold)
    assert made.missing == ()
    assert found.errors[2].max() < 1e-12
    assert found.errors[0].max() > 0.1


@pytest.mark.parametrize("structure", STRUCTURES)
def test_a_library_holds_inertia_that_depends_on_the_attitude(structure):
    fuzzy = model_of(CASES[structure])
    size = 0.003 * np.mean(STATED.inertia_kg_m2) / np.abs(fuzzy.coefficients).max()
    rigid = np.array([*STATED.inertia_kg_m2, 1e-4, -2e-4, 5e-5])
    fuzzy = replace(fuzzy, coefficients=size * fuzzy.coefficients, rigid_body=rigid)
    made, found = fly("casadi", replace(truth(), fuzzy=fuzzy))
    assert made.missing == ()
    assert found.errors[2].max() < 1e-10


@pytest.mark.usefixtures("brief")
@pytest.mark.parametrize("lag", [0.0, 0.035])
@pytest.mark.parametrize("form", SIMULATORS)
def test_a_simulator_flies_what_it_holds(form, lag):
    _, found = fly(form, whole(response=RotorResponse(lag_s=lag), remainder=None))
    assert found.equations.max() < AGREES
    assert found.missing.max() > 1e-3
    assert found.step.max() < 0.3


@pytest.mark.usefixtures("brief")
def test_each_simulator_names_what_it_lacks():
    model = whole()
    rests = {form: exported(sheet_of_vehicle(model), form, "v").missing for form in SIMULATORS}
    lacks = {form: " ".join(each.title for each in missing) for form, missing in rests.items()}
    rolling = {form: sum(e.torque for e in missing if "rolling" in e.title) for form, missing in rests.items()}
    for words in lacks.values():
        assert all(each in words for each in ("slow actuation", "delay of the rotors", "the learned part"))
    assert "constant torque" in lacks["rotorpy"]
    # Rotors that differ stand where their thrust gives the model's torque, which moves their air a little.
    assert rolling["sdf"] < 0.01 * rolling["rotorpy"]
    assert "rotors that differ" not in lacks["sdf"]
    assert "constant torque" not in lacks["mjcf"]
    assert "linear rotational damping" in lacks["rotorpy"]
    assert "linear rotational damping" not in lacks["mjcf"]
    assert "rotor drag" not in lacks["mjcf"]
    assert "flapping" in lacks["mjcf"]


@pytest.mark.usefixtures("brief")
@pytest.mark.parametrize("share", [0.6, 1.0])
@pytest.mark.parametrize("form", FORMS)
def test_a_thrust_curve_hovers_at_the_same_speed_in_every_form(form, share):
    """By squares alone where a form has no more; the curve is missing there, or where its torque about z is none."""
    model = replace(truth(), effects=(thrust_curve(share),))
    hover = hover_speed(model.vehicle)
    made = exported(sheet_of_vehicle(model), form, "v")
    _, lines, squares, *_ = np.split(made.held.weights[:, 0], 1 + model.rotors * np.arange(4), axis=1)
    wrench = hover * lines.sum(axis=1) + hover**2 * squares.sum(axis=1)
    assert wrench[5] == pytest.approx(model.vehicle.mass_kg * model.vehicle.gravity_m_s2, rel=1e-9)
    assert lines[2].any() != any("thrust curve" in each.title for each in made.missing)


def test_sizes_are_those_of_what_is_missing():
    """Torque, floors and the end of half a second, of a vehicle that lacks one part alone."""
    flapping = truth().effects[2]
    model = replace(truth(), effects=(flapping,), response=RotorResponse())
    (missing,) = exported(sheet_of_vehicle(model, floor=(1e-3,) * 6), "mjcf", "v").missing
    assert missing.title == "flapping hub moment"
    assert missing.floors == pytest.approx(max(missing.torque, missing.force) / 1e-3)
    assert 0.1 < missing.off.rate < 10.0
    half = replace(model, effects=(flapping._replace(coefficients=0.5 * flapping.coefficients),))
    (smaller,) = exported(sheet_of_vehicle(half), "mjcf", "v").missing
    assert smaller.torque == pytest.approx(0.5 * missing.torque)
    assert smaller.off.rate < missing.off.rate
    assert np.isnan(smaller.floors)


@pytest.mark.parametrize("form", ["sdf", "mjcf", "casadi"])
def test_an_export_flies_in_the_wind_of_its_flights(form):
    require(form)
    model = replace(truth(), response=RotorResponse())
    flight, windy = probe_flight(model), replace(model, wind=(3.0, -2.0, 0.0))
    made = exported(sheet_of_vehicle(model, wind=windy.wind), form, "vehicle.py")
    assert made.missing[-1].title.startswith("wind of its flights, 3 and -2 m/s along x and y of the world")
    assert made.missing[-1].off.velocity > 0.1
    found = verified(form, made, flight, (flight, player_of(windy, flight)), 8, 3)
    assert found.agrees
    if form == "casadi":
        assert found.errors[2].max() < 1e-12
    still = verified(form, made, flight, (flight, player_of(model, flight)), 8, 3)
    assert np.abs(still.errors[0] - found.errors[0]).max() > 1e-3


@pytest.mark.usefixtures("brief")
def test_an_inertia_that_depends_on_the_attitude_is_named():
    fuzzy = replace(model_of(CASES["default"]), rigid_body=np.array([*STATED.inertia_kg_m2, 0.0, 0.0, 0.0]))
    fuzzy = replace(fuzzy, coefficients=1e-5 * fuzzy.coefficients)
    made = exported(sheet_of_vehicle(replace(truth(), fuzzy=fuzzy)), "mjcf", "v.xml")
    assert FUZZY in [each.title for each in made.missing]


@pytest.mark.usefixtures("brief")
def test_an_inertia_that_no_body_has_is_brought_to_the_nearest():
    model = replace(truth(), vehicle=replace(QUAD, inertia_kg_m2=(0.004, 0.005, 0.0096)), effects=())
    np.testing.assert_allclose(np.diag(of_a_body(model.body).inertia), [0.0042, 0.0052, 0.0094], rtol=1e-6)
    made = exported(sheet_of_vehicle(model), "mjcf", "v.xml")
    assert any("which no body has" in each.title for each in made.missing)
    if find_spec("mujoco") is not None:
        import mujoco

        mujoco.MjModel.from_xml_string(made.text)


def test_six_rotors_are_too_many_for_rotorpy_alone():
    model = whole(HEXA)
    with pytest.raises(InputError, match=r"vehicle\.h5: RotorPy allocates .* to four rotors, but this vehicle has 6"):
        exported(sheet_of_vehicle(model), "rotorpy", "v.py")
    _, found = fly("mjcf", replace(model, remainder=None, response=RotorResponse()), 4, 2)
    assert found.agrees


def test_jax_differentiates_and_batches():
    require("jax")
    import jax

    model = replace(truth(), effects=())
    names = {"__name__": "exported"}
    exec(exported(sheet_of_vehicle(model), "jax", "v.py").text, names)
    state = np.concatenate([np.zeros(6), np.eye(3).ravel(), np.zeros(3)])
    with jax.enable_x64(True):
        parameters = jax.numpy.array(names["PARAMETERS"])
        rotor = names["steady"](jax.numpy.full(4, 600.0))

        def climb(p):
            return names["step"](jax.numpy.array(state), rotor, 0.01, p)[5]

        slopes = jax.jit(jax.vmap(jax.grad(climb)))(parameters * np.ones((3, 1)))
    thrust = 4 * 600.0**2 * model.vehicle.rotors[0].thrust_factor_n_s2
    by_mass = np.array(slopes[:, names["PARAMETER_NAMES"].index("mass")])
    np.testing.assert_allclose(by_mass, [-0.01 * thrust / model.vehicle.mass_kg**2] * 3, rtol=1e-9)


def test_what_a_target_does_otherwise_counts_as_not_held():
    made, found = fly("urdf", replace(whole(response=RotorResponse()), remainder=None))
    (turned,) = [each for each in made.missing if each.title.startswith("drag along the axes of the world")]
    assert turned.off.velocity > 1e-4
    # The equations are compared along the axes of the body, and the flight is along those of the world.
    assert found.equations.max() < AGREES
    made, found = fly("ardupilot", VehicleModel(vehicle=QUAD))
    (otherwise,) = [each for each in made.missing if "cube of the speed" in each.title]
    assert otherwise.off.rate > 1e-3
    assert found.missing[3] > 1e-4
    assert found.equations.max() < AGREES
