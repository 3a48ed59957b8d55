"""`cpfls init`: a log is looked into, a config proposed, and what only a person knows is asked for."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.io
import yaml

from tests.builders.studies import put_file
from tests.builders.unknown_logs import FLIP, HUBS, flat_log, flight, named, ulog_of_flight, with_ground, write_csv

MASS, ARM = "0.8", "0.16"


@pytest.fixture(scope="module")
def own():
    return flight(seconds=20.0)


@pytest.fixture
def log(tmp_path, own):
    return write_csv(tmp_path / "log.csv", flat_log(own))


@pytest.fixture
def proposed(cpfls, tmp_path):
    """Run init, and give what it printed, what it wrote and that as data."""

    def call(*words, output="study.yaml"):
        result = cpfls.done("init", *words, "-o", tmp_path / output)
        text = (tmp_path / output).read_text()
        return result, text, yaml.safe_load(text)

    return call


@pytest.fixture(scope="module")
def usual(cpfls, own, tmp_path_factory):
    """A log, the config that `init` writes for it with mass and arm, and what it says."""
    folder = tmp_path_factory.mktemp("usual")
    log, study = write_csv(folder / "log.csv", flat_log(own)), folder / "study.yaml"
    return log, study, cpfls.done("init", log, "--mass", MASS, "--arm", ARM, "-o", study).stdout


def test_the_next_commands_take_what_it_wrote(cpfls, usual, tmp_path):
    (log, study, _), made = usual, tmp_path / "flight.h5"
    summary = cpfls.summary("import", study, log, "-o", made)
    assert {"attitude", "body_rate", "specific_force", "position", "velocity", "rotor_speed"} <= set(summary["signals"])
    assert summary["samples"] == 2000
    cpfls.done("vehicle", study, made, "-o", tmp_path / "vehicle.h5", "--dry-run")


def test_after_a_log_that_contradicts_itself_comes_no_command_that_refuses_it(cpfls, tmp_path, own):
    wrong = SimpleNamespace(**vars(own) | {"velocity": own.velocity[::-1]})
    log, study = put_file(tmp_path / "log.ulg", ulog_of_flight(wrong)), tmp_path / "study.yaml"
    result = cpfls.done("init", log, "--mass", MASS, "-o", study)
    assert "The log contradicts itself: log.ulg: the velocity" in result.stderr
    *_, after, said, _ = result.stdout.splitlines()
    assert (after, said) == ("next:", f"  cpfls config {study} --section import")
    assert cpfls("vehicle", study, log, "-o", tmp_path / "v.h5", "--dry-run").exit_code == 2


@pytest.mark.parametrize("imported_first", [True, False])
def test_a_flight_is_not_judged_by_the_log_that_it_was_imported_from(cpfls, refuse, usual, tmp_path, imported_first):
    (log, study, _), made = usual, tmp_path / "flight.h5"
    cpfls.done("import", study, log, "-o", made)
    one, other = (made, log) if imported_first else (log, made)
    (line,) = refuse("vehicle", study, one, "--held-out", other, "-o", tmp_path / "vehicle.h5", "--dry-run")
    assert line.startswith(f"{other.name}: is both learned from (as {one.name}) and held out")


@pytest.mark.parametrize("command", ["vehicle", "gap"])
def test_a_stretch_of_a_log_is_not_judged_by_one_that_overlaps_it(cpfls, refuse, usual, tmp_path, command):
    log, study, _ = usual
    first, second, third = (tmp_path / f"{name}.h5" for name in ("first", "second", "third"))
    for made, ends in ((first, "[0, 9]"), (second, "[8.5, 18]"), (third, "[9, 18]")):
        cpfls.done("import", study, log, "--set", f"import.crop_s={ends}", "-o", made)
    words, output = ("--accept-guesses",) if command == "gap" else (), tmp_path / "out.h5"
    (line,) = refuse(command, study, first, "--held-out", second, "-o", output, "--dry-run", *words)
    assert line.startswith("second.h5: holds 8.5 to 9.0 s of the log that first.h5 is from too, which is learned from")
    cpfls.done("vehicle", study, first, "--held-out", third, "-o", output, "--dry-run")


def test_every_guess_has_its_reason_in_the_file_and_in_the_answer(usual):
    _, study, said = usual
    text = study.read_text()
    data = yaml.safe_load(text)
    signals = data["import"]["signals"]
    assert signals["body_rate"] == {"columns": ["gyro_x", "gyro_y", "gyro_z"], "unit": "rad/s"}
    assert signals["rotor_speed"]["unit"] == "rpm"
    lines = text.splitlines()
    for name in (*signals, *(key for key in ("body_frame", "world_frame", "acceleration_frame") if key in text)):
        place = next(index for index, line in enumerate(lines) if line.strip().startswith(f"{name}:"))
        assert lines[place - 1].strip().startswith("#"), name
        assert name in said
    assert max(len(line) for line in lines if line.lstrip().startswith("#")) <= 110
    assert [rotor["spin"] for rotor in data["vehicle"]["rotors"]] == [spin for _, _, spin in HUBS]
    assert [rotor["position_m"][:2] for rotor in data["vehicle"]["rotors"]] == [
        pytest.approx([0.16 * x / np.sqrt(2), 0.16 * y / np.sqrt(2)], abs=1e-6) for x, y, _ in HUBS
    ]
    assert "Placed for an arm of 0.16 m; measured x, y and z are better" in " ".join(text.replace("#", "").split())
    assert data["vehicle"]["inertia_kg_m2"] is None
    assert {rotor["thrust_factor_n_s2"] for rotor in data["vehicle"]["rotors"]} == {None}


def test_what_only_a_person_knows_is_asked_for_and_refused_in_one_sentence(cpfls, proposed, refuse, log, tmp_path):
    result, text, _ = proposed(log)
    assert "mass_kg: ASK" in text
    assert "front right: [0.707 a, -0.707 a, 0.0]" in text
    asked = "vehicle.mass_kg, " + ", ".join(f"vehicle.rotors.{index}.position_m" for index in range(4))
    by_hand = "vehicle.mass_kg, position_m of M1, M2, M3 and M4"
    study = tmp_path / "study.yaml"
    such_as = (
        "in place of ASK, such as mass_kg: 0.8, position_m: [0.1, -0.1, 0.0] (kg, with battery; x forward, y left and z"
        " up from the centre of mass, m); cpfls init --mass KG --arm M fills them in"
    )
    by_init = "in place of ASK; cpfls init --mass KG --arm M fills them in"
    assert f"first edit {study}: write {by_hand} {by_init}\n" in result.stdout
    # Every command refuses the config until then.
    assert "next:" not in result.stdout
    sentence = f"{study}: {asked} = ASK: no log says them; write what is true of the vehicle {such_as}"
    for words in (
        ("import", study, log, "-o", tmp_path / "flight.h5"),
        ("vehicle", study, log, "-o", tmp_path / "vehicle.h5"),
        ("trajectory", study, "-o", tmp_path / "path.h5"),
        ("config", study),
    ):
        assert refuse(*words) == [sentence]
    filled = text.replace("mass_kg: ASK", "mass_kg: 0.8").replace("position_m: ASK", "position_m: [0.1, 0.1, 0.0]")
    study.write_text(filled)
    cpfls.done("config", study)
    study.write_text(filled.replace("mass_kg: 0.8", "mass_kg: ASK"))
    assert refuse("config", study) == [
        f"{study}: vehicle.mass_kg = ASK: no log says it; write what is true of the vehicle in place of ASK, such as"
        " mass_kg: 0.8 (kg, with battery); cpfls init --mass KG fills it in"
    ]
    cpfls.done("config", study, "--set", "vehicle.mass_kg=0.8")


def test_the_same_log_gives_the_same_file_and_never_over_another(proposed, refuse, usual, tmp_path):
    log, study, _ = usual
    assert refuse("init", log, "-o", study) == [f"{study}: exists already; --force replaces it"]
    (tmp_path / "study.yaml").write_text("seed: 1\n")
    assert proposed(log, "--mass", MASS, "--arm", ARM, "--force")[1] == study.read_text()


def test_the_answer_for_machines(proposed, log):
    result, _, _ = proposed(log, "--json")
    summary = json.loads(result.stdout)
    assert summary["asked"] == ["vehicle.mass_kg", *(f"vehicle.rotors.{index}.position_m" for index in range(4))]
    assert summary["signals"]["body_rate"]["certainty"] == "data"
    assert summary["signals"]["body_rate"]["columns"] == ["gyro_x", "gyro_y", "gyro_z"]
    assert summary["choices"]["body_frame"]["value"] == "FLU"
    assert [rotor["name"] for rotor in summary["rotors"]] == ["front right", "rear left", "front left", "rear right"]
    assert summary["crop_s"] is None


def test_time_on_the_ground_is_cut_and_said(proposed, tmp_path, own):
    path = write_csv(tmp_path / "ground.csv", flat_log(with_ground(own)))
    result, text, data = proposed(path, "--mass", MASS, "--arm", ARM, "-v")
    assert data["import"]["crop_s"] == pytest.approx([5.5, 24.5], abs=0.1)
    assert "the first 5.5 s are cut: the rotors are below 60 % of their hover level" in result.stdout
    assert "# the last 4.5 s are cut: the rotors stand still or idle" in text


def test_two_guesses_that_the_data_cannot_part_are_both_listed(proposed, tmp_path, own):
    speed = named(own.speed, "rotor1", "rotor2", "rotor3", "rotor4")
    result, text, _ = proposed(write_csv(tmp_path / "log.csv", flat_log(own, speed=speed)))
    (rival,) = re.findall(r"# or (unit: .*)", text)
    assert re.fullmatch(r"unit: rpm \(a level of 57\d\.\d fits both\)", rival)
    assert "rotor_speed: a guess; it may also be unit: rpm: a level of 57" in result.stderr


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "rad/s"), (60 / (2 * np.pi), "rpm")])
def test_mass_and_arm_part_two_units_of_speed(proposed, tmp_path, own, factor, unit):
    # A vehicle with slow propellers, whose speeds in rpm look like those of others in rad/s.
    slow = factor * own.speed * (1.0 if unit == "rad/s" else 0.4)
    path = write_csv(tmp_path / "log.csv", flat_log(own, speed=named(slow, "rotor1", "rotor2", "rotor3", "rotor4")))
    arm = ARM if unit == "rad/s" else "0.3"
    result, text, data = proposed(path, "--mass", MASS, "--arm", arm)
    assert data["import"]["signals"]["rotor_speed"]["unit"] == unit
    assert "propellers that fit between the arms carry the mass at hover" in " ".join(text.replace("#", "").split())
    assert "it may also be" not in result.stderr


def test_several_logs_share_one_mapping(proposed, tmp_path, own):
    first = write_csv(tmp_path / "one.csv", flat_log(own))
    second = write_csv(tmp_path / "two.csv", flat_log(flight(seconds=20.0, seed=5), velocity=None))
    _, text, data = proposed(first, second, "--mass", MASS, "--arm", ARM)
    assert data["import"]["signals"]["velocity"]["required"] is False
    assert data["import"]["signals"]["attitude"].get("required", True) is True
    assert f"these columns are missing in {second}" in " ".join(text.replace("#", "").split())


def test_logs_of_two_versions_share_a_config_by_columns_that_stand_in(cpfls, proposed, tmp_path, own):
    first, second = tmp_path / "new.ulg", tmp_path / "old.ulg"
    first.write_bytes(ulog_of_flight(own))
    second.write_bytes(ulog_of_flight(flight(seconds=20.0, seed=7), without="vehicle_angular_velocity"))
    _, _, data = proposed(first, second, "--mass", MASS)
    assert data["import"]["time_column"] is None
    stand_in = data["import"]["signals"]["body_rate"]["otherwise"]
    assert stand_in == [{"columns": [f"sensor_combined.gyro_rad[{axis}]" for axis in range(3)], "unit": "rad/s"}]
    for log in (first, second):
        cpfls.done("import", tmp_path / "study.yaml", log, "-o", tmp_path / f"{log.stem}.h5")


def test_logs_with_clocks_of_other_names_are_refused(refuse, tmp_path, own):
    first = write_csv(tmp_path / "one.csv", flat_log(own))
    second = write_csv(tmp_path / "two.csv", flat_log(own, t={"time_us": 1e6 * own.time}))
    assert refuse("init", first, second, "-o", tmp_path / "study.yaml") == [
        f"{first} and {second}: the stamps are t in s and time_us in us, so one config cannot suit both: run cpfls init"
        " for each of them"
    ]


def test_logs_that_are_cut_differently_each_get_their_own_cut(cpfls, proposed, tmp_path, own):
    first = write_csv(tmp_path / "one.csv", flat_log(with_ground(own)))
    second = write_csv(tmp_path / "two.csv", flat_log(with_ground(own, before_s=15.0)))
    _, text, data = proposed(first, second, "--mass", MASS, "--arm", ARM, "--json")
    assert data["import"]["crop_s"] == "flown"
    begin, end = map(float, re.search(r"two\.csv: \[(15\.\d+), (3\d\.\d+)\]", text).groups())
    summary = cpfls.summary("import", tmp_path / "study.yaml", second, "-o", tmp_path / "two.h5")
    assert summary["samples"] == pytest.approx(100 * (end - begin), abs=3)


def test_a_touchdown_contradicts_nothing_in_the_log_that_leads(proposed, tmp_path, own):
    """Of what jolts a vehicle that lands the accelerometer and the velocity, each filtered, show unlike parts."""
    logs = []
    for number, before in enumerate((5.0, 8.0)):
        longer = with_ground(own, before_s=before)
        landed = round(100 * (before + 20.0))
        longer.velocity[landed : landed + 40, 2] -= 4.0
        longer.specific_force[landed + 80 : landed + 120, 2] += 20.0
        logs.append(write_csv(tmp_path / f"{number}.csv", flat_log(longer)))
    result, _, _ = proposed(*logs, "--mass", MASS, "--arm", ARM)
    assert "contradicts itself" not in result.stderr


def test_logs_of_several_rates_are_imported_at_one(proposed, tmp_path, own):
    first = write_csv(tmp_path / "one.csv", flat_log(own))
    second = write_csv(tmp_path / "two.csv", flat_log(flight(seconds=20.0, rate_hz=99.6)))
    _, _, data = proposed(first, second, "--mass", MASS, "--arm", ARM)
    assert data["import"]["rate_hz"] == 99.6
    assert "rate_hz" not in proposed(first, first, "--mass", MASS, "--arm", ARM, output="same.yaml")[2]["import"]


def test_one_config_cannot_suit_logs_of_other_axes(refuse, tmp_path, own):
    first = write_csv(tmp_path / "one.csv", flat_log(own))
    turned = named(own.rate @ FLIP, "gyro_x", "gyro_y", "gyro_z")
    second = write_csv(tmp_path / "two.csv", flat_log(own, rate=turned))
    (line,) = refuse("init", first, second, "-o", tmp_path / "study.yaml")
    assert line.startswith(f"{first} and {second}: ")
    assert line.endswith("so one config cannot suit both: run cpfls init for each of them")


def test_the_one_log_of_other_axes_is_named_to_be_left_out(refuse, tmp_path, own):
    odd = write_csv(tmp_path / "odd.csv", flat_log(own, rate=named(own.rate @ FLIP, "gyro_x", "gyro_y", "gyro_z")))
    one, two = (
        write_csv(tmp_path / f"{name}.csv", flat_log(flight(seconds=20.0, seed=seed)))
        for name, seed in (("one", 3), ("two", 5))
    )
    for logs in ((odd, one, two), (one, odd, two)):
        (line,) = refuse("init", *logs, "-o", tmp_path / "study.yaml")
        assert line.endswith(
            f"so one config cannot suit both: {odd} reads differently from {one} and {two}: leave it out, or run cpfls"
            " init for it separately"
        )


def test_two_vehicles_in_one_call_are_refused(refuse, tmp_path, own):
    first = write_csv(tmp_path / "one.csv", flat_log(own))
    swapped = named(own.speed[:, [1, 0, 2, 3]] * 60 / (2 * np.pi), "rpm1", "rpm2", "rpm3", "rpm4")
    second = write_csv(tmp_path / "two.csv", flat_log(own, speed=swapped))
    assert refuse("init", first, second, "-o", tmp_path / "study.yaml") == [
        f"{first} and {second} are of different vehicles (judged by the motion, the rotors are numbered or turn"
        " differently): run cpfls init for each of them"
    ]


def test_surfaces_of_an_airplane_are_named_where_no_rotors_are(proposed, tmp_path, own):
    surfaces = named(np.sin(own.time[:, None] * [1.0, 2.0]), "aileron", "elevator")
    path = write_csv(tmp_path / "log.csv", flat_log(own, speed=surfaces))
    said = " ".join(proposed(path, "--mass", MASS)[0].stdout.split())
    assert "aileron and elevator are by their names surfaces of an airplane, or sticks: only vehicles" in said
    assert "if some are" not in said


def test_a_log_without_rotors_is_imported_and_drives_nothing(cpfls, proposed, tmp_path, own):
    path = write_csv(tmp_path / "log.csv", flat_log(own, speed=None))
    result, text, data = proposed(path, "--mass", MASS)
    said = " ".join(result.stdout.split())
    assert "no column is recognised as a rotor's, and a model of the vehicle needs rotors; if some are" in said
    assert "name them in import.signals (rotor_speed or rotor_command)" in said
    assert "then: cpfls vehicle" not in result.stdout
    assert data["vehicle"]["rotors"] == "ASK"
    stated = [
        {"position_m": [0.1, y, 0.0], "spin": 1, "thrust_factor_n_s2": None, "drag_factor_n_m_s2": None}
        for y in (0.1, -0.1)
    ]
    (tmp_path / "study.yaml").write_text(text.replace("rotors: ASK", f"rotors: {json.dumps(stated)}"))
    cpfls.done("import", tmp_path / "study.yaml", path, "-o", tmp_path / "flight.h5")
    assert "The log has no columns of rotors" in text


def test_rotors_that_nothing_shows_are_asked_for(proposed, tmp_path, own):
    speed = named(np.random.default_rng(2).normal(500, 3, own.speed.shape), "rotor1", "rotor2", "rotor3", "rotor4")
    result, text, data = proposed(
        write_csv(tmp_path / "log.csv", flat_log(own, speed=speed)), "--mass", MASS, "--arm", ARM
    )
    assert "such as position_m: [0.113, -0.113, 0.0], spin: 1\n" in result.stdout
    assert "fills them in" not in result.stdout
    comments = " ".join(text.replace("#", "").split())
    assert "in Betaflight: rear right -1, front right 1, rear left 1, front left -1" in comments
    assert {(rotor["position_m"], rotor["spin"]) for rotor in data["vehicle"]["rotors"]} == {("ASK", "ASK")}
    assert "4 rotors; neither parameters nor the motion say where they are" in result.stdout


def test_a_log_of_px4_brings_its_rotors_along(proposed, tmp_path, own):
    result, text, data = proposed(put_file(tmp_path / "log.ulg", ulog_of_flight(own)), "--mass", MASS)
    assert "vehicle_attitude.q[{0,1,2,3}] " in result.stdout
    signals = data["import"]["signals"]
    assert signals["quaternion"]["columns"][0] == "vehicle_attitude.q[0]"
    assert signals["rotor_command"]["columns"] == [f"actuator_motors.control[{index}]" for index in range(4)]
    assert (data["import"]["body_frame"], data["import"]["world_frame"]) == ("FRD", "NED")
    assert data["import"]["rotor_command_is"] == "thrust"
    assert "THR_MDL_FAC is 1" in text
    assert [rotor["spin"] for rotor in data["vehicle"]["rotors"]] == [spin for _, _, spin in HUBS]
    assert data["vehicle"]["rotors"][0]["position_m"] == pytest.approx([0.11, -0.12, 0.0])
    assert "ASK" not in result.stdout + result.stderr


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (
            {f"CA_ROTOR{index}_KM": 0.05 for index in range(4)},
            "CA_ROTOR*_PX, _PY and the signs of _KM in the log: these 4 rotors cannot turn the vehicle about"
            " yaw by themselves; correct the parameters in the autopilot, or state vehicle.rotors by hand",
        ),
        (
            {"MAV_TYPE": 1},
            "a log of an airplane (MAV_TYPE = 1), not of a multirotor: only vehicles that rotors carry are modelled",
        ),
    ],
)
def test_parameters_that_contradict_a_multirotor_are_refused(refuse, tmp_path, own, parameters, message):
    path = put_file(tmp_path / "log.ulg", ulog_of_flight(own, **parameters))
    assert refuse("init", path, "-o", tmp_path / "study.yaml") == [f"{path}: {message}"]


def test_a_vehicle_of_other_parameters_is_another_vehicle(refuse, tmp_path, own):
    first, second = tmp_path / "one.ulg", tmp_path / "two.ulg"
    first.write_bytes(ulog_of_flight(own))
    second.write_bytes(ulog_of_flight(own, CA_ROTOR0_PX=0.3, SYS_AUTOSTART=4002))
    (line,) = refuse("init", first, second, "-o", tmp_path / "study.yaml")
    assert line.startswith(f"{first} and {second} are of different vehicles (CA_ROTOR0_PX 0.11 and 0.3; ")
    assert "SYS_AUTOSTART 4001 and 4002" in line


def test_bad_logs_are_refused_with_one_message(refuse, tmp_path, own):
    output = tmp_path / "study.yaml"
    cut, text, still = tmp_path / "cut.ulg", tmp_path / "notes.txt", tmp_path / "still.csv"
    cut.write_bytes(ulog_of_flight(own)[:12])
    text.write_text("no log\n")
    write_csv(still, flat_log(own, speed=named(np.zeros((2000, 4)), "cmd1", "cmd2", "cmd3", "cmd4")))
    assert refuse("init", still, "-o", output) == [f"{still}: no flight in it: the rotors (cmd*) never change"]
    assert refuse("init", tmp_path / "none.csv", "-o", output) == [f"{tmp_path / 'none.csv'}: no such file"]
    (line,) = refuse("init", text, "-o", output)
    assert line.startswith(f"{text}: not a log")
    (line,) = refuse("init", cut, "-o", output)
    assert line.startswith(f"{cut}: a broken ULog file")


def test_a_stamp_a_year_off_takes_no_memory_and_is_said(refuse, tmp_path, own):
    """One bit of a log is enough."""
    log = flat_log(own)
    columns = log.topics[""]
    clock = next(iter(columns))
    columns[clock] = np.append(columns[clock][:-1], columns[clock][-1] + 3e7)
    path = write_csv(tmp_path / "log.csv", log)
    (line,) = refuse("init", path, "-o", tmp_path / "study.yaml")
    said = "its stamps span 3e+07 s, but 2000 rows at 100 Hz are 20 s: damaged, or not a clock"
    assert line.startswith(f"{path}: {said}")


@pytest.mark.parametrize("option", [("--mass", "inf"), ("--mass", "1e300"), ("--arm", "170")])
def test_masses_and_arms_that_nothing_flies_with_are_refused(cpfls, log, tmp_path, option):
    result = cpfls("init", log, "-o", tmp_path / "study.yaml", *option)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"cpfls: error: {option[0]} = {float(option[1]):g}: the ")
    assert "and no vehicle has more than" in result.stderr
    assert not (tmp_path / "study.yaml").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--mass", "45", "--arm", "50"),
            ("--mass = 45: ", "0.045 kg? 45 is a mass in g", "0.05 m? 50 is an arm in mm"),
        ),
        (("--mass", "800", "--arm", ARM), ("--mass = 800: ", "0.8 kg? 800 is a mass in g")),
        (("--arm", "160"), ("--arm = 160: ", "0.16 m? 160 is an arm in mm")),
        (("--mass", MASS, "--arm", ARM, "--inertia", "40,44,75"), ("--inertia = 75: ", "75 is an inertia in kg cm^2")),
        (("--inertia", "0.004,0.004,0.02"), ("--inertia = 0.004,0.004,0.02: no body has this inertia",)),
        (("--inertia", "0.004,0.004"), ("is not three moments of inertia above 0; write IXX,IYY,IZZ in kg m^2",)),
        (("--mass", MASS, "--arm", ARM, "--thrust-factor", "6.5e-8"), ("6.5e-08: ", "6.5e-08 is a factor in N/rpm^2")),
    ],
)
def test_a_mass_and_an_arm_that_no_vehicle_has_are_refused_with_the_likely_unit(cpfls, log, tmp_path, words, said):
    result = cpfls("init", log, "-o", tmp_path / "study.yaml", *words)
    assert result.exit_code == 2
    assert all(each in result.stderr for each in said)
    assert not (tmp_path / "study.yaml").exists()


def test_constants_that_are_known_are_options(cpfls, proposed, log, tmp_path):
    known = ("--inertia", "0.004,0.0044,0.0075", "--thrust-factor", "6e-6", "--drag-factor", "1.4e-7")
    _, _, data = proposed(log, "--mass", MASS, "--arm", ARM, *known)
    assert data["vehicle"]["inertia_kg_m2"] == [0.004, 0.0044, 0.0075]
    for rotor in data["vehicle"]["rotors"]:
        assert (float(rotor["thrust_factor_n_s2"]), float(rotor["drag_factor_n_m_s2"])) == (6e-6, 1.4e-7)
    cpfls.done("compare", tmp_path / "study.yaml", log, "-o", tmp_path / "gap.h5", "--dry-run")


@pytest.mark.parametrize("most", [900.0, 4000.0])
@pytest.mark.parametrize(("scale", "offset"), [(1.0, 0.0), (1000.0, 1000.0)])
def test_a_thrust_factor_and_the_mass_say_the_largest_speed_that_commands_are_shares_of(
    proposed, tmp_path, own, most, scale, offset
):
    """A right factor of fast rotors would lift nothing at a largest speed that nobody stated."""
    share = own.speed * 0.6 / own.speed.mean()
    factor = 9.81 * float(MASS) / (4 * most**2 * (share**2).mean())
    commands = named(offset + scale * share, "cmd1", "cmd2", "cmd3", "cmd4")
    log = write_csv(tmp_path / "share.csv", flat_log(own, speed=commands))
    words = ("--mass", MASS, "--arm", ARM)
    _, text, data = proposed(log, *words, "--thrust-factor", f"{factor:.6g}")
    assert data["vehicle"]["rotor_speed_max_rad_s"] == pytest.approx(most, rel=0.05)
    assert "the thrust factor carries the mass" in " ".join(text.replace("#", "").split())
    _, _, data = proposed(log, *words, output="open.yaml")
    assert data["vehicle"]["rotor_speed_max_rad_s"] == 1000.0


@pytest.mark.parametrize(("by", "mass"), [("speed", 37.0), ("speed", 44.0), ("command", 44.0), ("accelerometer", 44.0)])
def test_two_masses_in_one_config_are_said_by_how_much(proposed, tmp_path, own, by, mass):
    """Of two flights with equal propellers, the rotors of the one carry 44 g where those of the other carry 37 g."""
    columns = [f"{'cmd' if by == 'command' else 'w'}{number}" for number in range(1, 5)]
    size = 0.6 / own.speed.mean() if by == "command" else 1.0
    logs = []
    for number, (seed, ratio) in enumerate([(3, 1.0), (5, (mass / 37.0) ** 0.5)]):
        other = flight(seconds=12.0, seed=seed)
        values = {"speed": named(size * ratio * other.speed, *columns)}
        values |= {} if by == "accelerometer" else {"force": None}
        logs.append(write_csv(tmp_path / f"{number}.csv", flat_log(other, **values)))
    result, _, _ = proposed(*logs, "--mass", "0.037", "--arm", "0.05")
    learns = next(line for line in result.stdout.splitlines() if "cpfls vehicle" in line)
    assert ("1.h5" in learns) == (mass == 37.0)
    # Every log that was given is named, the heavier flight for a playback.
    after = result.stdout.partition("next:")[2]
    assert all(f"{number}.h5" in after for number in (0, 1))
    assert ("cpfls replay" in after) == (mass == 44.0)
    heavier = r"so with equal propellers it weighs (\d+) % more, (0\.\d+) kg if the other weighs"
    found = re.search(heavier, result.stderr)
    assert bool(found) == (mass == 44.0)
    if found:
        assert int(found[1]) == pytest.approx(19, abs=3)
        assert float(found[2]) == pytest.approx(0.044, abs=0.001)
        assert ("or its battery is lower" in result.stderr) == (by == "command")
        assert "its own --mass" in result.stderr


def test_how_two_pilots_fly_is_no_mass(proposed, tmp_path, own):
    """Squared commands of punches and dives are larger on average, and the vehicle is the same."""
    logs = []
    for number in range(2):
        other = flight(seconds=12.0, seed=3 + number)
        punches = 1 + number * (0.3 + 0.5 * np.sign(np.sin(1.5 * other.time)))
        values = 0.4 / own.speed.mean() * np.sqrt(punches)[:, None] * other.speed
        commands = named(values, *(f"cmd{motor}" for motor in range(1, 5)))
        logs.append(write_csv(tmp_path / f"{number}.csv", flat_log(other, speed=commands)))
    result, _, _ = proposed(*logs, "--mass", "0.037", "--arm", "0.05")
    assert "it weighs" not in result.stderr
    learns = next(line for line in result.stdout.splitlines() if "cpfls vehicle" in line)
    assert "0.h5" in learns
    assert "1.h5" in learns


@pytest.mark.parametrize(("volts", "heavier"), [(16.0, True), (14.5, False)])
def test_an_emptier_battery_is_no_mass(proposed, tmp_path, own, volts, heavier):
    """A fifth more of command at a tenth less of voltage is the same thrust."""
    logs = []
    for number, battery in enumerate((16.0, volts)):
        other = flight(seconds=12.0, seed=3 + number)
        values = 0.6 / own.speed.mean() * (1.19 if number else 1.0) ** 0.5 * other.speed
        commands = named(values, *(f"cmd{motor}" for motor in range(1, 5)))
        more = {"voltage": {"battery_voltage": battery - 0.001 * other.time}}
        logs.append(write_csv(tmp_path / f"{number}.csv", flat_log(other, speed=commands, **more)))
    result, _, _ = proposed(*logs, "--mass", "0.037", "--arm", "0.05")
    assert ("it weighs" in result.stderr) is heavier


def test_a_file_that_is_given_twice_is_counted_once_and_said(proposed, tmp_path, own):
    first = write_csv(tmp_path / "one.csv", flat_log(own))
    copy = write_csv(tmp_path / "copy.csv", flat_log(own))
    result, _, _ = proposed(first, copy, "--mass", MASS, "--arm", ARM, "--json")
    assert "copy.csv: is given twice, also as one.csv" in result.stderr
    assert json.loads(result.stdout)["logs"] == [str(first)]


def test_every_column_that_is_not_used_is_listed(proposed, tmp_path, own):
    others = {"extra": named(own.rate, "oil[0]", "oil[1]", "oil[2]"), "more": {"paint": own.time}}
    log = write_csv(tmp_path / "log.csv", flat_log(own, **others))
    result, _, _ = proposed(log, "--mass", MASS, "--arm", ARM, "-v")
    assert "not used: oil[{0,1,2}], paint" in result.stdout


def test_topics_of_which_nothing_is_used_are_named_once(proposed, tmp_path, own):
    other = ("float load;float ram_usage", 5, own.rate[:, :2])
    path = put_file(tmp_path / "log.ulg", ulog_of_flight(own, asked={"cpuload": other, "system_power": other}))
    result, _, _ = proposed(path, "--mass", MASS, "--arm", ARM, "-v")
    assert "not used: anything of cpuload, system_power\n" in result.stdout
    assert "not used: actuator_motors.control[{4,5,6,7,8,9,10,11}]\n" in result.stdout
    assert "ram_usage" not in result.stdout


def test_matrices_of_usual_names_are_read_by_what_moves(proposed, tmp_path, own):
    """A motor[*] of nobody in particular is not one of Betaflight, whose numbers nothing here speaks for."""
    data = {"time": own.time[:, None], "position": own.position, "attitude": own.angles, "gyro": own.rate}
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, data | {"motor": 1000 + own.speed, "films": np.zeros((5, 4, 3))})
    result, text, config = proposed(path, "--mass", MASS, "--arm", ARM)
    signals = config["import"]["signals"]
    assert signals["position"]["columns"] == [f"position[{axis}]" for axis in range(3)]
    assert signals["rotor_command"]["columns"] == [f"motor[{index}]" for index in range(4)]
    assert "Betaflight" not in text
    assert "contradicts itself" not in result.stderr
    assert "arrays that are no columns of numbers are left out: films" in result.stderr


def test_what_a_log_does_not_state_is_marked_a_guess_in_the_config(proposed, tmp_path, own):
    commands = named(1000 + own.speed, *(f"motor[{index}]" for index in range(4)))
    log = write_csv(tmp_path / "log.csv", flat_log(own, speed=commands))
    _, text, _ = proposed(log, "--mass", MASS, "--arm", ARM)
    assert "# A guess: called motor[*], up to" in text


def test_an_arm_next_to_places_that_a_log_states_is_asked_for(cpfls, refuse, tmp_path, own):
    log = put_file(tmp_path / "log.ulg", ulog_of_flight(own))
    (line,) = refuse("init", log, "-o", tmp_path / "study.yaml", "--arm", "0.3")
    assert "leave --arm out to take these, or add --scale-to-arm" in line
    cpfls.done("init", log, "-o", tmp_path / "study.yaml", "--arm", "0.3", "--scale-to-arm")


def test_a_log_of_a_moment_says_how_short_it_is(refuse, tmp_path):
    short = put_file(tmp_path / "log.ulg", ulog_of_flight(flight(seconds=0.4)))
    assert refuse("init", short, "-o", tmp_path / "study.yaml") == [
        f"{short}: holds only 0.39 s; a flight to learn from has at least ten"
    ]


def test_a_flight_imported_twice_under_two_names_does_not_judge_what_was_learned_from_it(
    cpfls, refuse, usual, tmp_path
):
    log, study, _ = usual
    first, second, compared = (tmp_path / f"{name}.h5" for name in ("first", "second", "compared"))
    for made, name in ((first, "import.lowpass_hz=20"), (second, "import.lowpass_hz=30")):
        cpfls.done("import", study, log, "--set", name, "-o", made)
    cpfls.done("compare", study, first, "--accept-guesses", "-o", compared)
    output, said = tmp_path / "out.h5", "second.h5: is both learned from (as first.h5) and held out"
    for words in (("vehicle", study, first), ("gap", study, first), ("diagnose", study, compared)):
        guesses = () if words[0] == "vehicle" else ("--accept-guesses",)
        (line,) = refuse(*words, "--held-out", second, "-o", output, "--dry-run", *guesses)
        assert line.startswith(said), words
