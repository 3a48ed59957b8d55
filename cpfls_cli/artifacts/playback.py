"""Playback in the records of vehicles and of the gap workflow, which are not results yet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.spec import dataset, group, record
from cpfls_cli.playback.errors import MOTION, ByHorizon, Errors, Prediction, Region
from cpfls_cli.result import plain

if TYPE_CHECKING:
    from cpfls_cli.playback.replay import Played, Replay


@record
class SignalErrorGroup:
    """Errors of one signal by prediction and horizon."""

    mae: Array = dataset(
        "mean norm of the error; of attitudes the geodesic distance", "prediction", "horizon", units="SI"
    )
    rms: Array = dataset("root mean square error by axis", "prediction", "horizon", "axis", units="SI")
    chance: Array | None = dataset(
        "half of the 95 % interval of the difference of its mean norm from that of the model, over blocks of windows",
        "prediction",
        "horizon",
        units="SI",
        least=0.0,
        default=None,
    )

    def row(self, index: int) -> Errors:
        """Give the errors of one prediction."""
        chance = None if self.chance is None else self.chance[index]
        return Errors(mae=self.mae[index], rms_by_axis=self.rms[index], chance=chance)


@record
class RegionGroup:
    """Where a model predicts body rates better than what knows no model."""

    share: float = dataset("of the windows")
    rate: Array = dataset("body rate at the start of nine tenths of these windows: least, most", "2", units="rad/s")
    speed: Array | None = dataset("the same of the speed of the flight", "2", units="m/s", default=None)


@record
class PlaybackGroup:
    """A model played back along flights, and what it has to beat."""

    flown: tuple[str, ...] = dataset("file names", "playback_flight", path="flight")
    windows: int = dataset("samples from which it was played back")
    prediction: tuple[str, ...] = dataset(
        "as in cpfls/replay; with-past: the same model with /history; before, after: as given and with the effects",
        "prediction",
    )
    horizon_s: Array = dataset("horizons", "horizon", units="s")
    diverged: IntArray = dataset("windows in which a prediction ran away and was stopped", "prediction")
    body_rate: SignalErrorGroup = group()
    attitude: SignalErrorGroup | None = group(default=None)
    velocity: SignalErrorGroup | None = group(default=None)
    position: SignalErrorGroup | None = group(default=None)

    @classmethod
    def of(cls, flights: Sequence[Played], replay: Replay, names: Mapping[str, str], **more: Any) -> Self:
        """Arrange a replay without its windows: what it calls its predictions; others are left out."""
        kept = [replay.models[name] for name in names]
        groups: dict[str, Any] = {}
        for signal in kept[0].signals:
            own = [each.signals[signal] for each in kept]
            chances = [each.chance for each in own if each.chance is not None]
            groups[signal] = SignalErrorGroup(
                mae=np.array([each.mae for each in own]),
                rms=np.array([each.rms_by_axis for each in own]),
                chance=np.array(chances) if chances else None,
            )
        return cls(
            flown=tuple(played.flight.name for played in flights),
            windows=len(replay.windows.start),
            prediction=tuple(names.values()),
            horizon_s=replay.horizon_s,
            diverged=np.array([each.diverged for each in kept]),
            **groups,
            **more,
        )

    @property
    def by_horizon(self) -> ByHorizon:
        """The errors as a result."""
        groups = {signal: getattr(self, signal) for signal in MOTION}
        return ByHorizon(
            horizon_s=self.horizon_s,
            models={
                name: Prediction(
                    diverged=int(self.diverged[row]),
                    **{signal: own.row(row) for signal, own in groups.items() if own is not None},
                )
                for row, name in enumerate(self.prediction)
            },
        )

    @property
    def summary(self) -> dict[str, Any]:
        """The replay for machines: mean errors by prediction and signal."""
        return {
            "flights": list(self.flown),
            "windows": self.windows,
            "horizon_s": self.horizon_s.tolist(),
            "models": {
                name: {signal: own.mae.tolist() for signal, own in each.signals.items()}
                for name, each in self.by_horizon.models.items()
            },
        }


def by_horizon(held: PlaybackGroup | None) -> ByHorizon | None:
    """Give the errors of a playback as a result; None where there is none."""
    return None if held is None else held.by_horizon


@record
class HeldOutGroup(PlaybackGroup):
    """A model played back along flights that it was not found in, and what it has to beat."""

    better: RegionGroup | None = group(default=None)

    @classmethod
    def judged(cls, flights: Sequence[Played], replay: Replay) -> Self:
        """Arrange a replay without its windows, and where the model is better than what knows no model."""
        found = replay.along(flights).better
        region = None if found is None else RegionGroup(share=found.share, rate=found.rate_rad_s, speed=found.speed_m_s)
        return cls.of(flights, replay, {name: name for name in replay.models}, better=region)

    @property
    def region(self) -> Region | None:
        """Where the model is better, as a result."""
        own = self.better
        return None if own is None else Region(share=own.share, rate_rad_s=own.rate, speed_m_s=own.speed)

    @property
    def summary(self) -> dict[str, Any]:
        """The replay for machines."""
        return {**super().summary, "models": plain(self.by_horizon.models), "better": plain(self.region)}
