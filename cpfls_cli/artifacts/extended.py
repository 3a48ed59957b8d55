"""The artifact of an extended model: the effects that it missed in it."""

from __future__ import annotations

from typing import ClassVar

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.gap_groups import AuditGroup, BaseGroup, GapChangeGroup, NamedEffectsGroup, ReplayChangeGroup
from cpfls_cli.artifacts.spec import BODY, Format, Record, dataset, group, record


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
    replay: ReplayChangeGroup | None = group("replay", default=None)
    audit: AuditGroup = group("")
    base: BaseGroup = group("base")
