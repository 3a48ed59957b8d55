"""The membership function and its copies, which `cpfls_cli.fuzzy.basis` lists, at the same points.

A model of one function of roll whose rules have the coefficients 0, 1, 0, 1 ... gives the memberships themselves:
with the Euler rates (0, 2, 0) and the accelerations (0, 1, 0) its torque is minus twice their slope about roll, and
their value about pitch.
"""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.export.json_form import HOW_TO_EVALUATE_INERTIA
from cpfls_cli.export.points import parts_along
from cpfls_cli.export.source import c_source, python_source
from cpfls_cli.fuzzy.basis import Z_FUNCTION, memberships, z_function
from cpfls_cli.identification.samples import mapped_inputs, padded_breakpoints, structure_table
from cpfls_cli.playback.flight import MeasuredMotion
from cpfls_cli.playback.model import Remainder, VehicleModel, learned_wrench
from cpfls_cli.playback.windows import Runs, Steps, errors_of_runs
from cpfls_cli.regressor import kernels
from cpfls_cli.regressor.regressor import Motion, Regressor
from cpfls_cli.vehicle.motion import Instant, Numbers
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import Each
from tests.builders.compiled_c import evaluate, require_gcc, written
from tests.builders.exported_models import Case, model_of, sheet_of
from tests.builders.exported_vehicles import FORMS, on_numpy

METHOD = Path(__file__).parents[3] / "docs/method.md"
FUNCTIONS = 6
STRUCTURES = {
    "circular": {"membership_functions": FUNCTIONS},
    "classic": {"membership_functions": FUNCTIONS, "structure": "fls", "consequents": "seesaw"},
}
MIDDLE = [np.nextafter(0.5, 0), 0.5, np.nextafter(0.5, 1)]
WORDS = {"json": next(line for line in HOW_TO_EVALUATE_INERTIA if Z_FUNCTION in line), "method.md": METHOD.read_text()}


@pytest.fixture(params=STRUCTURES)
def case(request):
    """A model that gives memberships, states at which it does, and what its torque is by the definition."""
    model = model_of(Case({**STRUCTURES[request.param], "input_map": "full-circle"}), seed=4)
    block = next(block for block in model.structure.blocks if block.function.name == "D22")
    peaks = model.partitions[block.partitions[0]]
    coefficients = np.zeros(model.structure.parameters)
    # The first feature of a rule is the constant 1.
    coefficients[block.columns] = np.outer(np.arange(block.rules) % 2, np.arange(block.features) == 0).ravel()
    x = (peaks[:-1, None] + np.diff(peaks)[:, None] * np.append(np.linspace(0.01, 0.99, 37), MIDDLE)).ravel()
    seam = 0.0 if model.structure.circular else 0.5
    attitude = np.column_stack([2 * np.pi * (x - seam), np.zeros((len(x), 2))])
    return SimpleNamespace(
        model=replace(model, coefficients=coefficients),
        motion=Motion(attitude, np.tile([0.0, 2.0, 0.0], (len(x), 1)), np.tile([0.0, 1.0, 0.0], (len(x), 1))),
        expected=by_definition(x, peaks, model.structure.circular),
    )


def by_definition(x, peaks, circular):
    """Torque of the model by Zadeh's function alone, interval by interval."""
    torque = np.zeros((len(x), 3))
    for row, value in enumerate(x):
        left = np.flatnonzero(peaks[:-1] <= value)[-1]
        right = 0 if circular and left + 2 == len(peaks) else left + 1
        width = peaks[left + 1] - peaks[left]
        u = (value - peaks[left]) / width
        falling, slope = (1 - 2 * u**2, -4 * u) if u < 0.5 else (2 * (1 - u) ** 2, -4 * (1 - u))
        degree = falling * (left % 2) + (1 - falling) * (right % 2)
        torque[row] = -2 * ((left % 2 - right % 2) * slope / width / (2 * np.pi)), degree, 0.0
    return torque


def assert_same(torque, case):
    assert case.expected.any(axis=0).tolist() == [True, True, False]
    # A position u next to the middle may fall on either side of it; both formulas meet there.
    np.testing.assert_allclose(torque, case.expected, rtol=0, atol=1e-12 * np.max(np.abs(case.expected)))


def test_the_library(case):
    assert_same(case.model.torque(case.motion), case)


def test_the_compiled_loops(case):
    """Three columns of ones, one for each axis, make the sums of a sample its rows of the regressor."""
    structure, every = case.model.structure, 10
    breakpoints = padded_breakpoints(case.model.partitions)
    table = structure_table(structure, case.model.ranges)
    rows = np.zeros((len(case.motion), structure.parameters, 3))
    # Sums of each sample by itself take a gigabyte where they are taken of all at once.
    for first in range(0, len(rows), every):
        motion, moment = case.motion[first : first + every], rows[first : first + every]
        inputs = mapped_inputs(table, motion.attitude)
        axes = np.tile(np.eye(3), (len(moment), 1, 1))
        chunk = kernels.Chunk(kernels.motion_lines(motion.rate, motion.acceleration, axes), inputs)
        runs, gram = kernels.runs_of(table, breakpoints, inputs), np.zeros((len(moment), *(structure.parameters,) * 2))
        none, sums = (kernels.NOTHING,) * 2, (gram, moment, kernels.NOTHING)
        kernels.add_sums(kernels.GRAM, table, breakpoints, chunk, runs, np.ones(3), np.arange(len(moment)), none, sums)
    assert_same(rows.swapaxes(1, 2) @ case.model.coefficients, case)
    dense = Regressor(structure, case.motion, case.model.ranges).matrix(case.model.partitions)
    np.testing.assert_allclose(rows.swapaxes(1, 2), dense, rtol=0, atol=1e-12 * np.max(np.abs(dense)))


def test_the_exported_c(case, tmp_path):
    require_gcc()
    written(tmp_path, "vehicle", c_source(sheet_of(case.model), "vehicle"))
    assert_same(evaluate(tmp_path, "vehicle", case.motion)["torque"], case)


def test_the_exported_python(case):
    torque = on_numpy(python_source(sheet_of(case.model), "vehicle.py", "jax"))["torque"]
    found = [torque(*motion)[0] for motion in zip(*vars(case.motion).values(), strict=True)]
    assert_same(np.array(found), case)


@pytest.fixture
def airflow():
    """A vehicle whose torque about x is memberships of the direction of the airflow, and directions at which it is."""
    peaks = np.array([0.0, 0.13, 0.3, 0.55, 0.7, 0.86, 1.0])
    coefficients = np.zeros((1, 3 * (len(peaks) - 1), 2))
    # Of each rule the constant feature, times the speed squared, which is 1.
    coefficients[0, ::3, 1] = np.arange(len(peaks) - 1) % 2
    learned = Remainder(breakpoints=peaks, harmonic_order=1, rows=np.array([0]), coefficients=coefficients)
    model = VehicleModel(vehicle=VehicleSettings(), remainder=learned)
    x = (peaks[:-1, None] + np.diff(peaks)[:, None] * np.append(np.linspace(0.01, 0.99, 37), MIDDLE)).ravel()
    air = np.column_stack([np.cos(2 * np.pi * x), np.sin(2 * np.pi * x), np.zeros(len(x))])
    return SimpleNamespace(model=model, air=air, expected=by_definition(x, peaks, True)[:, 1])


@pytest.mark.parametrize("form", ["library", *FORMS])
def test_the_learned_part_of_a_vehicle(airflow, form, tmp_path):
    if form == "c":
        require_gcc()
    model, still = airflow.model, np.zeros_like(airflow.air)
    rotor = np.eye(1, 1 + 4 * model.rotors).repeat(len(still), axis=0)

    def library(*motion):
        return sum(parts_along(model, *motion).values())

    wrench = library if form == "library" else FORMS[form](tmp_path, model).wrench
    np.testing.assert_allclose(wrench(airflow.air, still, rotor)[:, 0], airflow.expected, rtol=0, atol=1e-12)


def test_the_learned_part_of_a_vehicle_that_is_simulated(airflow):
    acts, rotors = learned_wrench(airflow.model.remainder), Each([0.0] * airflow.model.rotors)
    seen = (Instant(VehicleSettings(), rotors, air_velocity=tuple(air)) for air in airflow.air.tolist())
    torque = [acts(one, Numbers()).torque[0] for one in seen]
    np.testing.assert_allclose(torque, airflow.expected, rtol=0, atol=1e-12)


def test_the_free_runs_of_playback(airflow):
    """One step from rest changes the rate by the torque at its middle, where the airflow is that of the start."""
    model, samples = airflow.model, len(airflow.air)
    rotor = np.eye(1, 1 + 4 * model.rotors).repeat(samples, axis=0)
    still, level = np.zeros((samples + 1, 3)), np.eye(3)[None].repeat(samples + 1, axis=0)
    velocity = np.vstack([airflow.air, airflow.air[:1]])
    period = 1e-7
    flown = replace(model.flown, body=model.body._replace(gravity=0.0))
    runs = Runs(MeasuredMotion(still, velocity, level, still, period), np.arange(samples), translates=True)
    errors, _ = errors_of_runs(flown, runs, Steps(rotor[None]))
    torque = errors[:, 0, 3, 0] / period * model.body.inertia[0, 0]
    # Rolling for half a step turns the airflow, by next to nothing.
    np.testing.assert_allclose(torque, airflow.expected, rtol=0, atol=1e-7)


def formula(words):
    """Make a function of what words say: one term up to the middle, another one after it."""
    plain = " ".join(words.replace("`", "").replace("²", "^2").split()).replace("^", "**")
    terms = re.search(r"(\S.*?) up to (?:u = 1/2|the middle) and (.+?) after it", plain).groups()
    left, right = (re.sub(r"(?<=\d) ?(?=[u(])", " * ", term) for term in terms)
    return lambda u: eval(left if u < 0.5 else right, {"u": u})


@pytest.mark.parametrize("page", WORDS)
def test_the_words(page):
    words = WORDS[page]
    said = formula(words[words.index("1 - 2") :])
    u = np.append(np.linspace(0, 1, 41), MIDDLE)
    np.testing.assert_allclose([said(value) for value in u], z_function(u)[0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(memberships(u, np.array([0.0, 1.0])).value[:, 0], z_function(u)[0], rtol=0, atol=1e-15)


def test_what_the_formula_must_satisfy():
    """The ends give a continuous torque; the derivatives are those of the value."""
    value, first, second = z_function(np.array([0.0, 0.5, 1.0]))
    assert value.tolist() == [1.0, 0.5, 0.0]
    assert [first[0], first[-1]] == [0.0, 0.0]
    assert second[0] == -second[-1]
    u, step = np.linspace(0.02, 0.98, 16), 1e-6
    for k in (0, 1):
        slope = (z_function(u + step)[k] - z_function(u - step)[k]) / (2 * step)
        np.testing.assert_allclose(z_function(u)[k + 1], slope, atol=1e-8)
