"""What all models answer; and a vehicle as a group of datasets, all that is needed to evaluate it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.audit import AuditGroup
from cpfls_cli.artifacts.learned import LearnedFlight, LearnedGroup, learned_in
from cpfls_cli.artifacts.spec import BODY, EULER, WORLD, Format, Record, dataset, group, group_of, record
from cpfls_cli.inertia import INERTIA_PARAMETERS, beyond_any_body, more_than_others, six_parameters
from cpfls_cli.playback.gusts import Gusts
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.validation.trust import Trust
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings

if TYPE_CHECKING:
    # Reading a record waits for no numerics; `artifacts/rebuilt.py` makes a model of it again.
    from cpfls_cli.dynamics.inertia_functions import InertiaFunctions
    from cpfls_cli.playback.model import ModelEffect, VehicleModel

USUAL = "usual"
"""What a command is between samples, where the model does not say: as a flight is usually taken."""


@record
class RotorsGroup:
    """Rotors, in the order of their speeds."""

    position: Array = dataset("hubs relative to the centre of mass", "rotor", "axis", units="m", frame=BODY)
    spin: IntArray = dataset("1 turns counter-clockwise seen from above, -1 clockwise", "rotor")
    thrust_factor: Array = dataset("thrust over squared speed", "rotor", units="N s^2")
    drag_factor: Array = dataset("reaction torque over squared speed", "rotor", units="N m s^2")
    radius: Array = dataset("of the propellers", "rotor", units="m", gaps=True)
    speed_max: float = dataset("largest speed of a rotor", units="rad/s")
    thrust_linear: float = dataset(
        "a: thrust and drag follow w^2 + a w_h w, w_h the speed that hovers under the square alone"
    )

    @classmethod
    def of(cls, vehicle: VehicleSettings, thrust_linear: float) -> Self:
        """Arrange the rotors of a vehicle."""
        rotors = vehicle.rotors
        return cls(
            position=np.array([rotor.position_m for rotor in rotors], dtype=float),
            spin=np.array([rotor.spin for rotor in rotors], dtype=np.int64),
            thrust_factor=np.array([rotor.thrust_factor_n_s2 for rotor in rotors], dtype=float),
            drag_factor=np.array([rotor.drag_factor_n_m_s2 for rotor in rotors], dtype=float),
            radius=np.array([np.nan if rotor.radius_m is None else rotor.radius_m for rotor in rotors], dtype=float),
            speed_max=vehicle.rotor_speed_max_rad_s,
            thrust_linear=thrust_linear,
        )

    def rotors(self) -> tuple[RotorSettings, ...]:
        """Rebuild them."""
        columns = (self.position, self.spin, self.thrust_factor, self.drag_factor, self.radius)
        return tuple(
            RotorSettings(
                position_m=tuple(position),
                spin=1 if spin > 0 else -1,
                thrust_factor_n_s2=thrust,
                drag_factor_n_m_s2=drag,
                radius_m=None if np.isnan(radius) else radius,
            )
            for position, spin, thrust, drag, radius in zip(*(column.tolist() for column in columns), strict=True)
        )


@record
class ResponseGroup:
    """How rotors follow their logged speed."""

    delay_s: float = dataset("pure delay", path="delay", units="s")
    lag_s: float = dataset("time constant of the first-order lag; 0 for none", path="lag", units="s")
    slow_roll_pitch: float = dataset(
        "share by which roll and pitch torque of the rotors come back after a change; below 0: fade"
    )
    slow_yaw: float = dataset("the same of the yaw torque")
    slow_s: float = dataset("time constant with which they do", path="slow", units="s")
    commanded: bool = dataset(
        "1 where delay and lag lie behind commands, which measured speeds have already; 0 behind any speed"
    )
    hold: str = dataset("what a command is between samples: linear, previous, or usual for the flight")

    @classmethod
    def of(cls, response: RotorResponse, *, commanded: bool, hold: str | None) -> Self:
        """Arrange a response, whether it lies behind commands, and what those are between samples."""
        return group_of(cls, response, commanded=commanded, hold=hold or USUAL)

    def response(self) -> RotorResponse:
        """Rebuild it."""
        return RotorResponse(**{own.name: getattr(self, own.name) for own in fields(RotorResponse)})


@record
class EffectsGroup:
    """Effects of the catalogue in the model."""

    name: tuple[str, ...] = dataset("identifier, see `cpfls effects`", "vehicle_effect")
    linear_effect: tuple[str, ...] = dataset("effect that each linear coefficient belongs to", "vehicle_linear")
    linear: Array = dataset("linear coefficients, by effect in the order of its columns", "vehicle_linear", units="SI")
    shape_effect: tuple[str, ...] = dataset("effect that each shape belongs to", "vehicle_shape")
    shape_name: tuple[str, ...] = dataset("what the effect depends on nonlinearly", "vehicle_shape")
    shape: Array = dataset("value of the shape", "vehicle_shape", units="SI")

    @classmethod
    def of(cls, effects: Sequence[ModelEffect]) -> Self:
        """Arrange effects."""
        shapes = [(one.name, name, value) for one in effects for name, value in one.shape.items()]
        return cls(
            name=tuple(one.name for one in effects),
            linear_effect=tuple(one.name for one in effects for _ in one.coefficients),
            linear=np.array([value for one in effects for value in one.coefficients], dtype=float),
            shape_effect=tuple(effect for effect, _, _ in shapes),
            shape_name=tuple(name for _, name, _ in shapes),
            shape=np.array([value for _, _, value in shapes], dtype=float),
        )

    def linear_of(self, effect: str) -> Array:
        """Give the linear coefficients of an effect, shape (coefficient,)."""
        return np.asarray(self.linear[[name == effect for name in self.linear_effect]])

    def shape_of(self, effect: str) -> dict[str, float]:
        """Give the shapes of an effect, by name."""
        shapes = zip(self.shape_effect, self.shape_name, self.shape.tolist(), strict=True)
        return {name: value for of, name, value in shapes if of == effect}


@record
class RemainderGroup:
    """What has no name: torque and force over the direction of the airflow."""

    breakpoints: Array = dataset(
        "peaks of the membership functions over the direction, share of a turn", "direction_breakpoint"
    )
    harmonic_order: int = dataset("of the consequents; 0 for the seesaw")
    rows: IntArray = dataset("which of torque (0 to 2) and force (3 to 5) it adds to", "remainder_row")
    coefficients: Array = dataset(
        "of each column: by speed in the rotor plane times mean rotor speed, and by that speed squared",
        "remainder_row",
        "remainder_column",
        "2",
        units="SI",
    )


@record
class GustsGroup:
    """Random torque and force of its flights, as Gauss-Markov processes: roll, pitch, yaw, then along x, y, z."""

    torque: Array = dataset("standard deviation; 0 for none", "axis", units="N m", frame=BODY)
    torque_memory: Array = dataset("time in which a gust falls to 37 %", "axis", units="s", frame=BODY)
    force: Array = dataset("standard deviation; 0 for none", "axis", units="N", frame=BODY)
    force_memory: Array = dataset("time in which a gust falls to 37 %", "axis", units="s", frame=BODY)
    torque_white: Array | None = dataset(
        "white noise beside it, as of a step of 1 s", "axis", units="N m s^0.5", frame=BODY, default=None
    )
    force_white: Array | None = dataset(
        "white noise beside it, as of a step of 1 s", "axis", units="N s^0.5", frame=BODY, default=None
    )

    @classmethod
    def of(cls, gusts: Gusts) -> Self:
        """Arrange gusts."""
        (torque, force), (turning, pushing), (torque_white, force_white) = (values.reshape(2, 3) for values in gusts)
        return cls(
            torque=torque,
            torque_memory=turning,
            force=force,
            force_memory=pushing,
            torque_white=torque_white,
            force_white=force_white,
        )

    def gusts(self) -> Gusts:
        """Rebuild them."""
        return Gusts(np.append(self.torque, self.force), np.append(self.torque_memory, self.force_memory), self.white)

    @property
    def white(self) -> Array:
        """White noise of torque and force, 0 in files of before, shape (6,)."""
        torque, force = (np.zeros(3) if own is None else own for own in (self.torque_white, self.force_white))
        return np.append(torque, force)


@record
class InertiaFunctionsGroup:
    """Inertia over attitude by fuzzy systems, all that is needed to evaluate it, and where it was found."""

    structure: str = dataset("cpfls: first and last rule joined; fls: classic TSK system")
    input_map: str = dataset("full-circle or data-range")
    consequents: str = dataset("harmonic or seesaw")
    harmonic_order: int = dataset("highest harmonic of harmonic consequents")
    products: str = dataset("features of two inputs: additive or tensor")
    membership_functions: IntArray = dataset("of D13(pitch) D22(roll) D23(roll) D23(pitch) D33(roll) D33(pitch)", "6")
    partition: tuple[str, ...] = dataset("partition each breakpoint belongs to", "breakpoint")
    breakpoints: Array = dataset("peaks of the membership functions on [0, 1]", "breakpoint")
    coefficients: Array = dataset(
        "coefficients of the rule consequents", "rule_coefficient", units="kg m^2", frame=EULER
    )
    parameter: tuple[str, ...] = dataset("inertia function, rule and feature", "rule_coefficient")
    rigid_body: Array = dataset(
        "Ixx Iyy Izz Ixy Ixz Iyz under the fuzzy part; zero for none", "6", units="kg m^2", frame=BODY
    )
    input_range: Array = dataset("minimum and maximum of roll and pitch inputs", "2", "2")
    visited: BoolArray = dataset("cells of roll and pitch that training visited", "cell", "cell", frame=EULER)

    @classmethod
    def of(cls, model: InertiaFunctions) -> Self:
        """Arrange an inertia over attitude."""
        structure = model.structure
        names = [p.name for p, peaks in zip(structure.partitions, model.partitions, strict=True) for _ in peaks]
        return group_of(
            cls,
            structure.settings,
            membership_functions=np.array([each.functions for each in structure.partitions]),
            partition=tuple(names),
            breakpoints=np.concatenate(model.partitions),
            coefficients=model.coefficients,
            parameter=tuple(structure.parameter_names),
            rigid_body=model.rigid_body,
            input_range=np.array([[r.minimum, r.maximum] for r in model.ranges]),
            visited=model.visited,
        )


@record
class VehicleGroup:
    """The model of a vehicle, all that is needed to evaluate it."""

    mass: float = dataset("mass", units="kg")
    gravity: float = dataset("gravitational acceleration", units="m/s^2")
    inertia: Array = dataset("Ixx Iyy Izz Ixy Ixz Iyz", "6", units="kg m^2", frame=BODY)
    rotor: RotorsGroup = group()
    response: ResponseGroup = group()
    effect: EffectsGroup = group()
    remainder: RemainderGroup | None = group(default=None)
    wind: Array | None = dataset(
        "of its flights; no part of the vehicle", "3", path="steady_wind", units="m/s", frame=WORLD, default=None
    )
    inertia_functions: InertiaFunctionsGroup | None = group(default=None)
    repair: AuditGroup | None = group(default=None)
    gusts: GustsGroup | None = group(default=None)

    @classmethod
    def of(cls, model: VehicleModel) -> Self:
        """Arrange a model."""
        vehicle, functions = model.vehicle, cast("InertiaFunctions | None", model.fuzzy)
        return cls(
            mass=vehicle.mass_kg,
            gravity=vehicle.gravity_m_s2,
            inertia=six_parameters(vehicle.inertia_kg_m2),
            rotor=RotorsGroup.of(vehicle, model.thrust_linear),
            response=ResponseGroup.of(model.response, commanded=model.commanded, hold=model.hold),
            effect=EffectsGroup.of(model.effects),
            remainder=None if model.remainder is None else group_of(RemainderGroup, model.remainder),
            wind=np.array(model.wind) if any(model.wind) else None,
            # What is written was identified.
            inertia_functions=None if functions is None else InertiaFunctionsGroup.of(functions),
            repair=None if model.repairs is None else AuditGroup.of(model.repairs),
            gusts=None if model.gusts is None else GustsGroup.of(model.gusts),
        )

    def vehicle(self) -> VehicleSettings:
        """Rebuild mass, inertia and rotors."""
        first, second, third, *products = self.inertia.tolist()
        return VehicleSettings(
            gravity_m_s2=self.gravity,
            mass_kg=self.mass,
            inertia_kg_m2=(first, second, third, *products) if any(products) else (first, second, third),
            rotors=self.rotor.rotors(),
            rotor_speed_max_rad_s=self.rotor.speed_max,
        )


def of_no_body(model: VehicleModel) -> tuple[str, ...]:
    """Name the moments of inertia of a vehicle that are those of no body of its mass between its rotors."""
    vehicle = model.vehicle
    pairs = zip(INERTIA_PARAMETERS[:3], vehicle.inertia_kg_m2, strict=False)
    moments = {f"inertia.{name}": value for name, value in pairs}
    excess = {f"inertia.{name}" for name in more_than_others(list(moments.values()))}
    hubs = np.array([rotor.position_m for rotor in vehicle.rotors])
    wrong = {*beyond_any_body(vehicle.mass_kg, hubs, moments), *excess}
    return tuple(name for name in moments if name in wrong)


class AnyModel:
    """What every model of a vehicle answers, whoever found it."""

    MADE_BY: ClassVar[str]
    """Command that makes it."""
    if TYPE_CHECKING:
        # Of a result it is a field, whose kind the class says that has it.
        model: VehicleModel

    @property
    def learned_from(self) -> tuple[LearnedFlight, ...]:
        """Flights that it was found in, those of what it was built on among them."""
        return ()

    @property
    def chosen_on(self) -> frozenset[str]:
        """Hashes of the flights that it was chosen on, among several."""
        return frozenset()

    @property
    def trust(self) -> str:
        """How far to trust it, a word of `Trust`; of a file by a newer program possibly another."""
        return Trust.NOT_JUDGED

    @property
    def judged_as(self) -> dict[str, str]:
        """How far to trust it, by what it is judged as; the word of the last is that of whoever takes it elsewhere."""
        return {"": self.trust}

    @property
    def stopped(self) -> str:
        """Why the search for it ended before its end; empty where it did not."""
        return ""

    @property
    def impossible(self) -> tuple[str, ...]:
        """Numbers of it that no such vehicle has, by the names of a fit."""
        return ()


@record
class ModelRecord(Record, AnyModel):
    """What every artifact `cpfls/model` holds, until it is a result."""

    FORMAT: ClassVar = Format("cpfls/model", "a model of a vehicle, and how it was found", "identify, extend, gap")

    vehicle: VehicleGroup = group()
    learned: LearnedGroup | None = group(default=None)

    @cached_property
    def model(self) -> VehicleModel:  # type: ignore[override]
        """The model."""
        from cpfls_cli.artifacts.rebuilt import vehicle_model

        return vehicle_model(self.vehicle)

    @property
    def learned_from(self) -> tuple[LearnedFlight, ...]:
        """Flights that it was found in, those of what it was built on among them."""
        # What is not written yet knows no files.
        return () if self.header is None else learned_in(self.header.inputs, self.learned, "flight")

    @property
    def provenance(self) -> dict[str, Any]:
        """How far to trust it and what it learned from, for machines."""
        return {"trust": str(self.trust), "learned_from": [flight._asdict() for flight in self.learned_from]}
