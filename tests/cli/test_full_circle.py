"""The shipped study of the whole circle through the commands, on short random paths."""

import json
from pathlib import Path

import pytest

import cpfls_cli

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
    result = cpfls.done(*words)
    summary = json.loads(result.stdout)
    assert (summary["rank"], summary["parameters"]) == (61, 61)
    assert summary["held_out"][other.name]["relative_error"] < 1e-8


def test_attitudes_not_visited_are_trusted_to_one_rule_with_known_coefficients(cpfls, fly, flights, tmp_path):
    """One flight of 12 s leaves the condition number at 3000; three of them bring it to 40."""
    other = fly(4)
    for name, training, said in (("a", flights[:1], "do not trust"), ("b", flights, "the same coefficients hold")):
        model = tmp_path / f"{name}.h5"
        cpfls.done("identify", CONFIG, *training, "-o", model)
        with pytest.warns(UserWarning, match=f"samples lie outside the attitudes that training visited: {said}"):
            cpfls_cli.load_model(model).predict(other)


@pytest.mark.parametrize(("structure", "least", "most"), [("seesaw", 0.05, float("inf")), ("harmonic", 0.0, 1e-8)])
def test_a_structure_is_chosen_on_one_flight_and_judged_on_another(cpfls, flights, tmp_path, structure, least, most):
    """As `make full-circle` fits each: of two structures beside each other one is exact."""
    first, kept, other = flights
    products, functions = ("additive", 3) if structure == "seesaw" else ("tensor", 1)
    keys = {"consequents": structure, "products": products, "membership_functions": functions, "choice": "held-out"}
    less = {"population": 4, "generations": 1, "local_search.enabled": "false", "validation.enabled": "false"}
    given = [word for key, value in (keys | less).items() for word in ("--set", f"identification.{key}={value}")]
    words = ("identify", CONFIG, first, "--choose-on", kept, "--validate", other, "-o", tmp_path / "m.h5", *given)
    error = cpfls.told(*words)["held_out"][other.name]["relative_error"]
    assert least <= error < most, error
