"""Exported C computes what the library computes, says when not to trust it, and compiles without a warning."""

import subprocess

import numpy as np
import pytest

from cpfls_cli.dynamics import vertical
from cpfls_cli.export.source import c_source
from cpfls_cli.regressor.regressor import Motion
from tests.builders.compiled_c import CHECKS, build, drive, driver, require_gcc, written
from tests.builders.exported_models import CASES, Case, errors, model_of, sheet_of, short_runs, states, wanted_of

OUTSIDE, NOT_FINITE, VERTICAL = 1, 2, 4
SAMPLES = {"paper": 10_000, "default": 10_000}
QUICK = ("paper", "default", "rigid body, rules", "zero width, classic", "nothing at all")
ALLOWED = 1e-12


@pytest.fixture(autouse=True, scope="module")
def compiler():
    require_gcc()


def exported(folder, model, name="vehicle"):
    source = c_source(sheet_of(model, name=name), name)
    written(folder, name, source)
    return source


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    """What the exported C of a case computes along a motion; all cases are compiled together, with all checks."""
    folder = tmp_path_factory.mktemp("cases")
    names = {case: f"case_{number}" for number, case in enumerate(CASES)}
    with short_runs():
        for case, name in names.items():
            exported(folder, model_of(CASES[case]), name)
    program = driver(folder, [*names.values()])
    return lambda case, motion: drive(program, motion, [*names].index(case))


@pytest.mark.parametrize("name", CASES)
def test_c_agrees_with_the_library(computed, name):
    model = model_of(CASES[name])
    motion = states(model, SAMPLES.get(name, 2000))
    found, wanted = computed(name, motion), wanted_of(model, motion)
    assert max(errors(found, wanted).values()) < ALLOWED, errors(found, wanted)
    assert np.array_equal(found["inside"], wanted.inside)
    flags = np.where(wanted.inside, 0, OUTSIDE) + np.where(vertical(motion.attitude), VERTICAL, 0)
    assert np.array_equal(found["status"], np.column_stack([flags] * 3))


def test_the_comparison_would_notice_a_wrong_coefficient_and_a_wrong_side(computed):
    model = model_of(CASES["paper"])
    motion = states(model, 2000)
    found = computed("paper", motion)
    model.coefficients[40] *= 1 + 1e-9
    assert max(errors(found, wanted_of(model, motion)).values()) > ALLOWED
    # At a fold of the seesaw the slope depends on the side alone.
    fold = Motion(np.full((1, 3), 0.5 * np.pi), np.ones((1, 3)), np.ones((1, 3)))
    beyond = Motion(fold.attitude + 4e-15, fold.rate, fold.acceleration)
    here, there = (computed("paper", m) for m in (fold, beyond))
    assert np.max(np.abs(here["C"] - there["C"])) > 1e-3
    model = model_of(CASES["paper"])
    for found, motion in ((here, fold), (there, beyond)):
        assert max(errors(found, wanted_of(model, motion)).values()) < ALLOWED


@pytest.mark.parametrize("name", QUICK)
@pytest.mark.parametrize("flags", [(), ("-DCPFLS_FLOAT",)], ids=["double", "float"])
def test_self_test_passes_and_names_the_largest_error(tmp_path, name, flags):
    exported(tmp_path, model_of(CASES[name]))
    program = build(tmp_path, ["vehicle.c"], "-DCPFLS_SELF_TEST", *flags)
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("vehicle: largest relative error ")
    assert " at 16 states and after " in done.stdout
    assert done.stdout.endswith(" runs, 0 wrong flags\n")


COMBINATIONS = [
    {"structure": structure, "input_map": inputs, "consequents": consequents, "products": products, **functions}
    for structure, consequents in (("cpfls", "seesaw"), ("cpfls", "harmonic"), ("fls", "seesaw"))
    for inputs in ("full-circle", "data-range")
    for products in ("additive", "tensor")
    for functions in ({"membership_functions": 1}, {"membership_functions": 3})
]


def test_every_combination_of_settings_compiles_and_passes_its_self_test(tmp_path):
    for index, settings in enumerate(COMBINATIONS):
        with short_runs():
            exported(tmp_path, model_of(Case(settings, rigid=index % 3 == 0), index))
        program = build(tmp_path, ["vehicle.c"], "-DCPFLS_SELF_TEST", output=f"program-{index}")
        assert subprocess.run([program], check=False).returncode == 0, settings


@pytest.mark.parametrize(
    ("before", "after"),
    [("R(2) / PI", "R(2.000000001) / PI"), ("0x", "0xf"), ("< 0 ? rest + TURN", "< 0 ? rest + 2 * TURN")],
    ids=["slope", "region", "turn"],
)
def test_self_test_fails_where_the_code_was_changed(tmp_path, before, after):
    source = exported(tmp_path, model_of(CASES["seesaw, full-circle, tensor"])).source
    if before == "0x":
        source = source.replace("0x", "(unsigned char)~0x")
    assert before in source
    (tmp_path / "vehicle.c").write_text(source.replace(before, after) if before != "0x" else source)
    program = build(tmp_path, ["vehicle.c"], "-DCPFLS_SELF_TEST")
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stdout


@pytest.mark.parametrize("name", ["paper", "rigid body, rules"])
def test_input_that_is_not_finite_is_flagged_and_gives_zeros(computed, name):
    rows = np.ones((30, 9))
    for row in range(27):
        rows[row, row // 3] = (np.nan, np.inf, -np.inf)[row % 3]
    rows[27, 3:6] = 1e200  # finite, but the torque is not
    rows[28, :3] = 1e300
    found = computed(name, Motion(rows[:, :3], rows[:, 3:6], rows[:, 6:]))
    assert np.all(found["status"][:9] == NOT_FINITE)
    assert np.all(found["inside"][:9] == 0)
    assert np.all(found["status"][9:18, 0] & NOT_FINITE == 0)
    assert np.all(found["status"][9:18, 1:] == NOT_FINITE)
    assert np.all(found["status"][18:27, 2] == NOT_FINITE)
    assert found["status"][27, 2] & NOT_FINITE
    assert np.all(found["status"][28:] & NOT_FINITE == 0)
    results = {key: found[key] for key in ("D", "C", "torque", "body")}
    assert all(np.isfinite(value).all() for value in results.values())
    assert np.all(found["torque"][:28] == 0)
    assert np.all(found["body"][:28] == 0)
    assert np.all(found["D"][:9] == 0)
    assert np.all(found["C"][:18] == 0)


def test_the_torque_of_a_rigid_body_is_exact_with_the_nose_up(computed):
    model = model_of(CASES["rigid body alone"])
    motion = Motion(np.array([[0.3, 0.5 * np.pi, 0.1], [0.3, -0.5 * np.pi, 0.1]]), np.ones((2, 3)), np.ones((2, 3)))
    found = computed("rigid body alone", motion)
    assert max(errors(found, wanted_of(model, motion)).values()) < 1e-15
    assert np.abs(found["body"]).max() < 10


def test_outputs_may_be_the_inputs_and_two_models_live_in_one_program(tmp_path):
    for stem, case in (("first", "paper"), ("second", "default")):
        written(tmp_path, stem, c_source(sheet_of(model_of(CASES[case]), name=stem), stem))
    main = """#include "first.h"
#include "second.h"
int main(void)
{
    double q[3] = {1, 2, 3}, qd[3] = {4, 5, 6}, qdd[3] = {7, 8, 9}, torque[3], body[3], D[3][3];
    int i;
    first_torque(q, qd, qdd, torque, body);
    second_inertia(q, D);
    first_torque(q, qd, qdd, qd, qdd);
    for (i = 0; i < 3; ++i)
        if (qd[i] != torque[i] || qdd[i] != body[i])
            return 1;
    return !FIRST_COMPLETE || !SECOND_COMPLETE;
}
"""
    (tmp_path / "main.c").write_text(main)
    program = build(tmp_path, ["main.c", "first.c", "second.c"], *CHECKS)
    assert subprocess.run([program], check=False).returncode == 0


def test_nothing_that_changes_is_kept_and_nothing_is_allocated(tmp_path):
    source = exported(tmp_path, model_of(CASES["paper"])).source
    kept = [line for line in source.splitlines() if line.startswith("static") and "(" not in line.split("=")[0]]
    assert kept
    assert all(line.startswith("static const ") for line in kept)
    assert "alloc" not in source
    assert [line for line in source.splitlines() if line.startswith("#include")] == [
        '#include "vehicle.h"',
        "#include <math.h>",
        "#include <stdio.h>",
    ]
