"""Models in Python, TOML, JSON and C headers: what they state, read without being executed, and what is refused."""

import ast
import json

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.export.numbers import places, spins
from cpfls_cli.export.registry import FORMS
from cpfls_cli.inertia import INERTIA_ENTRIES
from cpfls_cli.simulators.formats import is_simulator_file, read_model
from cpfls_cli.simulators.study import of_log
from tests.builders.exported_vehicles import sheet_of_vehicle
from tests.builders.gusty_flights import SMALL
from tests.builders.playback_flights import truth
from tests.builders.simulator_files import FRAME, HEADER, SECTION, rotorpy_of
from tests.builders.studies import put_file
from tests.builders.vehicle_models import vehicle_of

CLOSE = {"rtol": 1e-9, "atol": 1e-15}
RPM = 30 / np.pi


@pytest.fixture
def mine(tmp_path):
    """Write a text as a file of a name."""

    def write(name, text):
        return put_file(tmp_path / name, text)

    return write


@pytest.mark.parametrize("form", ["rotorpy", "ardupilot", "crazyflow"])
def test_an_exported_vehicle_is_read_again(tmp_path, form):
    vehicle = vehicle_of(truth()).model
    held, _ = FORMS[form].held(vehicle)
    path = tmp_path / f"uav{FORMS[form].ending}"
    path.write_text(FORMS[form].write(sheet_of_vehicle(vehicle), held, (), path.name))
    read = read_model(path)
    np.testing.assert_allclose(read.mass_kg, held.body.mass, **CLOSE)
    own, wanted = ([each[at] for at in INERTIA_ENTRIES] for each in (read.inertia, held.body.inertia))
    np.testing.assert_allclose(own, wanted, rtol=1e-9, atol=1e-9 * held.body.inertia.max())
    order = [int(each) - 1 for each in json.loads(_plain(path))["rotors"]] if form == "ardupilot" else [0, 1, 2, 3]
    # crazyflow's rotors are in the plane of the centre of mass.
    axes = slice(0, 2 if form == "crazyflow" else 3)
    np.testing.assert_allclose(read.hubs[:, axes], places(vehicle, alike=True)[order][:, axes], rtol=1e-9, atol=1e-9)
    assert [rotor.spin for rotor in read.rotors] == (-spins(vehicle.vehicle)[order]).tolist()
    found, hover = held.numbers, np.sqrt(held.body.mass * held.body.gravity / 4 / held.numbers["thrust"])
    assert found.get("thrust_linear", 0.0) == found.get("yaw_linear", 0.0) == 0.0
    for rotor in read.rotors:
        np.testing.assert_allclose(rotor.thrust.value, found["thrust"], **CLOSE)
        np.testing.assert_allclose(rotor.drag_factor, found["yaw"], **CLOSE)
    assert read.speed_max.value == pytest.approx(vehicle.vehicle.rotor_speed_max_rad_s, rel=1e-9)
    if form == "rotorpy":
        assert read.rotors[0].drag.value == pytest.approx(found["k_d"], rel=1e-9)
        assert read.effects["inflow"]["k_z"].value == pytest.approx(found["k_z"], rel=1e-9)
        assert read.effects["flapping_moment"]["k_f"].value == pytest.approx(found["k_flap"], rel=1e-9)
    if form != "ardupilot":
        assert read.rotors[0].lag_up.value == pytest.approx(held.response.lag_s or 1e-3, rel=1e-9)
    assert hover > 0


def _plain(path):
    return "\n".join(line for line in path.read_text().splitlines() if not line.startswith("#"))


def test_python_states_numbers_and_their_places(mine):
    path = mine("mine.py", rotorpy_of(SMALL))
    read, raw = read_model(path), path.read_bytes()
    np.testing.assert_allclose(np.diag(read.inertia), SMALL.inertia, rtol=1e-6)
    np.testing.assert_allclose(read.hubs[:, :2], SMALL.places, atol=1e-6)
    rotor = read.rotors[0]
    assert rotor.thrust.where == "mine.py line 21: quad_params.k_eta"
    assert float(raw[rotor.thrust.span.start : rotor.thrust.span.end]) == rotor.thrust.value
    # What is no literal is replaced as a whole.
    mass = read.bodies[0].mass
    assert ast.literal_eval(raw[mass.span.start : mass.span.end].decode().replace("grams", "45").split(" / ")[0]) == 45
    assert mass.value == pytest.approx(SMALL.mass)
    more = of_log(read_model(mine("more.py", rotorpy_of(SMALL).replace("'k_d'", "'k_z': 2e-7, 'k_d'"))), None, None)
    assert "k_z 2e-07 (more.py line 22: quad_params.k_z)" in more.besides
    assert all(rotor.hub is not None and rotor.lag_up is rotor.lag_down for rotor in read.rotors)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("import os", "import os states no number"),
        ("open('x', 'w')", "states no number"),
        ("x = __import__('os').getpid()", "is no number, nor arithmetic of them"),
        ("def f(): return 1", "states no number"),
        ("x = [y for y in (1, 2)]", "is no number"),
        ("x = 10.0 ** 10.0 ** 10.0", "has arithmetic that fails"),
        ("x = np.sqrt(-1)", "has arithmetic that fails"),
        ("x = 'a' * 1000000000", "is no number"),
        ("x = np.array([[1]] * 99)", ".* is no number"),
        ("x = " + "(" * 5000 + "1" + ")" * 5000, "is no Python that can be read"),
        ("x = 9" + "9" * 5000, "is no Python that can be read"),
        ("aa = [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "\n".join(
            f"{2 * chr(98 + i)} = [" + ", ".join([2 * chr(97 + i)] * 10) + "]" for i in range(8)), "more numbers than"),
        ("aa = {}\n" + "\n".join(
            f"{2 * chr(98 + i)} = {{" + ", ".join(f"'{k}': {2 * chr(97 + i)}" for k in range(10)) + "}"
            for i in range(9)), "more numbers than"),
        ("quad_params['mass'] = 1", "states no number"),
    ],
)  # fmt: skip
def test_python_that_does_anything_else_is_refused(mine, line, words):
    path = mine("mine.py", rotorpy_of(SMALL) + line + "\n")
    with pytest.raises(InputError, match=words) as refused:
        read_model(path)
    assert str(refused.value).startswith(str(path))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("'mass'", "'weight'", "no dictionary with mass and k_eta"),
        ("'Ixx'", "'I_xx'", "states no quad_params.Ixx; write a number for it"),
        ("[-1, 1, -1, 1]", "[1, -1, 1]", "rotor_directions has 3 numbers; write 4"),
        ("[-1, 1, -1, 1]", "[1, -1, 2, -1]", "rotor_directions.2. .an expression. is -2; write 1 or -1"),
        ("'mass': grams / 1000", "'mass': float('inf')", "no number, nor arithmetic"),
        ("'mass': grams / 1000", "'mass': 45", "it cannot hover"),
        ("'mass': grams / 1000", "'mass': -1", "a mass of -1 kg"),
    ],
)
def test_numbers_of_python_that_no_vehicle_has(mine, old, new, words):
    text = rotorpy_of(SMALL)
    assert old in text
    with pytest.raises(InputError, match=words):
        read_model(mine("mine.py", text.replace(old, new)))


def test_a_section_of_toml(mine):
    path = mine("params.toml", SECTION.format(name="a") + SECTION.format(name="b").replace("0.0319", "0.04"))
    read = read_model(path.with_name("params.toml:b"))
    assert (read.mass_kg, read.file) == (0.04, path)
    a = read_model(path.with_name("params.toml:a"))
    hover = a.rotors[0].thrust.value
    # By the curve itself: what it lifts at the speed of hover is a quarter of the weight.
    turning = np.sqrt(0.0319 * 9.81 / 4 / hover) * RPM
    assert -5.4e-7 * turning + 2.5e-10 * turning**2 == pytest.approx(0.0319 * 9.81 / 4, rel=1e-9)
    assert a.rotors[0].torque.value == pytest.approx((1.4e-9 / 2 / turning + 1.5e-12) * RPM**2, rel=1e-9)
    assert a.rotors[0].lag_up.value == pytest.approx(1 / 7.4, rel=1e-9)
    assert a.rotors[0].lag_down.value == pytest.approx(1 / (2 * 2.4e-4 * turning), rel=1e-9)
    assert a.rotors[0].drag.value == pytest.approx(0.0147 / (4 * turning / RPM), rel=1e-9)
    assert [rotor.spin for rotor in a.rotors] == [1, -1, 1, -1]
    np.testing.assert_allclose(a.hubs[0], [0.0325, -0.0325, 0.0], atol=1e-12)
    assert a.lift == pytest.approx(4 * 0.12)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("params.toml", lambda text: text, "has the vehicles a, b; name one of them, as .*params.toml:a"),
        ("params.toml:c", lambda text: text, "has the vehicles a, b"),
        ("params.toml:a", lambda text: text.replace("L =", "L"), "is no valid TOML"),
        ("params.toml:a", lambda text: text.replace("[a]", "[[a]]").replace("[b]", "[[b]]"), "params.toml"),
        (
            "params.toml:a",
            lambda text: text.replace("L = ", 'L = "', 1).replace("0.0325", '0.0325"', 1),
            "states no a.L",
        ),
        (
            "params.toml:a",
            lambda text: text.replace("L = ", "day = 1979-05-27\nL = ", 1),
            "is no TOML of plain numbers",
        ),
        ("params.toml:a", lambda text: text.replace("mass", "kg"), "has no section that states a mass"),
        ("params.toml:a", lambda text: text.replace("2.5e-10", "-2.5e-10"), "no speed lifts"),
        ("params.toml:a", lambda text: text.replace("mixing_matrix", "mixing"), "no mixing_matrix of rotors"),
    ],
)
def test_toml_that_states_no_vehicle(mine, name, change, words):
    path = mine("params.toml", change(SECTION.format(name="a") + SECTION.format(name="b")))
    with pytest.raises(InputError, match=words):
        read_model(path.with_name(name))


def test_a_frame_of_ardupilot(mine):
    path = mine("frame.json", FRAME)
    assert is_simulator_file(path)
    read = read_model(path)
    command = (np.sqrt(0.5**2 + 4 * 0.5 * 0.31) - 0.5) / 1.0
    share, speed = 0.2 + 0.775 * command, read.speed_max.value
    assert read.rotors[0].thrust.value * (share * speed) ** 2 == pytest.approx(1.5 * 9.80665 / 4, rel=1e-9)
    assert read.lift == pytest.approx(1.5 * 9.80665 / 0.31)
    # As Frame::init takes it where there is none.
    np.testing.assert_allclose(np.diag(read.inertia), np.array([0.25, 0.25, 0.5]) * 1.5 * 0.225**2)
    np.testing.assert_allclose(read.hubs[0], [0.45 * np.sqrt(0.5), -0.45 * np.sqrt(0.5), 0.0])
    assert [rotor.spin for rotor in read.rotors] == [1, 1, -1, -1]
    assert any("diagonal_size for the arm" in note for note in read.notes)


def test_a_frame_of_more_motors_takes_the_rotors_of_the_log(mine):
    read = read_model(mine("frame.json", FRAME.replace('"num_motors": 4', '"num_motors": 8')))
    assert read.rotors == ()
    assert of_log(read, None, None).asked == ("vehicle.rotor_speed_max_rad_s", "vehicle.rotors")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"Xu": -0.2}', "states none of hoverThrOut"),
        ("[1, 2]", "no object of JSON"),
        ('{"propExpo": }', "no valid JSON"),
        ('{"propExpo": "high", "diagonal_size": 0.4, "hoverThrOut": 2}', "write numbers of 0 to 1"),
        ('{"hoverThrOut": 0.4, "num_motors": 4e50}', "is 4e.50; write a number of motors, at most 32"),
        ('{"hoverThrOut": 0.4, "mass": 0}', "mass is 0; write a number above 0"),
        ('{"propExpo": 1e999, "hoverThrOut": 0.4}', "is inf"),
        ("[" * 5000, "no valid JSON"),
    ],
)
def test_json_that_is_no_frame(mine, text, words):
    with pytest.raises(InputError, match=words):
        read_model(mine("frame.json", text))


def test_a_config_or_a_log_in_json_is_no_frame(mine):
    assert not is_simulator_file(mine("study.json", '{"vehicle": {"mass_kg": 1}}'))


def test_a_header_by_the_options_that_it_is_built_with(mine):
    path = mine("platform_defaults_cf2.h", HEADER)
    read = read_model(path)
    assert (read.mass_kg, read.states_inertia) == (0.029, False)
    assert read.rotors[0].ratio.value == 0.007
    assert read.bodies[0].mass.where == "platform_defaults_cf2.h line 9: CF_MASS"
    raw, span = path.read_bytes(), read.bodies[0].mass.span
    assert raw[span.start : span.end + 1] == b"0.029f"
    other = read_model(path.with_name(f"{path.name}:CRAZYFLIE_THRUST_UPGRADE_KIT"))
    assert (other.mass_kg, other.rotors[0].ratio.value, other.rotors[0].most.value) == (0.0325, 0.005, 0.18)
    np.testing.assert_allclose(read.hubs[1], [-0.046 * np.sqrt(0.5), -0.046 * np.sqrt(0.5), 0.0])
    assert [rotor.spin for rotor in read.rotors] == [1, -1, 1, -1]
    assert of_log(read, None, None).inertia is None


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("CF_MASS", "MASS", "states no CF_MASS; give platform_defaults_cf2.h"),
        ("0.029f", "(float) 29 / 1000", "states no CF_MASS"),
        ("#if defined(CONFIG_KIT_MASS)", "#if KIT ? 1 : 0", "line 4: the condition 'KIT . 1 : 0 .*' is not understood"),
        ("0.12f", "0.02f", "it cannot hover"),
    ],
)
def test_headers_that_state_no_vehicle(mine, old, new, words):
    assert old in HEADER
    with pytest.raises(InputError, match=words):
        read_model(mine("platform_defaults_cf2.h", HEADER.replace(old, new)))
