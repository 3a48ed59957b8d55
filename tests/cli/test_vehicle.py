"""`cpfls vehicle`: what it writes and prints of a vehicle found in flights, and what it refuses."""

import json
import os
import shutil
import signal
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from cpfls_cli.config.load import load_study, read_config
from cpfls_cli.flights.models import found_vehicle
from cpfls_cli.result import plain
from tests.builders.artifacts import edited
from tests.builders.vehicle_search import CONFIG, TRIED, left_out

DAMPING = 0.012
RESUME = "the same command with --resume goes on"


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    path = tmp_path_factory.mktemp("vehicle") / "quad.yaml"
    search = {"search_windows": 20, "folds": 2, "leave_out": left_out(TRIED)}
    path.write_text(f"{CONFIG}playback: {json.dumps(search)}\ngap: {{horizon_s: 0.1}}\n")
    return path


@pytest.fixture(scope="module")
def flights(cpfls, config):
    """One flight to learn from, another to judge on."""
    folder, made = config.parent, []
    for number, direction in ((1, "[-0.3, 1.0, 0.4]"), (2, "[1.0, -0.7, 0.3]")):
        plan, flight = folder / f"path-{number}.h5", folder / f"flight-{number}.h5"
        words = ("--set", "trajectory.path=straight", "--set", f"trajectory.direction={direction}")
        for result in (
            cpfls("trajectory", config, "-o", plan, *words),
            cpfls("simulate", config, plan, "--seed", number, "-o", flight),
        ):
            assert result.exit_code == 0, result.stderr
        made.append(flight)
    return made


@pytest.fixture(scope="module")
def found(cpfls, config, flights):
    """What is printed for machines, and the file."""
    output = config.parent / "vehicle.h5"
    summary = cpfls.summary("vehicle", config, flights[0], "--held-out", flights[1], "-o", output)
    return SimpleNamespace(output=output, summary=summary, record=found_vehicle(output))


def test_it_finds_what_was_put_in(found):
    numbers, truth = {each["name"]: each for each in found.summary["numbers"]}, dict.fromkeys("xyz", DAMPING)
    for axis, value in truth.items():
        number = numbers[f"linear_damping.d_{axis}"]
        assert number["value"] == pytest.approx(value, rel=0.15)
        assert number["low"] < number["value"] < number["high"]
        assert (number["stated"], number["determined"], number["at_bound"]) == (None, True, False)
    (damping,) = [each for each in found.summary["model"]["effects"] if each["name"] == "linear_damping"]
    assert damping["coefficients"] == pytest.approx([DAMPING] * 3, rel=0.15)
    assert found.summary["model"]["vehicle"]["mass_kg"] == 0.8


@pytest.mark.decides
def test_json_shows_verdict_structures_and_what_was_held_out(found):
    summary = found.summary
    assert summary["verdict"] == "good-for-simulation"
    assert summary["complete"] is True
    names = [row["name"] for row in summary["structures"]]
    assert names[:5] == ["chosen", "best", "added", "everything", "nothing"]
    assert set(names[5:]) == {"front"}
    errors = {row["name"]: row["error"] for row in summary["structures"][:5]}
    assert errors["best"] <= errors["chosen"] < 0.1 * errors["nothing"]
    assert set(summary["structures"][3]["blocks"]) == set(TRIED)
    assert summary["held_out"]["flights"] == ["flight-2.h5"]
    models = summary["held_out"]["models"]
    assert models["model"]["body_rate"]["sum"] < 0.2 * models["stated"]["body_rate"]["sum"]
    better = summary["held_out"]["better"]
    assert better["share"] > 0.9
    assert 0 <= better["speed_m_s"][0] < better["speed_m_s"][1] < 10
    shares = {each["name"] for each in summary["shares"]}
    assert shares == {"rotors", *(each["name"] for each in summary["model"]["effects"])}


def test_the_file_keeps_to_its_format_and_says_the_same(cpfls, found):
    cpfls.done("check", found.output)
    assert plain(found.record) == found.summary
    assert "GOOD FOR SIMULATION AND CONTROL" in cpfls("info", found.output).stdout


def test_people_read_verdict_and_numbers(cpfls, config, flights, found, tmp_path):
    output = tmp_path / "vehicle.h5"
    result = cpfls.done("vehicle", config, flights[0], "--held-out", flights[1], "-o", output)
    assert output.read_bytes() == found.output.read_bytes()
    first, *lines = result.stdout.splitlines()
    assert first.startswith("GOOD FOR SIMULATION AND CONTROL: vehicle.h5: predicts motion ")
    assert first.endswith(" s ahead; its constants are identified.")
    assert len(lines) < 15, "verdicts, numbers, next commands"
    whole = cpfls.done("info", output, "-v").stdout
    for words in ("Body rate: better than “rate fades” at every horizon", "linear damping d_x", "stated vehicle"):
        assert words in whole
        assert words not in result.stdout


def test_without_a_held_out_flight_it_is_not_judged(cpfls, config, flights, tmp_path):
    words = ("--set", f"playback.leave_out={json.dumps(left_out(TRIED[:2]))}", "--json")
    summary = json.loads(cpfls.done("vehicle", config, flights[0], "-o", tmp_path / "v.h5", *words).stdout)
    assert (summary["verdict"], summary["held_out"]) == ("not-judged", None)


@pytest.mark.usefixtures("sketched")
def test_other_commands_take_it(cpfls, config, flights, found, tmp_path):
    replayed = cpfls.done("replay", config, found.output, flights[1], "-o", tmp_path / "replay.h5", "--json")
    model = json.loads(replayed.stdout)["models"]["model"]
    assert model["body_rate"]["sum"] == found.summary["held_out"]["models"]["model"]["body_rate"]["sum"]
    worth = cpfls("export", found.output, "-o", tmp_path / "worth.json").stdout.splitlines()[-3:]
    assert worth[0].startswith("GOOD FOR SIMULATION AND CONTROL: predicts motion ")
    rate, horizon = model["body_rate"]["mae"][-1], json.loads(replayed.stdout)["horizon_s"]
    last = horizon[-1] if isinstance(horizon, list) else horizon
    assert worth[1].startswith(f"On held-out flights it ends {rate:.3g} rad/s, ")
    assert worth[1].endswith(f" m off the measured motion after {last:.3g} s, on average.")
    assert worth[2] == "JSON holds all of it."
    compared = cpfls.summary("compare", config, flights[1], "--model", found.output, "-o", tmp_path / "gap.h5")
    assert max(compared["gap"]["floors"]) < 1.5
    alone = ("--model", found.output, "--set", "simulation.closed_loop.effects={}")
    cpfls.done("simulate", config, flights[1].parent / "path-2.h5", *alone, "-o", tmp_path / "f.h5")
    cpfls.done("export", found.output, "-o", tmp_path / "vehicle.json")
    summary = json.loads(cpfls("report", config, found.output, "-o", tmp_path / "page.html", "--json").stdout)
    assert summary["sections"] == ["summary", "vehicle", "stated-vehicle", "provenance"]
    text = (tmp_path / "page.html").read_text()
    assert "A vehicle found in flights" in text
    assert "Not shown, because" not in text


def test_it_is_a_model_of_its_own(cpfls, refuse, config, flights, found, tmp_path):
    """Its study is that which it was found with, so no config has to be given with it."""
    apart = ("--held-out", flights[1])
    said = cpfls.summary("gap", found.output, flights[0], *apart, "-o", tmp_path / "alone")
    with_config = cpfls.summary("gap", config, flights[0], *apart, "--model", found.output, "-o", tmp_path / "both")
    assert said["effects"] == with_config["effects"]
    assert said["verdict"] == with_config["verdict"]
    assert load_study(tmp_path / "alone" / "study.yaml").vehicle == load_study(config).vehicle
    (message,) = refuse("gap", found.output, flights[1], "--model", found.output, "-o", tmp_path / "gap")
    assert "is the model; give one of the two" in message
    cpfls.done("init", "--from", found.output, "-o", tmp_path / "again.yaml")
    vehicle, own = load_study(tmp_path / "again.yaml").vehicle, found.record.model.vehicle
    np.testing.assert_allclose(vehicle.inertia_kg_m2, own.inertia_kg_m2[: len(vehicle.inertia_kg_m2)], rtol=1e-9)
    for made, rotor in zip(vehicle.rotors, own.rotors, strict=True):
        assert made.thrust_factor_n_s2 == pytest.approx(rotor.thrust_factor_n_s2, rel=1e-9)
        assert made.drag_factor_n_m_s2 == pytest.approx(rotor.drag_factor_n_m_s2, rel=1e-9)
        assert (made.spin, made.position_m) == (rotor.spin, pytest.approx(rotor.position_m))


@pytest.mark.usefixtures("sketched")
@pytest.mark.parametrize("along", [1, 0], ids=["held out", "another flight"])
def test_a_replay_is_shown_also_of_the_flight_held_out(cpfls, config, flights, found, tmp_path, along):
    replayed = tmp_path / "replay.h5"
    cpfls("replay", config, found.output, flights[along], "-o", replayed)
    cpfls.done("report", config, found.output, replayed, "-o", tmp_path / "page.md")
    text = (tmp_path / "page.md").read_text()
    assert text.count("; sum over all horizons") == text.count("Body rate: better than") == 2
    assert "The windows in which the body rate is farthest off" in text


@pytest.fixture
def interrupt_at(monkeypatch):
    """Send this very process an interrupt when so many structures were judged."""

    def at(number):
        from cpfls_cli.stages import vehicle

        find = vehicle.find_vehicle

        def finding(stated, flights, settings, progress, *others):
            def summary(judged, total):
                evaluated.append(len(judged))
                if len(judged) == number:
                    os.kill(os.getpid(), signal.SIGINT)
                progress(judged, total)

            return find(stated, flights, settings, summary, *others)

        evaluated = []
        monkeypatch.setattr(vehicle, "find_vehicle", finding)
        return evaluated

    return at


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_an_interrupt_keeps_what_was_found(cpfls, config, flights, tmp_path, interrupt_at):
    interrupt_at(4)
    result = cpfls("vehicle", config, flights[0], "-o", tmp_path / "v.h5", "--json")
    assert result.exit_code == 130
    assert names(tmp_path) == ["v.h5", "v.h5.checkpoint"]
    assert (
        f"cpfls: note: {tmp_path / 'v.h5'}: is incomplete, because the search was interrupted; {RESUME}"
    ) in result.stderr.splitlines()
    cpfls.done("check", tmp_path / "v.h5.checkpoint")
    summary = json.loads(result.stdout)
    assert (summary["complete"], summary["evaluated"]) == (False, 4)
    cpfls.done("report", config, tmp_path / "v.h5", "-o", tmp_path / "page.md")
    assert "the search was stopped before its end" in (tmp_path / "page.md").read_text()


def test_an_interrupt_after_the_first_structure_gives_the_stated_vehicle(
    cpfls, config, flights, tmp_path, interrupt_at
):
    interrupt_at(1)
    result = cpfls("vehicle", config, flights[0], "-o", tmp_path / "v.h5", "--json")
    assert result.exit_code == 130
    summary = json.loads(result.stdout)
    assert (summary["complete"], summary["evaluated"]) == (False, 1)
    assert {each["name"] for each in summary["structures"]} == {"chosen", "best", "nothing", "front"}
    assert summary["model"]["effects"] == []
    assert names(tmp_path) == ["v.h5", "v.h5.checkpoint"]
    cpfls.done("report", config, tmp_path / "v.h5", "-o", tmp_path / "page.md")


@pytest.mark.decides
def test_a_quick_search_finds_the_same_effect_in_fewer_structures(cpfls, config, flights, found, tmp_path):
    words = ("vehicle", config, flights[0], "--held-out", flights[1], "--quick", "-v")
    result = cpfls.done(*words, "-o", tmp_path / "v.h5")
    summary = plain(found_vehicle(tmp_path / "v.h5"))
    assert summary["evaluated"] <= found.summary["evaluated"]
    assert summary["model"]["effects"][0]["name"] == "linear_damping"
    assert "a first answer by --quick" in result.stderr
    assert "v-full.h5" in result.stdout


def test_an_interrupted_search_goes_on_to_the_same_end(
    cpfls, config, flights, found, tmp_path, interrupt_at, monkeypatch
):
    words = ("vehicle", config, flights[0], "--held-out", flights[1], "-o", tmp_path / "vehicle.h5")
    before = interrupt_at(7)
    assert cpfls(*words).exit_code == 130
    monkeypatch.undo()
    after = interrupt_at(None)
    cpfls.done(*words, "--resume")
    assert [*before, *after] == list(range(1, found.summary["evaluated"] + 1))
    assert (tmp_path / "vehicle.h5").read_bytes() == found.output.read_bytes()
    assert names(tmp_path) == ["vehicle.h5"]


def test_a_search_is_killed_and_goes_on(cpfls, config, flights, found, tmp_path, monkeypatch):
    """Whatever ends the program, some structures before are kept."""
    from cpfls_cli.stages import vehicle

    monkeypatch.setattr(vehicle, "_KEPT_EVERY", 4)
    written, write = [], vehicle.VehicleCheckpoint.write

    def dying(checkpoint, judged):
        write(checkpoint, judged)
        written.append(len(judged))
        raise MemoryError

    monkeypatch.setattr(vehicle.VehicleCheckpoint, "write", dying)
    words = ("vehicle", config, flights[0], "--held-out", flights[1], "-o", tmp_path / "vehicle.h5")
    assert cpfls(*words).exit_code != 0
    assert written == [4]
    assert names(tmp_path) == ["vehicle.h5.checkpoint"]
    monkeypatch.undo()
    cpfls.done(*words, "--resume")
    assert (tmp_path / "vehicle.h5").read_bytes() == found.output.read_bytes()


def test_what_cannot_be_resumed_is_refused(cpfls, refuse, config, flights, tmp_path, interrupt_at):
    output = tmp_path / "v.h5"
    (message,) = refuse("vehicle", config, flights[0], "-o", output, "--resume")
    assert message == f"{output}.checkpoint: no such file, so nothing to resume; start without --resume"
    interrupt_at(1)
    assert cpfls("vehicle", config, flights[0], "-o", output).exit_code == 130
    (message,) = refuse("vehicle", config, flights[0], "-o", output)
    assert message.startswith(f"{output}.checkpoint: a search for {output} was stopped here; --resume continues it")
    for words, named in (
        ((flights[1],), "flight-1 = flight-1.h5 ("),
        ((flights[0], "--set", "playback.folds=3"), "playback.folds = 2 there, 3 here"),
        ((flights[0], "--set", "seed=2"), "seed = 1 there, 2 here"),
    ):
        (message,) = refuse("vehicle", config, *words, "-o", output, "--resume")
        assert message.startswith(f"{output}.checkpoint: belongs to another search: ")
        assert named in message


@pytest.fixture
def refused(refuse, config, tmp_path):
    def call(*flights, options=()):
        (message,) = refuse("vehicle", config, *flights, "-o", tmp_path / "x.h5", *options)
        return message

    return call


def test_an_unknown_block_is_refused(refused, flights):
    message = refused(flights[0], options=("--set", "playback.leave_out=[rotor_drga]"))
    assert message == "playback.leave_out = rotor_drga: no such block (did you mean rotor_drag?)"


def test_a_flight_without_rotor_speeds_is_refused(refused, flights, tmp_path):
    still = tmp_path / "still.h5"
    with h5py.File(flights[0]) as source, edited(still, "w") as target:
        target.attrs.update(source.attrs)
        for name in source:
            if name not in ("rotor_speed", "rotor_command", "torque", "body_torque"):
                source.copy(name, target)
    assert refused(still).startswith("still.h5: ")


def test_a_flight_of_another_vehicle_is_refused(refused, flights):
    message = refused(flights[0], options=("--set", "vehicle.mass_kg=0.9"))
    assert message.startswith(f"{flights[0]}: was made with another vehicle")


@pytest.mark.parametrize(
    ("rotors", "axes"),
    [
        ([(1, 1, 1), (-1, 1, 1), (-1, -1, 1), (1, -1, 1)], "thrust, yaw"),
        ([(0, 1, 1), (0, 1, -1)] * 2, "thrust, roll, pitch"),
    ],
    ids=["all spin one way", "all on one side"],
)
@pytest.mark.parametrize("command", [("vehicle",), ("replay", "vehicle"), ("gap",)])
def test_rotors_that_no_vehicle_flies_with_are_refused(refuse, config, tmp_path, command, rotors, axes):
    log, time = tmp_path / "log.csv", np.arange(0.0, 4.0, 0.01)
    waves = np.column_stack([np.sin((1 + i) * time) for i in range(7)])
    np.savetxt(log, np.column_stack([time, waves + 600]), delimiter=",", header="t,p,q,r,a,b,c,d", comments="")
    signals = {
        "body_rate": {"columns": ["p", "q", "r"], "unit": "rad/s"},
        "rotor_speed": {"columns": ["a", "b", "c", "d"], "unit": "rad/s"},
    }
    given = [
        {"position_m": [0.1 * x, 0.1 * y, 0.0], "spin": spin, "thrust_factor_n_s2": 6e-6, "drag_factor_n_m_s2": 1e-7}
        for x, y, spin in rotors
    ]
    name, *model = command
    sets = {"import.signals": signals, "import.torque_source": None, "vehicle.rotors": given}
    words = [word for key, value in sets.items() for word in ("--set", f"{key}={json.dumps(value)}")]
    assert refuse(name, config, *model, log, "-o", tmp_path / "out.h5", *words) == [
        f"vehicle.rotors: the rotors cannot produce {axes} independently of the rest; check their positions and spins"
    ]


@pytest.mark.parametrize("more", [(), ("--dry-run",)])
def test_a_flight_shorter_than_the_horizon_is_refused(refused, flights, more):
    message = refused(flights[0], options=("--set", "playback.horizon_s=5.0", *more))
    assert message.startswith("flight-1.h5: a horizon of 5 s is longer than its longest stretch without a pause")


def test_a_log_of_stated_torque_is_refused(refused, tmp_path):
    log, time = tmp_path / "stated.csv", np.arange(0.0, 4.0, 0.01)
    np.savetxt(log, np.column_stack([time, np.zeros((len(time), 6))]), delimiter=",", header="t,p,q,r,mx,my,mz",
               comments="")  # fmt: skip
    signals = {
        "body_rate": {"columns": ["p", "q", "r"], "unit": "rad/s"},
        "body_torque": {"columns": ["mx", "my", "mz"], "unit": "N m"},
    }
    options = ("--set", f"import.signals={json.dumps(signals)}", "--set", "import.torque_source=column")
    assert refused(log, options=options).startswith("stated.csv: holds torque instead of rotor speeds")


def test_the_copy_of_the_config_has_what_the_command_line_changes(cpfls, config, flights, tmp_path):
    copy = tmp_path / "found.yaml"
    words = ("--set", "playback.horizon_s=0.4", "--seed", 7, "--write-config", copy)
    cpfls.done("vehicle", config, flights[0], "-o", tmp_path / "v.h5", *words)
    written = read_config(copy)
    assert (written["seed"], written["playback"]["horizon_s"]) == (7, 0.4)


@pytest.mark.parametrize("name", ["x.h5", "x.h5.checkpoint"])
def test_the_copy_of_the_config_is_no_other_output(refused, flights, tmp_path, name):
    line = refused(flights[0], options=("--write-config", tmp_path / name, "--force", "--dry-run"))
    assert line == f"{tmp_path / name}: is what the command writes for -o {tmp_path / 'x.h5'}; name another file"


@pytest.mark.parametrize(("name", "also"), [("flight-1.h5", ""), ("copy.h5", " (as flight-1.h5)")])
def test_a_flight_that_is_learned_from_is_not_held_out(refused, flights, tmp_path, name, also):
    line = refused(flights[0], options=("--held-out", shutil.copy(flights[0], tmp_path / name)))
    said = f"{name}: is both learned from{also} and held out, so nothing would be judged; leave it out of one of them"
    assert line == f"{said}, or hold out another flight"


def test_a_replay_names_flights_given_twice_and_those_that_the_vehicle_learned_from(
    cpfls, config, flights, found, tmp_path
):
    words = (flights[0], flights[0], "-o", tmp_path / "r.h5", "--every", 500)
    result = cpfls("replay", config, found.output, *words)
    assert "flight-1.h5: is given twice" in result.stderr
    assert "flight-1.h5: vehicle.h5 has learned from it" in result.stderr


def test_a_velocity_in_another_unit_is_said(cpfls, config, flights, tmp_path):
    flight = tmp_path / "kmh.h5"
    shutil.copy(flights[0], flight)
    with edited(flight) as file:
        file["velocity"][:] *= 3.6
    found = ("vehicle", config, flight, "--held-out", flights[1], "--anyway")
    for words in (found, ("replay", config, "vehicle", flight)):
        result = cpfls.done(*words, "-o", tmp_path / "out.h5", "--force")
        said = "The log contradicts itself: kmh.h5: the velocity is in km/h, judged by the position"
        assert said in "".join(result.stdout.splitlines()[:2])
        assert "flight-2.h5:" not in result.stdout + result.stderr
