"""Every option of every command, typed once on a study that states all its numbers."""

import json

import numpy as np
import pytest
import typer

from cpfls_cli.cli.stages import app
from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import resolved_yaml
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.rotors import RotorResponse
from tests.builders.autopilots import found_vehicle
from tests.builders.changed_flights import flight_table, save
from tests.builders.gusty_flights import LARGE
from tests.builders.simulator_files import sdf_of
from tests.builders.spread_vehicles import found_record
from tests.builders.studies import TINY
from tests.builders.vehicle_models import write_vehicle
from tests.builders.vehicle_search import CONFIG, left_out

SETTINGS = {
    "playback": {"search_windows": 20, "folds": 2, "horizon_s": 0.2, "leave_out": left_out(("inertia",))},
    "gap": {"horizon_s": 0.1},
    "import": {
        "time_column": "t",
        "signals": {
            "attitude": {"columns": ["roll", "pitch", "yaw"], "unit": "rad"},
            "body_torque": {"columns": ["mx", "my", "mz"], "unit": "N m"},
        },
    },
}
COMMON = dict.fromkeys(("--json", "--force", "--verbose", "--accept-guesses"), "")
COMMON |= {"--set": "seed=3", "--seed": "4", "--model": "vehicle.h5"}
"""What is typed after the options of a line where the command takes it."""
ALONE = ("--dry-run", "--quiet")
"""Common options that are typed in turn: the first writes nothing, the second prints nothing."""
ELSEWHERE = {("identify", "--scheduler"), ("trend", "--scheduler")}
"""Those that need a scheduler at work, which the tests of `tests/builders/dask_cluster.py` type."""
LEARN = "--validate flight2.h5 --choose-on flight3.h5 --workers 1 --set identification.choice=held-out"
LINES = (
    "look rotors.csv -o look",
    "trajectory study.yaml -o 1.h5 --waypoints points.csv --plot --format px4 --home 47.4,8.5,1",
    "trajectory study.yaml -o 2.h5 --separate com_offset,motor_lag --box 6,6,4 --height 3 --duration 10",
    "trajectory study.yaml -o 3.h5 --hover 4 --repeat 2 --excite roll --signal multisine --band 0.5,4 --size 5",
    "simulate study.yaml path.h5 -o 4.h5 --mode closed-loop --effect com_offset=0.01,0 --gusts --model vehicle.h5",
    "simulate study.yaml 3.h5 -o 16.h5 --autopilot px4",
    "init rotors.csv -o 5.yaml --mass 6 --arm 0.3 --inertia 0.6,0.6,1.2 --thrust-factor 1e-4 --drag-factor 2e-6",
    "init rotors.csv -o 18.yaml --mass 6 --arm 0.3 --scale-to-arm",
    "init -o 19.yaml --from mine.sdf --mass 1.6",
    "import study.yaml log.csv -o 6.h5",
    "reduce study.yaml flight.h5 -o selection.h5",
    f"identify study.yaml flight.h5 -o model.h5 --selection selection.h5 {LEARN} --time-limit 0.001",
    f"identify study.yaml flight.h5 -o model.h5 --selection selection.h5 {LEARN} --resume",
    "vehicle study.yaml flight.h5 -o found.h5 --held-out flight3.h5 --write-config found.yaml --anyway --quick",
    "vehicle study.yaml flight.h5 -o found.h5 --held-out flight3.h5 --resume # nothing to resume",
    "replay study.yaml vehicle flight.h5 -o 8.h5 --horizon 0.2 --every 50 --hold linear",
    "replay study.yaml vehicle.h5 flight.h5 -o 9.h5 --history 0.1 # holds no forecast that uses the past",
    "response study.yaml flight.h5 -o 10.h5 --csv 10.csv",
    "tune study.yaml vehicle.h5 -o 11.h5 --autopilot px4 --flight flight2.h5 --gain-margin 5 --phase-margin 40 "
    "--disk-margin 30",
    "report study.yaml flight.h5 -o 12.md --format md",
    "compare study.yaml flight.h5 flight3.h5 -o gap.h5 --model model.h5",
    "diagnose study.yaml gap.h5 -o 13.h5 --held-out flight2.h5",
    "gap study.yaml flight.h5 -o gap --held-out flight3.h5",
    "trajectory study.yaml -o 14.h5 --for gap/diagnosis.h5 --duration 10 # leaves nothing to separate",
    "extend study.yaml gap/diagnosis.h5 -o 15.h5 # not extended",
    "changed study.yaml flight.h5 -o changed --since flight2.h5 --since flight3.h5 --fail-on-change --anyway",
    "trend study.yaml flight.h5 flight2.h5 flight3.h5 -o trend --reference 2 --order name --workers 1 --anyway",
    "export vehicle.h5 -o 17.c --format c --name quad --anyway",
    "spread vehicle.h5 -o 18.json --count 3 --seed 2 --anyway",
    "info flight.h5",
    "info --format flight",
    "check flight.h5",
    "config study.yaml --section vehicle",
    "effects com_offset",
)
"""In an order in which each finds what it takes; behind a hash what a line is refused with."""


@pytest.fixture(scope="module")
def folder(cpfls, tmp_path_factory):
    """A complete study, with flights, logs, a path and a vehicle that was found."""
    folder = tmp_path_factory.mktemp("options")
    study, path = folder / "study.yaml", folder / "path.h5"
    identification = TINY[TINY.index("reduction:") :]
    text = CONFIG.replace("seed: 1", "seed: 4") + identification
    text = text.replace("trajectory: {", "trajectory: {next_flight: {starts: 1, iterations: 1}, ")
    study.write_text(text + "".join(f"{key}: {json.dumps(own)}\n" for key, own in SETTINGS.items()))
    stated = load_study(study)
    write_vehicle(folder / "vehicle.h5", vehicle_of(stated.vehicle), resolved_yaml(stated))
    time = 0.01 * np.arange(400)
    save(
        folder / "log.csv",
        np.column_stack([time, *(0.1 * np.sin((n + 1) * time) for n in range(6))]),
        "t,roll,pitch,yaw,mx,my,mz",
    )
    save(folder / "rotors.csv", flight_table(1), "t,wx,wy,wz,ax,ay,az,motor_1,motor_2,motor_3,motor_4,volts")
    (folder / "mine.sdf").write_text(sdf_of(LARGE))
    (folder / "points.csv").write_text("x_m,y_m,z_m\n0,0,1\n1,0,1\n1,1,1\n")
    cpfls.done("trajectory", study, "-o", path)
    for number in ("", 2, 3):
        cpfls.made("simulate", study, path, "--seed", number or 1, at=folder / f"flight{number}.h5")
    return folder


def vehicle_of(stated):
    """A vehicle as if it had been found, with gusts, and good for everything."""
    good = found_vehicle(stated)
    model = VehicleModel(vehicle=stated, response=RotorResponse(lag_s=0.03))
    return found_record(model, instruments=good.instruments, responses=good.responses)


def options_of(command):
    """The options that a command offers, each with its names."""
    offered = [one for one in command.params if isinstance(one, typer.core.TyperOption) and not one.hidden]
    return [set(one.opts) for one in offered if one.name != "help"]


EXISTS = {"exists", "--force", "--resume"}
"""Words of which one says what keeps a file that is there."""
COMMANDS = typer.main.get_command(app).commands


def test_every_option_has_a_line():
    typed = {name: {word for line in LINES if line.split()[0] == name for word in line.split()} for name in COMMANDS}
    missing = {
        (name, *options)
        for name, command in COMMANDS.items()
        for options in options_of(command)
        if not options & {*typed[name], *COMMON, *ALONE}
    }
    assert missing == ELSEWHERE


def held(folder):
    """What lies in a folder, and since when."""
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*")}


def test_every_line_is_answered(cpfls, folder, monkeypatch):
    """With all common options at once, and never again without --force; first dry and silent."""
    monkeypatch.chdir(folder)
    wrong, alone = {}, set()
    for line in LINES:
        words, _, refusal = line.partition(" # ")
        name, *words = words.split()
        offered = set().union(*options_of(COMMANDS[name])) - {*words}
        common = [word for option in COMMON if option in offered for word in (option, *COMMON[option].split())]
        dry = ["--force", "--quiet", *(["--dry-run"] if "--dry-run" in offered else [])]
        turns = [common] if name in alone else [dry, common]
        alone.add(name)
        for added in turns:
            before = held(folder)
            result = cpfls(name, *words, *added)
            if bool(result.exit_code) != bool(refusal) or refusal not in result.stderr:
                wrong[name, *words, *added] = result.stderr
            if "--quiet" in added and result.output and not result.exit_code:
                wrong[name, *words, *added] = "is not silent"
            if "--dry-run" in added and held(folder) != before:
                wrong[name, *words, *added] = "has written"
        # The folder of a trend grows from run to run.
        if "-o" in words and "--resume" not in words and not refusal and name != "trend":
            again = cpfls(name, *words)
            if again.exit_code != 2 or not EXISTS & {*again.stderr.split()}:
                wrong[name, *words] = "is done again without --force"
    assert not wrong, wrong
