"""A whole vehicle as a group of datasets, and the artifact of a vehicle found in flights."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.parameters import Parameter, parameters_of
from cpfls_cli.artifacts.replay import HeldOutGroup, better_to
from cpfls_cli.artifacts.spec import BODY, WORLD, Format, Record, columns_of, dataset, group, record, rows_of
from cpfls_cli.inertia import INERTIA_PARAMETERS, six_parameters

if TYPE_CHECKING:
    # Reading a record does not need the compiled loops that play a vehicle back.
    from cpfls_cli.playback.model import ModelEffect, Remainder, VehicleModel
    from cpfls_cli.playback.rotors import RotorResponse
    from cpfls_cli.playback.structure import Choice
    from cpfls_cli.playback.vehicle import FoundVehicle
    from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings


CONTROL_HORIZON = 0.1
"""Horizon in s to which a controller of the attitude relies on its model."""


@record
class RotorsGroup:
    """Rotors, in the order of their speeds."""

    position: Array = dataset("position", "hubs relative to the centre of mass", "rotor", "axis", units="m", frame=BODY)
    spin: IntArray = dataset("spin", "1 turns counter-clockwise seen from above, -1 clockwise", "rotor")
    thrust_factor: Array = dataset("thrust_factor", "thrust over squared speed", "rotor", units="N s^2")
    drag_factor: Array = dataset("drag_factor", "reaction torque over squared speed", "rotor", units="N m s^2")
    radius: Array = dataset("radius", "of the propellers", "rotor", units="m", gaps=True)
    speed_max: float = dataset("speed_max", "largest speed of a rotor", units="rad/s")
    thrust_linear: float = dataset(
        "thrust_linear", "a: thrust and drag follow w^2 + a w_h w, w_h the speed that hovers under the square alone"
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
        from cpfls_cli.vehicle.settings import RotorSettings

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

    delay: float = dataset("delay", "pure delay", units="s")
    lag: float = dataset("lag", "time constant of the first-order lag; 0 for none", units="s")
    slow_roll_pitch: float = dataset(
        "slow_roll_pitch", "share by which roll and pitch torque of the rotors come back after a change; below 0: fade"
    )
    slow_yaw: float = dataset("slow_yaw", "the same of the yaw torque")
    slow: float = dataset("slow", "time constant with which they do", units="s")

    @classmethod
    def of(cls, response: RotorResponse) -> Self:
        """Arrange a response."""
        return cls(
            delay=response.delay_s,
            lag=response.lag_s,
            slow_roll_pitch=response.slow_roll_pitch,
            slow_yaw=response.slow_yaw,
            slow=response.slow_s,
        )

    def response(self) -> RotorResponse:
        """Rebuild it."""
        from cpfls_cli.playback.rotors import RotorResponse

        return RotorResponse(
            delay_s=self.delay,
            lag_s=self.lag,
            slow_roll_pitch=self.slow_roll_pitch,
            slow_yaw=self.slow_yaw,
            slow_s=self.slow,
        )


@record
class EffectsGroup:
    """Effects of the catalogue in the model: polynomials of motion and rotor speeds."""

    name: tuple[str, ...] = dataset("name", "identifier, see `cpfls effects`", "vehicle_effect")
    linear_effect: tuple[str, ...] = dataset(
        "linear_effect", "effect that each linear coefficient belongs to", "vehicle_linear"
    )
    linear: Array = dataset(
        "linear", "linear coefficients, by effect in the order of its columns", "vehicle_linear", units="SI"
    )
    shape_effect: tuple[str, ...] = dataset("shape_effect", "effect that each shape belongs to", "vehicle_shape")
    shape_name: tuple[str, ...] = dataset("shape_name", "what the effect depends on nonlinearly", "vehicle_shape")
    shape: Array = dataset("shape", "value of the shape", "vehicle_shape", units="SI")

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

    def effects(self) -> tuple[ModelEffect, ...]:
        """Rebuild them.

        Raises
        ------
        InputError
            If this program does not know one of them.
        """
        from cpfls_cli.effects.registry import effect
        from cpfls_cli.playback.model import ModelEffect

        return tuple(ModelEffect(effect(name).name, self._shape_of(name), self.linear_of(name)) for name in self.name)

    def linear_of(self, effect: str) -> Array:
        """Give the linear coefficients of an effect, shape (coefficient,)."""
        return np.asarray(self.linear[[name == effect for name in self.linear_effect]])

    def _shape_of(self, effect: str) -> dict[str, float]:
        shapes = zip(self.shape_effect, self.shape_name, self.shape.tolist(), strict=True)
        return {name: value for of, name, value in shapes if of == effect}


@record
class RemainderGroup:
    """What has no name: torque and force over the direction of the airflow."""

    breakpoints: Array = dataset(
        "breakpoints", "peaks of the membership functions over the direction, share of a turn", "direction_breakpoint"
    )
    harmonic_order: int = dataset("harmonic_order", "of the consequents; 0 for the seesaw")
    rows: IntArray = dataset("rows", "which of torque (0 to 2) and force (3 to 5) it adds to", "remainder_row")
    coefficients: Array = dataset(
        "coefficients",
        "of each column: by speed in the rotor plane times mean rotor speed, and by that speed squared",
        "remainder_row",
        "remainder_column",
        "2",
        units="SI",
    )

    @classmethod
    def of(cls, remainder: Remainder) -> Self:
        """Arrange a remainder."""
        return cls(
            breakpoints=remainder.breakpoints,
            harmonic_order=remainder.harmonic_order,
            rows=remainder.rows,
            coefficients=remainder.coefficients,
        )

    def remainder(self) -> Remainder:
        """Rebuild it."""
        from cpfls_cli.playback.model import Remainder

        return Remainder(
            breakpoints=self.breakpoints,
            harmonic_order=self.harmonic_order,
            rows=self.rows.astype(np.int64),
            coefficients=self.coefficients,
        )


@record
class VehicleGroup:
    """A whole vehicle but for an inertia that depends on the attitude."""

    mass: float = dataset("mass", "mass", units="kg")
    gravity: float = dataset("gravity", "gravitational acceleration", units="m/s^2")
    inertia: Array = dataset("inertia", "Ixx Iyy Izz Ixy Ixz Iyz", "6", units="kg m^2", frame=BODY)
    rotor: RotorsGroup = group("rotor")
    response: ResponseGroup = group("response")
    effect: EffectsGroup = group("effect")
    remainder: RemainderGroup | None = group("remainder", default=None)
    not_held: tuple[str, ...] = dataset(
        "not_held", "parts of the model that stand elsewhere in the file, being no polynomials", "part_not_held"
    )
    wind: Array | None = dataset(
        "steady_wind",
        "of its flights; no part of the vehicle",
        "3",
        units="m/s",
        frame=WORLD,
        default=None,
    )

    @classmethod
    def of(cls, model: VehicleModel, not_held: Sequence[str] = ()) -> Self:
        """Arrange a model without its fuzzy inertia.

        Parameters
        ----------
        not_held : sequence of str
            Parts of the model that stand elsewhere.
        """
        vehicle = model.vehicle
        return cls(
            mass=vehicle.mass_kg,
            gravity=vehicle.gravity_m_s2,
            inertia=six_parameters(vehicle.inertia_kg_m2),
            rotor=RotorsGroup.of(vehicle, model.thrust_linear),
            response=ResponseGroup.of(model.response),
            effect=EffectsGroup.of(model.effects),
            remainder=None if model.remainder is None else RemainderGroup.of(model.remainder),
            not_held=tuple(not_held),
            wind=np.array(model.wind) if any(model.wind) else None,
        )

    def vehicle(self) -> VehicleSettings:
        """Rebuild mass, inertia and rotors."""
        from cpfls_cli.vehicle.settings import VehicleSettings

        first, second, third, *products = self.inertia.tolist()
        return VehicleSettings(
            gravity_m_s2=self.gravity,
            mass_kg=self.mass,
            inertia_kg_m2=(first, second, third, *products) if any(products) else (first, second, third),
            rotors=self.rotor.rotors(),
            rotor_speed_max_rad_s=self.rotor.speed_max,
        )

    def vehicle_model(self) -> VehicleModel:
        """Rebuild the model.

        Raises
        ------
        InputError
            If this program does not know one of its effects.
        """
        from cpfls_cli.playback.model import VehicleModel

        return VehicleModel(
            vehicle=self.vehicle(),
            response=self.response.response(),
            thrust_linear=self.rotor.thrust_linear,
            effects=self.effect.effects(),
            remainder=None if self.remainder is None else self.remainder.remainder(),
            wind=(0.0, 0.0, 0.0) if self.wind is None else tuple(self.wind.tolist()),
        )

    @property
    def summary(self) -> dict[str, Any]:
        """The vehicle for machines."""
        return {
            "mass_kg": self.mass,
            "inertia_kg_m2": dict(zip(INERTIA_PARAMETERS, self.inertia.tolist(), strict=True)),
            "thrust_factor_n_s2": self.rotor.thrust_factor.tolist(),
            "drag_factor_n_m_s2": self.rotor.drag_factor.tolist(),
            "thrust_linear": self.rotor.thrust_linear,
            "response": {
                "delay_s": self.response.delay,
                "lag_s": self.response.lag,
                "slow_roll_pitch": self.response.slow_roll_pitch,
                "slow_yaw": self.response.slow_yaw,
                "slow_s": self.response.slow,
            },
            "effects": {name: self.effect.linear_of(name).tolist() for name in self.effect.name},
            "remainder": None if self.remainder is None else self.remainder.rows.tolist(),
            "steady_wind_m_s": [0.0, 0.0, 0.0] if self.wind is None else self.wind.tolist(),
            "not_held": list(self.not_held),
        }


@record
class FoundNumbersGroup:
    """The numbers that were free, with 95 % intervals."""

    name: tuple[str, ...] = dataset("name", "block and number", "found")
    unit: tuple[str, ...] = dataset("unit", "empty for a ratio", "found")
    value: Array = dataset("value", "estimate", "found", units="SI")
    low: Array = dataset("low", "lower end of the 95 % interval", "found", units="SI")
    high: Array = dataset("high", "upper end of the 95 % interval", "found", units="SI")
    stated: Array = dataset("stated", "in /config; not finite where no config does", "found", units="SI", gaps=True)
    determined: BoolArray = dataset("determined", "1 where the flights say more than what was believed before", "found")
    at_bound: BoolArray = dataset("at_bound", "1 where it lies on a bound, so that the interval says little", "found")


@record
class TradesGroup:
    """Pairs of numbers that the flights cannot tell apart."""

    first: tuple[str, ...] = dataset("first", "one number", "trade")
    second: tuple[str, ...] = dataset("second", "the other", "trade")
    correlation: Array = dataset("correlation", "of the two estimates", "trade")


@record
class SharesGroup:
    """How much each part of the model does along the training flights."""

    name: tuple[str, ...] = dataset("name", "rotors, an effect, or remainder", "part")
    torque: Array = dataset("torque", "root mean square", "part", "axis", units="N m", frame=BODY)
    force: Array = dataset("force", "root mean square", "part", "axis", units="N", frame=BODY)


@record
class StructuresTriedGroup:
    """Structures of the Pareto front and the baselines, each judged on the flights kept aside."""

    name: tuple[str, ...] = dataset("name", "chosen, best, greedy, everything, nothing, or front", "structure")
    blocks: tuple[str, ...] = dataset("blocks", "its blocks, one space between two", "structure")
    error: Array = dataset("error", "mean error of the windows kept aside; about 1.1 for rates that stay", "structure")
    worse: Array = dataset("worse", "error less that of the best", "structure")
    uncertain: Array = dataset("uncertain", "standard error of that difference", "structure")
    numbers: IntArray = dataset("numbers", "free numbers", "structure")
    condition_number: Array = dataset("condition_number", "of the numbers in their natural sizes", "structure")

    @classmethod
    def of(cls, choice: Choice) -> Self:
        """Arrange a choice."""
        baselines = ("chosen", "best", "greedy", "everything", "nothing")
        listed = [*((name, getattr(choice, name)) for name in baselines), *(("front", each) for each in choice.front)]
        differences = [judged.worse_than(choice.best) for _, judged in listed]
        return cls(
            name=tuple(name for name, _ in listed),
            blocks=tuple(" ".join(judged.structure.blocks) for _, judged in listed),
            error=np.array([judged.error for _, judged in listed]),
            worse=np.array([worse for worse, _ in differences]),
            uncertain=np.array([uncertain for _, uncertain in differences]),
            numbers=np.array([judged.numbers for _, judged in listed], dtype=np.int64),
            condition_number=np.array([judged.condition_number for _, judged in listed]),
        )


@record
class DifferencesGroup:
    """What other configurations have that the vehicle has not, with 95 % intervals."""

    name: tuple[str, ...] = dataset("name", "configuration, and what differs", "difference")
    unit: tuple[str, ...] = dataset("unit", "of the difference", "difference")
    value: Array = dataset("value", "estimate", "difference", units="SI")
    low: Array = dataset("low", "lower end of the 95 % interval", "difference", units="SI")
    high: Array = dataset("high", "upper end of the 95 % interval", "difference", units="SI")


@record
class VehicleRecord(Record):
    """The artifact `cpfls/vehicle`."""

    FORMAT: ClassVar = Format("cpfls/vehicle", "a vehicle found in flights", "vehicle", ("flight", "held-out"))

    vehicle: VehicleGroup = group("vehicle")
    found: FoundNumbersGroup = group("found")
    trade: TradesGroup = group("trade")
    structure: StructuresTriedGroup = group("structure")
    held_out: HeldOutGroup | None = group("held_out", default=None)
    share: SharesGroup = group("share")
    airspeed: float = dataset(
        "airspeed", "speed in the rotor plane that 95 % of the training samples stay below", units="m/s"
    )
    evaluated: int = dataset("evaluated", "structures that were judged")
    complete: bool = dataset("complete", "1 where the search came to its end")
    blocks: int = dataset("blocks", "blocks of windows that the intervals come from")
    warning: tuple[str, ...] = dataset("warning", "what to know about the flights", "warning")
    guess: tuple[str, ...] | None = dataset(
        "guess", "numbers of /vehicle that are guesses still: no flight tells them", "guess", default=None
    )
    difference: DifferencesGroup | None = group("difference", default=None)
    contradiction: tuple[str, ...] | None = dataset(
        "contradiction", "what of the flights contradicts itself or the vehicle", "contradiction", default=None
    )
    commanded: bool | None = dataset(
        "commanded", "1 where its rotors were driven by commands, 0 by measured speeds", default=None
    )

    @classmethod
    def of(
        cls,
        found: FoundVehicle,
        held_out: HeldOutGroup | None,
        warnings: Sequence[str],
        contradictions: Sequence[str] | None = None,
        *,
        commanded: bool,
    ) -> Self:
        """Arrange a vehicle that was found, and how well it predicts flights that it was not found in."""
        return cls(
            vehicle=VehicleGroup.of(found.model),
            found=columns_of(
                FoundNumbersGroup,
                found.numbers,
                determined=np.array([number.determined for number in found.numbers], dtype=bool),
                at_bound=np.array([number.at_bound for number in found.numbers], dtype=bool),
            ),
            trade=columns_of(TradesGroup, found.trades),
            structure=StructuresTriedGroup.of(found.choice),
            held_out=held_out,
            share=SharesGroup(
                name=tuple(share.name for share in found.shares),
                torque=np.array([share.wrench[:3] for share in found.shares]),
                force=np.array([share.wrench[3:] for share in found.shares]),
            ),
            airspeed=found.airspeed,
            evaluated=found.choice.evaluated,
            complete=found.choice.complete,
            blocks=found.blocks,
            warning=tuple(warnings),
            guess=found.guessed or None,
            difference=columns_of(DifferencesGroup, found.differences) if found.differences else None,
            contradiction=None if contradictions is None else tuple(contradictions),
            commanded=commanded,
        )

    @property
    def verdict(self) -> str:
        """What playback on flights held out says of it.

        Good for simulation where errors of rates, attitude, velocity and position, as far as the flights know them, add
        up to less over the horizon than those of what knows no model; for control where those of the rates do, over
        0.1 s at least. For nothing where the flights contradict themselves, however well it repeats them.
        """
        if self.contradiction:
            return "do-not-use"
        if self.held_out is None:
            return "not-judged"
        last, known = float(self.held_out.horizon_s[-1]), self.held_out.errors
        reached = {signal: better_to(self.held_out, signal) for signal, group in known.items() if group is not None}
        if known["velocity"] is not None and all(horizon >= last for horizon in reached.values()):
            return "good-for-simulation"
        return "good-for-control" if reached["body_rate"] >= min(CONTROL_HORIZON, last) else "do-not-use"

    @property
    def summary(self) -> dict[str, Any]:
        """The vehicle for machines."""
        numbers = {row.pop("name"): row for row in rows_of(self.found)}
        return {
            **self.vehicle.summary,
            "verdict": self.verdict,
            "parameters": {each.key: _but_key(each) for each in parameters_of(self)},
            "numbers": numbers,
            "differences": {}
            if self.difference is None
            else {row.pop("name"): row for row in rows_of(self.difference)},
            "trades": [list(row.values()) for row in rows_of(self.trade)],
            "structures": rows_of(self.structure),
            "held_out": None if self.held_out is None else self.held_out.summary,
            "shares": {row.pop("name"): row for row in rows_of(self.share)},
            "evaluated": self.evaluated,
            "complete": self.complete,
            "contradictions": list(self.contradiction or ()),
            "warnings": list(self.warning),
        }


def _but_key(parameter: Parameter) -> dict[str, Any]:
    return {name: value for name, value in parameter._asdict().items() if name != "key"}
