"""Exports of an identified model: JSON, polynomials, texts and samples."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.export.holding import Held
from cpfls_cli.export.json_form import json_text
from cpfls_cli.export.numbers import motion_terms, weights_of
from cpfls_cli.export.points import parts_along, reference_points
from cpfls_cli.export.registry import exported
from cpfls_cli.export.source import jax_parameters, jax_parts, python_source
from cpfls_cli.export.text import checked_identifier, comment_lines, comment_text, identifier, literal_text
from cpfls_cli.playback.player import free_runs, player_of
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.playback.spread import drawn
from tests.builders.exported_models import CASES, model_of, sheet_of, states, verdict_of
from tests.builders.exported_vehicles import on_numpy, sheet_of_vehicle
from tests.builders.flown_exports import executed
from tests.builders.playback_flights import flown, truth
from tests.builders.spread_vehicles import found_record
from tests.builders.vehicle_models import HEXA, QUAD, thrust_curve, whole

DELAYED = replace(
    truth(), response=RotorResponse(lag_s=0.035, delay_s=0.013), effects=(*truth().effects, thrust_curve(0.15))
)


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
    inertia, _ = json_text(sheet_of(model_of(CASES["default"]))).split('\n "rotors": ')
    assert len(inertia.splitlines()) < 400


@pytest.mark.parametrize("vehicle", [QUAD, HEXA], ids=["four rotors", "six rotors"])
def test_weights_are_those_of_the_parts(vehicle):
    model = whole(vehicle)
    points = reference_points(model, np.random.default_rng(2), 40)
    weights = weights_of(model.parts, vehicle)
    parts = parts_along(model, points.air, points.rate, points.rotor)
    assert [*parts] == [*weights, "remainder"]
    terms = motion_terms(points.air, points.rate)
    for name, own in weights.items():
        found = np.einsum("rtu,nt,nu->nr", own, terms, points.rotor)
        assert np.abs((found - parts[name]) / points.scale).max() < 1e-12
    everything = Held.whole(model).wrench(points.air, points.rate, points.rotor)
    assert np.abs((everything - sum(parts.values())) / points.scale).max() < 1e-12


@pytest.mark.parametrize(
    ("text", "safe"),
    [
        ("a */ b", "a * / b"), ("a /* b", "a / * b"), ("*/*/*", "* / * / *"), ("what??/", "what?/"),
        ("one\ntwo\rthree\0", "one?two?three?"), ("Größe \u202e", "Gr?e ?"), ("C:\\flights", "C:|flights"),
        ("N m/s, 3 * 4", "N m/s, 3 * 4"),
    ],
)  # fmt: skip
def test_comment_text(text, safe):
    assert comment_text(text) == safe


def test_comment_lines_are_short_and_literals_hold_no_quotes():
    lines = comment_lines(["word " * 100, "", "x" * 300])
    assert "" in lines
    assert all(len(line) <= 115 for line in lines)
    assert all(line == "" or line.startswith(" ") for line in lines)
    assert literal_text('good" "\\n%s??/') == "good_ __n_s___"


@pytest.mark.parametrize(
    ("stem", "name"),
    [
        ("model", "model"), ("my model-2", "my_model_2"), ("2nd", "model_2nd"), ("_x", "x"), ("模型", "model"),
        ("...", "model"), ("é1", "model_1"),
    ],
)  # fmt: skip
def test_identifier(stem, name):
    assert identifier(stem) == name
    assert checked_identifier(name) == name


@pytest.mark.parametrize("name", ["", "2x", "_x", "a b", "a-b", "é", "a;b", "a\n"])
def test_a_name_that_is_no_identifier_is_refused(name):
    with pytest.raises(InputError, match="not an identifier; use letters, digits and underscores"):
        checked_identifier(name)


def test_a_name_is_no_longer_than_compilers_tell_names_apart():
    assert checked_identifier(identifier("a" * 5000)) == "a" * 48
    with pytest.raises(InputError, match=r"--name aaaaaaaa\.\.\.: has 5000 letters; at most 48"):
        checked_identifier("a" * 5000)


def vehicles(model, count):
    record = found_record(model)
    return record.model, drawn(record.model, record, count, np.random.default_rng(1))


def test_the_parameters_of_each_vehicle_are_those_of_its_own_export():
    model, spread = vehicles(DELAYED, 3)
    sheet = sheet_of_vehicle(model)
    for own, row in zip(spread.models, jax_parameters(sheet, spread.models), strict=True):
        text = python_source(replace(sheet, model=own), "v.py", "casadi")
        start = text.index("PARAMETERS = [") + len("PARAMETERS = [")
        alone = np.fromstring(text[start : text.index("]", start)].replace("\n", " "), sep=",")
        assert np.array_equal(row[:-1], alone)
        assert row[-1] == own.response.delay_s


def test_the_parts_alone_are_those_of_the_model():
    model = whole()
    sheet, points = sheet_of_vehicle(model), reference_points(model, np.random.default_rng(1), 3)
    wrench = on_numpy(python_source(sheet, "v.py", "jax"))["wrench"]
    parts = parts_along(model, points.air, points.rate, points.rotor)
    for own, row in zip(parts.values(), jax_parts(sheet, [*parts]), strict=True):
        found = np.array([wrench(*each, row) for each in zip(points.air, points.rate, points.rotor, strict=True)])
        assert np.abs((found - own) / points.scale).max() < 1e-12


def test_one_batched_function_flies_all_vehicles():
    jax = pytest.importorskip("jax", reason="the extra simulators is not installed")
    model, spread = vehicles(DELAYED, 4)
    flight = flown(model, ("multisine",), hold="linear", duration_s=1.0)[0]
    period, horizon = flight.motion.period, len(flight) - 1
    with jax.enable_x64(True):
        sheet = sheet_of_vehicle(model)
        module = executed(exported(sheet, "jax", "v.py").text)
        parameters = jax_parameters(sheet, spread.models)
        assert parameters.shape[1] == len(module["PARAMETER_NAMES"]) == len(module["PARAMETERS"])
        state = np.concatenate([part[0].ravel() for part in flight.motion[:4]])
        longest = max(each.response.delay_s for each in spread.models)

        def fly(own):
            return module["fly"](state, flight.speed, period, parameters=own, longest=longest)

        flown_ = np.array(jax.jit(jax.vmap(fly))(parameters))
        short = np.array(
            jax.jit(jax.vmap(lambda own: module["fly"](state, flight.speed, period, parameters=own, longest=0.0)))(
                parameters
            )
        )
    assert np.isnan(short).any()
    for own, path in zip(spread.models, flown_, strict=True):
        runs = free_runs(player_of(own, flight), flight, np.array([0]), horizon)
        assert np.abs(path[:, 15:] - (runs.errors[0, :, 3] + flight.motion.rate[1:])).max() < 1e-9
