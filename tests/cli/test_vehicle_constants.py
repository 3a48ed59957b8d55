"""`cpfls vehicle` with constants that nobody knows, and with several configurations, as a user sees it."""

import pytest
import yaml

from cpfls_cli.config.load import load_study
from cpfls_cli.flights.models import found_vehicle
from cpfls_cli.result import plain
from tests.builders.vehicle_search import CONFIG, TRIED, left_out

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
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("constants")


@pytest.fixture(scope="module")
def flights(cpfls, folder):
    """Flights by name; the loaded one is of a vehicle that is 5 % heavier."""
    config, made = folder / "flown.yaml", {}
    config.write_text(CONFIG)
    for name, direction, mass in (("flight", "[-0.3, 1.0, 0.4]", 0.8), ("loaded", "[1.0, -0.7, 0.3]", 0.84)):
        plan, made[name] = folder / f"{name}-path.h5", folder / f"{name}.h5"
        words = ("--set", "trajectory.path=straight", "--set", f"trajectory.direction={direction}")
        heavy = ("--set", f"vehicle.mass_kg={mass}")
        cpfls.done("trajectory", config, "-o", plan, *words, *heavy)
        cpfls.done("simulate", config, plan, "-o", made[name], *heavy)
    return made


def written(folder, name, change):
    data = yaml.safe_load(CONFIG) | {"playback": dict(SEARCH)}
    change(data)
    path = folder / name
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return path


def open_constants(data):
    data["vehicle"]["inertia_kg_m2"] = None
    for rotor in data["vehicle"]["rotors"]:
        rotor |= {"thrust_factor_n_s2": None, "drag_factor_n_m_s2": None}


@pytest.fixture(scope="module")
def unknown(folder):
    return written(folder, "unknown.yaml", open_constants)


def same_vehicle(data):
    data["playback"]["groups"] = [{"name": "payload", "flights": ["loaded*"], "differs": ["mass"]}]


def test_what_is_null_is_a_guess_that_is_named(unknown):
    vehicle = load_study(unknown).vehicle
    assert set(vehicle.unknown) == {"thrust_factor", "drag_factor", "inertia"}
    assert all(moment > 0 for moment in vehicle.inertia_kg_m2)


@pytest.mark.parametrize("command", ["identify", "gap", "diagnose"])
def test_other_commands_refuse_a_guess(refuse, unknown, flights, folder, command):
    (message,) = refuse(command, unknown, flights["flight"], "-o", folder / "x.h5")
    assert "vehicle.inertia_kg_m2" in message
    assert "--model VEHICLE.h5 takes the numbers that `cpfls vehicle` found, --accept-guesses those" in message


def test_a_torque_of_unknown_rotors_is_refused(refuse, folder):
    def change(data):
        open_constants(data)
        data["import"] = {
            "torque_source": "rotor-speed",
            "signals": {"rotor_speed": {"columns": ["a", "b", "c", "d"], "unit": "rad/s"}},
        }

    log = folder / "log.csv"
    log.write_text("t,a,b,c,d\n0,1,1,1,1\n")
    (message,) = refuse("import", written(folder, "torque.yaml", change), log, "-o", folder / "x.h5")
    assert message.startswith("import.torque_source = rotor-speed: needs vehicle.")


def heavier(flights, folder, change, name):
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
        np.savetxt(folder / f"{own}.csv", table, delimiter=",", header=",".join(names), comments="", fmt="%.9g")

    def whole(data):
        change(data)
        data["import"] = {"torque_source": None, "signals": mapped}

    return written(folder, name, whole)


def test_constants_are_found_and_written_into_a_config(cpfls, flights, folder):
    config = heavier(flights, folder, open_constants, "logs.yaml")
    copy = folder / "found.yaml"
    words = ("vehicle", config, folder / "flight.csv", "-o", folder / "v.h5", "--write-config", copy)
    result = cpfls.done(*words)
    assert f"{copy}: written, the config with these constants" in result.stdout
    parameters = plain(found_vehicle(folder / "v.h5"))["parameters"]
    assert set(parameters) == KEYS
    told = {"value", "unit", "low", "high", "stated", "determined", "reason", "possible"}
    assert set(parameters["motor_lag_s"]) == told
    thrust = parameters["rotors.thrust_factor_n_s2"]
    stated = yaml.safe_load(CONFIG)["vehicle"]["rotors"][0]["thrust_factor_n_s2"]
    assert thrust["low"] < thrust["value"] < thrust["high"]
    assert thrust["value"] == pytest.approx(float(stated), rel=0.02)
    assert load_study(copy).vehicle.rotors[0].thrust_factor_n_s2 == pytest.approx(thrust["value"], rel=1e-5)
    assert load_study(copy).import_ == load_study(config).import_
    cpfls.done("report", config, folder / "v.h5", "-o", folder / "v.md")
    page = (folder / "v.md").read_text()
    assert "which the thrust lifts, gives all forces their size" in page
    assert "The values of what the config leaves open are guesses: drag factor, inertia and thrust factor." in page


def test_an_added_mass_is_found_beside_what_is_shared(cpfls, flights, folder):
    config = heavier(flights, folder, same_vehicle, "groups.yaml")
    told = cpfls.told("vehicle", config, folder / "flight.csv", folder / "loaded.csv", "-o", folder / "g.h5")
    (added,) = (found for found in told["differences"] if found["name"] == "payload: added mass")
    assert added["low"] < 0.04 < added["high"]
    assert added["value"] == pytest.approx(0.04, rel=0.15)
    cpfls.done("report", config, folder / "g.h5", "-o", folder / "g.md")
    assert "payload: added mass" in (folder / "g.md").read_text()


@pytest.mark.parametrize(
    ("group", "said"),
    [
        ({"name": "p", "flights": ["heavy*"]}, "no training flight belongs to p"),
        ({"name": "p", "flights": ["*"]}, "every flight belongs to a group"),
        ({"name": "p", "flights": ["loaded*"], "differs": ["inerta"]}, "did you mean inertia?"),
    ],
)
def test_groups_that_say_nothing_are_refused(refuse, flights, folder, group, said):
    def change(data):
        data["playback"]["groups"] = [group]

    config = heavier(flights, folder, change, "bad.yaml")
    (message,) = refuse("vehicle", config, folder / "flight.csv", folder / "loaded.csv", "-o", folder / "x.h5")
    assert said in message
