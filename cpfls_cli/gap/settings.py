"""Settings of the section `gap`: how flights and simulation are compared, and how an effect is named."""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Lt, MinLen
from typing_extensions import Doc

from cpfls_cli.blocks import BLOCK_S
from cpfls_cli.errors import SettingError
from cpfls_cli.settings import Settings

# Root mean square in floors above which a gap is there.  Without a gap half of the channels exceed 1 floor, and floors
# of coloured noise are off by a third.
CLEAR = 1.5
NOISE = 1.25
"""Mean square in squared floors up to which a residual counts as noise: what an estimate of the floor is off by."""

OFF = 0.1
"""Share of its torque and force that a formula may be off by: laws of drag, lift and rotors are known to a tenth."""

# Root mean square in floors of one channel from which on an effect shows.  With noise it makes the channel 4 % larger;
# less than that floors are off by.
VISIBLE = 0.3
ERRORS = 2.0  # Standard errors by which a difference is sure, 95 % two-sided.
COUNTS = 0.05
"""Share of a gap, in squares, from which on a part of it counts: an effect, a channel, what follows a signal."""

# Probability of chance from which on something makes an answer more careful: an unnamed effect, a form of lag.
CHANCE = 0.05
RARE = 0.01
"""The rate of errors that names are given at, gusts among them: of chance, of an effect that is 0 by
instruments, and of a rival against the chosen set."""


@dataclass(frozen=True, kw_only=True)
class GapSettings(Settings):
    """Settings of `cpfls compare`, `diagnose`, `extend` and `gap`."""

    window_s: Annotated[
        float,
        Gt(0),
        Doc("length of the smooth windows over which torques are compared, s; at least eight updates of the rotors"),
    ] = 0.4
    overlap: Annotated[float, Ge(0), Lt(1), Doc("share that neighbouring windows have in common")] = 0.5
    block_s: Annotated[float, Gt(0), Doc("length of the blocks that cross-validation leaves out, s")] = BLOCK_S
    shifts: Annotated[int, Ge(39), Doc("circular time shifts that say what chance alone explains")] = 199
    significance: Annotated[
        float, Gt(0), Lt(0.5), Doc("largest probability that an accepted effect is chance, over the whole catalogue")
    ] = RARE
    effects_max: Annotated[int, Ge(1), Le(10), Doc("largest number of effects in one diagnosis")] = 6
    named_share: Annotated[
        float, Gt(0.5), Le(1), Doc("share of the gap above the noise floor from which on effects count as the answer")
    ] = 0.9
    partial_share: Annotated[
        float, Gt(0), Lt(1), Doc("share from which on effects are called the closest, not all")
    ] = 0.5
    ground_height_m: Annotated[float, Doc("height of the ground in the world frame of the flights, m")] = 0.0
    ignore: Annotated[tuple[str, ...], Doc("effects that are not considered")] = ()
    force: Annotated[bool, Doc("use the force balance too, where a flight has velocity or acceleration")] = True
    axes: Annotated[
        tuple[Literal["x", "y", "z"], ...],
        MinLen(1),
        Doc("body axes whose torque is compared; the others are left out"),
    ] = ("x", "y", "z")
    horizon_s: Annotated[float, Gt(0), Doc("how far free runs go, s")] = 0.5

    def __post_init__(self) -> None:
        """Check the shares against each other.

        Raises SettingError.
        """
        if self.partial_share >= self.named_share:
            raise SettingError("partial_share", "must be below named_share")
