"""The exported module computes what the library computes, in an interpreter that has no cpfls."""

import subprocess
import sys
import warnings

import numpy as np
import pytest

from cpfls_cli.export.source import python_source
from tests.builders.exported_models import CASES, errors, model_of, sheet_of, short_runs, states, wanted_of

SAMPLES = {"paper": 10_000, "default": 10_000}
ALLOWED = 1e-12

DRIVER = """
import sys
sys.modules["cpfls_cli"] = None
sys.path.insert(0, sys.argv[1])
import importlib, warnings
import numpy as np

for stem in sys.argv[2:]:
    module = importlib.import_module(stem)
    q, qd, qdd = np.load(f"{sys.argv[1]}/{stem}.npy")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        torque, body = module.torque(q, qd, qdd)
    kinds = sorted(w.category.__name__ for w in said)
    assert all(w.filename == "<string>" for w in said), said
    warnings.simplefilter("ignore")
    np.savez(f"{sys.argv[1]}/{stem}.npz", D=module.inertia(q), C=module.coriolis(q, qd), torque=torque, body=body,
             inside=module.inside(q), kinds=kinds)
assert not [name for name in sys.modules if name.split(".")[0] in ("scipy", "h5py", "yaml")]
"""


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    """Every case, exported, and evaluated by one fresh interpreter."""
    folder = tmp_path_factory.mktemp("modules")
    cases = {}
    for index, name in enumerate(CASES):
        model, stem = model_of(CASES[name]), f"case_{index}"
        motion = states(model, SAMPLES.get(name, 2000), seed=index)
        with short_runs():
            (folder / f"{stem}.py").write_text(python_source(sheet_of(model), f"{stem}.py"))
        np.save(folder / f"{stem}.npy", np.array([motion.attitude, motion.rate, motion.acceleration]))
        cases[name] = (model, motion, folder / f"{stem}.npz")
    words = [sys.executable, "-I", "-c", DRIVER, str(folder), *(f"case_{index}" for index in range(len(CASES)))]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return cases


@pytest.mark.parametrize("name", CASES)
def test_the_module_agrees_with_the_library(evaluated, name):
    model, motion, result = evaluated[name]
    with np.load(result) as found:
        wanted = wanted_of(model, motion)
        assert max(errors(found, wanted).values()) < ALLOWED, errors(found, wanted)
        assert np.array_equal(found["inside"], wanted.inside)
        assert found["kinds"].tolist() == ["NearVertical", "OutsideRegion"]


@pytest.mark.parametrize("name", ["paper", "rigid body alone"])
def test_as_a_script_the_module_tests_itself(tmp_path, name):
    model, path = model_of(CASES[name]), tmp_path / "vehicle.py"
    text = python_source(sheet_of(model), path.name)
    for content, code in ((text, 0), (text.replace("def _torque(q, qd, qdd, p):", "def _torque(q, qdd, qd, p):"), 1)):
        path.write_text(content)
        done = subprocess.run([sys.executable, "-I", path], capture_output=True, text=True, check=False)
        assert done.returncode == code, done.stderr
        assert done.stdout.startswith("largest relative error ")


@pytest.fixture
def module():
    model = model_of(CASES["default"])
    names = {"__name__": "vehicle"}
    exec(python_source(sheet_of(model), "vehicle.py"), names)
    return names


def cell(module, wanted):
    """Find an attitude inside or outside the region, away from a vertical pitch."""
    roll, pitch = np.argwhere(module["_VISITED"][:, 30:42] == wanted)[0]
    return np.deg2rad([5 * roll + 2.5 - 180, 5 * (pitch + 30) + 2.5 - 180, 10.0])


def test_shapes_follow_the_input(module):
    q = cell(module, True)
    assert module["inertia"](q).shape == (3, 3)
    assert module["inertia"](np.tile(q, (4, 5, 1))).shape == (4, 5, 3, 3)
    assert module["coriolis"](np.tile(q, (4, 1)), np.ones(3)).shape == (4, 3, 3)
    assert [part.shape for part in module["torque"](q, q, np.ones((2, 3)))] == [(2, 3), (2, 3)]
    assert module["inside"](q).shape == ()
    assert module["inertia"](np.zeros((0, 3))).shape == (0, 3, 3)
    with pytest.raises(ValueError, match=r"expected arrays of shape \(\.\.\., 3\), got \(2,\)"):
        module["inertia"](np.ones(2))


def test_a_warning_says_how_many_samples_lie_outside(module):
    q = np.array([cell(module, True), cell(module, False), cell(module, False)])
    with pytest.warns(module["OutsideRegion"], match="2 of 3 samples lie outside the attitudes that training visited"):
        module["inertia"](q)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        module["torque"](q[0], q[0], q[0])


def test_samples_that_are_not_finite_are_nan_and_leave_the_others_alone(module):
    q = np.tile(cell(module, True), (3, 1))
    alone = module["inertia"](q[0])
    q[1, 2] = np.inf
    with pytest.warns(module["NotFinite"], match="1 of 3 samples are not finite"):
        found = module["inertia"](q)
    assert np.isnan(found[1]).all()
    assert np.array_equal(found[[0, 2]], [alone, alone])
    with pytest.warns(module["NotFinite"]):
        torque, body = module["torque"](q[0], np.full(3, 1e200), q[0])
    assert np.isnan(torque).all()
    assert np.isnan(body).all()
    assert module["inside"](q).tolist() == [True, False, True]
