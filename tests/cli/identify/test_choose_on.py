"""`identify --choose-on`: flights that a model is chosen on."""

import json
import warnings

import h5py
import pytest

from cpfls_cli import load_model

HELD_OUT = ("--set", "identification.choice=held-out")
SEARCH = ("--set", "identification.generations=2")


@pytest.fixture(scope="module")
def others(cpfls, study, tmp_path_factory):
    """Two more flights of the tiny study."""
    folder, flights = tmp_path_factory.mktemp("others"), []
    for displacement in (50, 40):
        path, flight = (folder / f"{name}-{displacement}.h5" for name in ("trajectory", "flight"))
        turned = ("--set", f"trajectory.displacement_m={displacement}.0")
        for words in (("trajectory", study, *turned, "-o", path), ("simulate", study, path, "-o", flight)):
            cpfls.done(*words)
        flights.append(flight)
    return flights


def test_a_model_is_chosen_on_a_flight_and_judged_on_another(cpfls, study, pipeline, others, tmp_path):
    model, (kept, judged) = tmp_path / "model.h5", others
    words = ("--choose-on", kept, "--validate", judged, *HELD_OUT, *SEARCH)
    summary = cpfls.told("identify", study, pipeline.flight, *words, "-o", model)
    assert list(summary["held_out"]) == [judged.name]
    again = cpfls("identify", study, pipeline.flight, "--validate", kept, *SEARCH, "-o", tmp_path / "b.h5", "--json")
    # The same search, chosen by its objectives: never better on the flight that the other was chosen on.
    assert 0 < summary["choice_error"] <= json.loads(again.stdout)["held_out"][kept.name]["mse"] * (1 + 1e-6)
    with h5py.File(model) as file:
        assert {"flight", "choose-on-1", "validate-1"} == set(file["inputs"])


def test_choice_and_flights_must_go_together(refuse, study, pipeline, others, tmp_path):
    output = ("-o", tmp_path / "out.h5")
    (message,) = refuse("identify", study, pipeline.flight, *HELD_OUT, *output)
    assert 'identification.choice = "held-out": needs a flight' in message
    assert "--choose-on FLIGHT" in message
    (message,) = refuse("identify", study, pipeline.flight, "--choose-on", others[0], *output)
    assert "--choose-on" in message
    assert "held-out" in message


def test_a_flight_that_trains_or_judges_cannot_choose(refuse, study, pipeline, others, tmp_path):
    output = ("-o", tmp_path / "out.h5")
    (message,) = refuse("identify", study, pipeline.flight, "--choose-on", pipeline.flight, *HELD_OUT, *output)
    assert "is a training flight" in message
    same = ("--validate", others[0], "--choose-on", others[0])
    (message,) = refuse("identify", study, pipeline.flight, *same, *HELD_OUT, *output)
    assert "judges (--validate)" in message
    twice = ("--choose-on", others[0], "--choose-on", others[0])
    (message,) = refuse("identify", study, pipeline.flight, *twice, *HELD_OUT, *output)
    assert "is given twice" in message


def test_what_is_no_flight_cannot_choose(refuse, study, pipeline, tmp_path):
    """Not even where the same file is an input of its own."""
    words = ("--choose-on", pipeline.selection, *HELD_OUT, "-o", tmp_path / "out.h5")
    (message,) = refuse("identify", study, pipeline.flight, "--selection", pipeline.selection, *words)
    assert f"--choose-on {pipeline.selection}: is the selection, not a flight" in message
    (message,) = refuse("identify", study, pipeline.flight, *words)
    assert str(pipeline.selection) in message
    assert "flight" in message


def test_flights_of_another_vehicle_are_named(cpfls, study, pipeline, others, tmp_path):
    """Their numbers are of that vehicle; they are used all the same."""
    heavy = tmp_path / "heavy.h5"
    path = others[0].with_name(others[0].name.replace("flight", "trajectory"))
    inertia = ("--set", "vehicle.inertia_kg_m2=[0.7, 0.6, 1.2]")
    cpfls.done("simulate", study, path, *inertia, "-o", heavy)
    words = ("identify", study, pipeline.flight, *HELD_OUT, *SEARCH, "--choose-on", heavy, "--validate", others[1])
    result = cpfls.done(*words, "-o", tmp_path / "out.h5")
    said = [line for line in result.stderr.splitlines() if "another vehicle" in line]
    assert len(said) == 1
    assert f"{heavy.name}: was made with another vehicle; these differ: vehicle.inertia_kg_m2" in said[0]


def test_a_model_of_another_vehicle_is_named(cpfls, study, pipeline, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text(cpfls.done("config", study, "--set", "vehicle.inertia_kg_m2=[0.7, 0.6, 1.2]").stdout)
    said = f"{pipeline.model.name}: models a vehicle other than the config's; these differ: vehicle.inertia_kg_m2"
    with warnings.catch_warnings(record=True) as noted:
        warnings.simplefilter("always")
        load_model(pipeline.model, other).predict(pipeline.flight)
    assert any(said in str(each.message) for each in noted)
