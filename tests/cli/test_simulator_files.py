"""`cpfls init --from` and `cpfls gap` with a simulator's own file: what they write, and what they never touch."""

import json
import re
import runpy
from pathlib import Path

import h5py
import numpy as np
import pytest

from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import resolved_yaml
from cpfls_cli.errors import ComputationError
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.stages import extend
from tests.builders.gusty_flights import CALM, SMALL, Flight, gusty_flights
from tests.builders.simulator_files import sdf_of, write_log
from tests.builders.studies import put_file
from tests.builders.vehicle_models import number_of, vehicle_of, whole, write_vehicle

TRUE = SMALL._replace(drag=0.0, damping=0.0)
ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "configs" / "simulators.yaml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A file whose thrust is a fifth too large, and two short flights."""
    folder = tmp_path_factory.mktemp("simulator")
    (folder / "mine.sdf").write_text(sdf_of(TRUE, thrust=1.2))
    asked = [Flight(TRUE, CALM, path=run, draw=run, reach=3.0, swing=0.3) for run in range(2)]
    for run, flight in enumerate(gusty_flights(asked, 16.0)):
        write_log(folder / f"log{run}.csv", flight)
    return folder


def test_init_writes_the_vehicle_with_its_lines(cpfls, folder, tmp_path):
    output = tmp_path / "study.yaml"
    assert "mine.sdf, Gazebo: 0.04500 kg" in cpfls.done("init", "--from", folder / "mine.sdf", "-o", output).stdout
    text, vehicle = output.read_text(), load_study(output).vehicle
    assert "# mine.sdf line 8: <mass> of link base_link, and 4 more links" in text
    assert "<motorConstant>" in text
    assert vehicle.mass_kg == pytest.approx(TRUE.mass)
    np.testing.assert_allclose(vehicle.inertia_kg_m2[:3], TRUE.inertia, rtol=1e-4)
    assert [rotor.thrust_factor_n_s2 for rotor in vehicle.rotors] == [2.4e-8] * 4
    assert vehicle.rotor_speed_max_rad_s == 6000


def test_init_takes_the_log_too(cpfls, folder, tmp_path):
    output = tmp_path / "study.yaml"
    cpfls.done("init", "--from", folder / "mine.sdf", folder / "log0.csv", "-o", output, "--mass", "0.05")
    study = load_study(output)
    assert study.vehicle.mass_kg == 0.05
    assert "in place of the file's 0.045 kg" in output.read_text()
    assert study.import_.signals["rotor_speed"].columns == ("rpm_1", "rpm_2", "rpm_3", "rpm_4")


def test_rotors_that_turn_the_other_way_in_the_log_are_named(cpfls, folder, tmp_path):
    mine = put_file(tmp_path / "turned.sdf", sdf_of(TRUE, spins=(-1, 1, -1, -1)))
    result = cpfls.done("init", "--from", mine, folder / "log0.csv", "-o", tmp_path / "study.yaml")
    assert "rotor_3 turns clockwise in the file and counter-clockwise by the log" in result.stderr
    assert [rotor.spin for rotor in load_study(tmp_path / "study.yaml").vehicle.rotors] == [-1, 1, -1, 1]


def test_a_file_of_another_vehicle_is_refused(refuse, folder, tmp_path):
    mine = tmp_path / "three.sdf"
    text = sdf_of(TRUE).replace('name="rotor_3_joint" type="revolute"', 'name="rotor_3_joint" type="fixed"')
    mine.write_text(text[: text.rindex("    <plugin")] + text[text.rindex("    </plugin>") + len("    </plugin>") :])
    (message,) = refuse("init", "--from", mine, folder / "log0.csv", "-o", tmp_path / "study.yaml")
    assert "has 3 rotors, and the log 4; give the file of the vehicle that flew" in message


def test_init_needs_a_log_or_a_file(refuse, folder, tmp_path):
    (message,) = refuse("init", "-o", tmp_path / "study.yaml")
    assert "give logs, or a simulator's file by --from" in message
    (message,) = refuse("init", "--from", folder / "mine.sdf", "-o", tmp_path / "study.yaml", "--arm", "0.1")
    assert "states inertia, rotors and their factors, so leave out --inertia, --arm and the factors" in message


@pytest.mark.usefixtures("sketched")
def test_gap_writes_the_corrected_file_and_leaves_mine(cpfls, folder, tmp_path):
    mine = folder / "mine.sdf"
    before, output = mine.read_bytes(), tmp_path / "gap"
    words = ("gap", mine, folder / "log0.csv", "--held-out", folder / "log1.csv", "-o", output)
    cpfls.done(*words, "--dry-run")
    assert not output.exists()
    result = cpfls.done(*words)
    assert mine.read_bytes() == before
    (change,) = json.loads((output / "gap.json").read_text())["corrected"]["changes"]
    assert (change["file"], change["element"]) == ("mine.sdf", "motorConstant")
    assert change["low"] < TRUE.thrust_factor < change["high"]
    assert "mine.sdf motorConstant 2.4e-08 → " in " ".join(result.stdout.split())
    assert "-      &lt;motorConstant&gt;2.4e-08" in (output / "report.html").read_text()
    assert {path.name for path in output.iterdir()} >= {"study.yaml", "mine.sdf", "report.html", "extended.h5"}
    # What was made of the file is a study like any other.
    cpfls.done("gap", output / "study.yaml", folder / "log0.csv", folder / "log1.csv", "-o", tmp_path / "again")
    assert "corrected" in json.loads((tmp_path / "again" / "gap.json").read_text())


def test_a_second_fit_that_is_refused_leaves_the_first(cpfls, folder, tmp_path, monkeypatch):
    """With the thrust put in the effects are fitted once more, which may be refused: the first fit has it as one."""
    fitted, asked = extend.refitted, []

    def refused(*given):
        asked.append(len(given))
        if len(asked) > 1:
            raise ComputationError("not extended: no channel changes")
        return fitted(*given)

    monkeypatch.setattr(extend, "refitted", refused)
    words = ("gap", folder / "mine.sdf", folder / "log0.csv", "--held-out", folder / "log1.csv", "-o", tmp_path / "gap")
    cpfls.done(*words)
    assert len(asked) == 2
    assert "parameter_error" in json.dumps(cpfls.summary("info", tmp_path / "gap" / "extended.h5"))


def test_the_file_itself_is_no_output(cpfls, folder, tmp_path):
    """Its own folder as the output would put the corrected file in its place."""
    mine = put_file(tmp_path / "mine.sdf", (folder / "mine.sdf").read_bytes())
    before = mine.read_bytes()
    words = ("gap", mine, folder / "log0.csv", "--held-out", folder / "log1.csv", "-o", tmp_path, "--force")
    result = cpfls(*words)
    assert result.exit_code == 2
    assert "is an input of this command" in result.stderr
    assert mine.read_bytes() == before


def test_other_commands_say_how_to_make_a_config(refuse, folder, tmp_path):
    (message,) = refuse("compare", folder / "mine.sdf", folder / "log0.csv", "-o", tmp_path / "gap.h5")
    assert "mine.sdf: is a simulator's file, not a config (YAML); `cpfls init --from " in message
    # A log may end so, too.
    frame = put_file(tmp_path / "frame.json", b'{"mass": 2.1, "diagonal_size": 0.4, "hoverThrOut": 0.3}')
    (message,) = refuse("compare", frame, folder / "log0.csv", "-o", tmp_path / "gap.h5")
    assert "frame.json: is a simulator's file, not a config (YAML); `cpfls init --from " in message
    (message,) = refuse("gap", frame, folder / "log0.csv", "-o", tmp_path / "gap")
    assert "is a log" not in message


def test_a_file_that_states_too_little_says_what_to_write(refuse, folder, tmp_path):
    mine = tmp_path / "mine.xml"
    mine.write_text(
        '<mujoco><worldbody><body name="b"><freejoint/><inertial pos="0 0 0" mass="0.045" '
        'diaginertia="3.7e-5 4.2e-5 6.6e-5"/></body></worldbody></mujoco>'
    )
    flight = tmp_path / "flight.csv"
    (message,) = refuse("gap", mine, flight, "-o", tmp_path / "gap")
    assert message.endswith("flight.csv: no such file")
    flight.write_bytes((folder / "log0.csv").read_bytes())
    (message,) = refuse("gap", mine, flight, "-o", tmp_path / "gap")
    assert "does not state all that a gap needs" in message
    assert "write position_m of M1, M2, M3 and M4 in place of ASK" in message


def test_a_file_without_rotors_takes_those_of_the_log(cpfls, folder, tmp_path):
    mine, output = tmp_path / "mine.xml", tmp_path / "study.yaml"
    mine.write_text(
        '<mujoco><worldbody><body name="b"><freejoint/><inertial pos="0 0 0" mass="0.045" '
        'diaginertia="3.7e-5 4.2e-5 6.6e-5"/></body></worldbody></mujoco>'
    )
    cpfls.done("init", "--from", mine, folder / "log0.csv", "-o", output, "--arm", "0.046")
    vehicle = load_study(output).vehicle
    assert vehicle.unknown == ("drag_factor", "thrust_factor")
    np.testing.assert_allclose([r.position_m[:2] for r in vehicle.rotors], TRUE.places, atol=1e-4)


def test_an_included_file_in_the_output_folder_is_never_written_over(cpfls, folder, tmp_path):
    """The corrected include would have its name: refused before anything is computed, even with --force."""
    text = (folder / "mine.sdf").read_text()
    body, plugins = (
        tmp_path / "gap" / "body.sdf",
        "".join(re.findall(r" *<plugin.*?</plugin>\n", text, flags=re.DOTALL)),
    )
    body.parent.mkdir()
    body.write_text(re.sub(r" *<plugin.*?</plugin>\n", "", text, flags=re.DOTALL))
    mine = tmp_path / "mine.sdf"
    include = "<include merge='true'><uri>gap/body.sdf</uri></include>"
    mine.write_text(f"<sdf version='1.9'><model name='mine'>{include}\n{plugins}</model></sdf>")
    before = body.read_bytes()
    words = ("gap", mine, folder / "log0.csv", "--held-out", folder / "log1.csv", "-o", tmp_path / "gap", "--force")
    for added in ((), ("--dry-run",)):
        result = cpfls(*words, *added)
        assert result.exit_code == 2
        assert "body.sdf: is an input of this command" in result.stderr
        assert [path.name for path in body.parent.iterdir()] == ["body.sdf"]
    result = cpfls("init", "--from", mine, "-o", body, "--force")
    assert "body.sdf: is an input of this command" in result.stderr
    assert body.read_bytes() == before


def test_what_flights_did_not_identify_of_a_vehicle_is_said_with_the_config(cpfls, tmp_path):
    numbers = (number_of("inertia.Ixx", 0.02, determined=False), number_of("thrust_factor", 1e-6))
    found = write_vehicle(tmp_path / "found.h5", vehicle_of(whole(effects=()), numbers=numbers))
    said = cpfls.done("init", "--from", found, "-o", tmp_path / "study.yaml").stderr
    assert "Ixx: not identified by the flights of found.h5, so maybe not the vehicle's own" in " ".join(said.split())
    sure = (number_of("inertia.Ixx", 0.02),)
    found = write_vehicle(tmp_path / "sure.h5", vehicle_of(whole(effects=()), numbers=sure, correlation=np.eye(1)))
    assert "not identified" not in cpfls.done("init", "--from", found, "-o", tmp_path / "sure.yaml").stderr


ROUND = """<mujoco><worldbody><body name="b"><freejoint/>
  <inertial pos="0 0 0" mass="0.045" diaginertia="3.7e-5 4.2e-5 6.6e-5"/>
  <site name="s0" pos="0.03 -0.03 0"/><site name="s1" pos="-0.03 -0.03 0"/>
  <site name="s2" pos="-0.03 0.03 0"/><site name="s3" pos="0.03 0.03 0"/></body></worldbody>
  <actuator><motor site="s0" gear="0 0 1 0 0 0"/><motor site="s1" gear="0 0 1 0 0 -.006"/>
  <motor site="s2" gear="0 0 1 0 0 .006"/><motor site="s3" gear="0 0 1 0 0 -.006"/></actuator></mujoco>"""


def test_a_direction_that_nobody_states_is_asked_for(cpfls, refuse, folder, tmp_path):
    """The first actuator turns nothing: its spin is that of a log that is sure of it, and else asked for."""
    mine = put_file(tmp_path / "mine.xml", ROUND)
    result = cpfls.done("init", "--from", mine, folder / "log0.csv", "-o", tmp_path / "study.yaml")
    assert [rotor.spin for rotor in load_study(tmp_path / "study.yaml").vehicle.rotors] == [-1, 1, -1, 1]
    # Rotors of another time say nothing of the motion.
    header, *rows = (folder / "log0.csv").read_text().splitlines()
    mixed = [
        ",".join([*row.split(",")[:13], *late.split(",")[13:]]) for row, late in zip(rows, rows[::-1], strict=True)
    ]
    (tmp_path / "mixed.csv").write_text("\n".join([header, *mixed]))
    result = cpfls("init", "--from", mine, tmp_path / "mixed.csv", "-o", tmp_path / "asked.yaml", "--json")
    assert json.loads(result.stdout)["asked"] == ["vehicle.rotors.0.spin"]
    assert "spin: ASK" in (tmp_path / "asked.yaml").read_text()
    (message,) = refuse("gap", mine, tmp_path / "mixed.csv", "-o", tmp_path / "gap")
    assert "does not state all that a gap needs; `cpfls init --from" in message
    assert "write spin of M1 in place of ASK" in message


def test_a_flight_in_mujoco_comes_back(cpfls, tmp_path):
    pytest.importorskip("mujoco", reason="needs the package mujoco, of the extra simulators")
    study = load_study(CONFIG)
    offset = ModelEffect("com_offset", {}, np.array([0.01, -0.006]))
    vehicle = vehicle_of(VehicleModel(vehicle=study.vehicle, effects=(offset,)))
    model, uav, log, flight = (tmp_path / name for name in ("model.h5", "uav.xml", "log.h5", "flight.h5"))
    write_vehicle(model, vehicle, resolved_yaml(study))
    cpfls.done("export", model, "-o", uav)
    script = runpy.run_path(str(ROOT / "examples" / "fly_mujoco.py"))
    script["main"].__globals__.update(BEGIN_S=2.0, END_S=4.0)
    script["main"](str(uav), str(CONFIG), str(log))
    with h5py.File(log) as file:
        assert len(file["time"]) == 200
        assert np.abs(file["x"][:]).max() < 5.0
    cpfls.done("import", CONFIG, log, "-o", flight)
    sums = {
        name: each["body_rate"]["sum"]
        for name, each in cpfls.summary("replay", CONFIG, model, flight, "-o", tmp_path / "replay.h5")["models"].items()
    }
    assert sums["model"] < 0.1 * sums["stated"]
