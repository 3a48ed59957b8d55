"""Files of simulators for a vehicle that flies in `gusty_flights`, and its flights as logs."""

import re

import numpy as np
from scipy.spatial.transform import Rotation

from cpfls_cli.rotations import euler_angles, rotation_matrix

COLUMNS = (
    "t,x,y,z,vx,vy,vz,roll,pitch,yaw,wx,wy,wz,rpm_1,rpm_2,rpm_3,rpm_4,"
    "x_sp,y_sp,z_sp,vx_sp,vy_sp,vz_sp,roll_sp,pitch_sp,yaw_sp"
)
MOTOR = """    <plugin filename="gz-sim-multicopter-motor-model-system" name="gz::sim::systems::MulticopterMotorModel">
      <jointName>rotor_{index}_joint</jointName>
      <linkName>rotor_{index}</linkName>
      <turningDirection>{turn}</turningDirection>
      <timeConstantUp>0.02</timeConstantUp>
      <timeConstantDown>0.02</timeConstantDown>
      <maxRotVelocity>6000</maxRotVelocity>
      <motorConstant>{thrust:.6g}</motorConstant><!-- from a data sheet -->
      <momentConstant>{ratio:.6g}</momentConstant>
      <motorNumber>{index}</motorNumber>
      <rotorDragCoefficient>0</rotorDragCoefficient>
    </plugin>
"""
ROTOR = """    <link name="rotor_{index}">
      <pose>{x:.6g} {y:.6g} 0 0 0 0</pose>
      <inertial><mass>{mass:.6g}</mass><inertia><ixx>1e-10</ixx><ixy>0</ixy><ixz>0</ixz><iyy>1e-10</iyy>
        <iyz>0</iyz><izz>2e-10</izz></inertia></inertial>
    </link>
    <joint name="rotor_{index}_joint" type="revolute"><parent>base_link</parent><child>rotor_{index}</child>
      <axis><xyz>0 0 1</xyz><limit><lower>-1e16</lower><upper>1e16</upper></limit></axis></joint>
"""
MODEL = """<?xml version="1.0"?>
<!-- My own quadrotor. -->
<sdf version="1.9">
  <model name="mine">
    <link name="base_link">
      <inertial>
        <pose>0 0 0 0 0 0</pose>
        <mass>{mass:.6g}</mass>
        <inertia>
          <ixx>{x:.6g}</ixx>   <ixy>0</ixy> <ixz>0</ixz>
          <iyy>{y:.6g}</iyy>   <iyz>0</iyz>
          <izz>{z:.6g}</izz>   <!-- a guess -->
        </inertia>
      </inertial>
    </link>
{parts}  </model>
</sdf>
"""


def sdf_of(truth, *, thrust=1.0, inertia=(1.0, 1.0, 1.0), rotor_mass=1e-5, spins=(-1, 1, -1, 1)):
    """SDF of what flies, with numbers that are so many times the true ones."""
    parts = [
        ROTOR.format(index=index, x=x, y=y, mass=rotor_mass)
        + MOTOR.format(
            index=index,
            turn="ccw" if spin > 0 else "cw",
            thrust=thrust * truth.thrust_factor,
            ratio=truth.drag_factor / truth.thrust_factor,
        )
        for index, ((x, y), spin) in enumerate(zip(truth.places, spins, strict=True))
    ]
    apart = [rotor_mass * (truth.places**2).sum(axis=0)[::-1][axis] for axis in (0, 1)]
    apart.append(sum(apart))
    stated = [share * whole - own for share, whole, own in zip(inertia, truth.inertia, apart, strict=True)]
    return MODEL.format(mass=truth.mass - 4 * rotor_mass, x=stated[0], y=stated[1], z=stated[2], parts="".join(parts))


URDF = """<?xml version="1.0"?>
<robot name="mine">
  <link name="base_link"/>
  <link name="frame"><inertial><mass value="{mass:.9g}"/><inertia ixx="{x:.9g}" iyy="{y:.9g}" izz="{z:.9g}" ixy="0"
    ixz="0" iyz="0"/></inertial></link>
  <joint name="frame_joint" type="revolute"><limit lower="0" upper="0" effort="0" velocity="0"/>
    <parent link="base_link"/><child link="frame"/></joint>
{parts}</robot>
"""
URDF_ROTOR = """  <link name="rotor_{index}"/>
  <joint name="rotor_{index}_joint" type="continuous"><origin xyz="{x:.6g} {y:.6g} 0"/><axis xyz="0 0 1"/>
    <parent link="base_link"/><child link="rotor_{index}"/></joint>
  <gazebo>
{motor}  </gazebo>
"""


def urdf_of(truth, *, thrust=1.0, spins=(-1, 1, -1, 1)):
    """URDF of what flies with Gazebo's motor plugins, with a thrust that is so many times the true one."""
    numbers = {"thrust": thrust * truth.thrust_factor, "ratio": truth.drag_factor / truth.thrust_factor}
    motors = [
        MOTOR.format(index=index, turn="ccw" if spin > 0 else "cw", **numbers) for index, spin in enumerate(spins)
    ]
    places = zip(truth.places, motors, strict=True)
    parts = [URDF_ROTOR.format(index=index, x=x, y=y, motor=motor) for index, ((x, y), motor) in enumerate(places)]
    x, y, z = truth.inertia
    return URDF.format(mass=truth.mass, x=x, y=y, z=z, parts="".join(parts))


def write_log(path, flight):
    """Write a flight as a table with its setpoints."""
    motion = flight.motion
    time = motion.period * np.arange(len(flight))
    parts = [motion.position, motion.velocity, euler_angles(motion.rotation), motion.rate, 30 / np.pi * flight.speed]
    parts += [flight.setpoints[name] for name in ("position", "velocity", "attitude")]
    np.savetxt(path, np.column_stack([time, *parts]), delimiter=",", header=COLUMNS, comments="", fmt="%.9g")


MJCF = """<mujoco model="mine"><option timestep="{step}" integrator="{integrator}"/>
  <custom><numeric name="ctrl_power" data="2 2 2 2"/></custom>
  <worldbody><geom type="plane" size="9 9 .1"/>
  <body name="b"><freejoint/><inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia}"/>
  {sites}</body></worldbody><actuator>{motors}</actuator></mujoco>
"""


def mjcf_of(truth, spins, *, thrust=1.0, step=0.002, integrator="Euler"):
    """MJCF of what flies, whose controls are squared speeds, with a thrust that is so many times the true one."""
    sites = "\n  ".join(f'<site name="s{i}" pos="{x:.9g} {y:.9g} 0"/>' for i, (x, y) in enumerate(truth.places))
    gears = [f"0 0 {thrust * truth.thrust_factor:g} 0 0 {-thrust * spin * truth.drag_factor:g}" for spin in spins]
    motors = "\n  ".join(f'<motor name="m{i}" site="s{i}" gear="{gear}"/>' for i, gear in enumerate(gears))
    inertia = " ".join(f"{each:g}" for each in truth.inertia)
    return MJCF.format(step=step, integrator=integrator, mass=truth.mass, inertia=inertia, sites=sites, motors=motors)


def mjcf_in_newtons(truth, spins, *, ratio=1.0):
    """MJCF of what flies, whose controls are thrusts, with so many times the true yaw torque over thrust."""
    text, share = mjcf_of(truth, spins), truth.drag_factor / truth.thrust_factor
    text = text.replace('<custom><numeric name="ctrl_power" data="2 2 2 2"/></custom>', "")
    for index, spin in enumerate(spins):
        gear = f'site="s{index}" gear="0 0 1 0 0 {-spin * ratio * share:.9g}" ctrlrange="0 0.4"'
        text = re.sub(rf'site="s{index}" gear="[^"]*"', gear, text)
    return text


QUARTER = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Axes of a Crazyflie in those of the vehicle that flies: forward is to its right, where rotors turn as its own do."""
MOVING = ("x", "y", "z", "vx", "vy", "vz")
VOLTS, FASTEST = 4.0, 4000.0
"""Of the battery, and speed in rad/s that it turns rotors at."""


def write_crazyflie_log(path, flight, *, speeds):
    """Write a flight as a Crazyflie logs it, with speeds or with what its motors get and the volts of its battery."""
    motion = flight.motion
    asked = np.degrees(euler_angles(rotation_matrix(flight.setpoints["attitude"]) @ QUARTER)) * [1, -1, 1]
    parts = [motion.position, motion.velocity, Rotation.from_matrix(motion.rotation @ QUARTER).as_quat()]
    parts += [np.degrees(motion.rate @ QUARTER), flight.setpoints["position"], flight.setpoints["velocity"], asked]
    # Front right, rear right, rear left, front left are a quarter turn on.
    speed, time = flight.speed[:, [1, 2, 3, 0]], motion.period * np.arange(len(flight))
    volts = np.random.default_rng(0).normal(VOLTS, 0.01, len(time))
    parts += [30 / np.pi * speed] if speeds else [65536 / FASTEST * speed, volts]
    names = ["t", *(f"stateEstimate.{name}" for name in (*MOVING, "qx", "qy", "qz", "qw"))]
    names += [*(f"gyro.{axis}" for axis in "xyz"), *(f"ctrltarget.{name}" for name in MOVING)]
    names += [f"controller.{name}" for name in ("roll", "pitch", "yaw")]
    names += [f"{'rpm' if speeds else 'motor'}.m{motor}" for motor in (1, 2, 3, 4)] + ["pm.vbat"] * (not speeds)
    table = np.column_stack([time, *parts])
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    return speed


CURVE = np.array([-0.02, 0.06, -0.02, 0.006])
"""Of thrust in N by powers of volts, as motors with brushes have it."""


def header_of(truth, speed, *, thrust=1.0, ratio=1.0):
    """Header of what flies, by whose volts rotors lift on average as they do at these speeds, times factors."""
    lifts = np.polynomial.polynomial.polyval(VOLTS / FASTEST * speed, CURVE).mean()
    scale = thrust * truth.thrust_factor * (speed**2).mean() / lifts
    curve = "".join(f"    #define VMOTOR2THRUST{at} {scale * own:.9g}f\n" for at, own in enumerate(CURVE))
    arm, torque = float(np.linalg.norm(truth.places[0])), ratio * truth.drag_factor / truth.thrust_factor
    return (
        f"// Mine.\n#define ARM_LENGTH {arm:.9g}f\n#define CF_MASS {truth.mass:.9g}f  // kg\n"
        f"#ifdef CONFIG_ENABLE_THRUST_BAT_COMPENSATED\n{curve}    #define THRUST_MAX 0.3f\n"
        f"    #define THRUST2TORQUE {torque:.9g}f // m\n#endif\n#define PID_ROLL_KP 6.0\n"
    )


ROTORPY = """#!/usr/bin/env python3
'''Mine.'''
import numpy as np

grams = {grams:.8g}
d = {arm:.10g}  # Arm length, \u00e4hnlich
side = d * np.cos(np.pi / 4)
spins = np.array([-1, 1, -1, 1])

quad_params = {{
    'mass': grams / 1000, 'Ixx': {x:.8g}, 'Iyy': {y:.8g}, 'Izz': {z:.8g},   # kg m^2
    'Ixy': 0.0, 'Ixz': 0.0, 'Iyz': 0,
    'num_rotors': 4,
    'rotor_pos': {{
        'r1': np.array([side, -side, 0]),
        'r2': d * np.array([-0.5**0.5, -0.5**0.5, 0]),
        'r3': [-side, side, 0.],
        'r4': np.array([side, side, 0.0]),
    }},
    'rotor_directions': -spins,
    'k_eta': {thrust:.8g},  # from a data sheet
    'k_m': {drag:.8g}, 'k_d': 0.0, 'tau_m': 0.02,
    'rotor_speed_min': 0, 'rotor_speed_max': 6000.0, 'name': "mine", 'aero': True,
}}
"""


def rotorpy_of(truth, *, thrust=1.0):
    """RotorPy's dictionary for a vehicle, with a thrust that is so many times the true one."""
    x, y, z = truth.inertia
    return ROTORPY.format(
        grams=1e3 * truth.mass,
        arm=float(np.linalg.norm(truth.places[0])),
        x=x,
        y=y,
        z=z,
        thrust=thrust * truth.thrust_factor,
        drag=thrust * truth.drag_factor,
    )


SECTION = """[{name}]  # mine
gravity_vec = [0.0, 0.0, -9.81]
mass = 0.0319
L = 0.0325
J = [  # TODO
    [16.8e-6, 0.0, 0.0],
    [0.0, 16.8e-6, 0.0],
    [0.0, 0.0, 29.8e-6]
]
rpm2thrust = [0.0, -5.4e-7, 2.5e-10]
rpm2torque = [0.0, 1.4e-9, 1.5e-12] # Index is order
rotor_dyn_coef = [ 7.4, 0.0, 0.0, 0.00024,]
mixing_matrix = [[-1.0, -1.0, 1.0, 1.0], [-1.0, 1.0, 1.0, -1.0], [-1.0, 1.0, -1.0, 1.0]]
drag_matrix = [[-0.0147, 0.0, 0.0], [0.0, -0.0147, 0.0], [0.0, 0.0, -0.0128]]
pwm_max = 65535
thrust_max = 0.12  # N per motor

"""
FRAME = """# A frame.
{
    "mass": 1.5,   # kg
    "diagonal_size": 0.45,
    "hoverThrOut": 0.31, "propExpo": 0.5,
    "spin_min": 0.2, "spin_max": 0.975,
    "num_motors": 4
}
"""
HEADER = """/* Platform.
   #define CF_MASS 1.0f */
#define ARM_LENGTH  0.046f
#if defined(CONFIG_KIT_MASS) && (CONFIG_KIT_MASS >= 0)
    #define CF_MASS (CONFIG_KIT_MASS / 1000000.0f)
#elif defined(CONFIG_CRAZYFLIE_THRUST_UPGRADE_KIT)
    #define CF_MASS 0.0325f
#else
    #define CF_MASS 0.029f  // kg
#endif
#ifdef CONFIG_ENABLE_THRUST_BAT_COMPENSATED
  #if defined(CONFIG_CRAZYFLIE_21_PLUS)
    #define THRUST_MAX 0.12f
    #define THRUST2TORQUE 0.007f
  #else
    #define THRUST_MAX 0.18f
    #define THRUST2TORQUE 0.005f
  #endif
#endif
#define NAME "cf2"
#define LIMIT(x) ((x) > 0)
"""
