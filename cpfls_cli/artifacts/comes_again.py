"""What of a gap comes again where flights repeat their path, as a group of datasets with the facts that follow."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray, runs
from cpfls_cli.artifacts.spec import BODY, dataset, group_of, record
from cpfls_cli.blocks import half_width
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.settings import COUNTS

if TYPE_CHECKING:
    from cpfls_cli.gap.residual.repeated import ComesAgain

_SURE = 1 - 0.05 / 36
"""Confidence from which on something comes again: 36 numbers are looked at, and chance shall pass none in 95 %."""
OPEN = 0.5
"""Share of a gap up to which it has to be known that no more comes again, to say that it does not."""
_TOLD = 0.2
"""Standard error of an explained share above which it says nothing: hardly any motion comes again there."""


class Part(NamedTuple):
    """Neighbouring bands in which something comes again.

    Attributes
    ----------
    bands : slice
    low, high : float, Hz
    """

    bands: slice
    low: float
    high: float


@record
class ComesAgainGroup:
    """What of a gap comes again, and what does not."""

    low: Array = dataset("lower end of each band, about; the first band is all of them", "band", units="Hz")
    high: Array = dataset("upper end of each band, about", "band", units="Hz")
    total: Array = dataset(
        "mean square of the gap in a band, (N m)^2 and N^2", "channel", "band", units="SI", frame=BODY, gaps=True
    )
    again: Array = dataset(
        "what of it comes again: mean product with the gap of another run at the same place of the path",
        "channel",
        "band",
        units="SI",
        frame=BODY,
        gaps=True,
    )
    noise: Array = dataset(
        "what white noise of the sensors leaves of the gap; NaN where signals were filtered",
        "channel",
        "band",
        units="SI",
        frame=BODY,
        gaps=True,
    )
    taken: Array = dataset(
        "what comes again of the torque or force that the motion takes, as a mean product",
        "channel",
        "band",
        units="SI",
        frame=BODY,
        gaps=True,
    )
    share_error: Array = dataset("standard error of again over total", "channel", "band", frame=BODY, gaps=True)
    explained_error: Array = dataset(
        "standard error of 1 less again over taken, the share of the motion that comes again and the model explains",
        "channel",
        "band",
        frame=BODY,
        gaps=True,
    )
    resists: Array = dataset("moments of inertia, kg m^2, and mass, kg", "channel", units="SI", frame=BODY)
    flights: tuple[str, ...] = dataset("flights that repeat each other", "repeating", path="flight")
    runs: int = dataset("runs that are compared with others")
    paths: int = dataset("different paths among them")
    blocks: IntArray = dataset("blocks of the paths that tell the errors", "band")

    @classmethod
    def of(cls, found: ComesAgain | None) -> Self | None:
        """Arrange what comes again; None where no flight repeats another."""
        return None if found is None else group_of(cls, found)

    @property
    def share(self) -> Array:
        """Share of the gap that comes again, shape (channel, band)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.again / self.total)

    @property
    def share_half(self) -> Array:
        """Half of its 95 % interval, shape (channel, band)."""
        return half_width(self.share_error, self.blocks)

    @property
    def explained(self) -> Array:
        """Share of the motion that comes again and is explained, shape (channel, band); NaN where hardly any does."""
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 1 - self.again / self.taken
        return np.where((self.taken > 0) & (self.explained_error < _TOLD), share, np.nan)

    @property
    def sure(self) -> BoolArray:
        """Where more comes again than chance lets and than hardly counts, shape (channel, band)."""
        return np.asarray(self.share > np.maximum(half_width(self.share_error, self.blocks, _SURE), COUNTS))

    @property
    def known(self) -> list[int]:
        """Indices of the channels that are known."""
        return np.flatnonzero(np.isfinite(self.total[:, 0])).tolist()

    @property
    def channels(self) -> list[int]:
        """Indices of the channels of which something comes again."""
        return np.flatnonzero(self.sure.any(axis=1)).tolist()

    def parts(self, channel: int) -> list[Part]:
        """List neighbouring bands in which a gap comes again; all of them where it shows in none alone."""
        sure = self.sure[channel]
        bands = [slice(first + 1, after + 1) for first, after in runs(sure[1:])]
        found = [Part(own, float(self.low[own.stop - 1]), float(self.high[own.start])) for own in bands]
        return found or ([Part(slice(0, 1), float(self.low[0]), float(self.high[0]))] if sure[0] else [])

    def share_in(self, channel: int, part: Part) -> float:
        """Compute the share of a gap that comes again in some bands together."""
        return float(np.nansum(self.again[channel, part.bands]) / np.nansum(self.total[channel, part.bands]))

    def at_most(self, channel: int) -> float:
        """Bound the share of all of a gap that may come again, by 95 %; products that cancel are taken for none."""
        bound = np.maximum(self.share[channel, 0], 0.0) + self.share_half[channel, 0]
        return float(np.clip(np.nan_to_num(bound), 0.0, 1.0))

    @property
    def nothing(self) -> bool:
        """Whether it is known that nothing of a gap comes again but a part that does not matter."""
        return not self.channels and self.most <= OPEN

    @property
    def most(self) -> float:
        """Largest share of the gap of a channel that may come again."""
        return max((self.at_most(channel) for channel in self.known), default=0.0)

    @property
    def does_not(self) -> Array:
        """Root mean square of what is neither again nor noise of the sensors, rad/s^2 and m/s^2, shape (channel,)."""
        noise = np.nan_to_num(self.noise[:, 0])
        rest = self.total[:, 0] - np.clip(self.again[:, 0], 0.0, None) - noise
        return np.asarray(np.sqrt(np.clip(rest, 0.0, None)) / self.resists)

    @property
    def summary(self) -> dict[str, Any]:
        """What comes again, for machines: by channel a list over the bands."""
        values = {
            "gap": np.sqrt(self.total),
            "share": self.share,
            "share_half_width": self.share_half,
            "comes_again": self.sure,
            "noise": np.sqrt(self.noise),
            "explained": self.explained,
        }
        return {
            "flights": list(self.flights),
            "nothing": self.nothing,
            "runs": self.runs,
            "paths": self.paths,
            "bands_hz": np.column_stack([self.low, self.high]).tolist(),
            "channels": {
                name: {key: each[index].tolist() for key, each in values.items()} | {"does_not": self.does_not[index]}
                for index, name in enumerate(CHANNELS)
                if index in self.known
            },
        }
