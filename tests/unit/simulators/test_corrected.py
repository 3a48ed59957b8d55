"""A simulator's file corrected: what flights contradict is replaced, and not one byte besides."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.gap.naming.results import Alternative, Estimate, NotExcited
from cpfls_cli.simulators.corrected import corrected
from cpfls_cli.simulators.formats import read_model
from cpfls_cli.simulators.model import SimulatorModel
from cpfls_cli.simulators.study import of_log
from cpfls_cli.vehicle.rotors import gain_modes
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings
from tests.builders.gap_artifacts import named_effect
from tests.builders.gusty_flights import SMALL, Truth
from tests.builders.simulator_files import FRAME, SECTION, rotorpy_of, sdf_of, urdf_of
from tests.builders.studies import put_file

URDF = """<robot name="cf2">
  <properties arm="0.046" kf="{kf}" km="1.3e-12" thrust2weight="3" drag_coeff_xy="1e-7"/>
  <link name="base_link"><inertial><origin rpy="0 0 0" xyz="0 0 0"/><mass value="0.045"/>
    <inertia ixx="3.7e-5" ixy="0" ixz="0" iyy="4.2e-5" iyz="0" izz="6.6e-5"/></inertial></link>
{props}</robot>
"""
PROP = """  <link name="prop{index}_link"><inertial><origin xyz="{x} {y} 0"/><mass value="0"/>
    <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
  <joint name="prop{index}_joint" type="fixed"><parent link="base_link"/><child link="prop{index}_link"/></joint>
"""


ONE, TWO = (SimpleNamespace(name=f"{name}.csv") for name in ("one", "two"))
SHIFT = np.array([0.004, -0.003, 0.002])


def urdf():
    places = ((1, -1), (-1, -1), (-1, 1), (1, 1))
    props = "".join(PROP.format(index=i, x=0.0325 * x, y=0.0325 * y) for i, (x, y) in enumerate(places))
    return URDF.format(kf=SMALL.thrust_factor / (30 / np.pi) ** 2, props=props)


def number(name, value, half=0.005):
    return Estimate(name, "1", value, value - half, value + half, (-9.0, 9.0))


def effect(name, **values):
    return named_effect(name, numbers=[number(key, *np.atleast_1d(value)) for key, value in values.items()])


def files_of(of, *effects, vehicle=SMALL.vehicle, flights=(ONE,), **found):
    """What is said of a file and the corrected ones, where flights were compared with a vehicle."""
    usual = {"verdict": "NAMED", "contradictions": (), "rivals": {}, "not_excited": ()}
    return corrected(of, vehicle, SimpleNamespace(effects=effects, **(usual | found)), list(flights))


def correct(path, *effects, alternatives=(), hidden=(), vehicle=None, **found):
    of = of_log(read_model(path), None, None)
    vehicle = vehicle or VehicleSettings(
        mass_kg=of.mass_kg,
        inertia_kg_m2=tuple(of.model.moments[:3]),
        rotors=tuple(
            RotorSettings(
                position_m=tuple(line.position_m),
                spin=line.spin,
                thrust_factor_n_s2=line.thrust,
                drag_factor_n_m_s2=line.drag,
            )
            for line in of.rotors
        ),
    )
    rivals = {}
    for each in alternatives:
        rivals.setdefault(each.instead_of, []).append(each)
    found |= {"rivals": rivals, "not_excited": hidden}
    said, files = files_of(of, *effects, vehicle=vehicle, flights=(ONE, TWO), **found)
    (path.parent / "new").mkdir(exist_ok=True)
    for name, content in files.items():
        (path.parent / "new" / name).write_bytes(content)
    return said, read_model(path.parent / "new" / path.name)


@pytest.fixture
def mine(tmp_path):
    return put_file(tmp_path / "mine.sdf", sdf_of(SMALL))


def replaced(path):
    """What differs in the corrected file, which is numbers alone but for the comment: each before and after."""
    given, new = (file.read_bytes().decode() for file in (path, path.parent / "new" / path.name))
    new = re.sub(r"<!-- Corrected.*?-->\r?\n", "", new, count=1, flags=re.DOTALL)
    (*before,), (*after,) = (re.split(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)", text) for text in (given, new))
    assert before[::2] == after[::2]
    return [(own, its) for own, its in zip(before[1::2], after[1::2], strict=True) if own != its]


def test_thrust_alone_leaves_the_inertia(mine):
    """Flights show the ratio of inertia to torque: a thrust of 17 % less makes all moments look 20 % larger."""
    look = 1 / 0.83 - 1
    wrong = effect(
        "parameter_error", inertia_x=look, inertia_y=look, inertia_z=look, thrust_scale=-0.17, coupling_x=0.0
    )
    before = mine.read_bytes()
    said, new = correct(mine, wrong)
    assert [each.element for each in said.changes] == ["motorConstant"]
    assert said.changes[0].sentence == "thrust of M1 to M4 is 17 % less"
    assert said.changes[0].low < 0.83 * SMALL.thrust_factor < said.changes[0].high
    for rotor in new.rotors:
        assert rotor.thrust.value == pytest.approx(0.83 * SMALL.thrust_factor, rel=1e-3)
    np.testing.assert_allclose(new.inertia, read_model(mine).inertia, rtol=1e-12)
    assert mine.read_bytes() == before
    assert replaced(mine) == [("2e-08", "1.66e-08")] * 4
    assert "-      <motorConstant>2e-08</motorConstant><!-- from a data sheet -->" in said.diff
    assert "+      <motorConstant>1.66e-08</motorConstant><!-- from a data sheet -->" in said.diff


def test_plugins_of_urdf_are_corrected_and_put_in(tmp_path):
    """Numbers where they stand, drag where the plugin lacks it, and products of inertia where no number has a place."""
    path = tmp_path / "mine.urdf"
    path.write_text(
        urdf_of(SMALL)
        .replace("<rotorDragCoefficient>0</rotorDragCoefficient>", "")
        .replace(' ixy="0"\n    ixz="0"', "")
    )
    found = (
        effect("parameter_error", inertia_x=(-0.2, 0.01), thrust_scale=(-0.17, 0.01)),
        effect("rotor_drag", k_d=(2e-5, 1e-6)),
        effect("products_of_inertia", I_xy=(4e-6, 1e-7), I_xz=(0.0, 1e-7), I_yz=(0.0, 1e-7)),
    )
    said, new = correct(path, *found)
    assert [each.element for each in said.changes] == ["motorConstant", "ixx", "rotorDragCoefficient"]
    for rotor in new.rotors:
        assert (rotor.thrust.value, rotor.drag.value) == (pytest.approx(0.83 * SMALL.thrust_factor), 2e-5)
    assert new.inertia[0, 0] == pytest.approx(0.8 * 0.83 * SMALL.inertia[0], rel=1e-3)
    assert any(each.startswith("ixy = ") and each.endswith("write it there") for each in said.elsewhere)


def test_an_inertia_about_z_of_no_body_is_a_yaw_torque(mine):
    """Flights show the ratio of the two: the other one is wrong where this one cannot be."""
    said, new = correct(mine, effect("parameter_error", inertia_z=0.25, thrust_scale=-0.17))
    assert [each.element for each in said.changes] == ["motorConstant", "izz"]
    look = 1 / 0.83 - 1
    said, new = correct(
        mine, effect("parameter_error", inertia_x=look, inertia_y=look, inertia_z=0.8, thrust_scale=-0.17)
    )
    assert [each.element for each in said.changes] == ["motorConstant", "momentConstant"]
    assert said.changes[1].sentence.endswith(
        "by its ratio to the inertia about z, which in its place would be that of no body"
    )
    np.testing.assert_allclose(new.inertia, read_model(mine).inertia)
    np.testing.assert_allclose(
        SMALL.inertia[2] / new.rotors[0].drag_factor, 1.8 * SMALL.inertia[2] / SMALL.drag_factor, rtol=1e-3
    )


def test_what_the_file_keeps_decides_whether_an_inertia_is_of_no_body(mine):
    said, _ = correct(mine, effect("parameter_error", inertia_x=(-0.4, 0.6), inertia_z=0.15))
    assert [each.element for each in said.changes] == ["izz"]


def test_numbers_that_instruments_do_not_identify_stay(mine):
    loose = replace(effect("drag_factor_error", error=0.2), identified=False)
    said, _ = correct(mine, loose, effect("parameter_error", thrust_scale=-0.17))
    assert [each.element for each in said.changes] == ["motorConstant"]
    assert said.unchanged[0].startswith("wrong drag (yaw) factor, error 0.2 [0.195, 0.205] 1: setpoints do not show it")


def test_a_yaw_torque_is_corrected_once(mine):
    said, new = correct(mine, *(effect("drag_factor_error", error=0.2), effect("parameter_error", inertia_z=0.8)))
    assert [each.element for each in said.changes] == ["momentConstant"]
    assert new.rotors[0].drag_factor == pytest.approx(1.2 / 1.8 * SMALL.drag_factor, rel=1e-3)


def test_inertia_alone_is_that_of_the_whole_vehicle(mine):
    said, new = correct(mine, effect("parameter_error", inertia_x=0.2, inertia_y=(0.002, 0.004), thrust_scale=0.001))
    assert [each.element for each in said.changes] == ["ixx"]
    assert new.inertia[0, 0] == pytest.approx(1.2 * SMALL.inertia[0], rel=1e-3)
    assert any("iyy" in sentence and "agrees with the flights" in sentence for sentence in said.unchanged)


def test_centre_of_mass_moves_and_is_put_in_where_there_is_none(mine):
    said, new = correct(mine, effect("com_offset", c_x=(0.004, 1e-4), c_y=(-0.002, 1e-4), c_z=(0.001, 0.005)))
    np.testing.assert_allclose(new.centre, [0.004, -0.002, 0], atol=3e-6)
    assert [each.element for each in said.changes] == ["pose x", "pose y"]
    assert "4 mm forward" in said.changes[0].sentence
    mine.write_text(mine.read_text().replace("        <pose>0 0 0 0 0 0</pose>\n", ""))
    said, new = correct(mine, effect("com_offset", c_x=(0.004, 1e-4), c_y=(-0.002, 1e-4)))
    np.testing.assert_allclose(new.centre, [0.004, -0.002, 0], atol=3e-6)
    assert len(said.changes) == 2


def test_drag_that_is_not_stated_is_put_in(mine):
    mine.write_text(mine.read_text().replace("      <rotorDragCoefficient>0</rotorDragCoefficient>\n", ""))
    said, new = correct(mine, effect("rotor_drag", k_d=(3e-5, 1e-6)))
    assert [rotor.drag.value for rotor in new.rotors] == [3e-5] * 4
    assert "+      <rotorDragCoefficient>3e-05</rotorDragCoefficient>" in said.diff


def test_rolling_moments_have_the_sign_of_the_turn(mine):
    _, new = correct(mine, effect("rolling_moment", mu=(2e-6, 1e-7)))
    assert [rotor.rolling.value for rotor in new.rotors] == [-2e-6, 2e-6, -2e-6, 2e-6]


@pytest.mark.parametrize(("tau", "changed"), [(0.021, False), (0.04, True)])
def test_a_lag_changes_both_constants_or_none(mine, tau, changed):
    said, new = correct(mine, effect("motor_lag", time_constant_s=(tau, 0.002)))
    assert [each.element for each in said.changes] == ["timeConstantUp", "timeConstantDown"] * changed
    assert new.rotors[2].lag_down.value == (tau if changed else 0.02)


def test_rotors_that_differ_have_the_pattern_that_was_found(mine):
    said, new = correct(mine, effect("rotor_mismatch", difference_1=(0.1, 0.01), difference_2=0.0))
    assert [each.sentence.partition(";")[0] for each in said.changes] == [
        "thrust of M1 is 5 % more",
        "thrust of M3 is 5 % less",
    ]
    wanted = np.array([1.05, 1.0, 0.95, 1.0]) * SMALL.thrust_factor
    np.testing.assert_allclose([rotor.thrust.value for rotor in new.rotors], wanted, rtol=1e-3)


class Six(Truth):
    @property
    def places(self):
        angles = np.pi / 3 * np.arange(6)
        return self.arm * np.column_stack([np.cos(angles), np.sin(angles)])


def test_of_a_pattern_over_six_rotors_all_are_corrected(tmp_path):
    """Of M3 alone, as its interval asks for, the torque would be another."""
    path, loss = tmp_path / "six.sdf", np.array([0.0, 0.0, -0.06, 0.0, 0.0, 0.0])
    path.write_text(sdf_of(Six(*SMALL), spins=(1, -1) * 3))
    rotors = of_log(read_model(path), None, None).rotors
    settings = (RotorSettings(position_m=tuple(each.position_m), spin=each.spin) for each in rotors)
    modes = gain_modes(VehicleSettings(rotors=tuple(settings)))
    shown = np.linalg.pinv(modes) @ loss
    found = effect("rotor_mismatch", **{f"difference_{n}": (value, 0.02) for n, value in enumerate(shown, 1)})
    said, new = correct(path, found)
    assert [each.sentence.partition(";")[0] for each in said.changes] == [
        "thrust of M1 and M5 is 2 % more",
        "thrust of M3 is 4 % less",
    ]
    wanted = (1 + modes @ shown) * SMALL.thrust_factor
    np.testing.assert_allclose([rotor.thrust.value for rotor in new.rotors], wanted, rtol=1e-3)
    assert not correct(path, effect("rotor_mismatch", difference_1=(0.01, 0.02)))[0].changes


def test_one_weak_rotor_with_what_the_force_shows(mine):
    """M3 lifts 10 % less: a pattern, less thrust in all, less of its spin, and as much less of its torque."""
    weak = {"difference_1": (0.1, 0.002), "difference_2": (0.0, 0.002), "lift_imbalance": (0.025, 0.002)}
    scale = 1 / 0.975 - 1
    said, new = correct(
        mine,
        effect("parameter_error", inertia_x=scale, inertia_y=scale, inertia_z=scale, thrust_scale=(-0.025, 0.002)),
        effect("rotor_mismatch", **weak, drag_imbalance=(-0.025, 0.002)),
    )
    wanted = np.array([1.0, 1.0, 0.9, 1.0]) * SMALL.thrust_factor
    np.testing.assert_allclose([rotor.thrust.value for rotor in new.rotors], wanted, rtol=3e-3)
    assert {each.element for each in said.changes} == {"motorConstant"}
    assert [each.sentence.partition(" is ")[0] for each in said.changes] == ["thrust of M3"]


def test_torque_of_the_rotors_and_a_product_of_inertia(mine):
    _, new = correct(mine, effect("drag_factor_error", error=0.3))
    assert [rotor.ratio.value for rotor in new.rotors] == pytest.approx([0.0078] * 4)
    _, new = correct(mine, effect("products_of_inertia", I_xy=(2e-6, 1e-7), I_xz=(0.0, 1e-7), I_yz=(0.0, 1e-7)))
    assert new.inertia[0, 1] == pytest.approx(2e-6, rel=1e-3)


def test_what_is_not_determined_stays(mine):
    """An effect with a rival, one without a place in the file, and a log that contradicts itself."""
    rival = Alternative("torque_bias", "com_offset", 0.9, "change the thrust")
    offset = effect("com_offset", c_x=(0.004, 1e-4), c_y=(0.0, 1e-4))
    said, new = correct(mine, offset, effect("parasitic_drag", c_x=(0.02, 0.001)), alternatives=[rival])
    assert (said.changes, said.diff) == ((), "")
    assert "these flights cannot separate it from" in said.unchanged[0]
    assert "the format has no number for it: a plugin of your own" in said.elsewhere[0]
    np.testing.assert_allclose(new.centre, 0, atol=1e-12)
    assert (mine.parent / "new" / mine.name).read_bytes() == mine.read_bytes()
    said, _ = correct(mine, offset, contradictions=("x is wrong",))
    assert (said.changes, said.diff) == ((), "")
    said, _ = correct(mine, offset, verdict="UNEXPLAINED")
    assert said.changes == ()


def test_what_the_file_states_and_no_flight_shows(mine):
    """A study's vehicle has no drag: what the file states of it is neither right nor wrong for that."""
    mine.write_text(mine.read_text().replace("<rotorDragCoefficient>0<", "<rotorDragCoefficient>1e-5<"))
    said, _ = correct(mine, verdict="NO_GAP", hidden=[NotExcited("motor_lag", "commands are not logged")])
    assert "rotorDragCoefficient 1e-05: these flights show none of it" in said.unchanged
    assert "timeConstantUp 0.02: these flights cannot show it: commands are not logged" in said.unchanged
    assert said.diff == ""


def test_line_ends_and_comments_stay(mine):
    mine.write_bytes(mine.read_bytes().replace(b"\n", b"\r\n").replace(b"<mass>", b"<mass><!-- kg --> ", 1))
    correct(mine, effect("parameter_error", inertia_x=0.2, thrust_scale=-0.17))
    new = (mine.parent / "new" / mine.name).read_bytes()
    assert [own for own, _ in replaced(mine)] == ["2e-08"] * 4
    assert new.count(b"\n") == new.count(b"\r\n")


def test_attributes_of_urdf(tmp_path):
    """Its torque is a number of its own, so that a wrong thrust leaves the inertia about z."""
    path = put_file(tmp_path / "cf2x.urdf", urdf())
    look = 1 / 0.83 - 1
    wrong = effect("parameter_error", inertia_x=look, inertia_y=0.445, inertia_z=(0.0, 0.004), thrust_scale=-0.17)
    said, new = correct(path, wrong, effect("motor_lag", time_constant_s=(0.03, 0.002)))
    assert [each.element for each in said.changes] == ["kf", "thrust2weight", "iyy"]
    assert new.rotors[0].thrust.value == pytest.approx(0.83 * SMALL.thrust_factor, rel=1e-3)
    np.testing.assert_allclose(np.diag(new.inertia), [3.7e-5, 1.2 * 4.2e-5, 6.6e-5], rtol=2e-3)
    assert said.elsewhere[0].startswith("motor lag: ")
    assert [after for _, after in replaced(path)] == [
        f"{new.rotors[0].thrust.scale * 1.66e-8:.4g}",
        "2.49",
        "5.037e-05",
    ]
    # Rotors turn as fast as before.
    assert new.speed_max.value == pytest.approx(read_model(path).speed_max.value, rel=1e-3)


def test_one_number_for_rotors_that_differ_takes_what_is_common(tmp_path):
    path = put_file(tmp_path / "cf2x.urdf", urdf())
    uneven = effect(
        "rotor_mismatch", difference_1=(0.1, 0.001), difference_2=0.0, drag_imbalance=0.0, lift_imbalance=0.0
    )
    said, _ = correct(path, uneven)
    assert (said.changes, said.diff) == ((), "")
    kf, km = said.unchanged[:2]
    assert kf.startswith(
        "kf is one number for all rotors, and the flights have another for each: M1 2.303e-10, M2 2.193e-10"
    )
    assert km.startswith(
        "km is one number for all rotors, and the flights have another for each: M1 1.365e-12, M2 1.3e-12"
    )
    scale = effect("parameter_error", inertia_x=1 / 0.83 - 1, inertia_y=1 / 0.83 - 1, thrust_scale=(-0.17, 0.001))
    said, new = correct(path, scale, uneven)
    assert [each.element for each in said.changes] == ["kf", "thrust2weight"]
    assert new.rotors[0].thrust.value == pytest.approx(0.83 * SMALL.thrust_factor, rel=1e-3)
    assert said.unchanged[0].startswith("kf is one number for all rotors")


def test_what_urdf_without_km_cannot_hold_is_listed(tmp_path):
    path = put_file(tmp_path / "cf2x.urdf", urdf().replace('km="1.3e-12" ', ""))
    said, _ = correct(path, effect("drag_factor_error", error=(0.3, 0.02)), vehicle=SMALL.vehicle)
    assert said.elsewhere == (
        "yaw torque over thrust, as a factor on that which flights were compared with: all rotors 1.3 [1.28, 1.32]; "
        "the file states none; write kf and km into <properties>, as gym-pybullet-drones reads them, or scale the "
        "forces and torques that you apply",
    )
    assert not any("nothing" in each for each in said.unchanged)


MJCF = """<mujoco model="cf2">
  <worldbody><body name="cf2"><freejoint/>
    <inertial pos="0 0 0" mass="0.045" diaginertia="3.7e-5 4.2e-5 6.6e-5"/> <!-- by CAD -->
    <site name="middle"/></body></worldbody>
  <actuator><motor name="thrust" site="middle" gear="0 0 1 0 0 0" ctrlrange="0 1.2"/></actuator>
</mujoco>
"""


def test_inertia_and_centre_of_mjcf(tmp_path):
    """Its controls are thrusts: what the flights say of them has no place in the file, and is listed."""
    said, files = files_of(
        of_log(read_model(put_file(tmp_path / "cf2.xml", MJCF)), None, None),
        effect("parameter_error", inertia_x=0.445, thrust_scale=-0.17),
        effect("com_offset", c_x=(0.002, 1e-4), c_y=(0.0, 1e-4)),
        effect("rotor_drag", k_d=(1e-5, 1e-6)),
    )
    (new,) = files.values()
    assert b'pos="0.002 0 0" mass="0.045" diaginertia="4.438e-05 4.2e-5 6.6e-5"/> <!-- by CAD -->' in new
    assert [each.element for each in said.changes] == ["ixx", "pose x"]
    assert said.elsewhere[0].startswith(
        "thrust, as a factor on that which flights were compared with: all rotors 0.83 [0.825, 0.835]; controls"
    )
    assert said.elsewhere[1].startswith("rotor drag (H-force): ")


GEARS = """<mujoco model="cf2">
  <custom><numeric name="ctrl_power" data="2 2 2 2"/></custom>
  <worldbody><body name="cf2"><freejoint/>
    <inertial pos="0 0 0" mass="0.045" diaginertia="3.7e-5 4.2e-5 6.6e-5"/>
    <site name="s0" pos="0.03 -0.03 0"/><site name="s1" pos="-0.03 -0.03 0"/>
    <site name="s2" pos="-0.03 0.03 0"/><site name="s3" pos="0.03 0.03 0"/></body></worldbody>
  <actuator><general name="m0" site="s0" gear="0 0 1 0 0 .006" gainprm="2e-8"/>
    <general name="m1" site="s1" gear="0 0 1 0 0 -.006" gainprm="2e-8"/>
    <general name="m2" site="s2" gear="0 0 2e-8 0 0 1.2e-10"/>
    <general name="m3" site="s3" gear="0 0 1 0 0 -.006" gainprm="2e-8"/></actuator>
</mujoco>
"""


def test_gear_of_mjcf_is_thrust_and_yaw_torque(tmp_path):
    """Controls are squared speeds: the thrust in the third number, the torque in the sixth, each by its gain."""
    path = put_file(tmp_path / "cf2.xml", GEARS)
    look = 1 / 0.83 - 1
    wrong = effect("parameter_error", inertia_x=look, inertia_y=look, inertia_z=0.0, thrust_scale=-0.17)
    said, new = correct(path, wrong, effect("drag_factor_error", error=0.25))
    gears = [("1", "0.83"), (".006", "0.0075"), ("1", "0.83"), ("-.006", "-0.0075"), ("2e-8", "1.66e-08"),
             ("1.2e-10", "1.5e-10"), ("1", "0.83"), ("-.006", "-0.0075")]  # fmt: skip
    assert replaced(path) == gears
    np.testing.assert_allclose([rotor.thrust.value for rotor in new.rotors], 1.66e-8)
    np.testing.assert_allclose([rotor.drag_factor for rotor in new.rotors], 1.5e-10)
    assert [rotor.spin for rotor in new.rotors] == [-1, 1, -1, 1]
    assert said.elsewhere == ()
    assert all(change.low < change.after < change.high for change in said.changes)
    assert [change.sentence for change in said.changes if change.before == 1] == [
        "thrust of M1, M2 and M4 is 17 % less"
    ]


def test_uneven_rotors_of_mjcf_each_have_their_gear(tmp_path):
    path = put_file(tmp_path / "cf2.xml", GEARS)
    said, new = correct(path, effect("rotor_mismatch", difference_1=(0.1, 0.001), difference_2=0.0, drag_imbalance=0.0))
    assert replaced(path) == [("1", "1.05"), (".006", "0.0063"), ("2e-8", "1.9e-08"), ("1.2e-10", "1.14e-10")]
    assert [each.element for each in said.changes] == ["gear z", "gear z", "gear yaw", "gear yaw"]
    np.testing.assert_allclose([rotor.drag_factor for rotor in new.rotors], [1.26e-10, 1.2e-10, 1.14e-10, 1.2e-10])


def test_a_filter_of_mjcf_is_the_lag(tmp_path):
    path = put_file(tmp_path / "cf2.xml", GEARS.replace("<general ", '<general dyntype="filterexact" dynprm="0.02 0" '))
    said, _ = correct(path, effect("motor_lag", time_constant_s=(0.04, 0.002)))
    assert replaced(path) == [("0.02", "0.04")] * 4
    assert [change.sentence for change in said.changes] == ["time constant of M1 to M4 is 100 % more"]
    path.write_text(GEARS)
    said, _ = correct(path, effect("motor_lag", time_constant_s=(0.04, 0.002)))
    assert said.elsewhere[0].startswith("motor lag: ")


def test_thrusts_as_controls_are_not_what_flights_were_compared_with(tmp_path):
    """A control in N says nothing of a thrust over squared speed: that is of the vehicle that was given."""
    path = tmp_path / "cf2.xml"
    text = re.sub(r" *<custom>.*\n", "", GEARS).replace(' gainprm="2e-8"', "").replace("2e-8 0 0 1.2e-10", "1 0 0 .006")
    path.write_text(text.replace(".006", ".0045"))
    of = of_log(read_model(path), None, None)
    effects = (effect("drag_factor_error", error=0.25), effect("rotor_mismatch", difference_1=(0.1, 0.001)))
    said, files = files_of(of, *effects)
    assert files["cf2.xml"] == path.read_bytes()
    assert said.elsewhere[0].startswith(
        "thrust, as a factor on that which flights were compared with: M1 1.05 [1.05, 1.05], M3 0.95 [0.9495, 0.9505]; "
        "controls are newtons"
    )
    assert said.elsewhere[1].startswith(
        "yaw torque over thrust, as a factor on that which flights were compared with: "
    )


def test_a_number_goes_into_an_empty_element(mine):
    for text in ("<inertia/>", "<inertia></inertia>"):
        start, end = mine.read_text().index("<inertia>"), mine.read_text().index("</inertia>") + len("</inertia>")
        mine.write_text(mine.read_text()[:start] + text + mine.read_text()[end:])
        _, new = correct(mine, effect("parameter_error", inertia_x=-0.9, inertia_y=-0.8))
        np.testing.assert_allclose([new.bodies[0].inertia[0, 0], new.bodies[0].inertia[1, 1]], [0.1, 0.2], rtol=1e-4)
        mine.write_text(sdf_of(SMALL))
    mine.write_text(mine.read_text().replace("<pose>0 0 0 0 0 0</pose>", "<pose/>", 1))
    _, new = correct(mine, effect("com_offset", c_x=(0.004, 1e-4)))
    np.testing.assert_allclose(new.centre, [0.004, 0, 0], atol=3e-6)


def test_a_first_link_without_mass_leaves_the_heaviest(tmp_path):
    """A frame of reference as the first link, and the body on it, as drivers of ROS have them."""
    path = tmp_path / "cf2x.urdf"
    base = '<link name="footprint"/><joint name="j" type="fixed"><parent link="footprint"/><child link="base_link"/>'
    path.write_text(urdf().replace('  <link name="base_link">', f'{base}</joint>\n  <link name="base_link">'))
    _, new = correct(path, effect("com_offset", c_x=(0.004, 1e-4)), effect("parameter_error", inertia_x=(0.2, 0.001)))
    np.testing.assert_allclose(new.centre, [0.004, 0, 0], atol=3e-6)
    np.testing.assert_allclose(np.diag(new.inertia), [1.2 * 3.7e-5, 4.2e-5, 6.6e-5], rtol=1e-3)


@pytest.mark.parametrize("name", ["a--b---.csv", "\u00fc--.csv", "-->.csv", "line\nbreak.csv"])
def test_no_name_of_a_log_ends_the_comment(mine, name):
    of = of_log(read_model(mine), None, None)
    _, files = files_of(of, effect("drag_factor_error", error=0.25), flights=[SimpleNamespace(name=name)])
    comment = files["mine.sdf"].decode("ascii").partition("<!-- Corrected")[2].partition("-->")[0]
    assert "--" not in comment
    assert comment.endswith(" ")
    mine.write_bytes(files["mine.sdf"])
    assert read_model(mine).rotors[0].ratio.value == pytest.approx(0.0075)


def test_each_file_says_its_own_changes(tmp_path):
    """The inertia stands in what is included, and the rotors in the file itself."""
    text = sdf_of(SMALL)
    plugins = re.findall(r"    <plugin.*?</plugin>\n", text, flags=re.DOTALL)
    for plugin in plugins:
        text = text.replace(plugin, "")
    (tmp_path / "base").mkdir()
    (tmp_path / "whole").mkdir()
    (tmp_path / "base" / "model.sdf").write_text(text)
    whole = (
        "<sdf version='1.9'><model name='w'><include merge='true'><uri>model://base</uri></include>\n{}</model></sdf>"
    )
    of = of_log(read_model(put_file(tmp_path / "whole" / "model.sdf", whole.format("".join(plugins)))), None, None)
    _, files = files_of(of, effect("parameter_error", inertia_x=0.5, thrust_scale=-0.17))
    assert list(files) == ["model.sdf", "base-model.sdf"]
    own, base = (text.decode().partition("<!-- Corrected")[2].partition("-->")[0] for text in files.values())
    assert "motorConstant" in own
    assert "ixx" not in own
    assert "ixx" in base
    assert "motorConstant" not in base


def test_files_of_one_name_are_numbered():
    files = [Path("w/model.sdf"), Path("a/base/model.sdf"), Path("b/base/model.sdf"), Path("c/base2-model.sdf")]
    assert list(SimulatorModel("m", "sdf", (), (), (), (), tuple(files)).output_names.values()) == [
        "model.sdf", "base-model.sdf", "base2-model.sdf", "c-base2-model.sdf"
    ]  # fmt: skip


def lines_that_differ(path):
    """Give the lines that were replaced and what stands there now, and the comment above."""
    given, new = (file.read_text().splitlines() for file in (path, path.parent / "new" / path.name))
    comment = [line for line in new if "Corrected by cpfls" in line or line.startswith("#   ")]
    kept = [line for line in new if line not in comment]
    return [pair for pair in zip(given, kept, strict=True) if pair[0] != pair[1]], comment


def test_python_is_corrected_in_place(tmp_path):
    """Literals in place, what is an expression as a whole; effects whose formula RotorPy has among them."""
    path = put_file(tmp_path / "mine.py", rotorpy_of(SMALL).replace("'Ixx': 3.7e-05", "'Ixx': 37e-6 * 1.0"))
    said, new = correct(
        path,
        effect("parameter_error", inertia_x=0.5, thrust_scale=-0.17),
        effect("inflow", k_z=(3e-7, 1e-8)),
        effect("rotor_drag", k_d=(2e-7, 1e-8)),
        effect("motor_lag", time_constant_s=(0.05, 0.002)),
    )
    assert {change.element: change.after for change in said.changes} == {
        "quad_params.k_eta": 1.66e-8,
        "quad_params.Ixx": float(f"{1.5 * 0.83 * 3.7e-5:.4g}"),
        "quad_params.k_d": 2e-7,
        "quad_params.tau_m": 0.05,
    }
    assert new.rotors[0].drag.value == 2e-7
    # It has no k_z to replace.
    (missing,) = [each for each in said.elsewhere if "k_z" in each]
    assert missing == (
        "quad_params.k_z = 3e-07 [2.9e-07, 3.1e-07]: mine.py: quad_params has no k_z, for which RotorPy takes 0; write "
        "it there"
    )
    differ, comment = lines_that_differ(path)
    assert len(differ) == 3
    assert "'Ixx': 4.606e-05, 'Iyy'" in differ[0][1]
    assert path.parent.joinpath("new", "mine.py").read_text().startswith("#!/usr/bin/env python3\n# Corrected by cpfls")
    assert len(comment) == 5


def test_a_curve_is_corrected_in_proportion(tmp_path):
    path = put_file(tmp_path / "params.toml", SECTION.format(name="a"))
    before = read_model(path)
    beside = effect("motor_lag", time_constant_s=(0.2, 0.002)), effect("rotor_drag", k_d=(1e-6, 1e-8))
    said, new = correct(path, effect("parameter_error", inertia_x=0.0, thrust_scale=-0.17), *beside)
    changes = {change.element: (change.before, change.after) for change in said.changes}
    assert changes["a.rpm2thrust[2]"] == (2.5e-10, 2.075e-10)
    assert changes["a.rpm2thrust[1]"] == (-5.4e-7, -4.482e-7)
    # What the file states at its hover speed waits for the thrust.
    assert not [element for element in changes if "drag" in element or "rotor_dyn" in element]
    assert [each for each in said.unchanged if "the hover speed" in each]
    said, new = correct(path, *beside)
    changes = {change.element: (change.before, change.after) for change in said.changes}
    assert changes["a.rotor_dyn_coef[0]"] == (7.4, 5.0)
    assert new.rotors[0].lag_up.value == pytest.approx(0.2, rel=1e-3)
    (slower,) = [change.sentence for change in said.changes if change.element == "a.rotor_dyn_coef[0]"]
    assert slower == "time constant of M1 to M4 is 48 % more"
    assert new.rotors[0].lag_down.value == pytest.approx(0.2, rel=0.1)
    assert changes["a.drag_matrix[0][0]"][1] == changes["a.drag_matrix[1][1]"][1]
    assert new.rotors[0].drag.value == pytest.approx(1e-6, rel=1e-3)
    assert len(before.rotors) == len(new.rotors)
    assert path.parent.joinpath("new", "params.toml").read_text().startswith("# Corrected by cpfls gap")


@pytest.mark.parametrize("comments", [True, False])
def test_thrust_of_ardupilot_is_the_reciprocal_of_its_hover_throttle(tmp_path, comments):
    path = tmp_path / "frame.json"
    path.write_text(FRAME if comments else "\n".join(line.partition("#")[0].rstrip() for line in FRAME.splitlines()))
    said, _ = correct(path, effect("parameter_error", inertia_x=0.0, thrust_scale=(-0.17, 0.01)))
    (change,) = said.changes
    assert (change.element, change.before, change.after) == ("hoverThrOut", 0.31, float(f"{0.31 / 0.83:.4g}"))
    assert change.low < change.after < change.high
    assert change.sentence == "thrust of M1 to M4 is 17 % less"
    differ, comment = lines_that_differ(path)
    assert len(differ) == 1
    # JSON has no comments, unless it has some.
    assert bool(comment) is comments


def test_a_direction_that_no_flight_shows_stays(mine):
    """The log states another one, and its flight has no speeds of rotors."""
    of = replace(of_log(read_model(mine), None, None), spins=(-1, 1, -1, -1))
    said, files = files_of(of, verdict="NO_GAP", flights=[SimpleNamespace(name="one.csv", rotor_speed=None)])
    assert files["mine.sdf"] == mine.read_bytes()
    assert said.unchanged[0].startswith("directions of rotors: no flight of more than 5 s")


def shifted(path):
    """Correct a file by a centre of mass that is elsewhere; give what is said, and the file before and after."""
    before = read_model(path)
    offset = effect("com_offset", **{f"c_{axis}": (c, 1e-4) for axis, c in zip("xyz", SHIFT, strict=True)})
    return *correct(path, offset), before


def test_rotors_of_rotorpy_move_around_its_centre(tmp_path):
    """Its own vehicle gives the torque about the centre of mass where that is, and the force of before."""
    multirotor = pytest.importorskip("rotorpy.vehicles.multirotor").Multirotor
    path = tmp_path / "mine.py"
    text = rotorpy_of(SMALL).replace("'k_d'", "'k_z': 2e-7, 'k_d'")
    path.write_text(text)
    said, new, before = shifted(path)
    # The second rotor is an expression for all three numbers: all are listed.
    assert (said.changes, len(said.elsewhere)) == ((), 12)
    path.write_text(text.replace("d * np.array([-0.5**0.5, -0.5**0.5, 0])", "[-side, -side, 0]"))
    said, new, before = shifted(path)
    np.testing.assert_allclose(new.hubs, before.hubs - SHIFT, rtol=0, atol=1e-5)
    assert (said.elsewhere, len(said.changes)) == ((), 12)
    assert said.changes[0].sentence == "centre of mass of the vehicle is 4 mm forward, and the place of M1 is from it"
    rng, wrenches = np.random.default_rng(1), []
    speeds, rate, air = rng.uniform(800, 2500, 4), rng.normal(0, 0.0, 3), rng.normal(0, 3, 3)
    for own in (path, path.parent / "new" / path.name):
        names: dict = {}
        exec(own.read_text(), names)
        wrenches.append(multirotor(names["quad_params"]).compute_body_wrench(rate, speeds, air))
    (force, torque), (after, moved) = wrenches
    np.testing.assert_allclose(after, force, rtol=1e-12)
    thrusts = before.rotors[0].thrust.value * (speeds**2).sum()
    assert np.linalg.norm(np.cross(SHIFT, [0, 0, thrusts])) > 1e-4
    np.testing.assert_allclose(moved, torque - np.cross(SHIFT, force), rtol=0, atol=1e-9 + 1e-5 * thrusts)


def test_rotors_of_crazyflow_move_in_its_plane(tmp_path):
    """Its mixing matrix times L has the levers of thrust, and none of heights."""
    said, new, before = shifted(put_file(tmp_path / "params.toml", SECTION.format(name="a")))
    np.testing.assert_allclose(new.hubs[:, :2], before.hubs[:, :2] - SHIFT[:2], rtol=0, atol=3e-5)
    entries = {f"a.mixing_matrix[{row}][{rotor}]" for row in (0, 1) for rotor in range(4)}
    assert {change.element for change in said.changes} == entries
    assert said.elsewhere == ("centre of mass of the vehicle is 2 mm up: the format has no number for it",)


def test_motors_of_ardupilot_move_around_its_centre(tmp_path):
    path = tmp_path / "frame.json"
    places = ((0.2, 0.2), (-0.2, -0.2), (0.2, -0.2), (-0.2, 0.2))
    lines = "".join(f'"motor{i}_position": [{x}, {y}, -0.01],\n' for i, (x, y) in enumerate(places, 1))
    path.write_text(FRAME.replace('"mass"', f'{lines}    "mass"'))
    said, new, before = shifted(path)
    np.testing.assert_allclose(new.hubs, before.hubs - SHIFT, rtol=0, atol=1e-4)
    assert said.elsewhere == ()
