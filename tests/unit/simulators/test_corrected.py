"""A simulator's file corrected: what flights contradict is replaced, and not one byte besides."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.gap.naming.results import Alternative, Estimate, NotExcited
from cpfls_cli.simulators.corrected import corrected
from cpfls_cli.simulators.formats import read_model
from cpfls_cli.simulators.study import of_log
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings
from tests.builders.gap_artifacts import named_effect
from tests.builders.gusty_flights import SMALL
from tests.builders.simulator_files import sdf_of

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


def urdf():
    places = ((1, -1), (-1, -1), (-1, 1), (1, 1))
    props = "".join(PROP.format(index=i, x=0.0325 * x, y=0.0325 * y) for i, (x, y) in enumerate(places))
    return URDF.format(kf=SMALL.thrust_factor / (30 / np.pi) ** 2, props=props)


def number(name, value, half=0.005):
    return Estimate(name, "1", value, value - half, value + half, (-9.0, 9.0))


def effect(name, **values):
    return named_effect(name, numbers=[number(key, *np.atleast_1d(value)) for key, value in values.items()])


def correct(path, *effects, alternatives=(), verdict="NAMED", contradictions=(), hidden=()):
    of = of_log(read_model(path), None, None)
    vehicle = VehicleSettings(
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
    found = SimpleNamespace(
        verdict=verdict, contradictions=contradictions, rivals=rivals, effects=effects, not_excited=hidden
    )
    said, files = corrected(of, vehicle, found, ["one.csv", "two.csv"])
    (path.parent / "new").mkdir(exist_ok=True)
    for name, content in files.items():
        (path.parent / "new" / name).write_bytes(content)
    return said, read_model(path.parent / "new" / path.name)


@pytest.fixture
def mine(tmp_path):
    path = tmp_path / "mine.sdf"
    path.write_text(sdf_of(SMALL))
    return path


def rest(path):
    """All of a file but its numbers and the comment that was put in."""
    text = path.read_bytes().decode()
    return re.sub(r"[-+]?\d[\d.e+-]*", "#", re.sub(r"<!-- Corrected.*?-->\r?\n", "", text, flags=re.DOTALL))


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
    assert rest(mine) == rest(mine.parent / "new" / mine.name)
    assert "-      <motorConstant>2e-08</motorConstant><!-- from a data sheet -->" in said.diff
    assert "+      <motorConstant>1.66e-08</motorConstant><!-- from a data sheet -->" in said.diff


def test_inertia_alone_is_that_of_the_whole_vehicle(mine):
    said, new = correct(mine, effect("parameter_error", inertia_x=0.2, inertia_y=(0.002, 0.004), thrust_scale=0.001))
    assert [each.element for each in said.changes] == ["ixx"]
    assert new.inertia[0, 0] == pytest.approx(1.2 * SMALL.inertia[0], rel=1e-3)
    assert any("iyy" in sentence and "agrees with the flights" in sentence for sentence in said.unchanged)


def test_centre_of_mass_moves(mine):
    said, new = correct(mine, effect("com_offset", c_x=(0.004, 1e-4), c_y=(-0.002, 1e-4), c_z=(0.001, 0.005)))
    np.testing.assert_allclose(new.centre, [0.004, -0.002, 0], atol=3e-6)
    assert [each.element for each in said.changes] == ["pose x", "pose y"]
    assert "4 mm forward" in said.changes[0].sentence


def test_a_centre_is_put_in_where_there_is_none(mine):
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


def test_torque_of_the_rotors(mine):
    _, new = correct(mine, effect("drag_factor_error", error=0.3))
    assert [rotor.ratio.value for rotor in new.rotors] == pytest.approx([0.0078] * 4)


def test_a_product_of_inertia(mine):
    _, new = correct(mine, effect("products_of_inertia", I_xy=(2e-6, 1e-7), I_xz=(0.0, 1e-7), I_yz=(0.0, 1e-7)))
    assert new.inertia[0, 1] == pytest.approx(2e-6, rel=1e-3)


def test_what_is_not_determined_stays(mine):
    """An effect with a rival, one without a place in the file, and a log that contradicts itself."""
    rival = Alternative("torque_bias", "com_offset", 0.9, "change the thrust")
    offset = effect("com_offset", c_x=(0.004, 1e-4), c_y=(0.0, 1e-4))
    said, new = correct(mine, offset, effect("parasitic_drag", c_x=(0.02, 0.001)), alternatives=[rival])
    assert said.changes == ()
    assert said.diff == ""
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
    assert rest(mine) == rest(mine.parent / "new" / mine.name)
    assert new.count(b"\n") == new.count(b"\r\n")


def test_attributes_of_urdf(tmp_path):
    """Its torque is a number of its own, so that a wrong thrust leaves the inertia about z."""
    path = tmp_path / "cf2x.urdf"
    path.write_text(urdf())
    look = 1 / 0.83 - 1
    wrong = effect("parameter_error", inertia_x=look, inertia_y=0.445, inertia_z=(0.0, 0.004), thrust_scale=-0.17)
    said, new = correct(path, wrong, effect("motor_lag", time_constant_s=(0.03, 0.002)))
    assert [each.element for each in said.changes] == ["kf", "iyy"]
    assert new.rotors[0].thrust.value == pytest.approx(0.83 * SMALL.thrust_factor, rel=1e-3)
    np.testing.assert_allclose(np.diag(new.inertia), [3.7e-5, 1.2 * 4.2e-5, 6.6e-5], rtol=2e-3)
    assert said.elsewhere[0].startswith("motor lag: ")
    assert rest(path) == rest(path.parent / "new" / path.name)


MJCF = """<mujoco model="cf2">
  <worldbody><body name="cf2"><freejoint/>
    <inertial pos="0 0 0" mass="0.045" diaginertia="3.7e-5 4.2e-5 6.6e-5"/> <!-- by CAD -->
    <site name="middle"/></body></worldbody>
  <actuator><motor name="thrust" site="middle" gear="0 0 1 0 0 0" ctrlrange="0 1.2"/></actuator>
</mujoco>
"""


def test_inertia_and_centre_of_mjcf(tmp_path):
    """Its controls are thrusts: what the flights say of them has no place in the file, and is listed."""
    path = tmp_path / "cf2.xml"
    path.write_text(MJCF)
    of, vehicle = of_log(read_model(path), None, None), SMALL.vehicle
    effects = (
        effect("parameter_error", inertia_x=0.445, thrust_scale=-0.17),
        effect("com_offset", c_x=(0.002, 1e-4), c_y=(0.0, 1e-4)),
        effect("rotor_drag", k_d=(1e-5, 1e-6)),
    )
    found = SimpleNamespace(verdict="NAMED", contradictions=(), rivals={}, effects=effects, not_excited=())
    said, files = corrected(of, vehicle, found, ["one.csv"])
    (new,) = files.values()
    assert b'pos="0.002 0 0" mass="0.045" diaginertia="4.438e-05 4.2e-5 6.6e-5"/> <!-- by CAD -->' in new
    assert [each.element for each in said.changes] == ["ixx", "pose x"]
    assert said.elsewhere[0].startswith("thrust of all rotors is 0.83 [0.825, 0.835] times that of the file")
    assert said.elsewhere[1].startswith("rotor drag (H-force): ")
