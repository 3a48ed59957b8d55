"""A vehicle whose flights do not tell it: what its config leaves open, every command takes or refuses by name."""

import json
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from cpfls_cli.artifacts.diagnosis import Disagreement
from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import resolved_yaml
from cpfls_cli.export.registry import FORMS
from cpfls_cli.pages.gap_words import WHAT_TO_FLY
from cpfls_cli.playback.along_flights import Playback
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.store import read
from tests.builders.artifacts import edited, read_result, with_fields
from tests.builders.vehicle_models import vehicle_of, write_vehicle
from tests.builders.vehicle_search import CONFIG

ROOT = Path(__file__).parents[2]
HEADLINE = (
    "FORECAST NOT JUDGED; VEHICLE NOT JUDGED: THE FLIGHTS SHOW THE LOOP: not judged as a forecast; its constants are "
    "those of vehicle and autopilot together; 1 of 2 numbers are not determined."
)
HEAVY = "too heavy for 0.8 kg between these rotors (Ixx 0.05 where"
ROTATION = ("--set", "trajectory.path=full-rotation")
TRUE = (0.05, 0.0044, 0.0075)
HEAVY_BODY = (0.05, 0.045, 0.0075)
GUESSED = "guesses from mass and arms are used for what the config leaves open (--accept-guesses)"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("difficult")


@pytest.fixture(scope="module")
def config(folder):
    """What `vehicle --write-config` leaves open."""
    data, path = yaml.safe_load(CONFIG), folder / "found.yaml"
    data["vehicle"]["inertia_kg_m2"] = [None, None, None]
    for rotor in data["vehicle"]["rotors"]:
        rotor |= {"thrust_factor_n_s2": None, "drag_factor_n_m_s2": None}
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return path


@pytest.fixture(scope="module")
def vehicle(config, folder):
    """A vehicle whose flights show the loop, with an inertia that no body has."""
    return written_vehicle(config, folder / "vehicle.h5", TRUE)


@pytest.fixture(scope="module")
def heavy(config, folder):
    """The same with an inertia that a body can have, but none of its mass."""
    return written_vehicle(config, folder / "heavy" / "vehicle.h5", HEAVY_BODY)


def written_vehicle(config, path, inertia):
    path.parent.mkdir(exist_ok=True)
    study = load_study(config)
    vehicle = vehicle_of(VehicleModel(vehicle=replace(study.vehicle, inertia_kg_m2=inertia)))
    first, second = vehicle.numbers
    numbers = first._replace(value=inertia[0], determined=False), second._replace(value=0.0, determined=True)
    loop = vehicle.loop._replace(explained=np.full(3, 0.5))
    write_vehicle(path, replace(vehicle, numbers=numbers, loop=loop), resolved_yaml(study))
    return path


@pytest.fixture(scope="module")
def flight(cpfls, config, folder):
    plan, path, other = (folder / f"{name}.h5" for name in ("path", "flight", "other"))
    words = ("--set", "trajectory.path=straight", "--set", "trajectory.direction=[-0.3, 1.0, 0.4]")
    for result in (
        cpfls("trajectory", config, "-o", plan, *words),
        cpfls("simulate", config, plan, "-o", path, "--accept-guesses"),
        cpfls("simulate", config, plan, "-o", other, "--accept-guesses", "--seed", 2),
    ):
        assert result.exit_code == 0, result.stderr
    for made in (path, other):
        with edited(made) as file:
            assert file.attrs["cautions"].startswith(GUESSED)
            # As if it was measured: what its path was flown by is none of what follows.
            file.attrs["cautions"] = ""
    return path


@pytest.fixture
def command(config, flight, folder, tmp_path):
    """The words of a command by its name."""

    def words(name):
        given = {
            "simulate": ("simulate", config, folder / "path.h5"),
            "replay": ("replay", config, "vehicle", flight, "--every", "50"),
            "trajectory": ("trajectory", config, *ROTATION, "--set", "trajectory.infeasible=report"),
            "gap": ("gap", config, flight, "--held-out", flight.with_name("other.h5"), "--dry-run"),
            "compare": ("compare", config, flight, "--dry-run"),
            "response": ("response", config, flight, "--dry-run"),
            "identify": ("identify", config, flight, "--dry-run"),
        }
        return (*given[name], "-o", tmp_path / "out")

    return words


def test_an_error_says_what_it_came_about_with(cpfls, config, vehicle, tmp_path):
    result = cpfls("trajectory", config, *ROTATION, "--model", vehicle, "-o", tmp_path / "path.h5")
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr.splitlines()[-1] == f"cpfls: note: vehicle.h5: {HEADLINE}"


COMMANDS = ("simulate", "replay", "trajectory", "gap", "compare", "response", "identify")


@pytest.mark.parametrize("name", COMMANDS)
def test_a_refusal_names_both_ways_and_each_of_them_works(cpfls, refuse, command, vehicle, heavy, name):
    (line,) = refuse(*command(name))
    assert "vehicle.inertia_kg_m2" in line
    assert "--model VEHICLE.h5 takes the numbers that `cpfls vehicle` found" in line
    assert "--accept-guesses" in line
    (said,) = cpfls.told(*command(name), "--accept-guesses")["cautions"]
    assert said.startswith(GUESSED)
    assert "inertia 0.8 to 4" in said
    # A gap is told from a body alone.
    found = cpfls.done(*command(name), "--model", heavy if name == "gap" else vehicle, "--json", "--force")
    first, *others = json.loads(found.stdout)["cautions"]
    assert first == f"vehicle.h5: {HEADLINE}"
    assert any(HEAVY in each for each in others)
    assert not any(each.startswith(GUESSED) for each in others)


def test_found_numbers_stand_in_for_open_ones(cpfls, config, command, vehicle, tmp_path):
    cpfls.done(*command("replay"), "--model", vehicle)
    stored = yaml.safe_load(read(tmp_path / "out", Playback)[1].config)["vehicle"]
    assert stored["inertia_kg_m2"] == pytest.approx(TRUE)
    cpfls.done("report", config, tmp_path / "out", "-o", tmp_path / "page.html")


def test_no_gap_is_told_from_an_inertia_of_no_body(refuse, command, vehicle):
    (line,) = refuse(*command("gap"), "--model", vehicle)
    assert line == (
        f"{vehicle}: no body has this inertia: its largest principal moment, 0.05, exceeds the sum of the other two, "
        f"0.0119, so no gap can be measured against it; --accept-guesses takes guesses from mass and arms, or fly "
        f"what identifies its inertia: {WHAT_TO_FLY}"
    )


def test_only_a_vehicle_that_was_found_has_numbers_to_take(refuse, command, flight):
    (line,) = refuse(*command("replay"), "--model", flight)
    assert line == f"--model {flight}: is not a vehicle that `cpfls vehicle` found"


@pytest.mark.parametrize("form", FORMS)
def test_every_export_says_it_at_its_top(cpfls, vehicle, tmp_path, form):
    output = tmp_path / f"uav_model{FORMS[form].ending}"
    words = ("export", vehicle, "-o", output, "--format", form)
    refused = cpfls(*words)
    assert (refused.exit_code, "impossible numbers" in refused.stderr, output.exists()) == (2, True, False)
    shown = cpfls.done(*words, "--anyway").stdout
    for path in [output, *output.parent.glob("*.h")]:
        text = path.read_text()
        if form == "json":
            document = json.loads(text)
            assert (document["cautions"][0], HEAVY in document["cautions"][2]) == (HEADLINE, True)
            continue
        begin = " ".join(text[:2000].replace("#", " ").replace("*", " ").split())
        for words in (HEADLINE, HEAVY):
            assert words in begin
            assert words in " ".join(shown.split())


def test_a_file_made_with_it_carries_it_on(cpfls, config, flight, vehicle, tmp_path):
    compared = tmp_path / "compared.h5"
    made = cpfls.done("compare", config, flight, "--model", vehicle, "-o", compared)
    assert f"cpfls: note: vehicle.h5: {HEADLINE}" in made.stderr.splitlines()
    header = read(compared, Disagreement)[1]
    assert header.cautions[0] == f"vehicle.h5: {HEADLINE}"
    told = cpfls.told("info", compared)
    assert told["cautions"] == list(header.cautions)
    assert f"cpfls: note: vehicle.h5: {HEADLINE}" in cpfls("info", compared).stderr.splitlines()
    cpfls.done("report", config, compared, "-o", tmp_path / "page.md")
    summary = (tmp_path / "page.md").read_text().split("## ")[1]
    assert summary.count(HEADLINE) == 1


def test_two_vehicles_stand_side_by_side(cpfls, config, vehicle, tmp_path):
    made, other = read_result(vehicle), tmp_path / "other.h5"
    first, second = made.numbers
    numbers = (
        first._replace(value=0.0052, low=0.005, high=0.0054, determined=True),
        second._replace(value=0.0, low=0.0, high=0.0, determined=True),
    )
    with_fields(vehicle, other, numbers=numbers, loop=made.loop._replace(explained=np.ones(3)))
    cpfls.done("report", config, vehicle, other, "-o", tmp_path / "page.json")
    page = json.loads((tmp_path / "page.json").read_text())
    (section,) = [each for each in page["sections"] if each["name"] == "vehicles"]
    (table,) = [block for block in section["blocks"] if block["kind"] == "table"]
    (row,) = [row for row in table["rows"] if "Ixx, kg m^2" in str(row)]
    assert "0.005200, 0.00500 to 0.00540" in str(row)
    assert "beyond both intervals" in str(row)
    (mass,) = [row for row in table["rows"] if "Iyy, kg m^2" in str(row)]
    assert "beyond both intervals" not in str(mass)


def test_the_example_in_mujoco_says_what_to_give_it(config, vehicle):
    pytest.importorskip("mujoco", reason="needs the package mujoco, of the extra simulators")
    known = runpy.run_path(str(ROOT / "examples" / "fly_mujoco.py"))["known"]
    with pytest.raises(SystemExit, match=r"leaves numbers of the vehicle open; name the vehicle\.h5"):
        known(str(config))
    found = known(str(vehicle))
    assert found["inertia_kg_m2"][:3] == list(TRUE)
    assert [rotor["spin"] for rotor in found["rotors"]] == [1, -1, 1, -1]
