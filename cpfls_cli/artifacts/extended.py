"""A model with the effects that it missed in it, refitted together, and what the gap becomes with them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.learned import LearnedFlight
from cpfls_cli.artifacts.model import AnyModel
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.before_after import LeftOut, PlaybackChange
from cpfls_cli.gap.naming.causes import all_numbers
from cpfls_cli.gap.naming.results import BODY, Estimate, GapChange, GapSize, NamedEffect
from cpfls_cli.inertia import more_than_others, six_parameters
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.result import about, part, result
from cpfls_cli.validation.trust import capped, trust_by_playback

if TYPE_CHECKING:
    from cpfls_cli.gap.extended import Refit
    from cpfls_cli.vehicle.settings import VehicleSettings


@result
class Extended(AnyModel):
    """A model with the effects that it missed in it, refitted together."""

    FORMAT: ClassVar = "cpfls/extended"
    MADE_BY: ClassVar = "extend"
    SHOWN: ClassVar = ("trust", "gap_before", "gap_after", "warnings")

    model: VehicleModel = part()
    learned_from: tuple[LearnedFlight, ...] = part(default=())
    """Flights that it was found in, those of its base among them."""
    inertia: Array = about(
        "Ixx Iyy Izz Ixy Ixz Iyz: of the rigid body, or what the model gets", "6", unit="kg m^2", frame=BODY
    )
    thrust_scale: float = about("thrust over that of the vehicle in the config")
    effects: tuple[NamedEffect, ...] = part()
    vehicle_numbers: tuple[Estimate, ...] = part(brief=False)
    gap: GapChange = part(brief=False)
    playback: PlaybackChange | None = part(default=None)
    left_out: tuple[LeftOut, ...] = part(default=(), brief=False)
    """Effects that no vehicle for other programs holds."""

    @classmethod
    def of(
        cls,
        refit: Refit,
        stated: VehicleSettings,
        model: VehicleModel,
        playback: PlaybackChange,
        left_out: Sequence[LeftOut],
    ) -> Extended:
        """Put a refit together; `stated` is the vehicle that the effects were fitted with."""
        fitted, unseen, moments = refit.model, refit.unseen, stated.inertia_kg_m2
        rigid_body = six_parameters(moments) if fitted.base is None else np.zeros(6)
        correction = np.array([*fitted.parameters[:3] * np.array(moments[:3]), 0.0, 0.0, 0.0])
        scale = next((each.value for each in refit.estimates.parameters if each.name == "thrust_scale"), 0.0)
        return cls(
            model=model,
            inertia=rigid_body + correction,
            thrust_scale=1.0 + scale,
            effects=refit.effects,
            vehicle_numbers=all_numbers(refit.estimates),
            gap=GapChange.of(unseen.size(unseen.before), unseen.size(unseen.after), unseen.floor),
            playback=playback,
            left_out=tuple(left_out),
        )

    @property
    def contradictions(self) -> tuple[str, ...]:
        """Contradictions within the flights that it was found in."""
        return () if self.model.repairs is None else self.model.repairs.contradictions

    @property
    def trust(self) -> str:
        """What playback on flights held out says of it, as far as they do not contradict themselves."""
        return capped(trust_by_playback(self.playback), self.contradictions)

    @property
    def impossible(self) -> tuple[str, ...]:
        """Moments of inertia that are more than the other two together; others are as stated, or as they were found."""
        return tuple(f"inertia.{name}" for name in more_than_others(self.inertia.tolist()))

    @property
    def gap_before(self) -> dict[str, Any]:
        """The gap of the model as given, for machines: lists over x, y, z."""
        return GapSize(self.gap.before, self.gap.before_floors).as_summary

    @property
    def gap_after(self) -> dict[str, Any]:
        """The gap with the effects, for machines: lists over x, y, z."""
        return GapSize(self.gap.after, self.gap.after_floors).as_summary

    @property
    def warnings(self) -> tuple[str, ...]:
        """Axes that the extension serves ill, although it serves the whole well."""
        gap = self.gap
        return tuple(
            f"held out, {CHANNELS[index]}: the gap grows, {gap.before_floors[index]:.3g} -> "
            f"{gap.after_floors[index]:.3g} floors, although the sum over all channels shrinks"
            for index in gap.worse_axes
        )
