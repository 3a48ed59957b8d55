"""The artifact of an extended model: the effects that it missed in it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.audit import AuditGroup
from cpfls_cli.artifacts.gap_effects import GapChangeGroup, NamedEffectsGroup, PlaybackChangeGroup, effect_summary
from cpfls_cli.artifacts.model import ModelRecord, VehicleGroup
from cpfls_cli.artifacts.playback import by_horizon
from cpfls_cli.artifacts.spec import BODY, Format, columns_of, dataset, group, record
from cpfls_cli.inertia import more_than_others, six_parameters
from cpfls_cli.validation.trust import capped, trust_by_playback

if TYPE_CHECKING:
    from cpfls_cli.gap.before_after import LeftOut
    from cpfls_cli.gap.extended import Refit
    from cpfls_cli.playback.model import VehicleModel
    from cpfls_cli.vehicle.settings import VehicleSettings


@record
class LeftOutGroup:
    """Effects that no vehicle for other programs holds, and what they do along the held-out flights."""

    name: tuple[str, ...] = dataset("identifier, see `cpfls effects`", "left_out")
    wrench: Array = dataset(
        "root mean square of torque (x y z, N m) and force (x y z, N)", "left_out", "6", units="SI", frame=BODY
    )
    ends: Array = dataset(
        "how far off a free run of gap.horizon_s ends without it: position (m), velocity (m/s), attitude (rad), body "
        "rate (rad/s); NaN for what a flight does not show",
        "left_out",
        "4",
        units="SI",
        gaps=True,
    )


@record
class ExtendedVehicleGroup(VehicleGroup):
    """A vehicle with what was found of the sensors, which a refit repairs first."""

    repair: AuditGroup = group()


@record
class ExtendedRecord(ModelRecord):
    """The artifact `cpfls/model` of a model with the effects that it missed in it."""

    FORMAT: ClassVar = Format(
        "cpfls/model",
        "a model with the effects that it missed in it, refitted together",
        "extend, gap",
        ("flight", "diagnosis", "model"),
        kind="extended",
    )
    MADE_BY: ClassVar = "extend"

    vehicle: ExtendedVehicleGroup = group()
    inertia: Array = dataset(
        "Ixx Iyy Izz Ixy Ixz Iyz: of the rigid body, or what the model gets", "6", units="kg m^2", frame=BODY
    )
    thrust_scale: float = dataset("thrust over that of the vehicle in /config")
    effects: NamedEffectsGroup = group("")
    gap: GapChangeGroup = group()
    playback: PlaybackChangeGroup | None = group(default=None)
    left_out: LeftOutGroup | None = group(default=None)

    @classmethod
    def of(
        cls,
        refit: Refit,
        stated: VehicleSettings,
        model: VehicleModel,
        playback: PlaybackChangeGroup,
        left_out: Sequence[LeftOut],
    ) -> Self:
        """Arrange a refit; `stated` is the vehicle that the effects were fitted with."""
        fitted, unseen, moments = refit.model, refit.unseen, stated.inertia_kg_m2
        rigid_body = six_parameters(moments) if fitted.base is None else np.zeros(6)
        correction = np.array([*fitted.parameters[:3] * np.array(moments[:3]), 0.0, 0.0, 0.0])
        numbers = {number.name: number for number in refit.estimates.parameters}
        return cls(
            vehicle=ExtendedVehicleGroup.of(model),
            inertia=rigid_body + correction,
            thrust_scale=1.0 + numbers["thrust_scale"].value if "thrust_scale" in numbers else 1.0,
            effects=NamedEffectsGroup.of(refit.effects, True, numbers, fitted.parameters),
            gap=GapChangeGroup.of(unseen.size(unseen.before), unseen.size(unseen.after), unseen.floor),
            playback=playback,
            left_out=columns_of(LeftOutGroup, left_out) if left_out else None,
        )

    @property
    def audit(self) -> AuditGroup:
        """Faults of the sensors that it repairs."""
        return self.vehicle.repair

    @property
    def trust(self) -> str:
        """What playback on flights held out says of it, as far as they do not contradict themselves."""
        return capped(trust_by_playback(by_horizon(self.playback)), self.audit.contradiction or ())

    @property
    def impossible(self) -> tuple[str, ...]:
        """Moments of inertia that are more than the other two together; others are as stated, or as they were found."""
        return tuple(f"inertia.{name}" for name in more_than_others(self.vehicle.inertia.tolist()))

    @property
    def summary(self) -> dict[str, Any]:
        """The refit for machines."""
        return {
            "effects": [effect_summary(effect) for effect in self.effects.named],
            "gap_before": self.gap.summary_before,
            "gap_after": self.gap.summary_after,
            **self.provenance,
        }
