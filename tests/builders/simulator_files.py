"""Files of simulators for a vehicle that flies in `gusty_flights`, and its flights as logs."""

import numpy as np

from cpfls_cli.rotations import euler_angles

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


def write_log(path, flight):
    """Write a flight as a table with its setpoints."""
    motion = flight.motion
    time = motion.period * np.arange(len(flight))
    parts = [motion.position, motion.velocity, euler_angles(motion.rotation), motion.rate, 30 / np.pi * flight.speed]
    parts += [flight.setpoints[name] for name in ("position", "velocity", "attitude")]
    np.savetxt(path, np.column_stack([time, *parts]), delimiter=",", header=COLUMNS, comments="", fmt="%.9g")
