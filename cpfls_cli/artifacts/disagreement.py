"""The artifact of a comparison: where a model and flights disagree."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.audit import AuditGroup
from cpfls_cli.artifacts.comes_again import ComesAgainGroup
from cpfls_cli.artifacts.gap_effects import StretchGroup, above_noise, gap_summary
from cpfls_cli.artifacts.gap_flights import FlightsGroup, NotExcitedGroup
from cpfls_cli.artifacts.learned import MODEL_FLIGHT, LearnedFlight, LearnedGroup, learned_in
from cpfls_cli.artifacts.model import VehicleGroup
from cpfls_cli.artifacts.playback import PlaybackGroup
from cpfls_cli.artifacts.rebuilt import vehicle_model
from cpfls_cli.artifacts.spec import BODY, Format, Record, columns_of, dataset, group, group_of, record, rows_of
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.playback.errors import STATED
from cpfls_cli.playback.model import VehicleModel

if TYPE_CHECKING:
    from cpfls_cli.gap.compare import Disagreement, WorstChannel
    from cpfls_cli.vehicle.settings import VehicleSettings
    from cpfls_cli.weak_form.windows import Recording

_SIGNIFICANT = 0.05
"""Probability of chance below which a gap follows a signal."""


@record
class GapGroup:
    """Gap of each channel."""

    channel: tuple[str, ...] = dataset("names of the channels: torque about, force along the body axes", "channel")
    rms: Array = dataset(
        "root mean square of the gap over windows, N m and N", "channel", units="SI", frame=BODY, gaps=True
    )
    floor: Array = dataset("noise floor of the same windows, N m and N", "channel", units="SI", frame=BODY, gaps=True)
    floors: Array = dataset("gap over floor", "channel", frame=BODY, gaps=True)
    share: Array = dataset("gap over the torque or force that moves the vehicle", "channel", frame=BODY, gaps=True)

    @classmethod
    def of(cls, disagreement: Disagreement) -> Self:
        """Arrange the gap of each channel."""
        return group_of(cls, disagreement, channel=CHANNELS, share=disagreement.rms / disagreement.activity)

    @property
    def known(self) -> list[int]:
        """Indices of the channels whose gap is known."""
        return np.flatnonzero(np.isfinite(self.floors)).tolist()

    @property
    def above_noise(self) -> BoolArray:
        """Channels with a gap above noise, shape (channel,)."""
        return above_noise(self.floors)

    @property
    def largest(self) -> int | None:
        """Index of the channel with the largest gap in floors; None where no gap is known."""
        return int(np.nanargmax(self.floors)) if self.known else None


@record
class ResidualGroup:
    """Gap of each window."""

    time: Array = dataset("middle of each window, on the clock of its flight", "window", units="s")
    flight: IntArray = dataset("index of its flight", "window", into="flight")
    value: Array = dataset(
        "what inertia and rotors leave, N m and N", "window", "channel", units="SI", frame=BODY, gaps=True
    )


@record
class StateGroup:
    """Signals averaged over the windows."""

    name: tuple[str, ...] = dataset("signals averaged over the same windows", "state")
    value: Array = dataset("their averages", "window", "state", units="SI", gaps=True)


@record
class DependenceGroup:
    """How well single signals explain the gap of a channel."""

    channel: tuple[str, ...] = dataset("channel; the best pairs of channel and signal first", "dependence")
    signal: tuple[str, ...] = dataset("signal that the gap is explained with, alone", "dependence")
    r2: Array = dataset("share of the variance explained on blocks that the fit did not see", "dependence")
    p_value: Array = dataset("probability that chance does as well with any signal", "dependence")

    @property
    def sure(self) -> BoolArray:
        """Pairs that are no chance, shape (dependence,)."""
        return np.asarray((self.p_value < _SIGNIFICANT) & (self.r2 > 0))

    def of_channel(self, channel: str) -> IntArray:
        """Give the indices of the pairs of one channel, best first."""
        return np.flatnonzero([name == channel for name in self.channel])

    def followed(self, channel: str) -> list[tuple[str, float]]:
        """List the signals that the gap of a channel surely follows, with their shares, best first."""
        sure, shares = self.sure, self.r2.tolist()
        return [(self.signal[index], shares[index]) for index in self.of_channel(channel) if sure[index]]


@record
class HeatMapGroup:
    """Mean gap over the two signals that explain it best."""

    channel: str = dataset("channel with the largest gap in floors")
    signal: tuple[str, ...] = dataset("the two signals that explain it best", "2")
    first_edge: Array = dataset("edges of the cells along the first signal", "edge", units="SI")
    second_edge: Array = dataset("edges of the cells along the second signal", "edge", units="SI")
    mean: Array = dataset(
        "mean gap in each cell, N m or N", "cell_first", "cell_second", units="SI", frame=BODY, gaps=True
    )
    count: Array = dataset("windows in each cell", "cell_first", "cell_second")

    @classmethod
    def of(cls, worst: WorstChannel) -> Self:
        """Arrange the channel with the largest gap over two signals."""
        first, second = worst.heat_map.edges
        given = {"channel": worst.channel, "signal": worst.signals, "first_edge": first, "second_edge": second}
        return group_of(cls, worst.heat_map, **given)


@record
class DisagreementRecord(Record):
    """The artifact `cpfls/disagreement`."""

    FORMAT: ClassVar = Format(
        "cpfls/disagreement",
        "where a model and flights disagree, with the flights",
        "compare, gap",
        ("flight-1", "model", "model-flight-1"),
    )

    gap: GapGroup = group()
    residual: ResidualGroup = group()
    state: StateGroup = group()
    stretch: StretchGroup = group()
    dependence: DependenceGroup = group()
    heat_map: HeatMapGroup | None = group(default=None)
    playback: PlaybackGroup | None = group(default=None)
    not_excited: NotExcitedGroup = group()
    audit: AuditGroup = group("")
    warning: tuple[str, ...] = dataset("what to know about the flights", "warning")
    base: VehicleGroup = group()
    flights: FlightsGroup = group("")
    again: ComesAgainGroup | None = group("comes_again", default=None)
    learned: LearnedGroup | None = group(default=None)

    @classmethod
    def of(
        cls, disagreement: Disagreement, recordings: Sequence[Recording], warnings: tuple[str, ...], base: VehicleModel
    ) -> Self:
        """Arrange a comparison."""
        return cls(
            gap=GapGroup.of(disagreement),
            residual=ResidualGroup(
                time=disagreement.centres, flight=disagreement.flight_index, value=disagreement.residual
            ),
            state=StateGroup(
                name=tuple(disagreement.states), value=np.column_stack(list(disagreement.states.values()))
            ),
            stretch=columns_of(StretchGroup, disagreement.stretches),
            dependence=columns_of(DependenceGroup, disagreement.dependence),
            heat_map=None if disagreement.worst is None else HeatMapGroup.of(disagreement.worst),
            playback=PlaybackGroup.of(
                disagreement.played,
                disagreement.playback,
                {name: name for name in disagreement.playback.models if name != STATED},
            ),
            not_excited=columns_of(NotExcitedGroup, disagreement.not_excited),
            audit=AuditGroup.of(disagreement.audit),
            warning=(*disagreement.audit.filtered, *warnings),
            base=VehicleGroup.of(base),
            flights=FlightsGroup.of(recordings, ["given"] * len(recordings)),
            again=ComesAgainGroup.of(disagreement.again),
        )

    @property
    def model_learned_from(self) -> tuple[LearnedFlight, ...]:
        """Flights that the model learned from, which are not those that it is compared with."""
        return learned_in(self.origin.inputs, self.learned, MODEL_FLIGHT)

    def is_base(self, stated: VehicleSettings) -> bool:
        """Tell whether it was made with the vehicle of a config and no effects, which `cpfls diagnose` starts from."""
        model, rigid = vehicle_model(self.base), VehicleGroup.of(VehicleModel(vehicle=stated))
        return model.is_rigid_body and model.vehicle == rigid.vehicle()

    @property
    def summary(self) -> dict[str, Any]:
        """The comparison for machines."""
        names = self.flights.names()
        return {
            "flights": names,
            "gap": {**gap_summary(self.gap.rms, self.gap.floors), "share": self.gap.share.tolist()},
            "comes_again": self.again and self.again.summary,
            "stretches": [
                {"flight": names[flight], "start_s": start, "end_s": end, "channel": channel, "rms_floors": floors}
                for flight, start, end, channel, floors in self.stretch.first(len(self.stretch.channel))
            ],
            "dependence": rows_of(self.dependence),
            "heat_map": self.heat_map and {"channel": self.heat_map.channel, "signals": list(self.heat_map.signal)},
            "playback": self.playback and self.playback.summary,
            "not_excited": self.not_excited.summary,
            "audit": self.audit.summary,
            "warnings": list(self.warning),
        }
