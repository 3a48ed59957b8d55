"""The artifact of an extended model: the effects that it missed in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.gap_effects import GapChangeGroup, NamedEffectsGroup, PlaybackChangeGroup, effect_summary
from cpfls_cli.artifacts.gap_flights import AuditGroup, BaseGroup
from cpfls_cli.artifacts.spec import BODY, Format, Record, columns_of, dataset, group, record
from cpfls_cli.artifacts.vehicle_model import VehicleGroup
from cpfls_cli.inertia import six_parameters, symmetric

if TYPE_CHECKING:
    from cpfls_cli.gap.extended import ExtendedModel, Refit
    from cpfls_cli.vehicle.settings import VehicleSettings
    from cpfls_cli.weak_form.windows import Recording

FUZZY_INERTIA = "inertia over attitude"
"""Part of an extended model that no table of polynomials holds."""


@record
class LeftOutGroup:
    """Effects that no vehicle for other programs holds, and what they do along the held-out flights."""

    name: tuple[str, ...] = dataset("name", "identifier, see `cpfls effects`", "left_out")
    wrench: Array = dataset(
        "wrench",
        "root mean square of torque (x y z, N m) and force (x y z, N)",
        "left_out",
        "6",
        units="SI",
        frame=BODY,
    )
    ends: Array = dataset(
        "ends",
        "how far half a second of playback ends off without it: position (m), velocity (m/s), attitude (rad), body "
        "rate (rad/s); NaN for what a flight does not show",
        "left_out",
        "4",
        units="SI",
        gaps=True,
    )


@record
class ExtendedRecord(Record):
    """The artifact `cpfls/extended`."""

    FORMAT: ClassVar = Format(
        "cpfls/extended",
        "a model with the effects that it missed in it, refitted together",
        "extend, gap",
        ("diagnosis", "model"),
    )

    inertia: Array = dataset(
        "inertia", "Ixx Iyy Izz Ixy Ixz Iyz: of the rigid body, or what the model gets", "6", units="kg m^2", frame=BODY
    )
    thrust_scale: float = dataset("thrust_scale", "thrust over that of the vehicle in /config")
    effects: NamedEffectsGroup = group("")
    gap: GapChangeGroup = group("gap")
    playback: PlaybackChangeGroup | None = group("playback", default=None)
    audit: AuditGroup = group("")
    base: BaseGroup = group("base")
    vehicle: VehicleGroup | None = group("vehicle", default=None)
    left_out: LeftOutGroup | None = group("left_out", default=None)

    @classmethod
    def of(cls, refit: Refit, vehicle: VehicleSettings, playback: PlaybackChangeGroup, base: BaseGroup) -> Self:
        """Arrange a refit.

        Parameters
        ----------
        vehicle : VehicleSettings
            As stated.
        playback : PlaybackChangeGroup
            Of held-out flights.
        base : BaseGroup
            The identified model that is extended, or the vehicle.
        """
        model, unseen, moments = refit.model, refit.unseen, vehicle.inertia_kg_m2
        assert model.audit is not None, "a refit repairs what the audit found"
        rigid_body = six_parameters(moments) if model.base is None else np.zeros(6)
        correction = np.array([*model.parameters[:3] * np.array(moments[:3]), 0.0, 0.0, 0.0])
        numbers = {number.name: number for number in refit.estimates.parameters}
        return cls(
            inertia=rigid_body + correction,
            thrust_scale=1.0 + numbers["thrust_scale"].value if "thrust_scale" in numbers else 1.0,
            effects=NamedEffectsGroup.of(refit.effects, True, numbers, model.parameters),
            gap=GapChangeGroup.of(unseen.size(unseen.before), unseen.size(unseen.after), unseen.floor),
            playback=playback,
            audit=AuditGroup.of(model.audit),
            base=base,
            vehicle=_vehicle(model, vehicle, base),
        )

    def sized(self, model: ExtendedModel, held: Sequence[Recording]) -> Self:
        """Measure along held-out flights what `vehicle` does not hold."""
        from cpfls_cli.gap.playback import left_out

        assert self.vehicle is not None, "just made"
        names = [name for name in self.vehicle.not_held if name in self.effects.names()]
        return replace(self, left_out=columns_of(LeftOutGroup, left_out(model, names, held))) if names else self

    def rebuilt(self, path: object) -> ExtendedModel:
        """Rebuild the model with its effects.

        Parameters
        ----------
        path : Path
            For messages.
        """
        return self.effects.model(self.base.rebuilt(path), self.audit)

    @property
    def summary(self) -> dict[str, Any]:
        """The refit for machines."""
        return {
            "effects": [effect_summary(effect) for effect in self.effects.named],
            "gap_before": self.gap.summary_before,
            "gap_after": self.gap.summary_after,
        }


def _vehicle(model: ExtendedModel, vehicle: VehicleSettings, base: BaseGroup) -> VehicleGroup:
    """Arrange the whole vehicle, as far as it is a table of polynomials."""
    from cpfls_cli.gap.whole_vehicle import whole_vehicle

    known = base.constant_inertia(vehicle)
    whole = whole_vehicle(model, vehicle, symmetric(vehicle.inertia_kg_m2 if known is None else known))
    return VehicleGroup.of(whole.model, (*whole.not_held, *([FUZZY_INERTIA] if known is None else [])))
