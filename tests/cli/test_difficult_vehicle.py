"""A vehicle whose flights leave numbers open: what commands refuse, and constants that are found."""

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
from cpfls_cli.flights.models import found_vehicle
from cpfls_cli.pages.gap_words import WHAT_TO_FLY
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.replay import Playback
from cpfls_cli.result import plain
from cpfls_cli.store import read
from tests.builders.artifacts import edited, read_result, with_fields
from tests.builders.studies import put_file
from tests.builders.vehicle_models import vehicle_of, write_vehicle
from tests.builders.vehicle_search import CONFIG, TRIED, left_out
from tests.builders.vehicles import OPEN_FACTORS

ROOT = Path(__file__).parents[2]
HEADLINE = (
    "FORECAST NOT JUDGED; VEHICLE NOT JUDGED: THE FLIGHTS SHOW THE LOOP: no flight was held out to judge its forecast; "
    "its constants are those of vehicle and autopilot together; 1 of 2 numbers is not determined."
)
HEAVY = "too heavy for 0.8 kg between these rotors (Ixx 0.05 where"
ROTATION = ("--set", "trajectory.path=full-rotation")
TRUE = (0.05, 0.0044, 0.0075)
HEAVY_BODY = (0.05, 0.045, 0.0075)
USUAL_BODY = (0.005, 0.0044, 0.0075)
GUESSED = "guesses from mass and arms are used for what the config leaves open (--accept-guesses)"
COMMANDS = ("simulate", "replay", "trajectory", "gap", "compare", "response", "identify")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("difficult")


@pytest.fixture(scope="module")
def config(folder):
    """What `vehicle --write-config` leaves open."""
    data, path = yaml.safe_load(CONFIG), folder / "found.yaml"
    data["vehicle"]["inertia_kg_m2"] = [None, None, None]
    for rotor in data["vehicle"]["rotors"]:
        rotor |= OPEN_FACTORS
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


@pytest.fixture(scope="module")
def usual(config, folder):
    """The same with an inertia that such a vehicle can have."""
    return written_vehicle(config, folder / "usual" / "vehicle.h5", USUAL_BODY)


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


@pytest.mark.parametrize("name", COMMANDS)
def test_a_refusal_names_both_ways_and_each_of_them_works(cpfls, refuse, command, vehicle, usual, name):
    (line,) = refuse(*command(name))
    assert "vehicle.inertia_kg_m2" in line
    assert "--model VEHICLE.h5 takes the numbers that `cpfls vehicle` found" in line
    assert "--accept-guesses" in line
    (said,) = cpfls.summary(*command(name), "--accept-guesses")["cautions"]
    assert said.startswith(GUESSED)
    assert "inertia 0.8 to 4" in said
    # A gap is distinguished from a body that the vehicle can have.
    found = cpfls.done(*command(name), "--model", usual if name == "gap" else vehicle, "--json", "--force")
    first, *others = json.loads(found.stdout)["cautions"]
    assert first == f"vehicle.h5: {HEADLINE}"
    assert any(HEAVY in each for each in others) is (name != "gap")
    assert not any(each.startswith(GUESSED) for each in others)


def test_found_numbers_stand_in_for_open_ones(cpfls, config, command, vehicle, tmp_path):
    cpfls.done(*command("replay"), "--model", vehicle)
    stored = yaml.safe_load(read(tmp_path / "out", Playback)[1].config)["vehicle"]
    assert stored["inertia_kg_m2"] == pytest.approx(TRUE)
    cpfls.done("report", config, tmp_path / "out", "-o", tmp_path / "page.html")


@pytest.mark.parametrize("body", ["vehicle", "heavy"])
def test_no_gap_is_distinguished_from_an_inertia_of_no_such_vehicle(request, refuse, command, config, body):
    """From one too heavy, a sound log was said to contradict itself, by its inertia over that one."""
    vehicle = request.getfixturevalue(body)
    said, hint = refuse(*command("gap"), "--model", vehicle)[0], WHAT_TO_FLY.replace("CONFIG", str(config))
    why = (
        "no body has this inertia: its largest principal moment, 0.05, exceeds the sum of the other two, 0.0119"
        if body == "vehicle"
        else f"its inertia is {HEAVY}"
    )
    assert said.startswith(f"{vehicle}: {why}")
    assert "so no gap can be measured against it; --accept-guesses, with a config and without --model, takes" in said
    assert f"guesses from mass and arms. The flight that is missing: {hint.partition(' -o')[0]}" in said
    # The study in the vehicle is written to no folder, so that no command can name it.
    name, *words = command("gap")
    assert f"missing: {WHAT_TO_FLY.partition(' -o')[0]}" in refuse(name, vehicle, *words[1:])[0]


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
            assert (document["cautions"][0], any(HEAVY in each for each in document["cautions"])) == (HEADLINE, True)
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
    assert cpfls.summary("info", compared)["cautions"] == list(header.cautions)
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


SEARCH = {"search_windows": 20, "folds": 2, "leave_out": left_out(TRIED)}
KEYS = {
    "rotors.thrust_factor_n_s2",
    "rotors.drag_factor_n_m_s2",
    *(f"inertia_kg_m2.{place}" for place in range(6)),
    "motor_lag_s",
    "delay_s",
    "com_m.0",
    "com_m.1",
}


@pytest.fixture(scope="module")
def open_folder(tmp_path_factory):
    return tmp_path_factory.mktemp("constants")


@pytest.fixture(scope="module")
def flights(cpfls, open_folder):
    """Flights by name; the loaded one is of a vehicle that is 5 % heavier."""
    config, made = open_folder / "flown.yaml", {}
    config.write_text(CONFIG)
    for name, direction, mass in (("flight", "[-0.3, 1.0, 0.4]", 0.8), ("loaded", "[1.0, -0.7, 0.3]", 0.84)):
        plan, made[name] = open_folder / f"{name}-path.h5", open_folder / f"{name}.h5"
        words = ("--set", "trajectory.path=straight", "--set", f"trajectory.direction={direction}")
        heavy = ("--set", f"vehicle.mass_kg={mass}")
        cpfls.done("trajectory", config, "-o", plan, *words, *heavy)
        cpfls.done("simulate", config, plan, "-o", made[name], *heavy)
    return made


def written(open_folder, name, change):
    data = yaml.safe_load(CONFIG) | {"playback": dict(SEARCH)}
    change(data)
    return put_file(open_folder / name, yaml.safe_dump(data, sort_keys=False))


def open_constants(data):
    data["vehicle"]["inertia_kg_m2"] = None
    for rotor in data["vehicle"]["rotors"]:
        rotor |= OPEN_FACTORS


@pytest.fixture(scope="module")
def unknown(open_folder):
    return written(open_folder, "unknown.yaml", open_constants)


def same_vehicle(data):
    data["playback"]["groups"] = [{"name": "payload", "flights": ["loaded*"], "differs": ["mass"]}]


def test_what_is_null_is_a_guess_that_is_named(unknown):
    vehicle = load_study(unknown).vehicle
    assert set(vehicle.unknown) == {"thrust_factor", "drag_factor", "inertia"}
    assert all(moment > 0 for moment in vehicle.inertia_kg_m2)


def test_a_torque_of_unknown_rotors_is_refused(refuse, open_folder):
    def change(data):
        open_constants(data)
        data["import"] = {
            "torque_source": "rotor-speed",
            "signals": {"rotor_speed": {"columns": ["a", "b", "c", "d"], "unit": "rad/s"}},
        }

    log = put_file(open_folder / "log.csv", "t,a,b,c,d\n0,1,1,1,1\n")
    (message,) = refuse("import", written(open_folder, "torque.yaml", change), log, "-o", open_folder / "x.h5")
    assert message.startswith("import.torque_source = rotor-speed: needs vehicle.")


def heavier(flights, open_folder, change, name):
    """A config whose flights are logs of the same columns: artifacts of two masses are of two vehicles."""
    import h5py
    import numpy as np

    signals = {
        "attitude": ("rad", 3),
        "body_rate": ("rad/s", 3),
        "velocity": ("m/s", 3),
        "position": ("m", 3),
        "rotor_speed": ("rad/s", 4),
    }
    mapped = {key: {"columns": [f"{key}{i}" for i in range(n)], "unit": unit} for key, (unit, n) in signals.items()}
    for own, path in flights.items():
        with h5py.File(path) as file:
            table = np.column_stack([file["time"][()], *(file[key][()] for key in signals)])
        names = ["t", *(column for key in signals for column in mapped[key]["columns"])]
        np.savetxt(open_folder / f"{own}.csv", table, delimiter=",", header=",".join(names), comments="", fmt="%.9g")

    def whole(data):
        change(data)
        data["import"] = {"torque_source": None, "signals": mapped}

    return written(open_folder, name, whole)


def test_constants_are_found_and_written_into_a_config(cpfls, flights, open_folder):
    config = heavier(flights, open_folder, open_constants, "logs.yaml")
    copy = open_folder / "found.yaml"
    words = ("vehicle", config, open_folder / "flight.csv", "-o", open_folder / "v.h5", "--write-config", copy)
    assert f"{copy}: written, the config with these constants" in cpfls.done(*words).stdout
    parameters = plain(found_vehicle(open_folder / "v.h5"))["parameters"]
    assert set(parameters) == KEYS
    answer = {"value", "unit", "low", "high", "stated", "determined", "reason", "possible"}
    assert set(parameters["motor_lag_s"]) == answer
    thrust = parameters["rotors.thrust_factor_n_s2"]
    stated = yaml.safe_load(CONFIG)["vehicle"]["rotors"][0]["thrust_factor_n_s2"]
    assert thrust["low"] < thrust["value"] < thrust["high"]
    assert thrust["value"] == pytest.approx(float(stated), rel=0.02)
    assert load_study(copy).vehicle.rotors[0].thrust_factor_n_s2 == pytest.approx(thrust["value"], rel=1e-5)
    assert load_study(copy).import_ == load_study(config).import_
    cpfls.done("report", config, open_folder / "v.h5", "-o", open_folder / "v.md")
    page = (open_folder / "v.md").read_text()
    assert "which the thrust lifts, gives all forces their size" in page
    assert "The values of what the config leaves open are guesses: drag factor, inertia and thrust factor." in page


def test_an_added_mass_is_found_next_to_what_is_shared(cpfls, flights, open_folder):
    config = heavier(flights, open_folder, same_vehicle, "groups.yaml")
    answer = cpfls.summary(
        "vehicle", config, open_folder / "flight.csv", open_folder / "loaded.csv", "-o", open_folder / "g.h5"
    )
    (added,) = (found for found in answer["differences"] if found["name"] == "payload: added mass")
    assert added["low"] < 0.04 < added["high"]
    assert added["value"] == pytest.approx(0.04, rel=0.15)
    cpfls.done("report", config, open_folder / "g.h5", "-o", open_folder / "g.md")
    assert "payload: added mass" in (open_folder / "g.md").read_text()


@pytest.mark.parametrize(
    ("group", "said"),
    [
        ({"name": "p", "flights": ["heavy*"]}, "no training flight belongs to p"),
        ({"name": "p", "flights": ["*"]}, "every flight belongs to a group"),
        ({"name": "p", "flights": ["loaded*"], "differs": ["inerta"]}, "did you mean inertia?"),
    ],
)
def test_groups_that_say_nothing_are_refused(refuse, flights, open_folder, group, said):
    def change(data):
        data["playback"]["groups"] = [group]

    config = heavier(flights, open_folder, change, "bad.yaml")
    (message,) = refuse(
        "vehicle", config, open_folder / "flight.csv", open_folder / "loaded.csv", "-o", open_folder / "x.h5"
    )
    assert said in message
