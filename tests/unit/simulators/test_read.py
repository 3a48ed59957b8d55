"""Simulators' files read: what they state, in whose units, and what is refused with its line and a remedy."""

import re
from pathlib import Path

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.export.numbers import places, spins
from cpfls_cli.export.registry import FORMS
from cpfls_cli.inertia import INERTIA_ENTRIES
from cpfls_cli.simulators.formats import FORMATS, read_model
from tests.builders.exported_vehicles import sheet_of_vehicle
from tests.builders.gusty_flights import LARGE, SMALL
from tests.builders.playback_flights import truth
from tests.builders.simulator_files import sdf_of, urdf_of
from tests.builders.studies import put_file
from tests.builders.vehicle_models import HEXA, vehicle_of, whole

CLOSE = {"rtol": 1e-9, "atol": 1e-15}


def exported(folder, form, vehicle):
    held, _ = FORMS[form].held(vehicle)
    path = folder / f"uav{FORMS[form].ending}"
    path.write_text(FORMS[form].write(sheet_of_vehicle(vehicle), held, (), path.name))
    return held, read_model(path)


@pytest.mark.parametrize("form", ["sdf", "px4", "urdf", "mjcf"])
def test_an_exported_vehicle_is_read_again(tmp_path, form):
    held, read = exported(tmp_path, form, vehicle_of(truth()).model)
    np.testing.assert_allclose(read.mass_kg, held.body.mass, **CLOSE)
    np.testing.assert_allclose(
        [read.inertia[at] for at in INERTIA_ENTRIES], [held.body.inertia[at] for at in INERTIA_ENTRIES], rtol=1e-9,
        atol=1e-9 * held.body.inertia.max(),
    )  # fmt: skip
    np.testing.assert_allclose(read.centre, 0, atol=1e-12)


@pytest.mark.parametrize("vehicle", [vehicle_of(truth()).model, whole(HEXA)])
def test_rotors_of_sdf_are_those_that_were_written(tmp_path, vehicle):
    held, read = exported(tmp_path, "sdf", vehicle)
    count = len(read.rotors)
    assert count == vehicle.rotors
    np.testing.assert_allclose(read.hubs, places(vehicle, alike=False), rtol=1e-9, atol=1e-12)
    # The body turns against its rotors.
    assert [rotor.spin for rotor in read.rotors] == (-spins(vehicle.vehicle)).tolist()
    for name, of in {
        "thrust": lambda rotor: rotor.thrust.value,
        "yaw": lambda rotor: rotor.drag_factor,
        "drag": lambda rotor: rotor.drag.value,
        "rolling": lambda rotor: rotor.rolling.value,
    }.items():
        wanted = [held.numbers[f"{name}_{rotor + 1}"] for rotor in range(count)]
        np.testing.assert_allclose([of(rotor) for rotor in read.rotors], wanted, **CLOSE)
    assert read.rotors[0].lag_up.value == pytest.approx(max(held.response.lag_s, 1e-6), rel=1e-9)
    assert read.speed_max.value == pytest.approx(vehicle.vehicle.rotor_speed_max_rad_s, rel=1e-9)


def test_rotors_of_urdf_are_those_that_were_written(tmp_path):
    held, read = exported(tmp_path, "urdf", vehicle_of(truth()).model)
    for rotor in read.rotors:
        np.testing.assert_allclose(rotor.thrust.value, held.numbers["thrust"], **CLOSE)
        np.testing.assert_allclose(rotor.drag_factor, held.numbers["yaw"], **CLOSE)
        np.testing.assert_allclose(rotor.drag.value, held.numbers["drag_xy"], **CLOSE)
    assert [rotor.spin for rotor in read.rotors] == [1, -1, 1, -1]


def test_rotors_of_mjcf_are_those_that_were_written(tmp_path):
    vehicle = vehicle_of(truth()).model
    held, read = exported(tmp_path, "mjcf", vehicle)
    squares = held.weights[:, 0, 1 + vehicle.rotors : 1 + 2 * vehicle.rotors]
    np.testing.assert_allclose([rotor.thrust.value for rotor in read.rotors], squares[5], **CLOSE)
    np.testing.assert_allclose([rotor.hub for rotor in read.rotors], [r.position_m for r in vehicle.vehicle.rotors])
    assert read.rotors[0].lag_up.value == pytest.approx(held.response.lag_s, rel=1e-9)


def test_every_number_has_its_line(tmp_path):
    path = put_file(tmp_path / "mine.sdf", sdf_of(SMALL))
    read, lines = read_model(path), path.read_text().splitlines()
    thrust = read.rotors[1].thrust
    assert "<motorConstant>" in lines[int(thrust.where.partition("line ")[2].partition(":")[0]) - 1]
    assert path.read_bytes()[thrust.span.start : thrust.span.end] == f"{thrust.value:.6g}".encode()
    assert "base_link" in read.where_of_mass


def test_links_with_poses_add_up(tmp_path):
    """A weight on a mount that leans and turns: mass, centre and inertia as by hand."""
    extra = """    <link name="battery"><pose relative_to="mount">0.02 0 0 0 0 0</pose>
      <inertial><pose>0 0 0.01 0 0 0</pose><mass>0.02</mass>
      <inertia><ixx>2e-6</ixx><ixy>0</ixy><ixz>0</ixz><iyy>4e-6</iyy><iyz>0</iyz><izz>5e-6</izz></inertia></inertial>
    </link>
    <frame name="mount" attached_to="base_link"><pose degrees="true">0.01 0 -0.03 0 0 90</pose></frame>
    <joint name="strap" type="fixed"><parent>base_link</parent><child>battery</child></joint>
"""
    path = tmp_path / "mine.sdf"
    path.write_text(sdf_of(SMALL).replace('    <link name="rotor_0">', extra + '    <link name="rotor_0">'))
    read = read_model(path)
    battery = next(body for body in read.bodies if body.name == "battery")
    np.testing.assert_allclose(battery.centre, [0.01, 0.02, -0.02], atol=1e-12)
    np.testing.assert_allclose(np.diag(battery.inertia), [4e-6, 2e-6, 5e-6], atol=1e-15)
    assert read.mass_kg == pytest.approx(SMALL.mass + 0.02)
    np.testing.assert_allclose(read.centre, 0.02 * battery.centre / read.mass_kg, atol=1e-9)
    apart = SMALL.mass * 0.02 / (SMALL.mass + 0.02)
    lever = battery.centre
    wanted = np.diag(SMALL.inertia) + battery.inertia + apart * (lever @ lever * np.eye(3) - np.outer(lever, lever))
    np.testing.assert_allclose(read.inertia, wanted, rtol=1e-5, atol=1e-10)


def test_a_plugin_without_a_number_has_its_own(tmp_path):
    path = put_file(tmp_path / "mine.sdf", sdf_of(SMALL).replace("<momentConstant>0.006</momentConstant>", ""))
    ratio = read_model(path).rotors[0].ratio
    assert ratio.value == 0.016
    assert ratio.span is None
    assert "its own default" in ratio.where


def test_an_include_next_to_the_file_is_read(tmp_path):
    text = sdf_of(LARGE)
    body, motors = text[: text.index("    <plugin")], text[text.index("    <plugin") : text.index("  </model>")]
    parts = text.split("    <plugin")[1:]
    plugins = "".join("    <plugin" + part.partition("</plugin>")[0] + "</plugin>\n" for part in parts)
    for plugin in plugins.split("    <plugin")[1:]:
        text = text.replace("    <plugin" + plugin, "")
    assert body
    assert motors
    for name, content in {
        "base": text,
        "whole": f"<sdf version='1.9'><model name='whole'><include merge='true'><uri>model://base</uri></include>\n"
        f"{plugins}</model></sdf>",
    }.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "model.sdf").write_text(content)
    read = read_model(tmp_path / "whole" / "model.sdf")
    assert read.mass_kg == pytest.approx(LARGE.mass)
    assert [path.parent.name for path in read.files] == ["whole", "base"]


@pytest.mark.parametrize("of_include", ["", "<pose>1 0 0 0 0 1.5707963267948966</pose>"])
def test_a_merged_include_has_its_own_pose_or_that_of_the_model(tmp_path, of_include):
    """A battery 0.02 m ahead in its own model, which is placed 0.03 m to the left, or by the include."""
    (tmp_path / "battery.sdf").write_text(
        """<sdf version="1.9"><model name="battery"><pose>0 0.03 0 0 0 0</pose><link name="cell">
        <pose>0.02 0 0 0 0 0</pose><inertial><mass>0.02</mass><inertia><ixx>2e-6</ixx><iyy>4e-6</iyy><izz>5e-6</izz>
        <ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial></link>
        <frame name="lid"><pose relative_to="__model__">0 0 0.01 0 0 0</pose></frame></model></sdf>"""
    )
    include = f"""<include merge="true"><uri>battery.sdf</uri>{of_include}</include>
      <joint name="strap" type="fixed"><parent>base_link</parent><child>cell</child></joint>"""
    path = tmp_path / "mine.sdf"
    path.write_text(sdf_of(SMALL).replace('    <link name="rotor_0">', include + '<link name="rotor_0">', 1))
    cell = next(body for body in read_model(path).bodies if body.name == "cell")
    np.testing.assert_allclose(cell.centre, [1, 0.02, 0] if of_include else [0.02, 0.03, 0], atol=1e-12)
    np.testing.assert_allclose(np.diag(cell.inertia), [4e-6, 2e-6, 5e-6] if of_include else [2e-6, 4e-6, 5e-6])


def test_a_link_of_urdf_without_inertial_has_no_mass(tmp_path):
    path = tmp_path / "mine.urdf"
    path.write_text(
        """<robot name="mine"><link name="camera"/><link name="base"><inertial><mass value="2"/>
        <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="j" type="fixed"><parent link="base"/><child link="camera"/><origin xyz="1 0 0"/></joint></robot>"""
    )
    read = read_model(path)
    assert read.mass_kg == 2
    np.testing.assert_allclose(read.centre, 0)
    assert "states no mass, and counts as none" in read.notes[0]


def test_urdf_with_motor_plugins_is_the_vehicle_of_the_sdf(tmp_path):
    paths = [tmp_path / "mine.urdf", tmp_path / "mine.sdf"]
    for path, text in zip(paths, (urdf_of(SMALL), sdf_of(SMALL, rotor_mass=0.0)), strict=True):
        path.write_text(text)
    own, wanted = map(read_model, paths)
    assert (own.format, own.notes) == ("urdf-gazebo", ())
    assert own.mass_kg == pytest.approx(wanted.mass_kg)
    of_rotors = 4e-10 * np.diag([1, 1, 2])
    np.testing.assert_allclose(own.inertia, wanted.inertia - of_rotors, rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(own.hubs, wanted.hubs, atol=1e-12)
    for rotor, its in zip(own.rotors, wanted.rotors, strict=True):
        for name in ("thrust", "ratio", "speed_max", "lag_up", "drag", "rolling"):
            assert getattr(rotor, name).value == getattr(its, name).value
        assert (rotor.name, rotor.spin) == (its.name, its.spin)


def test_urdf_is_read_in_the_frame_of_the_link_that_its_rotors_hang_on(tmp_path):
    path, turned = tmp_path / "mine.urdf", tmp_path / "turned.urdf"
    path.write_text(urdf_of(SMALL))
    footprint = """<link name="footprint"/><joint name="up" type="fixed"><parent link="footprint"/>
    <child link="base_link"/><origin xyz="0 0 0.1" rpy="0 0.5 1.5707963"/></joint>"""
    turned.write_text(urdf_of(SMALL).replace('<link name="base_link"/>', f'{footprint}<link name="base_link"/>'))
    own, wanted = read_model(turned), read_model(path)
    np.testing.assert_allclose(own.hubs, wanted.hubs, atol=1e-12)
    np.testing.assert_allclose(own.inertia, wanted.inertia, atol=1e-12)


def test_rotors_of_urdf_on_arms_of_their_own_are_in_the_axes_of_what_these_hang_on(tmp_path):
    path, arms = tmp_path / "mine.urdf", tmp_path / "arms.urdf"
    text = urdf_of(SMALL)
    path.write_text(text)
    for index in range(4):
        begin = text.index(f'<joint name="rotor_{index}_joint"')
        place = re.search(r'<origin xyz="([^"]+)"/>', text[begin:])[1]
        arm = f"""<link name="arm_{index}"/><joint name="fixed_{index}" type="fixed"><parent link="base_link"/>
        <child link="arm_{index}"/><origin xyz="{place}" rpy="0 0 {0.7 * index + 0.7}"/></joint>"""
        own = text[begin:].replace(f'xyz="{place}"', 'xyz="0 0 0"', 1).replace("base_link", f"arm_{index}", 1)
        text = text[:begin] + arm + own
    arms.write_text(text)
    np.testing.assert_allclose(read_model(arms).hubs, read_model(path).hubs, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("<linkName>rotor_2<", "<linkName>rotor_9<"), "its link 'rotor_9' is not a part of the vehicle"),
        (("<jointName>rotor_2_joint<", "<jointName>none<"), "its joint 'none' is not in the file; correct <jointName>"),
        (('<joint name="rotor_2_joint"', '<joint name="gimbal"'), "its joint 'rotor_2_joint' is not in the file"),
        (('lower="0" upper="0"', 'lower="0" upper="1"'), "the joint frame_joint turns"),
        (("<motorNumber>2</motorNumber>", ""), "has no <motorNumber>"),
        (("<motorNumber>2</motorNumber>", "<motorNumber>1</motorNumber>"), "motor 1 is that of the plugin in line"),
        (
            ('<robot name="mine">', '<robot name="mine" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arm/>'),
            "is a template; render it first",
        ),
        (("multicopter-motor-model", "lift-drag"), "none of its plugins is a motor model that is known here"),
        (('<origin xyz="0.0325269 -', '<origin rpy="0 1 0" xyz="0.0325269 -'), "not along z of the body"),
    ],
)
def test_urdf_with_motor_plugins_is_refused(tmp_path, change, words):
    path = put_file(tmp_path / "bad.urdf", urdf_of(SMALL).replace(*change))
    with pytest.raises(InputError) as refused:
        read_model(path)
    assert words in str(refused.value)
    assert "bad.urdf" in str(refused.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("<robot/>".encode("utf-16"), "is in UTF-16; save it in UTF-8"),
        ("<robot/>".encode("utf-16-le"), "is in UTF-16; save it in UTF-8"),
        (b'<?xml version="1.0" encoding="klingon"?><robot/>', "encoding"),
        (b'<?xml version="1.0" encoding="shift_jis"?><robot/>', "is in an encoding that cannot be read"),
        (b'<?xml version="1.0" encoding="utf-8"?><robot name="\xff"/>', "is no valid XML"),
        (b'<?xml version="1.0" encoding="utf-16"?><robot/>', "encod"),
        (b'<robot name="\x00"/>', "is no valid XML"),
    ],
)
def test_encodings_that_are_not_read(tmp_path, content, words):
    path = put_file(tmp_path / "mine.urdf", content)
    with pytest.raises(InputError, match=words):
        read_model(path)


def test_numbers_of_a_file_in_latin_1_have_their_places(tmp_path):
    path = tmp_path / "mine.sdf"
    path.write_bytes(
        sdf_of(SMALL)
        .replace('version="1.0"', 'version="1.0" encoding="latin-1"')
        .replace("quadrotor", "M\xfcll")
        .encode("latin-1")
    )
    thrust = read_model(path).rotors[0].thrust
    assert path.read_bytes()[thrust.span.start : thrust.span.end] == b"2e-08"


QUAD = """<mujoco><compiler angle="radian"{compiler}/><default><geom density="100"/></default>
  <default><general ctrlrange="0 5"/></default>
  <worldbody><body name="quad"><freejoint/>
    <geom type="box" size="0.05 0.05 0.01"/><inertial pos="0 0 0" mass="0.5" diaginertia="1e-3 1e-3 2e-3"/>
    <site name="a" pos="0.1 0.1 0"{site}/><site name="b" pos="-0.1 -0.1 0"/>{more}</body></worldbody>
  <actuator><motor name="m0" site="a" gear="0 0 {gear} 0 0 -0.02"{motor}/>
  <motor name="m1" site="b" gear="0 0 1 0 0 0.02"/>
  </actuator></mujoco>"""


def quad(folder, *, compiler="", site="", more="", gear="1", motor="", change=("", "")):
    path = folder / "quad.xml"
    path.write_text(QUAD.format(compiler=compiler, site=site, more=more, gear=gear, motor=motor).replace(*change))
    return path


def test_the_compiler_of_mujoco_scales_masses(tmp_path):
    read = read_model(quad(tmp_path, compiler=' settotalmass="1.0"'))
    assert read.mass_kg == pytest.approx(1.0)
    np.testing.assert_allclose(np.diag(read.inertia), [2e-3, 2e-3, 4e-3])
    assert read.bodies[0].entries[0].scale == pytest.approx(0.5)


def test_classes_of_several_sections_are_one_main_class(tmp_path):
    read = read_model(quad(tmp_path, compiler=' inertiafromgeom="true"'))
    assert read.mass_kg == pytest.approx(100 * 0.1 * 0.1 * 0.02)
    assert [rotor.most.value for rotor in read.rotors] == [5.0, 5.0]


@pytest.mark.parametrize(
    ("given", "most", "spin"),
    [
        ({"gear": "2"}, 10.0, 1),
        ({"gear": "2", "motor": ' forcerange="0 3"'}, 6.0, 1),
        ({"gear": "2", "motor": ' ctrllimited="false"'}, None, 1),
        ({"gear": "-1", "motor": ' ctrlrange="-4 0"'}, 4.0, -1),
        ({"gear": "-1", "site": ' euler="3.141592653589793 0 0"'}, 5.0, -1),
    ],
)
def test_limits_and_signs_of_gear(tmp_path, given, most, spin):
    rotor = read_model(quad(tmp_path, **given)).rotors[0]
    assert (None if rotor.most is None else rotor.most.value) == most
    assert rotor.spin == spin
    np.testing.assert_allclose(rotor.axis, [0, 0, 1], atol=1e-9)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"gear": "-1"}, "not along z of the body"),
        ({"compiler": ' boundmass="0.1"'}, "boundmass changes parts that are too light"),
        ({"compiler": ' boundinertia="0.1"'}, "boundinertia changes parts"),
        ({"compiler": ' balanceinertia="true"'}, "balanceinertia changes moments"),
        ({"compiler": ' eulerseq="xyw"'}, "eulerseq is 'xyw'; write three of"),
        ({"site": ' axisangle="0 0 0 1"'}, "axisangle has no direction; write one whose length is not 0"),
        ({"site": ' quat="0 0 0 0"'}, "quat has no direction"),
        ({"site": ' quat="1 0 0"'}, "quat has 3 numbers; write 4"),
        ({"site": ' euler="1 nan 0"'}, "euler = '1 nan 0' is not"),
        ({"site": ' zaxis="1e999 0 0"'}, "zaxis = '1e999 0 0' is not"),
        ({"site": ' xyaxes="1 0 0 2 0 0"'}, "xyaxes has no direction"),
        ({"gear": "1 2 3 4 5 6 7"}, "gear has 12 numbers; write 1 to 6"),
        ({"motor": ' ctrlrange="5"'}, "ctrlrange has 1 numbers; write 2"),
        ({"more": '<frame pos="0 0 1"><geom size="1"/></frame>'}, "<frame>: is not read here"),
        ({"compiler": ' inertiafromgeom="true"', "change": ("0.05 0.05 0.01", "0.05 -0.05 0.01")}, "its size is"),
    ],
)
def test_what_mujoco_would_not_take_is_refused(tmp_path, given, words):
    with pytest.raises(InputError) as refused:
        read_model(quad(tmp_path, **given))
    assert words in str(refused.value)
    assert "quad.xml" in str(refused.value)


def test_mujoco_takes_mass_from_geoms_and_classes(tmp_path):
    """A cylinder of 0.4 kg on its side, and a box by its density."""
    path = tmp_path / "mine.xml"
    path.write_text(
        """<mujoco><compiler angle="radian"/>
  <default><default class="tube"><geom type="cylinder" size="0.02 0.1" mass="0.4"/></default>
  <motor ctrlrange="0 5"/></default>
  <worldbody><body name="quad" childclass="tube"><freejoint/>
    <geom euler="0 1.5707963267948966 0"/>
    <geom class="main" type="box" size="0.05 0.05 0.01" density="500" pos="0 0 0.05"/>
    <site name="a" pos="0.1 0.1 0"/><site name="b" pos="-0.1 -0.1 0"/></body></worldbody>
  <actuator><motor name="m0" site="a" gear="0 0 1 0 0 -0.02"/><motor name="m1" site="b" gear="0 0 1 0 0 0.02"/>
  </actuator></mujoco>"""
    )
    read = read_model(path)
    assert read.mass_kg == pytest.approx(0.5)
    np.testing.assert_allclose(read.centre, [0, 0, 0.01], atol=1e-12)
    across, along = 0.4 * (0.02**2 / 4 + 0.1**2 / 3), 0.4 * 0.02**2 / 2
    box = [0.1 * (0.05**2 + 0.01**2) / 3] * 2 + [0.1 * 2 * 0.05**2 / 3]
    lever = 0.4 * 0.1 / 0.5 * 0.05**2
    wanted = [along + box[0] + lever, across + box[1] + lever, across + box[2]]
    np.testing.assert_allclose(np.diag(read.inertia), wanted, rtol=1e-9)
    assert [(rotor.spin, rotor.ratio.value, rotor.most.value, rotor.thrust) for rotor in read.rotors] == [
        (1, 0.02, 5.0, None),
        (-1, 0.02, 5.0, None),
    ]


GOOD = sdf_of(SMALL)
BOMB = """<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]><sdf version="1.9"><model name="&b;"/></sdf>"""
BAD = {
    "bomb": (BOMB, "has a DOCTYPE or entities of its own"),
    "deep": ("<sdf>" * 200 + "</sdf>" * 200, "has 200 elements in each other"),
    "broken": (GOOD.replace("</model>", ""), "is no valid XML"),
    "empty": ("", "is no valid XML"),
    "other": ("<html/>", "begins with <html>, which is no model known here"),
    "negative": (GOOD.replace("<mass>1e-05</mass>", "<mass>-1</mass>", 1), "a mass of -1 kg; write one above 0"),
    "no number": (GOOD.replace("<izz>5", "<izz>five", 1).replace("<izz>6", "<izz>six", 1), "is not a number"),
    "huge": (
        GOOD.replace("<maxRotVelocity>6000", "<maxRotVelocity>1e200", 1),
        "'1e200' is not a number; write a number",
    ),
    "template": (GOOD.replace("<pose>0 0 0 0 0 0</pose>", "<pose>${x} 0 0 0 0 0</pose>", 1), "render it first"),
    "include": (
        GOOD.replace('<link name="base_link">', '<include><uri>model://away</uri></include><link name="base_link">'),
        "includes 'model://away', which is not next to this file",
    ),
    "two": (
        GOOD.replace("</sdf>", GOOD[GOOD.index("<model") : GOOD.index("</sdf>")].replace("mine", "yours") + "</sdf>"),
        "holds several models: mine, yours",
    ),
    "plugin": (GOOD.replace("multicopter-motor-model", "lift-drag"), "none of its plugins is a motor model"),
    "turns": (
        GOOD.replace('<joint name="rotor_0_joint"', '<joint name="gimbal"'),
        "its joint 'rotor_0_joint' is not in the file",
    ),
    "gimbal": (
        GOOD.replace(
            '    <link name="rotor_0">',
            '<link name="cam"/><joint name="gimbal" type="revolute"><parent>base_link</parent><child>cam</child>'
            '<axis><xyz>0 0 1</xyz></axis></joint>    <link name="rotor_0">',
        ),
        "the joint gimbal turns, and a study has one rigid body; fix it",
    ),
    "heavy": (GOOD.replace("<maxRotVelocity>6000", "<maxRotVelocity>1000"), "it cannot hover; check the mass"),
    "direction": (GOOD.replace(">cw<", ">left<", 1), "turningDirection is 'left'; write ccw or cw"),
    "sideways": (
        GOOD.replace(" 0 0 0 0</pose>\n      <inertial><mass>1e-05", " 0 1.57 0 0</pose>\n      <inertial><mass>1e-05"),
        "not along z of the body",
    ),
    "impossible": (GOOD.replace("<ixx>1e-10</ixx>", "<ixx>-1e-4</ixx>", 1), "a principal moment is below 0"),
    "loop": (
        GOOD.replace("<pose>0 0 0 0 0 0</pose>", "").replace(
            '<link name="base_link">', '<link name="base_link"><pose relative_to="base_link">0 0 0 0 0 0</pose>'
        ),
        "its pose is relative to itself",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_sentence(tmp_path, name):
    text, words = BAD[name]
    assert text != GOOD
    path = put_file(tmp_path / "bad.sdf", text)
    with pytest.raises(InputError) as refused:
        read_model(path)
    message = str(refused.value)
    assert words in message
    assert "bad.sdf" in message
    assert "\n" not in message


def test_what_is_there_not_or_a_template_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_model(tmp_path / "none.sdf")
    with pytest.raises(InputError, match=r"uav\.xacro: is a template; render it first \(xacro FILE > rendered\.urdf"):
        read_model(Path("uav.xacro"))
    mesh = tmp_path / "mesh.xml"
    mesh.write_text(
        '<mujoco><worldbody><body name="b"><freejoint/><geom type="mesh" mesh="x"/></body></worldbody></mujoco>'
    )
    with pytest.raises(InputError, match="its mass follows from a mesh, which is not read here; give the body"):
        read_model(mesh)


def test_units_and_frames_of_the_page_are_those_of_the_table():
    page = (Path(__file__).parents[3] / "docs" / "simulators-files.md").read_text()
    for each in FORMATS:
        assert f"| {each.units} | {each.frames} | {each.source} |" in page


def test_what_no_vehicle_has_is_said(tmp_path):
    """A moment larger than the others together; rotors of one turn on either side, as those of Menagerie's X2."""
    path = put_file(tmp_path / "odd.sdf", sdf_of(SMALL))
    assert read_model(path).notes == ()
    path.write_text(sdf_of(SMALL, inertia=(1.0, 1.0, 1.5), spins=(-1, -1, 1, 1)))
    moment, turns = read_model(path).notes
    assert moment.startswith(
        "its largest moment of inertia, 9.9e-05 kg m^2, is more than the other two together, 7.9e-05"
    )
    assert "odd.sdf line" in moment
    assert turns.startswith("its rotors turn clockwise, clockwise, counter-clockwise, counter-clockwise, so that roll")
