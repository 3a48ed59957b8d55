"""Gains from one log, judged on simulated flights whose vehicle is known: margins as predicted, and as flown.

Flights of `look_study.py` under the laws of four autopilots, logged at their ordinary rates: from each log come the
vehicle and gains. The gains that are proposed fly the true vehicle in gusts and noise, with sines added to the command
by which the loop is measured. Printed: how often the flown margins are within 5 degrees and 1.5 dB of the predicted
ones, how often inside the predicted interval, and how often the flown gains have the margin that was asked for.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.look_study import GUST_S, GUST_SIZE, GUSTS, GYRO_NOISE, Case, Lanes, flights
from benchmarks.shared.measure import program, table
from cpfls_cli.autopilots.law import AXES, Law
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.look.effectiveness import effectiveness
from cpfls_cli.look.gains import TunedGains, tuned_gains
from cpfls_cli.tuning.margins import axis_loops, crossing_margins, frequencies, moved_by
from cpfls_cli.tuning.plant import AxisPlant

PERIODS, PERIOD_S, SIZE = 12, 2.0, 0.03
PHASE_DEG, GAIN_DB = 5.0, 1.5


def new_law(case: Case, gains: TunedGains) -> Law:
    """Make the law of a flight with the gains that are proposed."""
    values = case.parameters | {row.parameter: row.proposed for row in gains.rows}
    return AUTOPILOTS[case.autopilot].law(values)


def true_margins(case: Case, law: Law, axis: int, attitude: bool) -> tuple[float, float]:
    """Compute gain and phase margin, cut at the command, with the true vehicle; it has no further step and hold."""
    plant = AxisPlant(
        case.gain[axis], case.gain[axis] * case.lead[axis], 0.0, 1.0, case.damping[axis], case.lag[axis],
        case.delay[axis] - 1.5 * law.period,
    )  # fmt: skip
    frequency = frequencies(law)
    loops = axis_loops(law, axis, moved_by(law, plant, frequency), frequency)
    gain, phase, _ = crossing_margins(frequency, (loops.command if attitude else loops.rate)[None])
    return float(gain[0]), float(phase[0])


def flown_margins(case: Case, law: Law, attitude: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Fly a law that is asked for level flight, and measure its loops by sines: gain and phase margin by axis."""
    period, count = law.period, round(PERIOD_S * law.rate_hz)
    bins = np.unique(np.geomspace(2, min(100, 0.4 * law.rate_hz) * PERIOD_S, 60).round().astype(int))
    turns = 2 * np.pi * np.outer(np.arange(count), bins) / count
    put = np.cos(turns + rng.uniform(0, 2 * np.pi, len(bins))).sum(axis=1)
    put *= SIZE / put.std()
    controller = Lanes(replace(law, axes=law.axes), law.axes)
    late, share = np.divmod(case.delay / period, 1.0)
    late = late.astype(int)
    line = int(late.max()) + 2
    sent, lagged, rate, angle, column = np.zeros((line, 3)), np.zeros(3), np.zeros(3), np.zeros(3), np.arange(3)
    size = GUST_SIZE * GUSTS[case.gusts]
    decay = np.exp(-period / GUST_S)
    gust, total = size * rng.standard_normal(3), np.zeros((PERIODS + 1, count, 3))
    noise = GYRO_NOISE * np.sqrt(law.rate_hz / 1000)
    for step in range((PERIODS + 1) * count):
        gyroscope = rate + noise * rng.standard_normal(3)
        asked = np.where(attitude, controller.asked_rate(-angle, gyroscope), 0.0)
        acting = controller.command(asked, gyroscope) + put[step % count]
        total[step // count, step % count] = acting
        sent[step % line] = acting
        first, second = sent[(step - late) % line, column], sent[(step - late - 1) % line, column]
        change = (first * (1 - share) + second * share - lagged) * (1 - np.exp(-period / case.lag))
        lagged = lagged + change
        gust = gust * decay + size * np.sqrt(1 - decay**2) * rng.standard_normal(3)
        torque = case.gain * (lagged + case.lead * change / period) + gust
        rate = rate + period * (torque - case.damping * rate)
        angle = angle + period * rate
    whole, added = np.fft.fft(total[1:].mean(axis=0), axis=0)[bins], np.fft.fft(put)[bins]
    loop = (added[:, None] - whole) / whole
    gain, phase, _ = crossing_margins(bins / PERIOD_S, loop.T)
    return np.array([gain, phase]).T


def judge(case: Case, gains: TunedGains, rng: np.random.Generator) -> list[tuple[object, ...]]:
    """Compare predicted margins of the axes that change with those of the true vehicle, computed and flown."""
    changed = [axis for axis in gains.axes if axis.changed and axis.after is not None]
    if not changed:
        return []
    law = new_law(case, gains)
    flown = flown_margins(case, law, np.array([axis.attitude for axis in gains.axes]), rng)
    rows = []
    for axis in changed:
        assert axis.after is not None
        own = AXES.index(axis.axis)
        said, true = axis.after, true_margins(case, law, own, axis.attitude)
        rows.append((case.autopilot, case.vehicle, axis.axis, said.gain_db, said.phase_deg, *true, *flown[own]))
    return rows


def share(values: list[bool]) -> str:
    return f"{100 * float(np.mean(values)):.0f} % of {len(values)}" if values else "-"


def main(seed: int = 1, count: int = 48) -> None:
    rng = np.random.default_rng(seed)
    rows: list[tuple[object, ...]] = []
    reasons: dict[str, int] = {}
    for case, log, _ in flights(seed, count):
        gains = tuned_gains(log, effectiveness(log))
        for axis in gains.axes:
            word = axis.reason or ("changed" if axis.changed else "kept")
            reasons[word] = reasons.get(word, 0) + 1
        rows += judge(case, gains, rng)
    print("axes:", ", ".join(f"{name} {number}" for name, number in sorted(reasons.items())))
    table_rows = []
    for name in (*AUTOPILOTS, "all"):
        own = [row for row in rows if name in (row[0], "all")]
        for label, gain, phase in (("true", 5, 6), ("flown", 7, 8)):
            near = [abs(row[phase] - row[4].value) <= PHASE_DEG for row in own]
            near_gain = [abs(min(row[gain], 40) - min(row[3].value, 40)) <= GAIN_DB for row in own]
            inside = [row[4].low <= row[phase] <= row[4].high for row in own]
            inside_gain = [min(row[3].low, 40) <= min(row[gain], 40) <= row[3].high for row in own]
            held = [row[phase] >= 44 for row in own]
            table_rows.append([name, label, *map(share, (near, near_gain, inside, inside_gain, held))])
    near = f"phase within {PHASE_DEG:g} deg | gain within {GAIN_DB:g} dB"
    columns = f"autopilot | vehicle | {near} | phase in its interval | gain in its interval | 45 deg held"
    table("gains", columns, table_rows)


if __name__ == "__main__":
    program(main)
