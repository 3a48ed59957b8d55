"""What each command shows on a terminal of 80 columns and 24 lines, and how wide its tables are where there is none."""

import shlex
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import pytest
import typer
import yaml

from cpfls_cli.cli import terminal
from cpfls_cli.cli.stages import app
from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import resolved_yaml
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.content import Table, unfolded
from cpfls_cli.report.terminal import terminal_lines
from tests.builders.autopilots import STUDY, found_vehicle
from tests.builders.changed_flights import write_flights
from tests.builders.shifted_flights import CONFIG, OFFSET, flight_table, save
from tests.builders.spread_vehicles import found_record
from tests.builders.studies import VEHICLE, put_file
from tests.builders.unknown_logs import flat_log, flight, write_csv
from tests.builders.vehicle_models import vehicle_of, write_vehicle
from tests.builders.vehicles import OPEN_FACTORS

COLUMNS, LINES, ANSWER, WIDEST = 80, 24, 15, 100
COARSE = ("--set", "simulation.closed_loop.integration_rate_hz=100")
"""What a screen says hangs on no step of an integration."""
WHOLE = ("config",)
"""Prints a file, to be written into one."""


def rows(text):
    """Count lines as a terminal breaks them."""
    return sum(max(1, -(-len(line) // COLUMNS)) for line in text.splitlines())


@pytest.fixture(scope="session")
def screens(cpfls, pipeline, study, tmp_path_factory):
    """Run every command as on a terminal; give what it showed, and its outcome, by the name of the run."""
    folder = tmp_path_factory.mktemp("screens")
    shown = {}

    def show(name, command, *words, output=None):
        options = () if output is None else ("-o", output)
        summary = []

        def tell(outcome, common):
            summary.append(outcome)
            terminal.tell(outcome, common)

        with (
            patch("cpfls_cli.cli.stages.tell", tell),
            patch.object(terminal, "_columns", lambda *_: COLUMNS),
            pytest.MonkeyPatch.context() as environment,
        ):
            environment.setenv("NO_COLOR", "1")
            environment.chdir(folder)
            result = cpfls(command, *words, *options)
        assert summary, result.output
        shown[name] = SimpleNamespace(command=command, result=result, outcome=summary[0], folder=folder)

    for source in (study, *pipeline.paths.values()):
        # Names as short as people's: a command is as long as the names in it.
        shutil.copy(source, folder)
    _of_torque(show)
    _of_gaps(show, folder)
    _of_changes(show, folder)
    _of_logs(show, folder)
    _of_open_numbers(show, folder)
    _of_autopilots(show, folder)
    return shown


def _of_torque(show):
    quick = ("--set", "trajectory.sample_time_s=0.02")
    show("trajectory", "trajectory", "tiny.yaml", output="path.h5")
    excited = ("--hover", "20", "--excite", "roll,pitch", "--repeat", "2")
    show("mission", "trajectory", "tiny.yaml", *excited, *quick, output="mission.h5")
    show("simulate", "simulate", "tiny.yaml", "path.h5", output="other.h5")
    show("reduce", "reduce", "tiny.yaml", "flight.h5", output="few.h5")
    show("identify", "identify", "tiny.yaml", "flight.h5", "--validate", "other.h5", output="found.h5")
    show("response", "response", "tiny.yaml", "flight.h5", output="response.h5")
    show("replay", "replay", "tiny.yaml", "model.h5", "flight.h5", output="replay.h5")
    show("report", "report", "tiny.yaml", "model.h5", output="report.md")
    show("export", "export", "model.h5", output="model.json")
    for name in ("flight", "selection"):
        show(f"info {name}", "info", f"{name}.h5")
    show("check", "check", "model.h5")
    show("effects", "effects")
    for effect in ("payload", "flexible_mount", "linear_damping"):
        show(f"effect {effect}", "effects", effect)


def _of_gaps(show, folder):
    put_file(folder / "gap.yaml", CONFIG + VEHICLE)
    flights = [save(folder / f"flight_{number}.csv", flight_table(number, OFFSET)) for number in (1, 2, 3)]
    exact = save(folder / "exact.csv", flight_table(4))
    show("compare", "compare", "gap.yaml", *(each.name for each in flights), output="disagreement.h5")
    show("diagnose", "diagnose", "gap.yaml", "disagreement.h5", output="diagnosis.h5")
    show("extend", "extend", "gap.yaml", "diagnosis.h5", output="extended.h5")
    show("gap", "gap", "gap.yaml", *(each.name for each in flights), output="gap")
    show("gap of nothing", "gap", "gap.yaml", exact.name, output="nothing")
    show("info diagnosis", "info", "diagnosis.h5")
    show("response of a model", "response", "gap.yaml", flights[0].name, "--model", "extended.h5", output="answer.h5")


def _of_changes(show, folder):
    own = folder / "own"
    own.mkdir(exist_ok=True)
    write_flights(own)
    before = [f"own/before{number}.csv" for number in range(1, 5)]
    show("changed", "changed", "own/study.yaml", "own/weak1.csv", "--since", *before, output="changed")
    show("not changed", "changed", "own/study.yaml", "own/same.csv", "--since", *before, output="unchanged")
    show("trend", "trend", "own/study.yaml", *before, "own/weak1.csv", "--order", "given", output="trend")


def _of_logs(show, folder):
    logs = [write_csv(folder / f"log{number}.csv", flat_log(flight(seconds=20.0, seed=number))) for number in (1, 2, 3)]
    names = [log.name for log in logs]
    show("init", "init", *names, "--mass", "0.8", "--arm", "0.16", output="found.yaml")
    show("init of one", "init", names[0], output="asked.yaml")
    show("import", "import", "found.yaml", names[0], output="log1.h5")


def _of_autopilots(show, folder):
    (folder / "cross.yaml").write_text(STUDY)
    write_vehicle(folder / "cross.h5", found_vehicle(), STUDY)
    show("tune", "tune", "cross.yaml", "cross.h5", "--autopilot", "px4", output="gains.h5")
    write_vehicle(folder / "several.h5", found_record())
    show("spread", "spread", "several.h5", "-n", "20", output="spread.json")


def _of_open_numbers(show, folder):
    """Show what goes on from a vehicle whose config leaves its numbers open: they are guessed, or were found."""
    config, data = folder / "open.yaml", yaml.safe_load(CONFIG + VEHICLE)
    study = load_study(folder / "gap.yaml")
    (folder / "own").mkdir(exist_ok=True)
    write_vehicle(folder / "own" / "vehicle.h5", vehicle_of(VehicleModel(vehicle=study.vehicle)), resolved_yaml(study))
    wide = VehicleModel(vehicle=replace(study.vehicle, inertia_kg_m2=(3.0, 0.6, 1.2)))
    write_vehicle(folder / "own" / "wide.h5", vehicle_of(wide), resolved_yaml(study))
    data["vehicle"]["inertia_kg_m2"] = None
    for rotor in data["vehicle"]["rotors"]:
        rotor |= OPEN_FACTORS
    config.write_text(yaml.safe_dump(data))
    show("open: trajectory", "trajectory", "open.yaml", output="open-path.h5")
    guesses, model = ("--accept-guesses",), ("--model", "own/vehicle.h5")
    show("guessed: trajectory", "trajectory", "open.yaml", *guesses, output="guessed-path.h5")
    show("guessed: simulate", "simulate", "open.yaml", "open-path.h5", *guesses, *COARSE, output="guessed-flight.h5")
    show("guessed: compare", "compare", "open.yaml", "flight_1.csv", *guesses, output="guessed-compared.h5")
    show("guessed: gap", "gap", "open.yaml", "flight_1.csv", *guesses, output="guessed-gap")
    show("found: compare", "compare", "open.yaml", "flight_1.csv", *model, output="found-compared.h5")
    show("found: response", "response", "open.yaml", "flight_1.csv", *model, output="found-response.h5")
    show("found: diagnose", "diagnose", "open.yaml", "found-compared.h5", *model, output="found-named.h5")
    show("wide: compare", "compare", "open.yaml", "flight_1.csv", "--model", "own/wide.h5", output="wide-compared.h5")


NAMES = (
    *("trajectory", "mission", "simulate", "reduce", "identify", "response"),
    *("info flight", "info selection", "info diagnosis", "check", "effects", "effect payload", "effect flexible_mount"),
    *("effect linear_damping", "compare", "diagnose", "extend", "gap", "gap of nothing", "response of a model"),
    *("changed", "not changed", "trend", "tune"),
    *("init", "init of one", "import"),
)
"""Runs by name."""
OF_MODELS = ("replay", "report", "export", "spread")
"""Of these the words are held next to their flights."""
OF_OPEN_NUMBERS = (
    *("open: trajectory", "guessed: trajectory", "guessed: simulate", "guessed: compare", "guessed: gap"),
    *("found: compare", "found: response", "found: diagnose", "wide: compare"),
)


@pytest.mark.parametrize("name", NAMES)
def test_the_first_screen_holds_the_answer(screens, name):
    result, outcome = screens[name].result, screens[name].outcome
    assert rows(result.stdout) + rows(result.stderr) <= LINES, result.output
    answer, *_ = result.stdout.partition("\nmore with -v: ")
    assert rows(answer) <= ANSWER, result.stdout
    assert max(map(len, result.stdout.splitlines())) <= COLUMNS or outcome.next


@pytest.mark.parametrize("name", NAMES)
def test_the_next_command_is_whole(screens, name):
    result, outcome = screens[name].result, screens[name].outcome
    printed = [line.strip() for line in result.stdout.partition("next:\n")[2].splitlines() if line.startswith("  ")]
    assert [shlex.split(line) for line in printed] == [[str(word) for word in command] for command in outcome.next]
    # A config that asks for something is refused by every command.
    assert bool(printed) == (name != "init of one")
    assert all(line.startswith("cpfls ") and "CONFIG" not in line and "FLIGHT" not in line for line in printed)


@pytest.mark.parametrize("name", [*NAMES, *OF_MODELS, *OF_OPEN_NUMBERS])
def test_the_next_command_is_accepted_where_it_was_printed(cpfls, screens, name, monkeypatch):
    shown = screens[name]
    monkeypatch.chdir(shown.folder)
    for number, command in enumerate(shown.outcome.next):
        words = [str(word) for word in command[1:]]
        if any("ASK" in Path(word).read_text() for word in words if word.endswith(".yaml") and Path(word).exists()):
            continue
        # What a later command reads is made; all else is only checked, as if it was not there yet.
        output = words.index("-o") + 1 if "-o" in words else None
        made = output and any(words[output] in map(str, later) for later in shown.outcome.next[number + 1 :])
        if output and not made:
            words[output] = str(Path("next", words[output]))
            Path(words[output]).parent.mkdir(parents=True, exist_ok=True)
        cpfls.done(*words, *(["--force"] if made else ["--dry-run"]))


@pytest.mark.parametrize("name", [*NAMES, *OF_MODELS])
def test_no_table_is_wider_than_people_read(screens, name):
    tables = [block for block in unfolded(screens[name].outcome.blocks) if isinstance(block, Table)]
    lines = [line for table in tables for line in terminal_lines([_without_caption(table)])]
    assert max(map(len, lines), default=0) <= WIDEST


def _without_caption(table):
    return Table(table.name, "", table.header, table.rows, table.words, table.sentences)


def test_every_command_is_shown(screens):
    commands = set(typer.main.get_command(app).commands)
    # The lines of `look` are counted in test_look.py.
    assert {each.command for each in screens.values()} >= commands - {*WHOLE, "vehicle", "look"}
    assert set(screens) == {*NAMES, *OF_MODELS, *OF_OPEN_NUMBERS}
