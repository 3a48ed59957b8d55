"""A log that contradicts itself gets no good verdict: axes, signs, units and numbers that are declared wrong."""

import json
import warnings
from dataclasses import asdict, replace
from html import unescape
from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli import load_model
from cpfls_cli.consistency.findings import Finding
from cpfls_cli.consistency.rotors import meant_unit
from cpfls_cli.flights.models import found_vehicle
from cpfls_cli.result import plain
from cpfls_cli.stages.init import _findings as of_proposal
from cpfls_cli.stages.init import _parted as parted
from tests.builders.closed_loop_flights import COARSE, PERIOD, VEHICLE, flown, signals_of
from tests.builders.command_line import run
from tests.builders.studies import put_file
from tests.builders.vehicle_search import left_out

NOISE = {"body_rate": 0.01, "attitude": 0.003, "velocity": 0.02, "position": 0.005, "rotor_speed": 1.0}
SEARCH = {"search_windows": 20, "folds": 2, "horizon_s": 0.2}
LEARNED = {
    "consequents": "seesaw",
    "products": "additive",
    "membership_functions": 3,
    "base": "rigid-body",
    "population": 4,
    "generations": 1,
    "subpopulations": 1,
    "local_search": {"enabled": False},
    "training_share": 0.6,
    "validation": {"structures": False, "draws": 20, "windows": 20, "horizon_samples": 20},
}
TRIED = ("linear_damping",)
ITS_CONFIG = {"the motion, the rotors are", "which lifts no vehicle"}


class WrongLog(NamedTuple):
    """What is wrong, as settings of a command or as columns of the log, and the words that have to be said of it."""

    settings: tuple[str, ...]
    words: str
    sign: tuple[float, ...] = (1.0, 1.0, 1.0)


REVERSED = [asdict(rotor) | {"spin": -rotor.spin} for rotor in VEHICLE.rotors]
WRONG = {
    "gyroscope mirrored about x": WrongLog((), "opposite signs", (-1.0, 1.0, 1.0)),
    "spins swapped": WrongLog((f"vehicle.rotors={json.dumps(REVERSED)}",), "the motion, the rotors are"),
    "a mass 20 times too large": WrongLog((f"vehicle.mass_kg={20 * VEHICLE.mass_kg}",), "which lifts no vehicle"),
    "ENU declared NED": WrongLog(("import.world_frame=NED",), "the vehicle is upside down on average"),
}


def config_of(folder):
    """Write the config that reads the log rightly."""
    columns = {
        "quaternion": (["qw", "qx", "qy", "qz"], "1"),
        "body_rate": (["p", "q", "r"], "rad/s"),
        "velocity": (["vx", "vy", "vz"], "m/s"),
        "position": (["x", "y", "z"], "m"),
        "rotor_speed": (["w1", "w2", "w3", "w4"], "rad/s"),
    }
    signals = {name: {"columns": names, "unit": unit} for name, (names, unit) in columns.items()}
    study = {
        "vehicle": asdict(VEHICLE),
        "import": {"signals": signals, "torque_source": "rotor-speed"},
        "gap": {"horizon_s": 0.1},
        "identification": LEARNED,
        "playback": {**SEARCH, "leave_out": left_out(TRIED)},
    }
    return put_file(folder / "quad.yaml", json.dumps(study, indent=1))


def log_of(path, seed, sign=(1.0, 1.0, 1.0), duration=8.0):
    """Write a log of a flight with measured rotor speeds; its gyroscope with these signs."""
    logged = flown(duration, seed=seed, noise=NOISE, also=0.05, integration_rate_hz=COARSE).signals
    turned = Rotation.from_euler("ZYX", logged["attitude"][:, ::-1]).as_quat()[:, [3, 0, 1, 2]]
    time = PERIOD * np.arange(len(turned))
    values = np.column_stack(
        [time, turned, logged["body_rate"] * sign, logged["velocity"], logged["position"], logged["rotor_speed"]]
    )
    header = "t,qw,qx,qy,qz,p,q,r,vx,vy,vz,x,y,z,w1,w2,w3,w4"
    np.savetxt(path, values, delimiter=",", header=header, comments="", fmt="%.9g")
    return path


def begins(wrong):
    """Say what the log contradicts: itself, or what the config says of its vehicle."""
    return f"The log contradicts {'its config' if wrong.words in ITS_CONFIG else 'itself'}: "


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Logs by the signs of their gyroscope, and the config that reads the right ones rightly."""
    folder = tmp_path_factory.mktemp("wrong")
    made = {}

    def call(sign):
        if sign not in made:
            made[sign] = [log_of(folder / f"{len(made)}-{number}.csv", number, sign) for number in (1, 2)]
        return config_of(folder), made[sign]

    return call


def asked(wrong):
    return [word for setting in wrong.settings for word in ("--set", setting)]


def output(command, config, *words):
    return run.summary(command, config, *words)


@pytest.mark.parametrize("name", ["gyroscope mirrored about x", "spins swapped"])
def test_gap_names_no_gap_and_no_effect(logs, name, tmp_path):
    wrong = WRONG[name]
    config, (first, second) = logs(wrong.sign)
    answer = output("gap", config, first, "--held-out", second, "-o", tmp_path / "gap", *asked(wrong))
    assert answer["verdict"] == "CONTRADICTED"
    assert wrong.words in answer["contradictions"][0]
    assert answer["effects"] == []
    assert answer["extension"]["written"] is False
    assert answer["disagreement"]["audit"]["contradictions"][0] == answer["contradictions"][0]
    page = unescape((tmp_path / "gap" / "report.html").read_text())
    assert "CONTRADICTED" in page
    assert begins(wrong) in page
    assert wrong.words in page
    assert "Correct what is wrong, in the section" in page


@pytest.mark.parametrize("name", ["gyroscope mirrored about x", "a mass 20 times too large"])
def test_a_vehicle_found_in_it_is_not_to_be_used(logs, name, tmp_path):
    wrong = WRONG[name]
    config, (first, second) = logs(wrong.sign)
    words = (first, "--held-out", second, "-o", tmp_path / "vehicle.h5", "--anyway", *asked(wrong))
    label, sentence = run.done("vehicle", config, *words).stdout.splitlines()[:2]
    assert label.startswith("DO NOT USE: ")
    assert sentence.startswith(f"  Do not use it. {begins(wrong)}{first.name}: ")
    assert wrong.words in sentence
    summary = plain(found_vehicle(tmp_path / "vehicle.h5"))
    assert summary["verdict"] == "do-not-use"
    assert wrong.words in summary["contradictions"][0]


@pytest.mark.parametrize("options", [(), ("--dry-run",), ("-q",)])
def test_vehicle_says_it_and_does_not_search(logs, options, tmp_path):
    wrong = WRONG[next(iter(WRONG))]
    config, (first, _) = logs(wrong.sign)
    result = run("vehicle", config, first, "-o", tmp_path / "v.h5", *options, *asked(wrong))
    assert (result.exit_code, result.stdout) == (2, "")
    first, *_, last = result.stderr.splitlines()
    assert begins(wrong) in first
    assert wrong.words in first
    assert last.endswith("or leave that flight out; --anyway searches all the same.")
    assert not (tmp_path / "v.h5").exists()


@pytest.mark.parametrize(("option", "says"), [((), True), (("-q",), False)])
def test_vehicle_searches_anyway_and_says_it_first(logs, option, says, tmp_path):
    wrong = WRONG[next(iter(WRONG))]
    config, (first, _) = logs(wrong.sign)
    result = run.done(
        "vehicle", config, first, "-o", tmp_path / "v.h5", "--dry-run", "--anyway", *option, *asked(wrong)
    )
    assert (begins(wrong) in result.stderr) is says
    assert (wrong.words in result.stderr) is says


def test_replay_says_it_first(logs, tmp_path):
    wrong = WRONG["ENU declared NED"]
    config, (first, _) = logs(wrong.sign)
    replayed = run.done("replay", config, "vehicle", first, "-o", tmp_path / "r.h5", "--every", "50", *asked(wrong))
    assert replayed.stdout.startswith(f"REPLAY: {begins(wrong)}{first.name}: according to its attitude, {wrong.words}")


def test_a_model_identified_in_it_is_not_to_be_used_and_predict_says_it_first(logs, tmp_path):
    wrong = WRONG["gyroscope mirrored about x"]
    flights = {}
    for name, sign in (("wrong", wrong.sign), ("right", (1.0, 1.0, 1.0))):
        config, (first, _) = logs(sign)
        flight, model = tmp_path / f"{name}.h5", tmp_path / f"{name}-model.h5"
        run.done("import", config, first, "-o", flight)
        verdict = output("identify", config, flight, "-o", model)["verdict"]
        with warnings.catch_warnings(record=True) as noted:
            warnings.simplefilter("always")
            load_model(model, config).predict(flight)
        flights[name] = (verdict, [str(each.message) for each in noted])
    verdict, contradictions = flights["wrong"]
    assert verdict["label"] == "do-not-use"
    assert verdict["reasons"][0]["text"].startswith("the log contradicts itself: wrong.h5: about body x (roll)")
    assert wrong.words in contradictions[0]
    verdict, contradictions = flights["right"]
    assert not any("contradicts" in reason["text"] for reason in verdict["reasons"])
    assert not any(wrong.words in each for each in contradictions)


def test_the_right_log_keeps_its_verdicts(logs, tmp_path):
    config, (first, second) = logs((1.0, 1.0, 1.0))
    gap = output("gap", config, first, "--held-out", second, "-o", tmp_path / "gap")
    assert (gap["verdict"], gap["contradictions"]) == ("NO_GAP", [])
    found = output("vehicle", config, first, "--held-out", second, "-o", tmp_path / "vehicle.h5")
    assert (found["verdict"], found["contradictions"]) == ("good-for-simulation", [])
    replayed = output("replay", config, "vehicle", first, "-o", tmp_path / "replay.h5", "--every", "50")
    assert replayed["contradictions"] == []


@pytest.mark.parametrize("whole", [True, False])
def test_init_reads_the_log_by_what_it_proposes(logs, whole):
    mirrored, right = WRONG["gyroscope mirrored about x"].sign, (1.0, 1.0, 1.0)
    for sign, said in ((mirrored, 1), (right, 0)):
        config, (first, _) = logs(sign)
        assert len(of_proposal(config.read_text(), first, whole=whole)) == said


@pytest.mark.parametrize("command", ["import", "vehicle", "replay", "gap"])
def test_speeds_of_rotors_in_a_unit_in_which_nothing_flies_are_refused(logs, command, tmp_path):
    config, (first, _) = logs((1.0, 1.0, 1.0))
    words = {"replay": ("vehicle", first)}.get(command, (first,))
    result = run(command, config, *words, "-o", tmp_path / "out.h5", "--set", "import.signals.rotor_speed.unit=rpm")
    assert result.exit_code == 2
    assert "import.signals.rotor_speed.unit = rpm: in flight the rotors would carry 0.01" in result.stderr
    assert "rad/s? then it is 1.0" in result.stderr
    assert not (tmp_path / "out.h5").exists()


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(("factor", "meant"), [(1.0, None), (9.549, "rpm"), (1 / 9.549, "rad/s"), (0.159, "Hz")])
def test_the_unit_that_carries_the_vehicle_is_said_where_the_declared_one_does_not(known, factor, meant):
    declared = "rpm" if meant == "rad/s" else "rad/s"
    flight = signals_of(flown(8.0, seed=1, integration_rate_hz=COARSE))
    vehicle = VEHICLE if known else replace(VEHICLE, unknown=("thrust_factor",))
    found = meant_unit(vehicle, factor * flight.rotor_speed, flight.attitude, declared)
    # Small propellers would carry it at nine times the speed, for all that is known of them.
    assert (found and found.unit) == (None if not known and meant == "rpm" else meant)
    # Nothing is known of slow rotors on the ground, nor where no unit does.
    assert meant_unit(vehicle, 1e-4 * flight.rotor_speed, flight.attitude, declared) is None
    if meant in ("rad/s", "Hz"):
        assert meant_unit(vehicle, factor * flight.rotor_speed, 0.001 * flight.attitude, declared) is None


def test_what_contradicts_a_guess_of_init_accuses_the_guess_and_not_the_log():
    ours = Finding("judged by the motion, the rotors are", "check vehicle.rotors and import.body_frame", ("rotors",))
    theirs = Finding("the velocity is in km/h", "check import.signals.velocity", ("velocity",))
    wrong, doubted = parted([ours, theirs], ("vehicle.rotors", "import.body_frame", "import.signals.rotor_command"))
    assert wrong == [theirs.sentence]
    assert doubted == [
        f"vehicle.rotors and import.body_frame are guesses, and one of them is likely wrong: {ours.sentence}"
    ]
    assert parted([ours, theirs], ()) == ([ours.sentence, theirs.sentence], [])
