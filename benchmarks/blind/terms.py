"""All terms by name, and their set-up for a batch of flights."""

from __future__ import annotations

from . import body_terms as body
from . import gusts
from . import pybullet_terms as pybullet
from . import rotor_terms as rotor
from . import strange_terms as strange

TERMS = {
    "rotor_drag": rotor.RotorDrag,
    "flapping_moment": rotor.FlappingMoment,
    "rolling_moment": rotor.RollingMoment,
    "rotor_plane_damping": rotor.RotorPlaneDamping,
    "inflow": rotor.Inflow,
    "inflow_momentum": rotor.InflowMomentum,
    "translational_lift": rotor.TranslationalLift,
    "ground_effect": rotor.GroundEffect,
    "ground_exponential": rotor.GroundExponential,
    "vertical_descent": rotor.VerticalDescent,
    "rotor_interference": rotor.RotorInterference,
    "thrust_tilt": rotor.ThrustTilt,
    "loose_arm": rotor.LooseArm,
    "rotor_gyroscopic": rotor.RotorGyroscopic,
    "rotor_acceleration": rotor.RotorAcceleration,
    "linear_damping": body.LinearDamping,
    "quadratic_damping": body.QuadraticDamping,
    "cubic_damping": body.CubicDamping,
    "stribeck_damping": body.StribeckDamping,
    "parasitic_drag": body.ParasiticDrag,
    "parasitic_power": body.ParasiticDrag,
    "torque_bias": body.TorqueBias,
    "payload": body.Payload,
    "fuel_slosh": body.FuelSlosh,
    "magnetic_torque": strange.MagneticTorque,
    "yaw_cogging": strange.YawCogging,
    "gust_turbulence": strange.GustTurbulence,
    "stick_slip_gimbal": strange.StickSlipGimbal,
    "thermal_drift": strange.ThermalDrift,
    "attitude_product": strange.AttitudeProduct,
    "wall_effect": strange.WallEffect,
    "sliding_battery": strange.SlidingBattery,
    "cyclic_swirl": strange.CyclicSwirl,
    "wake_on_body": strange.WakeOnBody,
    "flexible_arm": strange.FlexibleArm,
    "drag_over_height": strange.DragOverHeight,
    "gust_field": strange.GustField,
    "gusts": gusts.Gusts,
    "propeller_change": strange.PropellerChange,
    "bullet_damping": pybullet.BulletDamping,
    "bullet_drag": pybullet.BulletDrag,
    "bullet_ground": pybullet.BulletGround,
    "bullet_downwash": pybullet.BulletDownwash,
}
STAGES = ("thrust", "hub", "body", "coupled")


def build(flights):
    """Make the terms of a batch, sorted by stage.

    ``flights`` holds, per flight, its vehicle, a dict of hidden effects and a function giving a fresh generator.
    """
    by_stage = {stage: [] for stage in STAGES}
    for name, kind in TERMS.items():
        rows = [row for row, flight in enumerate(flights) if name in flight.hidden]
        if rows:
            parameters = [flights[row].hidden[name] for row in rows]
            vehicles = [flights[row].vehicle for row in rows]
            rngs = [flights[row].generator(name) for row in rows]
            by_stage[kind.stage].append(kind(rows, parameters, vehicles, rngs))
    return by_stage
