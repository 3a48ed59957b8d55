"""What of a gap is repeatable in gusts, against the same paths in still air, and how often gusts alone seem to be.

A vehicle of 45 g on two paths a draw, each flown four times for 40 s: with a drag and a damping that the model does not
know, in gusts and in still air, and with neither, in gusts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.shared.measure import program, table
from cpfls_cli.blocks import half_width
from cpfls_cli.gap.balance.weak_flight import weak_flight
from cpfls_cli.gap.extended import plain
from cpfls_cli.gap.residual.repeated import Repeatability, RepeatedRuns
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.weak_form.windows import common_windows
from tests.builders.gusty_flights import CALM, GUSTS, SMALL, Flight, gusty_flights, logged

RUNS = 4
CHANNELS = ("roll", "pitch", "yaw", "x", "y", "z")
MODELLED = [0, 1, 2, 5]
"""Channels of which the model explains anything: forces along x and y it has none."""
SETS = {
    "gusts": (SMALL._replace(drag=0.1, damping=6e-5), GUSTS),
    "calm": (SMALL._replace(drag=0.1, damping=6e-5), CALM),
    "gusts alone": (SMALL._replace(drag=0.0, damping=0.0), GUSTS),
}


def main(draws: int = 6) -> None:
    each = [
        (truth, gusts, 2 * draw + path) for draw in range(draws) for truth, gusts in SETS.values() for path in (0, 1)
    ]
    flown = gusty_flights([Flight(*one, run) for one in each for run in range(RUNS)], seconds=40.0)
    found = [{name: split([next(flown) for _ in range(2 * RUNS)]) for name in SETS} for _ in range(draws)]
    gusty, calm, alone = ([one[name] for one in found] for name in SETS)
    shares, inside, passed = [], [], []
    for there, truth in zip(gusty, calm, strict=True):
        expected = truth.repeatable / (truth.repeatable + there.total - there.repeatable)
        inside.append(np.abs(there.share - expected) < there.share_half)
        off = np.abs(there.explained - truth.explained) < half_width(there.explained_error, there.blocks)
        passed.append(off[MODELLED])
        shares.append([there.share, expected, there.explained, truth.explained])
    measured = np.array(shares).transpose(1, 2, 3, 0)
    rows = []
    for channel, name in enumerate(CHANNELS):
        for band, (low, high) in enumerate(zip(gusty[0].low, gusty[0].high, strict=True)):
            spans = [_span(values[channel, band]) for values in measured]
            rows.append([name, f"{low:g} to {high:g}", *spans, f"{np.mean([i[channel, band] for i in inside]):.2f}"])
    table("repeated_gaps", "axis | Hz | repeatable | truth of it | explained | in still air | inside", rows)
    known = np.isfinite(measured[2] + measured[3])[MODELLED]
    print(f"\nshares within their intervals: {np.mean(inside):.3f} of {np.size(inside)}")
    print(f"explained within theirs: {np.sum(passed) / known.sum():.3f} of {known.sum()}")
    sure = np.array([one.sure for one in alone])
    print(f"gusts alone: {sure.sum()} of {sure.size} are called repeatable")
    rest = np.array([one.non_repeatable for one in alone])
    print("the rest, rad/s^2 and m/s^2:", *(_span(rest[:, c]) for c in range(6)))


def split(flown: Sequence[PlaybackFlight]) -> Repeatability:
    """Split what a model without drag and damping leaves of flights."""
    recordings = [logged(flight, SMALL.vehicle).parts[0] for flight in flown]
    windows, model = common_windows(recordings, GapSettings()), plain(None)
    flights = [weak_flight(each, windows, None, force=True) for each in recordings]
    repeated = RepeatedRuns.of(recordings)
    again = None if repeated is None else repeated.split(model.system(flights), model.linear)
    assert again is not None, "each path is flown again"
    return again


def _span(values: np.ndarray) -> str:
    known = values[np.isfinite(values)]
    return f"{known.min():.2f} to {known.max():.2f}" if len(known) else "—"


if __name__ == "__main__":
    program(main)
