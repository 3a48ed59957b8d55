"""How far off predictions of motion are by horizon: of a model, and of what it has to beat."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.result import about, part, result
from cpfls_cli.rounding import less

MODEL, NOTHING_MOVES, RATE_STAYS, STATED = "model", "nothing-moves", "rate-stays", "stated"
PREDICTIONS = (MODEL, NOTHING_MOVES, RATE_STAYS, STATED)
"""The model; the whole state stays; rates and velocity stay; the rigid body and the rotors that the config states."""

RATE_FADES = "rate-fades"
"""Where flights train: rates fade with one time constant of theirs, velocity stays. A body that forgets its turning."""

WITHOUT_MODEL = (NOTHING_MOVES, RATE_STAYS, RATE_FADES)
"""What knows no model, and is what a model has to beat."""

WITH_PAST = "with-past"
"""A model that uses the flight before each start, next to the same one that does not."""

BEFORE, AFTER = "before", "after"
"""A model as given and with the effects that were found, where these are what is compared."""

FADING = "time constant with which the body rates of the training flights fade"
"""Of the prediction "rate fades"."""

MOTION = ("body_rate", "attitude", "velocity", "position")
"""Signals that errors are of, those that matter most first."""

CONTROL_HORIZON = 0.1
"""Horizon in s to which a controller of the attitude relies on its model."""

CONTROL_BAND = (0.04, 0.25)
"""Horizons in s at which a controller of the attitude corrects what its model got wrong."""

_VISIBLY = 0.95
"""Ratio of errors that is visible: on real flights decay by axis, in place of one time constant, saves up to 3 %."""


@result
class Errors:
    """Errors of one signal of one prediction by horizon."""

    SHOWN: ClassVar = ("rms", "sum")

    mae: Array = about("mean norm of the error; of attitudes the geodesic distance", "horizon", unit="SI")
    rms_by_axis: Array = about("root mean square error by axis", "horizon", "axis", unit="SI")
    chance: Array | None = about(
        "half of the 95 % interval of the difference of its mean norm from that of the model, over blocks of windows",
        "horizon",
        unit="SI",
        least=0.0,
        brief=False,
        default=None,
    )

    @property
    def rms(self) -> Array:
        """Root mean square error, shape (horizon,), SI."""
        return np.asarray(np.sqrt((self.rms_by_axis**2).sum(axis=1)))

    @property
    def sum(self) -> float:
        """Sum of the mean norms over the horizon."""
        return float(self.mae.sum())

    @property
    def by_chance(self) -> Array:
        """How far it is from the model by chance, shape (horizon,); 0 where there are too few windows."""
        return np.zeros(len(self.mae)) if self.chance is None else self.chance


@result
class Prediction:
    """Errors of one prediction; None of signals that no flight knows."""

    body_rate: Errors = part()
    attitude: Errors | None = part(default=None)
    velocity: Errors | None = part(default=None)
    position: Errors | None = part(default=None)
    diverged: int = about("windows in which it ran away and was stopped")

    @property
    def signals(self) -> dict[str, Errors]:
        """Errors of the signals that are known."""
        named = ((signal, getattr(self, signal)) for signal in MOTION)
        return {signal: own for signal, own in named if own is not None}


@result
class ByHorizon:
    """Errors of a model and of what it has to beat, by horizon.

    Predictions are model; nothing-moves: the whole state stays; rate-stays: rates and velocity; rate-fades: rates fade,
    velocity stays; stated: the vehicle of the config; with-past: the model with the flight before each start; before,
    after: a model as given and with the effects that were found.
    """

    horizon_s: Array = about("horizons", "horizon", unit="s")
    models: dict[str, Prediction] = part()

    @property
    def judged(self) -> str:
        """Name of what is judged: a model, or the one with effects."""
        return next(name for name in (MODEL, AFTER) if name in self.models)

    @property
    def model(self) -> Prediction:
        """What is judged."""
        return self.models[self.judged]

    @property
    def signals(self) -> tuple[str, ...]:
        """Signals whose errors are known."""
        return tuple(self.model.signals)

    @property
    def rivals(self) -> list[str]:
        """What knows no model, which a model has to beat."""
        return [name for name in WITHOUT_MODEL if name in self.models]

    def of(self, name: str, signal: str) -> Errors:
        """Give the errors of a signal that is known."""
        return self.models[name].signals[signal]

    def rival(self, signal: str) -> str:
        """Find what is best, over all horizons, of what knows no model; of ties the first."""
        best, *others = self.rivals
        for name in others:
            best = name if less(self.of(name, signal).sum, self.of(best, signal).sum) else best
        return best

    def moves(self, signal: str) -> bool:
        """Tell whether flights know a signal and it moves."""
        return signal in self.signals and self.of(self.rival(signal), signal).sum > 0

    def wins(self, signal: str) -> bool:
        """Tell whether the model is better, over all horizons, than what it has to beat."""
        return bool(less(self.of(self.judged, signal).sum, self.of(self.rival(signal), signal).sum))

    def better_to(self, signal: str) -> float:
        """Find the longest horizon, s, up to which the errors of the model add up to less than those of all its rivals.

        Sums are compared, because over the first samples noise of the start decides, and there nothing beats a state
        that stays. 0 where there is none, NaN for a signal that no flight knows.
        """
        if signal not in self.signals:
            return float("nan")
        rivals = [np.cumsum(self.of(name, signal).mae) for name in self.rivals]
        better = np.flatnonzero(less(np.cumsum(self.of(self.judged, signal).mae), np.min(rivals, axis=0)))
        return float(self.horizon_s[better[-1]]) if len(better) else 0.0

    def lost_to(self) -> dict[str, tuple[str, float, float]]:
        """Find where a model loses in rates or attitude to what knows no model at horizons where control lives.

        A loss is one beyond chance, as far as chance is known.

        Returns
        -------
        dict of str to (str, float, float)
            By signal: the rival that it loses to first, and from which horizon to which, s.
        """
        lost: dict[str, tuple[str, float, float]] = {}
        for signal in [name for name in self.signals if name in MOTION[:2]]:
            own, rivals = self.of(self.judged, signal), {name: self.of(name, signal) for name in self.rivals}
            behind = {name: self._inside & less(each.mae + each.by_chance, own.mae) for name, each in rivals.items()}
            where = np.flatnonzero(np.any(list(behind.values()), axis=0))
            if len(where):
                first, last = where[[0, -1]]
                rival = min((name for name in rivals if behind[name][first]), key=lambda name: rivals[name].mae[first])
                lost[signal] = (rival, float(self.horizon_s[first]), float(self.horizon_s[last]))
        return lost

    @property
    def _inside(self) -> BoolArray:
        """Horizons where control lives; all of a playback that ends before."""
        horizon, (low, high) = self.horizon_s, CONTROL_BAND
        # A rounding error is no horizon apart.
        return ~less(horizon, low) & ~less(high, horizon) if not less(horizon[-1], low) else np.ones(len(horizon), bool)

    def like_fading(self) -> float | None:
        """Find where a model has to beat "rate fades", s; None where it does, visibly and by more than chance.

        That is the end of where control lives: what knows nothing of the torque has forgotten most there. None too
        where it is not known how rates fade.
        """
        if RATE_FADES not in self.models:
            return None
        fades, last = self.of(RATE_FADES, "body_rate"), int(np.flatnonzero(self._inside)[-1])
        most = np.minimum(fades.mae - fades.by_chance, _VISIBLY * fades.mae)
        better = less(self.model.body_rate.mae, most)[last]
        return None if better else float(self.horizon_s[last])

    def behind_both(self) -> tuple[str, ...]:
        """List what of velocity and position is predicted worse, over all horizons, than by all that know no model."""
        worst = {name: max(self.of(rival, name).sum for rival in self.rivals) for name in self.signals}
        return tuple(name for name in worst if name in MOTION[2:] and less(worst[name], self.of(self.judged, name).sum))


@result
class Region:
    """Where a model predicts body rates better than what knows no model."""

    share: float = about("of the windows")
    rate_rad_s: Array = about("body rate at the start of nine tenths of these windows: least, most", "2", unit="rad/s")
    speed_m_s: Array | None = about("the same of the speed of the flight", "2", unit="m/s", default=None)


@result
class AlongFlights(ByHorizon):
    """A model played back along flights, and what it has to beat, without the single windows."""

    flights: tuple[str, ...] = about("file names", "flight")
    windows: int = about("samples from which it was played back")
    fading_s: float | None = about(FADING, unit="s", default=None)
    better: Region | None = part(default=None)
