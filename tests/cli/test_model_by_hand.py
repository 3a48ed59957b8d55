"""A stored model is evaluated as docs/format.md says, and the study of the whole circle runs."""

import json
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest

import cpfls_cli
from tests.builders.artifacts import edited

FUNCTIONS = {
    "D11": ((0, 0), ""),
    "D13": ((0, 2), "p"),
    "D22": ((1, 1), "r"),
    "D23": ((1, 2), "rp"),
    "D33": ((2, 2), "rp"),
}
NAMES = {"r": ("roll", 0), "p": ("pitch", 1)}
PARTITIONS = ("D13(pitch)", "D22(roll)", "D23(roll)", "D23(pitch)", "D33(roll)", "D33(pitch)")


def membership(x, peaks):
    """Zadeh's functions one by one, as a plain loop over the peaks."""
    if len(peaks) == 1:
        return np.ones((len(x), 1))

    def falling(low, high):
        # Equal peaks: the function between them is met nowhere.
        u = np.clip((x - low) / (high - low), 0, 1) if high > low else np.where(x >= high, 1.0, 0.0)
        return np.where(u < 0.5, 1 - 2 * u**2, 2 * (1 - u) ** 2)

    degrees = []
    for k, peak in enumerate(peaks):
        left = 1 - falling(peaks[k - 1], peak) if k else 1.0
        right = falling(peak, peaks[k + 1]) if k + 1 < len(peaks) else 1.0
        degrees.append(left * right)
    return np.column_stack(degrees)


class Stored:
    """A model read from its file with nothing of the program."""

    def __init__(self, path):
        with h5py.File(path) as file:
            group, settings = file["model/fuzzy"], file["model/fuzzy/structure/settings"]
            texts = ("structure", "input_map", "consequents", "products")
            self.settings = {name: settings[name].asstr()[()] for name in texts}
            self.settings["harmonic_order"] = int(settings["harmonic_order"][()])
            self.coefficients = file["model/fuzzy/coefficients"][:]
            self.rigid_body = file["model/fuzzy/rigid_body"][:]
            self.range = np.column_stack([group[f"ranges/{end}"][:] for end in ("minimum", "maximum")])
            row, peaks = (group[f"partitions/values/{name}"][:] for name in ("row", "values"))
            self.peaks = {name: peaks[row == place] for place, name in enumerate(PARTITIONS)}
        self.circular = self.settings["structure"] == "cpfls"

    def inputs(self, attitude, axis):
        """Input of the memberships and input of the linear consequents."""
        angle = attitude[:, axis]
        value = 2 / np.pi * np.arcsin(np.sin(angle)) if self.circular else (angle + np.pi) % (2 * np.pi) - np.pi
        if self.settings["input_map"] == "data-range":
            low, high = self.range[axis]
            return (value - low) / (high - low), (value - low) / (high - low)
        if self.circular:
            return angle % (2 * np.pi) / (2 * np.pi), value
        return value / (2 * np.pi) + 0.5, value / (2 * np.pi) + 0.5

    def along(self, attitude, function, letter):
        """Firing of the rules along one input, and its features without the constant."""
        name, axis = NAMES[letter]
        x, seesaw = self.inputs(attitude, axis)
        firing = membership(x, self.peaks[f"{function}({name})"])
        if self.circular and firing.shape[1] > 1:
            firing = np.column_stack([firing[:, 0] + firing[:, -1], firing[:, 1:-1]])
        if self.settings["consequents"] == "seesaw":
            return firing, [seesaw]
        orders, angle = range(1, self.settings["harmonic_order"] + 1), attitude[:, axis]
        return firing, [np.sin(k * angle) for k in orders] + [np.cos(k * angle) for k in orders]

    def terms(self, attitude, function, letters):
        """Everything that the coefficients of one inertia function multiply, in their order."""
        one = np.ones(len(attitude))
        if not letters:
            return [one]
        parts = [self.along(attitude, function, letter) for letter in letters]
        if len(parts) == 1:
            firing, own = parts[0]
            return [w * feature for w in firing.T for feature in [one, *own]]
        (first, of_first), (second, of_second) = parts
        rules = [a * b for a in first.T for b in second.T]
        if self.settings["products"] == "tensor":
            features = [a * b for a in [one, *of_first] for b in [one, *of_second]]
        else:
            features = [one, *of_first, *of_second]
        return [rule * feature for rule in rules for feature in features]

    def inertia(self, attitude):
        J, start = self.rigid(attitude), 0
        for function, ((row, column), letters) in FUNCTIONS.items():
            terms = self.terms(attitude, function, letters)
            value = self.coefficients[start : start + len(terms)] @ np.array(terms)
            start += len(terms)
            J[:, row, column] += value
            J[:, column, row] += value if row != column else 0
        assert start == len(self.coefficients)
        return J

    def rigid(self, attitude):
        xx, yy, zz, xy, xz, yz = self.rigid_body
        roll, pitch, _ = attitude.T
        zero, one = np.zeros(len(roll)), np.ones(len(roll))
        W = np.array(
            [
                [one, zero, -np.sin(pitch)],
                [zero, np.cos(roll), np.sin(roll) * np.cos(pitch)],
                [zero, -np.sin(roll), np.cos(roll) * np.cos(pitch)],
            ]
        )
        return np.einsum("ian,ij,jbn->nab", W, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), W)

    def torque(self, attitude, rate, acceleration, step=1e-6):
        shifted = [step * np.eye(3)[axis] for axis in range(3)]
        slope = np.array([self.inertia(attitude + by) - self.inertia(attitude - by) for by in shifted]) / (2 * step)
        return (
            np.einsum("nij,nj->ni", self.inertia(attitude), acceleration)
            + np.einsum("anij,na,nj->ni", slope, rate, rate)
            - 0.5 * np.einsum("anij,ni,nj->na", slope, rate, rate)
        )


STRUCTURES = {
    "the paper's": {},
    "its classic rival": {"structure": "fls", "input_map": "full-circle", "membership_functions": 3},
    "seesaw, tensor": {"products": "tensor", "input_map": "full-circle"},
    "harmonic, additive": {"consequents": "harmonic", "harmonic_order": 2, "input_map": "full-circle"},
    "harmonic, tensor, rigid body": {
        "consequents": "harmonic",
        "harmonic_order": 2,
        "products": "tensor",
        "input_map": "full-circle",
        "membership_functions": "[2, 3, 4, 3, 1, 4]",
        "base": "rigid-body",
    },
    "one rule": {"consequents": "harmonic", "products": "tensor", "membership_functions": 1},
}


SMALL = ("ridge.count=2", "generations=1", "validation.enabled=false")
"""Any model will do: its numbers are replaced."""


@pytest.mark.parametrize("name", STRUCTURES)
def test_inertia_and_torque_of_a_stored_model_follow_from_its_datasets(cpfls, pipeline, study, tmp_path, name):
    """The inertia to rounding; the torque to what a central difference of it leaves."""
    model = tmp_path / "model.h5"
    changed = [word for key, value in STRUCTURES[name].items() for word in ("--set", f"identification.{key}={value}")]
    small = [word for key in SMALL for word in ("--set", f"identification.{key}")]
    cpfls.done("identify", study, pipeline.flight, "-o", model, *changed, *small)
    with edited(model) as file:
        # Other numbers than those identified, or a fuzzy part that is switched off would prove nothing.
        numbers = np.random.default_rng(11)
        for key in ("model/fuzzy/coefficients", "model/fuzzy/rigid_body"):
            file[key][:] = numbers.uniform(0.5, 1.5, file[key].shape) * (
                key != "model/fuzzy/rigid_body" or "rigid" in name
            )
    with warnings.catch_warnings(action="ignore"):
        predicted = cpfls_cli.load_model(model).predict(pipeline.flight)
    stored, inertia, torque = Stored(model), predicted.inertia, predicted.torque
    with h5py.File(pipeline.flight) as flight:
        motion = [flight[key][:] for key in ("attitude", "attitude_rate", "attitude_acceleration")]
    np.testing.assert_allclose(stored.inertia(motion[0]), inertia, atol=1e-11 * np.abs(inertia).max())
    np.testing.assert_allclose(stored.torque(*motion), torque, atol=2e-6 * np.abs(torque).max())


CONFIG = Path(__file__).parents[2] / "configs" / "full-circle.yaml"
SHORT = (
    "--set",
    "trajectory.path=full-rotation",
    "--set",
    "trajectory.duration_s=12.0",
    "--set",
    "trajectory.sample_time_s=0.04",
)


@pytest.fixture(scope="module")
def fly(cpfls, tmp_path_factory):
    folder = tmp_path_factory.mktemp("circle")

    def call(seed):
        path, flight = (folder / f"{name}-{seed}.h5" for name in ("path", "flight"))
        for words in (("trajectory", CONFIG, *SHORT, "-o", path), ("simulate", CONFIG, path, "-o", flight)):
            cpfls.done(*words, "--seed", seed)
        return flight

    return call


@pytest.fixture(scope="module")
def flights(fly):
    return [fly(seed) for seed in (1, 2, 3)]


def test_the_model_of_one_flight_is_exact_on_another(cpfls, flights, tmp_path):
    first, _, other = flights
    words = ("identify", CONFIG, first, "--validate", other, "-o", tmp_path / "model.h5", "--json")
    summary = json.loads(cpfls.done(*words).stdout)
    assert (summary["rank"], summary["parameters"]) == (61, 61)
    assert summary["held_out"][other.name]["relative_error"] < 1e-8


def test_attitudes_not_visited_are_trusted_to_one_rule_with_known_coefficients(cpfls, fly, flights, tmp_path):
    """One flight of 12 s leaves the condition number at 3000; three of them bring it to 40."""
    other = fly(4)
    for name, training, said in (("a", flights[:1], "do not trust"), ("b", flights, "the same coefficients hold")):
        model = cpfls.made("identify", CONFIG, *training, at=tmp_path / f"{name}.h5")
        with pytest.warns(UserWarning, match=f"samples lie outside the attitudes that training visited: {said}"):
            cpfls_cli.load_model(model).predict(other)


@pytest.mark.parametrize(("structure", "least", "most"), [("seesaw", 0.05, float("inf")), ("harmonic", 0.0, 1e-8)])
def test_a_structure_is_chosen_on_one_flight_and_judged_on_another(cpfls, flights, tmp_path, structure, least, most):
    """As `make full-circle` fits each: of two structures next to each other one is exact."""
    first, kept, other = flights
    products, functions = ("additive", 3) if structure == "seesaw" else ("tensor", 1)
    keys = {"consequents": structure, "products": products, "membership_functions": functions, "choice": "held-out"}
    less = {"population": 4, "generations": 1, "local_search.enabled": "false", "validation.enabled": "false"}
    given = [word for key, value in (keys | less).items() for word in ("--set", f"identification.{key}={value}")]
    words = ("identify", CONFIG, first, "--choose-on", kept, "--validate", other, "-o", tmp_path / "m.h5", *given)
    error = cpfls.summary(*words)["held_out"][other.name]["relative_error"]
    assert least <= error < most, error
