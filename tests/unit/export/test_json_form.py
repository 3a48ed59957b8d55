"""The exported JSON is strict, and its own words are enough to evaluate the model."""

import json
from itertools import pairwise

import numpy as np
import pytest

from cpfls_cli.export.json_form import json_text
from tests.builders.exported_models import CASES, model_of, sheet_of, states, verdict_of


def refuse_constant(name):
    raise AssertionError(f"{name} is no JSON")


def document_of(model, **changes):
    text = json_text(sheet_of(model, **changes))
    assert text.isascii()
    return json.loads(text, parse_constant=refuse_constant)


class ByTheWords:
    """A model evaluated one attitude at a time as `how_to_evaluate` says, in plain Python."""

    def __init__(self, document):
        self.document, self.structure = document, document["structure"]

    def inertia(self, q):
        tensor = self.document["rigid_body"]["tensor"]
        xx, yy, zz, xy, xz, yz = (tensor[name] for name in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"))
        (sr, sp), (cr, cp) = np.sin(q[:2]), np.cos(q[:2])
        W = np.array([[1, 0, -sp], [0, cr, sr * cp], [0, -sr, cr * cp]])
        D = W.T @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ W
        for name, function in self.document["fuzzy"]["functions"].items():
            value = self.function(name, function, dict(zip(("roll", "pitch"), q[:2], strict=True)))
            row, column = function["row"], function["column"]
            D[row, column] += value
            D[column, row] += value if row != column else 0
        return D

    def function(self, name, function, angles):
        along = [self.along(name, axis, angles[axis]) for axis in function["inputs"]]
        firing, features = [1.0], [1.0]
        if along:
            (firing, first), *rest = along
            features = [1.0, *first]
            for second_firing, second in rest:
                firing = [a * b for a in firing for b in second_firing]
                tensor = [a * b for a in [1.0, *first] for b in [1.0, *second]]
                features = tensor if self.structure["products"] == "tensor" else [1.0, *first, *second]
        rules = function["rules"]
        assert len(rules) == len(firing) == np.prod(function["rules_per_input"], initial=1)
        return sum(w * np.dot(rule["coefficients"], features) for w, rule in zip(firing, rules, strict=True))

    def along(self, name, axis, q):
        x, consequent = self.inputs(axis, q)
        peaks = self.document["fuzzy"]["breakpoints"][f"{name}({axis})"]
        if self.structure["consequents"] == "harmonic":
            orders = range(1, self.structure["harmonic_order"] + 1)
            own = [np.sin(k * q) for k in orders] + [np.cos(k * q) for k in orders]
        else:
            own = [consequent]
        return self.firing(x, peaks), own

    def inputs(self, axis, q):
        wrapped = (q + np.pi) % (2 * np.pi) - np.pi
        periodic = self.structure["structure"] == "cpfls"
        s = 2 / np.pi * np.arcsin(np.sin(q)) if periodic else wrapped
        if self.structure["input_map"] == "data-range":
            data = self.document["fuzzy"]["inputs"][axis]
            return (s - data["minimum"]) / data["width"], (s - data["minimum"]) / data["width"]
        if periodic:
            return q % (2 * np.pi) / (2 * np.pi), s
        return wrapped / (2 * np.pi) + 0.5, wrapped / (2 * np.pi) + 0.5

    def firing(self, x, peaks):
        if len(peaks) == 1:
            return [1.0]
        degrees = [0.0] * len(peaks)
        x = min(max(x, 0.0), 1.0)
        for index, (low, high) in enumerate(pairwise(peaks)):
            if low < high and (low <= x < high or x == high == peaks[-1]):
                u = (x - low) / (high - low)
                degrees[index] = 1 - 2 * u**2 if u < 0.5 else 2 * (1 - u) ** 2
                degrees[index + 1] = 1 - degrees[index]
        if x == 1.0:
            degrees = [0.0] * (len(peaks) - 1) + [1.0]
        if self.structure["structure"] == "cpfls":
            return [degrees[0] + degrees[-1], *degrees[1:-1]]
        return degrees


@pytest.mark.parametrize("name", CASES)
def test_the_words_are_enough_to_evaluate_the_model(name):
    model = model_of(CASES[name])
    attitude = np.random.default_rng(5).uniform(-10, 10, (60, 3))
    by_hand = ByTheWords(document_of(model))
    wanted = model.inertia(attitude).value
    found = np.array([by_hand.inertia(q) for q in attitude])
    assert np.max(np.abs(found - wanted)) < 1e-11 * max(np.max(np.abs(wanted)), 1)


def test_reference_points_and_region_are_those_of_the_library():
    model = model_of(CASES["rigid body, rules"])
    document = document_of(model)
    attitude = states(model, 500).attitude
    rows = document["excited_region"]["rows"]
    cells = np.clip(np.floor((np.mod(attitude + np.pi, 2 * np.pi)) / np.deg2rad(5)), 0, 71).astype(int)
    inside = [rows[roll][pitch] == "#" for roll, pitch, _ in cells]
    assert np.mean(inside == ~model.outside(attitude)) > 0.99
    assert document["excited_region"]["share"] == np.mean(model.visited)
    for point in document["reference_points"]:
        assert np.allclose(model.inertia(np.array([point["q"]])).value[0], point["D"], rtol=0, atol=1e-14)
        torque = np.array(point["D"]) @ point["qdd"] + np.array(point["C"]) @ point["qd"]
        assert np.allclose(torque, point["torque"], rtol=0, atol=1e-12 * point["scale"][2])


def test_numbers_come_back_bit_by_bit():
    model = model_of(CASES["rigid body, rules"])
    document = document_of(model)
    functions = document["fuzzy"]["functions"].values()
    stored = [c for function in functions for rule in function["rules"] for c in rule["coefficients"]]
    assert stored == model.coefficients.tolist()
    assert list(document["rigid_body"]["tensor"].values()) == model.rigid_body.tolist()
    assert list(document["fuzzy"]["breakpoints"].values()) == [peaks.tolist() for peaks in model.partitions]


def test_what_is_not_finite_is_null_and_what_is_not_known_is_too():
    document = document_of(model_of(CASES["paper"]), verdict=None, config={"a": float("inf")})
    scores = document["judged"]["models"]["model"]["training"]
    known = {name: [1.0, 2.0, 3.0] for name in ("mse", "max_error", "vaf", "r2_body")}
    assert scores == {**known, "relative_error": [0.1, None, 0.2], "r2": [0.9, None, 0.5]}
    assert document["verdict"] is None
    assert document["provenance"]["config"] == {"a": None}


def test_the_verdict_and_its_reasons_are_there():
    verdict = verdict_of("do-not-use", "nowhere", ("D is not positive definite", -1), ("few samples", 0))
    document = document_of(model_of(CASES["paper"]), verdict=verdict, stop_reason="interrupted")
    assert document["complete"] is False
    assert document["verdict"]["label"] == "do-not-use"
    assert document["verdict"]["reasons"][0] == {"reason": "D is not positive definite", "speaks": -1.0}


def test_tables_take_one_line_for_each_rule():
    text = json_text(sheet_of(model_of(CASES["default"])))
    inertia, _ = text.split('\n "rotors": ')
    assert len(inertia.splitlines()) < 400
