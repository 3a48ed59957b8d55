"""The catalogue of effects, each of which is one file."""

import ast
import pkgutil
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import cpfls_cli
from cpfls_cli.effects import catalogue
from cpfls_cli.effects.registry import CATALOGUE, effect
from cpfls_cli.errors import InputError
from tests.builders.sources import nodes

EFFECTS = pytest.mark.parametrize("name", list(CATALOGUE))

# What is usual: (6 kg, Crazyflie), None where no source gives a figure; signs as in the literature.
USUAL = {
    ("linear_damping", "d_x"): ((0.03, 0.4), (1e-6, 1e-5)),
    ("linear_damping", "d_z"): ((0.03, 0.4), (1e-6, 1e-5)),
    ("quadratic_damping", "d_y"): ((0.004, 0.1), (1e-7, 1e-6)),
    # The last: a thrust that leans by 16 / (Lock number w) per rate, Lock number 1, at hubs 8 mm up.
    ("rotor_plane_damping", "k_w"): ((0.02 / 1392, 0.1 / 1392), (1e-6 / 7156, 2.9e-9)),
    ("rotor_drag", "k_d"): ((0.8e-3, 2.4e-3), (1e-6, 0.0147 / 7156)),
    ("flapping_moment", "k_f"): ((-2e-4, 2e-4), None),
    ("own_wake", "c_F"): ((0.01, 0.15), (0.01, 0.15)),
    ("own_wake", "c_M"): ((0.001, 0.03), (1e-4, 0.005)),
    ("flexible_mount", "share_x"): ((0.05, 0.5), (0.05, 0.5)),
    ("flexible_mount", "damping"): ((0.02, 0.3), (0.02, 0.3)),
    ("notch_filter", "frequency_hz"): ((3.0, 10.0), None),
    ("low_pass_filter", "frequency_hz"): ((2.0, 10.0), None),
    ("rolling_moment", "mu"): ((1e-6, 1e-4), None),
    ("inflow", "k_z"): ((0.7e-3, 4e-3), (7.6e-7, 7.6e-7)),
    ("translational_lift", "k_h"): ((5e-3, 8e-2), (0.0, 0.0)),
    ("parasitic_drag", "c_x"): ((0.01, 0.08), (1e-3, 1e-3)),
    ("parasitic_drag", "cr_z"): ((-0.008, 0.008), None),
    ("ground_effect", "G"): ((1.0, 11.4), (1.0, 11.4)),
    ("wind", "k_d"): ((0.8e-3, 2.4e-3), (1e-6, 0.0147 / 7156)),
    ("wind", "W_x"): ((-8.0, 8.0), (-8.0, 8.0)),
    ("rotor_gyroscopic", "J_r"): ((2e-4, 1e-3), (3.45e-8, 3.45e-8)),
    ("rotor_acceleration", "J_r"): ((2e-4, 1e-3), (3.45e-8, 3.45e-8)),
    ("motor_lag", "time_constant_s"): ((0.02, 0.1), (0.072, 0.136)),
    ("command_delay", "delay_s"): ((0.005, 0.05), (0.005, 0.05)),
    ("channel_delay", "delay_s"): ((-0.05, 0.05), (-0.05, 0.05)),
    ("com_offset", "c_x"): ((-0.03, 0.03), (-0.002, 0.002)),
    ("products_of_inertia", "Ixz"): ((-0.1, 0.1), (-1e-6, 1e-6)),
    ("rotor_mismatch", "difference_1"): ((-0.15, 0.15), (-0.1, 0.1)),
    ("rotor_tilt", "twist_1"): ((-0.1, 0.1), (-0.1, 0.1)),
    ("torque_bias", "M_z"): ((-0.5, 0.5), None),
    ("payload", "mass"): ((0.2, 1.5), (0.002, 0.01)),
    ("payload", "mass_times_depth"): ((0.01, 0.3), (2e-5, 2e-4)),
    ("payload", "depth_m"): ((0.05, 0.2), (0.0, 0.02)),
    ("rotor_plane_damping", "k_F"): ((1.6e-4, 8e-4), (3e-8, 1.5e-7)),
    ("rotor_mismatch", "lift_imbalance"): ((-0.1, 0.1), (-0.1, 0.1)),
    ("parameter_error", "inertia_x"): ((-0.5, 1.0), (-0.5, 1.0)),
    ("parameter_error", "reference_z"): ((-0.15, 0.15), (-0.02, 0.02)),
    # Commands of shares of the full thrust are a line.
    ("thrust_slope", "linear"): ((-0.3, 1.0), (-0.3, 1.0)),
    ("vertical_descent", "f_2"): ((-0.2, 0.7), (-0.2, 0.7)),
    ("payload", "length_m"): ((0.5, 4.0), None),
    ("gyro_bias", "b_x"): ((-0.1, 0.1), (-0.1, 0.1)),
    ("gyro_scale", "e_x"): ((-0.05, 0.05), (-0.05, 0.05)),
    ("imu_misalignment", "delta_z"): ((-0.09, 0.09), (-0.09, 0.09)),
}


def bounds(entry, wanted, vehicle):
    found = {c.name: c.bounds(vehicle) for c in entry.coefficients}
    found |= {shape.name: (shape.grid[0], shape.grid[-1]) for shape in entry.shapes}
    return found[wanted]


CASES = [
    (craft, *coefficient, usual)
    for coefficient, both in USUAL.items()
    for craft, usual in zip(("6 kg", "Crazyflie"), both, strict=True)
    if usual is not None
]


@pytest.mark.parametrize(("craft", "name", "wanted", "usual"), CASES)
def test_bounds_hold_what_is_usual(vehicles, craft, name, wanted, usual):
    low, high = bounds(CATALOGUE[name], wanted, vehicles[craft])
    assert low <= usual[0] <= usual[1] <= high


@EFFECTS
def test_every_effect_says_everything(name):
    entry = CATALOGUE[name]
    assert entry.name == name
    texts = (entry.title, entry.formula, entry.sentence, entry.excitation, entry.source)
    assert all(text.strip() for text in texts)
    assert all(c.unit and c.meaning and c.low < c.high for c in (*entry.coefficients,))
    assert all(list(shape.grid) == sorted(set(shape.grid)) and shape.meaning for shape in entry.shapes)


@EFFECTS
def test_rivals_exist_and_come_with_a_flight(name):
    entry = CATALOGUE[name]
    assert entry.rivals
    assert set(entry.rivals) <= set(CATALOGUE) - {name}
    assert all(flight.strip() for flight in entry.rivals.values())


@EFFECTS
def test_columns_fit_their_coefficients(flight, commanded, name):
    entry = CATALOGUE[name]
    if entry.columns is None:
        return
    known = flight if not entry.missing(flight) else commanded
    found = entry.columns(known, {shape.name: shape.grid[1] for shape in entry.shapes})
    wanted = (len(known), 6, 1 if entry.unit_coefficient else len(entry.coefficients))
    for columns in (found.direct, found.momentum):
        assert columns is None or (columns.shape == wanted and np.isfinite(columns).all())


@EFFECTS
def test_what_is_needed_can_be_there(flight, commanded, name):
    assert CATALOGUE[name].needs <= flight.available | commanded.available


def test_all_are_there_and_in_order():
    modules = {module.name for module in pkgutil.iter_modules(catalogue.__path__)}
    assert (set(CATALOGUE), list(CATALOGUE)[:2]) == (modules, ["linear_damping", "quadratic_damping"])
    assert list(CATALOGUE)[33] == "parameter_error"


def test_an_unknown_name_gives_the_nearest():
    assert effect("wind") is CATALOGUE["wind"]
    with pytest.raises(InputError, match="motor_lagg: no such effect \\(did you mean motor_lag"):
        effect("motor_lagg")
    with pytest.raises(InputError, match="lists all"):
        effect("qqq")


def test_wind_and_drag_are_two_sides_of_one_number():
    entry = CATALOGUE["wind"]
    physical = np.array([1.3e-3, 3.0, -2.0])
    np.testing.assert_allclose(entry.physical.of(entry.physical.linear(physical)), physical)
    assert np.isnan(entry.physical.of(np.array([0.0, 1e-3, 1e-3]))[1:]).all()


def test_a_shape_with_a_first_value_is_tried_there_only():
    shapes = {shape.name: shape for shape in CATALOGUE["payload"].shapes}
    assert (shapes["depth_m"].tried, shapes["length_m"].tried) == ((0.0,), shapes["length_m"].grid)
    assert all(shape.first in (None, *shape.grid) for entry in CATALOGUE.values() for shape in entry.shapes)


PACKAGE = Path(cpfls_cli.__file__).parent
ELSEWHERE = [path for path in sorted(PACKAGE.rglob("*.py")) if "catalogue" not in path.parts]

# Help for people, which may give an example: nothing is decided by it.
MENTIONS = {
    ("stages/effects.py", "rotor_drag"),
    ("simulation/settings.py", "motor_lag"),
    ("simulation/settings.py", "battery_sag"),
}
# A line of the header of a blackbox log, and what makes rotors uneven, which are called like effects.
OF_OTHERS = {("logs/blackbox.py", "gyro_scale")}
UNEVEN = {("look/answers.py", "wind"), ("look/balance.py", "wind")}
# The vehicle's own numbers are part of every fit; what they mean stands in their own file, which the fits import.
IMPORTED = {"parameter_error"}


@cache
def read(path):
    """Literals of a module, and the modules that it imports from."""
    # Strings that stand alone: docstrings of modules, classes, functions and constants.
    alone = {id(node.value) for node in nodes(path) if isinstance(node, ast.Expr)}
    strings = [node for node in nodes(path) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    texts = [node.value for node in strings if id(node) not in alone]
    return texts, [node.module for node in nodes(path) if isinstance(node, ast.ImportFrom) and node.module]


def literals(path):
    return read(path)[0]


def test_no_effect_is_named_outside_the_catalogue():
    named = {(str(path.relative_to(PACKAGE)), text) for path in ELSEWHERE for text in literals(path)}
    assert {(path, text) for path, text in named if text in CATALOGUE} == OF_OTHERS | UNEVEN


def test_texts_mention_effects_only_as_examples():
    names = re.compile(rf"\b({'|'.join(name for name in CATALOGUE if '_' in name)})\b")
    mentions = {
        (str(path.relative_to(PACKAGE)), name)
        for path in ELSEWHERE
        for text in literals(path)
        for name in names.findall(text)
    }
    templates = [path for path in PACKAGE.rglob("templates/*") if path.is_file()]
    assert mentions == MENTIONS | OF_OTHERS
    assert [path.name for path in templates if names.search(path.read_text(encoding="utf-8"))] == []


def test_only_the_numbers_of_the_vehicle_are_imported_from_the_catalogue():
    prefix = "cpfls_cli.effects.catalogue"
    imported = {
        module.removeprefix(f"{prefix}.")
        for path in ELSEWHERE
        for module in read(path)[1]
        if module.startswith(f"{prefix}.")
    }
    assert imported == IMPORTED


@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=list(CATALOGUE))
def test_labels_of_the_audit_are_those_of_the_numbers(effect):
    if effect.test is not None:
        assert len(effect.test.labels) == len(effect.numbers)
