"""A whole vehicle flies, predicts and is compared: nothing of its model is left out on the way."""

import json
import warnings
from dataclasses import asdict, replace

import h5py
import numpy as np
import pytest

import cpfls_cli
from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import resolved_yaml
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.results import Flight
from cpfls_cli.playback.gusts import Gusts
from cpfls_cli.playback.model import ModelEffect
from cpfls_cli.playback.player import Observer
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.rotations import body_torque
from cpfls_cli.simulation.model import Simulated
from cpfls_cli.store import read
from tests.builders.artifacts import edited
from tests.builders.exported_vehicles import on_numpy
from tests.builders.playback_flights import STATED, truth
from tests.builders.vehicle_models import remainder, thrust_curve, vehicle_of, write_vehicle
from tests.builders.vehicles import OPEN_FACTORS

CONFIG = f"""\
seed: 1
vehicle: {json.dumps(asdict(STATED))}
trajectory:
  path: straight
  direction: [1.0, -0.7, 0.3]
  legs: 2
  displacement_m: 3.0
  period_s: 0.17
  sample_time_s: 0.01
  duration_s: 8.0
  yaw_turn_rad: 2.0
simulation: {{closed_loop: {{integration_rate_hz: 200.0}}}}
gap: {{horizon_s: 0.1}}
"""
RESPONSE = RotorResponse(delay_s=0.013, lag_s=0.02, slow_roll_pitch=-0.3, slow_yaw=0.4, slow_s=0.3)
# Reaction and flapping are the smallest parts of a gentle flight.
WHOLE = replace(
    truth(),
    response=RESPONSE,
    effects=(*truth().effects, ModelEffect("rotor_acceleration", {}, np.array([6e-6])), thrust_curve(0.1)),
    remainder=remainder(1, rows=(0, 1, 5), size=1e-5),
)
NOISE = {"attitude": 0.002, "body_rate": 0.01, "velocity": 0.01, "position": 0.002, "rotor_speed": 1.0}
BRIEF = ("--horizon", "0.2", "--every", "5")
SIGNALS = ("body_rate", "attitude", "velocity", "position")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("whole")


@pytest.fixture(scope="module")
def config(folder):
    (folder / "quad.yaml").write_text(CONFIG)
    return folder / "quad.yaml"


@pytest.fixture(scope="module")
def written(config, folder):
    """Write the file of a vehicle model, as if it had been found in flights of the config's vehicle."""

    def call(name, model=WHOLE, **changed):
        write_vehicle(folder / name, vehicle_of(model, **changed), resolved_yaml(load_study(config)))
        return folder / name

    return call


@pytest.fixture(scope="module")
def vehicle(written):
    return written("vehicle.h5")


@pytest.fixture(scope="module")
def path(cpfls, config, folder):
    cpfls.done("trajectory", config, "-o", folder / "path.h5")
    return folder / "path.h5"


@pytest.fixture(scope="module")
def fly(cpfls, config, path, folder):
    def call(name, model, *options):
        cpfls.done("simulate", config, path, "--model", model, "-o", folder / name, *options)
        return folder / name

    return call


@pytest.fixture(scope="module")
def flight(fly, vehicle):
    """Without noise."""
    return fly("flight.h5", vehicle)


@pytest.fixture(scope="module")
def noisy(fly, vehicle):
    return fly("noisy.h5", vehicle, "--mode", "closed-loop", "--set", f"simulation.noise={json.dumps(NOISE)}")


@pytest.fixture(scope="module")
def sums(cpfls, config, folder):
    """Play a model back along a flight: sums of the mean errors, by prediction and signal."""

    def call(model, flown, *options):
        words = ("replay", config, model, flown, "-o", folder / "r.h5", *BRIEF, "--force", "--json", *options)
        models = json.loads(cpfls.done(*words).stdout)["models"]
        return {name: np.array([models[name][signal]["sum"] for signal in SIGNALS]) for name in models}

    return call


@pytest.fixture(scope="module")
def own(sums, vehicle, flight):
    """The model that flew, played back along its flight."""
    return sums(vehicle, flight)


def test_a_flown_vehicle_is_played_back_by_its_own_model(own):
    assert (own["model"] < 0.005 * np.minimum(own["nothing-moves"], own["rate-stays"])).all()
    assert (own["model"] < 0.005 * own["stated"]).all()


def response(**changed):
    return replace(WHOLE, response=replace(RESPONSE, **changed))


WITHOUT = {
    "delay": response(delay_s=0.0),
    "lag": response(lag_s=0.0),
    "slow roll and pitch": response(slow_roll_pitch=0.0),
    "slow yaw": response(slow_yaw=0.0),
    "time of slow actuation": response(slow_s=0.1),
    "remainder": replace(WHOLE, remainder=None),
    **{one.name: replace(WHOLE, effects=tuple(e for e in WHOLE.effects if e is not one)) for one in WHOLE.effects},
}


@pytest.mark.parametrize("part", WITHOUT)
def test_every_part_of_the_model_flies(sums, written, own, flight, part):
    """A model that lacks a part does not play the flight back."""
    assert (sums(written("lacking.h5", WITHOUT[part]), flight)["model"] / own["model"]).max() > 4


def test_a_vehicle_found_from_commands_flies_from_commands(sums, fly, written):
    commanded = written("commanded.h5", replace(WHOLE, commanded=True))
    flown = fly("commanded-flight.h5", commanded)
    record = read(flown, Simulated)[0]
    assert record.rotor_speed is None
    assert {"motor_lag.time_constant_s": 0.02, "command_delay.delay_s": 0.013}.items() <= record.effects.items()
    errors = sums(commanded, flown, "--hold", "linear", "--horizon", "0.5")
    assert (errors["model"] < 0.005 * np.minimum(errors["nothing-moves"], errors["rate-stays"])).all()


def test_people_read_what_was_flown(cpfls, config, path, vehicle, tmp_path):
    top = ("--mode", "closed-loop", "--effect", "torque_bias.M_z=0.01")
    result = cpfls.done("simulate", config, path, "--model", vehicle, *top, "-o", tmp_path / "f.h5")
    assert "effects, those of the model among them: linear_damping.d_x = " in result.stdout
    assert "torque_bias.M_z = 0.01" in result.stdout
    assert "with vehicle.h5" in result.stdout


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--mode", "inverse"), "{model}: no model is flown in mode inverse; "),
        (("--set", "vehicle.mass_kg=0.9"), "{model}: was made with another vehicle; these differ: vehicle.mass_kg"),
        (
            ("--mode", "closed-loop", "--effect", "rotor_drag=1e-4"),
            "simulation.closed_loop.effects.rotor_drag = [0.0001]: the model has it already: k_d = ",
        ),
    ],
)
def test_what_cannot_be_flown_is_refused(refuse, config, path, vehicle, tmp_path, options, message):
    (line,) = refuse("simulate", config, path, "--model", vehicle, "-o", tmp_path / "x.h5", *options)
    assert line.startswith(message.format(model=vehicle))


def test_a_vehicle_with_more_than_its_table_is_evaluated_whole(cpfls, config, path, flight, written, tmp_path):
    # No polynomial of velocity and rotor speeds: evaluated along the motion, and by itself in a simulation.
    blown = ModelEffect("wind", {}, np.array([1e-5, 2e-5, 0.0]))
    model = written("more.h5", model=replace(WHOLE, effects=(*WHOLE.effects, blown)))
    for command, given in {
        "simulate": (path, "--model", model),
        "compare": (flight, "--model", model),
        "replay": (model, flight),
        "response": (flight, "--model", model),
    }.items():
        result = cpfls(command, config, *given, "-o", tmp_path / f"{command}.h5")
        assert result.exit_code == 0, (command, result.stderr)


def test_torque_and_force_are_what_the_motion_takes(vehicle, flight):
    found = cpfls_cli.load_model(vehicle).predict(flight)
    assert found.score.r2_body.min() > 0.999
    assert (found.force_rms < 1e-3 * found.measured_force.std(axis=0)).all()
    assert np.diag(found.inertia[0]) == pytest.approx(WHOLE.vehicle.inertia_kg_m2, rel=0.01)


def without(flown, target, *names):
    """Copy a flight without some of its signals."""
    with h5py.File(flown) as source, edited(target, "w") as file:
        file.attrs.update(source.attrs)
        for name in source:
            if name not in names:
                source.copy(name, file)
    return target


@pytest.mark.parametrize(
    ("names", "lacks"),
    [
        (("velocity",), "x.h5: lacks velocity, which the model of the whole vehicle needs"),
        (("rotor_speed", "rotor_command"), "x.h5: lacks rotor speed, which the model of the whole vehicle needs"),
    ],
)
def test_a_flight_that_lacks_what_the_model_needs_is_refused(refuse, config, vehicle, flight, tmp_path, names, lacks):
    flown = without(flight, tmp_path / "x.h5", *names)
    assert refuse("compare", config, flown, "--model", vehicle, "-o", tmp_path / "out.h5") == [lacks]
    with pytest.raises(InputError, match=lacks):
        cpfls_cli.load_model(vehicle).predict(flown)


@pytest.fixture
def written_log(flight, tmp_path):
    """Write what a flight measured as a log, and give the settings that import it."""

    def call(**more):
        flown = read(flight, Flight)[0]
        columns = {
            "attitude": ("rad", flown.attitude),
            "body_rate": ("rad/s", flown.body_rate),
            "velocity": ("m/s", flown.velocity),
            "rotor_speed": ("rad/s", flown.rotor_speed),
            **more,
        }
        names = {signal: [f"{signal}{k}" for k in range(values.shape[1])] for signal, (_, values) in columns.items()}
        table = np.column_stack([flown.time, *(values for _, values in columns.values())])
        header = ",".join(["t", *(name for listed in names.values() for name in listed)])
        np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=header, comments="")
        signals = {signal: {"columns": names[signal], "unit": unit} for signal, (unit, _) in columns.items()}
        return tmp_path / "log.csv", {"time_column": "t", "signals": signals}

    return call


def test_a_torque_that_was_logged_is_what_a_prediction_is_held_against(
    cpfls, config, vehicle, flight, written_log, tmp_path
):
    """A log of the true torque, which no rotor of the config shows, next to the measured rotor speeds."""
    torque = cpfls_cli.load_model(vehicle).predict(flight).body_torque
    log, settings = written_log(body_torque=("N m", torque))
    settings["torque_source"] = "column"
    cpfls.done("import", config, log, "-o", tmp_path / "log.h5", *("--set", f"import={json.dumps(settings)}"))
    with warnings.catch_warnings(action="ignore"):
        held = cpfls_cli.load_model(vehicle).predict(tmp_path / "log.h5")
    np.testing.assert_allclose(body_torque(held.attitude, held.measured_torque), torque, atol=1e-6)
    assert np.abs(held.error[5:-5]).max() < 1e-3 * np.abs(held.torque).max()


def gap(cpfls, config, output, *words):
    return np.array(cpfls.summary("compare", config, *words, "-o", output)["gap"]["floors"])


def test_the_true_vehicle_leaves_noise_alone(cpfls, refuse, config, vehicle, flight, noisy, tmp_path):
    """Behind a lag the noise of the speeds is slower than a floor counts on: a little more than one is noise too."""
    exact = gap(cpfls, config, tmp_path / "exact.h5", flight, "--model", vehicle)
    true = gap(cpfls, config, tmp_path / "true.h5", noisy, "--model", vehicle)
    stated = gap(cpfls, config, tmp_path / "stated.h5", noisy)
    assert (exact < 1).all()
    assert ((true > 0.7) & (true < 1.5)).all()
    assert (stated > 3 * true).all()
    (line,) = refuse("diagnose", config, tmp_path / "true.h5", "-o", tmp_path / "d.h5")
    assert line.startswith(f"{tmp_path / 'true.h5'}: was made with a model that has effects already")


@pytest.fixture
def open_config(tmp_path, written_log):
    """Leave inertia and the factors of the rotors open; give the config and a log."""
    log, settings = written_log()
    settings["torque_source"] = None
    rotors = [asdict(rotor) | OPEN_FACTORS for rotor in STATED.rotors]
    stated = {**asdict(STATED), "inertia_kg_m2": None, "rotors": rotors}
    (tmp_path / "open.yaml").write_text(json.dumps({"seed": 1, "vehicle": stated, "import": settings}))
    return tmp_path / "open.yaml", log


def test_a_config_may_leave_open_what_the_model_knows(cpfls, config, path, open_config, tmp_path):
    left_open, log = open_config
    vehicle = write_vehicle(tmp_path / "vehicle.h5", vehicle_of(WHOLE), resolved_yaml(load_study(left_open)))
    cpfls.done("import", left_open, log, "-o", tmp_path / "f.h5")
    with warnings.catch_warnings(action="ignore"):
        assert cpfls_cli.load_model(vehicle, left_open).predict(tmp_path / "f.h5").score.r2_body.min() > 0.999
    assert (gap(cpfls, left_open, tmp_path / "gap.h5", log, "--model", vehicle) < 1).all()
    # An autopilot needs numbers, and the model is of the vehicle that they were left open of.
    cpfls.done("simulate", config, path, "--model", vehicle, "-o", tmp_path / "flown.h5")


@pytest.mark.parametrize("command", ["compare", "replay", "response"])
def test_what_a_config_leaves_open_is_no_fact_for_another_model(refuse, open_config, tmp_path, command):
    left_open, log = open_config
    words = ("vehicle", log) if command == "replay" else (log,)
    (line,) = refuse(command, left_open, *words, "-o", tmp_path / "x.h5")
    assert f"not known in this config, but `cpfls {command}` needs what is null there" in line


@pytest.fixture(scope="module")
def gusty(written):
    gusts = Gusts(np.array([0.02, 0.03, 0.01, 0.2, 0.2, 0.2]), np.array([0.3, 1.0, 0.5, 1.0, 1.0, 1.0]))
    return written("gusty.h5", replace(WHOLE, gusts=gusts))


def test_gusts_of_a_model_are_played_where_they_are_asked_for(cpfls, config, path, folder, gusty, vehicle):
    def flown(name, *options, model=gusty):
        slow = ("--set", "simulation.closed_loop.integration_rate_hz=100")
        result = cpfls.done("simulate", config, path, "--model", model, "-o", folder / name, *slow, *options)
        return (folder / name).read_bytes(), read(folder / name, Flight)[0].body_rate, result.stdout

    once, shaken, said = flown("shaken.h5", "--gusts")
    again, _, _ = flown("again.h5", "--gusts")
    other, _, _ = flown("other-shaken.h5", "--gusts", "--set", "seed=2")
    _, still, calm = flown("calm.h5")
    _, before, nothing = flown("calm-known.h5", model=vehicle)
    assert once == again != other
    np.testing.assert_array_equal(still, before)
    assert np.abs(shaken - still).max() > 0.1
    assert "--gusts plays them" in calm
    assert "gusts" not in said + nothing


def test_gusts_that_nobody_knows_are_refused(refuse, config, path, folder, vehicle):
    for words in (("--model", vehicle), ()):
        (message,) = refuse("simulate", config, path, "--gusts", *words, "-o", folder / "x.h5")
        assert "simulation.closed_loop.gusts = true: no gusts are known; give --model" in message
    (message,) = refuse(
        "simulate", config, path, "--mode", "inverse", "--set", "simulation.closed_loop.gusts=true", "-o", folder / "x"
    )
    assert "gusts are flown in closed loop only" in message


def test_gusts_are_said_by_info_and_exported(cpfls, gusty, folder):
    held = cpfls.summary("info", gusty)["result"]["model"]["gusts"]
    assert held["size"] == [0.02, 0.03, 0.01, 0.2, 0.2, 0.2]
    cpfls.done("export", gusty, "-o", folder / "gusty.json")
    exported = json.loads((folder / "gusty.json").read_text())
    assert exported["gusts"]["torque_n_m"] == held["size"][:3]
    assert exported["gusts"]["force_memory_s"] == held["memory"][3:] == [1.0, 1.0, 1.0]
    assert "x = k x" in exported["gusts"]["how_to_play"]


def test_code_holds_gusts_and_says_how_to_play_them(cpfls, gusty, folder):
    """The recipe keeps the size, and after its memory 37 % of a gust."""
    for form, file in (("jax", "gusty.py"), ("c", "gusty.c")):
        cpfls.done("export", gusty, "--format", form, "-o", folder / file, "--force")
        assert "x = k x + size sqrt(1 - k^2) n" in " ".join((folder / file).read_text().replace("#", "").split())
    assert "_GUST_SIZE {0.02, 0.03, 0.01, 0.2, 0.2, 0.2}" in (folder / "gusty.h").read_text()
    module = on_numpy((folder / "gusty.py").read_text())
    size, memory, h = module["GUST_SIZE"][0], module["GUST_MEMORY"][0], 0.01
    k, rng = np.exp(-h / memory), np.random.default_rng(1)
    x, seen = size * rng.standard_normal(), []
    for n in rng.standard_normal(40_000).tolist():
        x = k * x + size * (1 - k**2) ** 0.5 * n
        seen.append(x)
    assert np.std(seen) == pytest.approx(size, rel=0.07)
    late = round(memory / h)
    assert np.mean(np.multiply(seen[late:], seen[:-late])) == pytest.approx(size**2 / np.e, rel=0.2)


def test_a_replay_uses_the_past_where_a_vehicle_holds_an_observer(
    cpfls, refuse, config, written, noisy, vehicle, tmp_path
):
    history = Observer(past_s=0.5, rate=np.full(6, 20.0), memory_s=np.full(6, 0.2))
    model, summary = written("remembers.h5", history=history), []
    for options in ((), ("--history", "0.5")):
        output = tmp_path / f"{len(summary)}.h5"
        result = cpfls.done("replay", config, model, noisy, "-o", output, "--every", "20", "--json", *options)
        cpfls.done("check", output)
        summary.append(json.loads(result.stdout))
    without, known = summary
    assert [each["history_s"] for each in summary] == [0.0, 0.5]
    assert without["windows"] == known["windows"]
    assert known["models"]["model"] != without["models"]["model"]
    assert known["models"]["stated"] == without["models"]["stated"]
    assert any("3 of" in each and "use what past there is" in each for each in known["warnings"])
    (message,) = refuse("replay", config, vehicle, noisy, "--history", "0.5", "-o", tmp_path / "x.h5")
    assert "vehicle.h5: holds no forecast that uses the past" in message
    (message,) = refuse("replay", config, model, noisy, "--history", "0.001", "-o", tmp_path / "x.h5")
    assert message.startswith("--history 0.001 s is shorter than a sample of noisy.h5")
