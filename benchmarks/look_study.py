"""Judge what `look` says of a vehicle's axes on simulated flights whose truth is known.

Rigid axes behind rotors with lag and delay, in torque gusts, under the control laws of four autopilots that step as
they do on board; logs at the ordinary rates of each. Seed 2 is what thresholds were chosen on, seed 4 what the table in
docs/look-study.md was judged on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import signal

from benchmarks.shared.measure import program, table
from cpfls_cli.autopilots.law import AXES, AxisLaw, Controller, Law, chain
from cpfls_cli.autopilots.parameters import Autopilot
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.look.columns import on_clock
from cpfls_cli.look.effectiveness import AxisPlant, PlantModel, effectiveness
from cpfls_cli.look.flight import LogFlight, Samples
from cpfls_cli.look.loop import AxisLoop, PlantAndLaw, loops_of
from cpfls_cli.tuning.margins import crossing_margins, disk_of, is_stable

VEHICLES = {
    # gain b of roll and pitch, of yaw, rad/s^2; lag s; damping 1/s; lead of yaw s; hover share of thrust
    "nano": (230.0, 60.0, 0.035, 1.5, 0.03, 0.5),
    "racer": (1000.0, 150.0, 0.022, 2.0, 0.12, 0.25),
    "1.5 kg": (140.0, 12.0, 0.05, 0.8, 0.15, 0.45),
}
GUSTS = {"none": 0.0, "light": 1.0, "strong": 2.0}
GUST_SIZE, GUST_S = np.array([3.4, 5.1, 2.0]), np.array([0.31, 1.18, 0.5])
"""Standard deviation, rad/s^2, and time constant about each axis; strong gusts have twice the size."""
WASH, WASH_S = 0.5, 0.05
"""Size over that of gusts, and time constant, of what a vehicle meets in its own wake."""
LOGGED_HZ = {
    "betaflight": (1000.0, 1000.0), "px4": (50.0, 250.0), "ardupilot": (400.0, 400.0), "crazyflie": (100.0, 100.0),
}  # fmt: skip
"""Of commands and of body rates."""
GYRO_NOISE = 0.02
CROSSOVER = {"betaflight": 60.0, "px4": 15.0, "ardupilot": 15.0, "crazyflie": 15.0}
STICKS = ("acro", "gentle", "hold")


@dataclass(frozen=True)
class Case:
    """A flight to simulate and its truth by axis."""

    autopilot: str
    vehicle: str
    gusts: str
    sticks: str
    law: Law
    parameters: dict[str, float]
    gain: np.ndarray
    delay: np.ndarray
    lag: np.ndarray
    damping: np.ndarray
    lead: np.ndarray
    limit: float


class Lanes(Controller):
    """The controller of an autopilot for many axes at once."""

    def __init__(self, law: Law, axes: tuple[AxisLaw, ...]) -> None:
        super().__init__(replace(law, axes=axes))
        self._integral, self._angle_integral = np.zeros(len(axes)), np.zeros(len(axes))


def tuned(values: dict[str, float], autopilot: Autopilot, axis: int, gain: float, wanted: float, late: float) -> None:
    """Set the gains of an axis to a crossover, rad/s, that its delay can bear."""
    wanted = min(wanted, 0.55 / late)
    own = autopilot.law(values).axes[axis]
    p = wanted / gain
    found = {"k": 1.0, "p": p, "i": p * wanted / 8, "d": p * min(0.25 / wanted, 0.012) if own.d else 0.0}
    found["angle"] = min(own.angle, wanted / 3.5)
    for role, value in found.items():
        groups = (AXES[axis], "tilt", "all") if axis < 2 else (AXES[axis], "all")
        each = next((each for group in groups if (each := autopilot.by_role(f"{group}.{role}")) is not None), None)
        if each is not None:
            values[each.name] = value / each.scale


def filters_delay(axis: AxisLaw) -> float:
    """Sum the delays of the filters of a gyroscope, s."""
    return sum({"first": 0.16, "second": 0.23, "notch": 0.0}[each.kind] / each.hz for each in axis.measured)


def draw_case(rng: np.random.Generator, autopilot: str, vehicle: str, gusts: str, sticks: str) -> Case:
    tilt, yaw, lag, damping, lead, hover = VEHICLES[vehicle]
    gain = np.array([tilt, tilt, yaw]) * np.exp(0.2 * rng.standard_normal(3))
    lags = np.full(3, lag * np.exp(0.2 * rng.standard_normal()))
    leads = np.array([0.0, 0.0, lead * np.exp(0.3 * rng.standard_normal())])
    delay = np.full(3, rng.uniform(0.003, 0.012) if vehicle != "1.5 kg" else rng.uniform(0.005, 0.02))
    values, speed = AUTOPILOTS[autopilot].defaults(), rng.uniform(0.6, 1.0)
    law = AUTOPILOTS[autopilot].law(values)
    for axis in range(3):
        fastest = (CROSSOVER[autopilot] if vehicle == "racer" else 25.0) * (1.0 if axis < 2 else 0.4)
        late = lags[axis] + delay[axis] + law.period + filters_delay(law.axes[axis])
        # What accelerates the rotors turns the vehicle too.
        at_once = gain[axis] * float(np.hypot(1.0, speed * fastest * leads[axis]))
        tuned(values, AUTOPILOTS[autopilot], axis, at_once, speed * fastest, late)
    return Case(
        autopilot, vehicle, gusts, sticks, AUTOPILOTS[autopilot].law(values), values, gain, delay, lags,
        damping * np.exp(0.3 * rng.standard_normal(3)), leads, min(hover, 1 - hover) * 1.2,
    )  # fmt: skip


def sticks_of(rng: np.random.Generator, kind: str, time: np.ndarray) -> np.ndarray:
    """Move three sticks: bursts and flips, gentle steps through a pilot's hand, or not at all. Shape (time, 3)."""
    out = np.zeros((len(time), 3))
    if kind == "hold":
        return out
    period = time[1] - time[0]
    for axis in range(3):
        at = 1.0
        while at < time[-1] - 1:
            length = rng.uniform(0.15, 0.5) if kind == "acro" else rng.uniform(0.4, 2.0)
            size = (
                rng.uniform(0.1, 0.5) * rng.choice([-1, 1])
                if rng.random() > 0.06 or kind != "acro"
                else rng.choice([-1.0, 1.0])
            )
            moved = (time >= at) & (time < at + length)
            out[moved, axis] += size * (0.4 if axis == 2 else 1.0)
            at += length + rng.exponential(0.7 if kind == "acro" else 1.2)
    hand = signal.butter(2, 5.0 if kind == "acro" else 2.5, fs=1 / period)
    return np.clip(signal.lfilter(*hand, out, axis=0), -1, 1)


def simulate(cases: list[Case], seconds: float, rng: np.random.Generator) -> list[dict[str, np.ndarray]]:
    """Fly cases of one autopilot side by side."""
    law = cases[0].law
    period, steps, lanes = law.period, int(seconds * law.rate_hz), 3 * len(cases)
    controller = Lanes(law, tuple(axis for case in cases for axis in case.law.axes))
    wide = {
        name: np.concatenate([getattr(case, name) for case in cases])
        for name in ("gain", "delay", "lag", "damping", "lead")
    }
    limit = np.repeat([case.limit for case in cases], 3)
    time = np.arange(steps) * period
    stick = np.concatenate([sticks_of(rng, case.sticks, time) for case in cases], axis=1)
    size = np.concatenate([GUST_SIZE * GUSTS[case.gusts] * (1.0 if case.vehicle != "racer" else 3.0) for case in cases])
    decay, decay_wash = np.exp(-period / np.tile(GUST_S, len(cases))), np.exp(-period / WASH_S)
    shocks, shocks_wash = size * np.sqrt(1 - decay**2), WASH * size * np.sqrt(1 - decay_wash**2)
    wash = np.zeros(lanes)
    acro = np.repeat([case.sticks == "acro" for case in cases], 3)
    yaw = np.tile([False, False, True], len(cases))
    top = np.where(
        acro, np.where(np.repeat([case.vehicle == "racer" for case in cases], 3), 8.0, 3.0), np.where(yaw, 1.5, 0.5)
    )
    expo = 0.3 * stick + 0.7 * stick**3
    noise = GYRO_NOISE * np.sqrt(law.rate_hz / 1000)
    late, share = np.divmod(wide["delay"] / period, 1.0)
    late = late.astype(int)
    line, column = int(late.max()) + 2, np.arange(lanes)
    sent, lagged = np.zeros((line, lanes)), np.zeros(lanes)
    pull = 1 - np.exp(-period / wide["lag"])
    gust, rate, angle, heading = size * rng.standard_normal(lanes), np.zeros(lanes), np.zeros(lanes), np.zeros(lanes)
    names = ("rate", "gyro", "asked", "angle", "wanted", "command", "acting")
    kept = {name: np.zeros((steps, lanes), dtype=np.float32) for name in names}
    command, saturated = np.zeros(lanes), np.zeros(lanes, dtype=bool)
    hold = np.repeat([case.sticks == "hold" for case in cases], 3)
    velocity = np.zeros(lanes)
    for step in range(steps):
        gyro = rate + noise * rng.standard_normal(lanes)
        # Position hold: the asked angle brakes the drift that the tilt makes; yaw holds its heading.
        wanted = np.where(hold, np.where(yaw, 0.0, np.clip(-0.25 * velocity, -0.5, 0.5)), top * stick[step])
        heading += period * np.where(yaw & ~acro & ~hold, top * expo[step], 0.0)
        target = np.where(yaw, heading, wanted)
        asked = np.where(acro, top * expo[step], controller.asked_rate(target - angle, gyro))
        asked = np.where(yaw & ~acro & ~hold, asked + top * expo[step], asked)
        command = controller.command(asked, gyro, saturated)
        acting = np.clip(command, -limit, limit)
        saturated = acting != command
        sent[step % line] = acting
        first, second = sent[(step - late) % line, column], sent[(step - late - 1) % line, column]
        arrived = first * (1 - share) + second * share
        change = (arrived - lagged) * pull
        lagged = lagged + change
        gust = gust * decay + shocks * rng.standard_normal(lanes)
        wash = wash * decay_wash + shocks_wash * rng.standard_normal(lanes)
        torque = wide["gain"] * (lagged + wide["lead"] * change / period) + gust + wash
        for values, value in zip(kept.values(), (rate, gyro, asked, angle, target, command, acting), strict=True):
            values[step] = value
        rate = rate + period * (torque - wide["damping"] * rate)
        angle = angle + period * rate
        velocity = velocity + period * (9.8 * np.sin(angle) - 0.3 * velocity)
    kept["stick"], kept["time"] = stick.astype(np.float32), time
    return [
        {name: (each if name == "time" else each[:, 3 * k : 3 * k + 3].astype(float)) for name, each in kept.items()}
        for k in range(len(cases))
    ]


def filtered(case: Case, gyro: np.ndarray) -> np.ndarray:
    """Filter the gyroscope as the law does in front of the control."""
    out = gyro.copy()
    for axis in range(3):
        for each in case.law.axes[axis].measured:
            section = each.section(case.law.period)
            out[:, axis] = signal.lfilter(section.over, section.under, out[:, axis])
    return out


def log_of(case: Case, flown: dict[str, np.ndarray], name: str) -> LogFlight:
    """Log a flight at the ordinary rates of its autopilot, quantised, on the common clock."""
    slow, fast = (min(hz, case.law.rate_hz) for hz in LOGGED_HZ[case.autopilot])
    time = flown["time"]
    clock = min(2 * min(slow, fast), 1000.0)
    common = np.arange(time[0], time[-1], 1 / clock)

    def at(values: np.ndarray, hz: float, unit: float = 0.0) -> np.ndarray:
        every = max(round(1 / (hz * (time[1] - time[0]))), 1)
        values = np.round(values[::every] / unit) * unit if unit else values[::every]
        return on_clock(Samples(time[::every], values), common, values.shape[1], cubic=True)

    racer = case.autopilot == "betaflight"
    command = flown["acting"] if racer else flown["command"]
    sticks_hz = {"px4": 5.0, "ardupilot": 10.0}.get(case.autopilot, slow)
    nothing, one = np.full((len(common), 3), np.nan), np.full(len(common), np.nan)
    every = np.ones(len(common), dtype=bool)
    level = case.sticks != "acro"
    rate = at(filtered(case, flown["gyro"]), fast, np.radians(1.0) if racer else 0.0)
    return LogFlight(
        name=name, autopilot=case.autopilot, parameters=case.parameters, rate_hz=clock, time=common, body_rate=rate,
        command=at(command, slow, 5e-4 if racer else 0.0),
        rate_setpoint=at(flown["asked"], slow, np.radians(1.0) if racer else 0.0),
        stick=at(flown["stick"], sticks_hz, 2e-3),
        attitude_setpoint=at(flown["wanted"], slow) if level and not racer else nothing,
        attitude=at(flown["angle"], slow), collective=one, voltage=one, current=one, height=one, climb_rate=one,
        specific_force=nothing, flown=every, usable=every, rotors=Samples(np.zeros(0), np.zeros((0, 4))),
        gyroscope=Samples(common, rate), gaps_s=np.zeros((0, 2)),
    )  # fmt: skip


def truth(case: Case, axis: int, frequency: np.ndarray) -> np.ndarray:
    """Angular acceleration by command as the log has both: with the gyroscope's filters and the hold of a step."""
    s, period = 2j * np.pi * frequency, case.law.period
    back = np.exp(-s * period)
    own = case.gain[axis] * (1 + s * case.lead[axis]) * np.exp(-s * case.delay[axis]) / (1 + s * case.lag[axis])
    # A step of the rotors' lag, taken whole at its begin, makes up for the hold of the command.
    own = own * s / (s + case.damping[axis])
    return own * chain(case.law.axes[axis].measured, back, period)


def flights(seed: int, count: int, seconds: float = 60.0):
    """Draw, fly and log cases: (case, log) of each."""
    rng = np.random.default_rng(seed)
    by_law: dict[tuple[str, float], list[Case]] = {}
    for number in range(count):
        autopilot = list(AUTOPILOTS)[number % 4]
        vehicle = (
            str(rng.choice(list(VEHICLES)))
            if autopilot in ("px4", "ardupilot")
            else {"betaflight": "racer", "crazyflie": "nano"}[autopilot]
        )
        gusts = list(GUSTS)[number // 4 % 3]
        kinds = ("acro", "gentle") if autopilot == "betaflight" else STICKS
        case = draw_case(rng, autopilot, vehicle, gusts, kinds[number // 12 % len(kinds)])
        by_law.setdefault((autopilot, case.law.rate_hz), []).append(case)
    for (autopilot, _), cases in by_law.items():
        for k, (case, flown) in enumerate(zip(cases, simulate(cases, seconds, rng), strict=True)):
            yield case, log_of(case, flown, f"{autopilot} {k}"), flown


def rows_of(case: Case, log: LogFlight) -> list[dict[str, object]]:
    """Hold what `look` says of a flight against its truth, by axis."""
    rows = []
    plants = effectiveness(log)
    for axis, (plant, loop) in enumerate(zip(plants, loops_of(log, plants), strict=True)):
        row: dict[str, object] = {"autopilot": case.autopilot, "gusts": case.gusts, "sticks": case.sticks}
        row |= {"vehicle": case.vehicle, "axis": "yaw" if axis == 2 else "roll, pitch", "verdict": plant.verdict}
        true = PlantModel(*(float(getattr(case, name)[axis]) for name in ("gain", "delay", "lag", "damping", "lead")))
        if plant.bound is not None:
            size = float(np.abs(true.acceleration(plant.at_hz)))
            row["bound"] = plant.bound.low <= size <= plant.bound.high
        if plant.identified:
            assert plant.effectiveness
            assert plant.total_delay
            assert plant.least_squares
            size, turn = float(np.abs(true.acceleration(plant.at_hz))), 2 * np.pi * plant.at_hz
            late = true.delay + (np.arctan(turn * true.lag) - np.arctan(turn * true.lead)) / turn
            row["inside"] = plant.effectiveness.low <= size <= plant.effectiveness.high
            row["error"], row["half"] = plant.effectiveness.value / size - 1, plant.effectiveness.half / size
            row["ls inside"] = plant.least_squares.low <= size <= plant.least_squares.high
            row["ls error"] = plant.least_squares.value / size - 1
            row["delay"], row["delay inside"] = (
                plant.total_delay.value - late,
                (plant.total_delay.low <= late <= plant.total_delay.high),
            )
        row |= loop_row(case, log, axis, loop, true)
        row |= margin_row(case, axis, plant, true)
        rows.append(row)
    return rows


def loop_row(case: Case, log: LogFlight, axis: int, loop: AxisLoop, true: PlantModel) -> dict[str, object]:
    """Hold the measured step against that of the true plant with the same law, over the same band."""
    row: dict[str, object] = {"law": loop.law_explains} if loop.measured else {}
    if loop.overshoot is not None:
        own = PlantAndLaw(PlantModel(*(np.full((1, 1), each) for each in true)), case.law, axis)
        step = own.steps(loop.time, log.rate_hz, round(2 * log.rate_hz), loop.clear_hz)[0]
        value = float(step.max()) - 1
        row["overshoot"] = loop.overshoot.value - value
        row["overshoot inside"] = loop.overshoot.low <= value <= loop.overshoot.high
    return row


def margin_row(case: Case, axis: int, plant: AxisPlant, true: PlantModel) -> dict[str, object]:
    """Hold the margins of the flown law with all plants that are possible against those of the true one."""
    if not plant.identified:
        return {}
    every = np.concatenate([np.array(true)[None], plant.parameters[None], plant.draws])
    plants = PlantModel(*(every[:, [place]] for place in range(5)))
    frequency = np.geomspace(0.1, 0.49 * case.law.rate_hz, 400)
    cut = plants.rate(frequency) * case.law.response(axis, frequency).feedback
    stable = is_stable(frequency, cut)
    if not stable[:2].all():
        return {}
    gain, phase, crossover = crossing_margins(frequency, cut[stable])
    disk = np.degrees(2 * np.arctan(disk_of(cut[stable]) / 2))
    found = {"gain margin": gain, "phase margin": phase, "disk margin": disk, "crossover": crossover}
    ends = {name: np.quantile(each[1:], [0.025, 0.975], method="nearest") for name, each in found.items()}
    row: dict[str, object] = {name: bool(ends[name][0] <= each[0] <= ends[name][1]) for name, each in found.items()}
    return {**row, "phase error": phase[1] - phase[0]}


def share(rows: list[dict[str, object]], name: str, within: float = 0.0) -> str:
    """Give the share that holds, or that lies within a size, in per cent."""
    values = [row[name] for row in rows if name in row]
    held = [abs(each) <= within if within else bool(each) for each in values]  # type: ignore[arg-type]
    return f"{100 * np.mean(held):.0f} %, {len(held)}" if held else "-"


def middle(rows: list[dict[str, object]], name: str) -> str:
    values = [abs(row[name]) for row in rows if name in row]  # type: ignore[arg-type]
    return f"{100 * np.median(values):.1f} %" if values else "-"


COLUMNS = {
    "axes": lambda own: len(own),
    "identified": lambda own: sum(row["verdict"] == "identified" for row in own),
    "effectiveness inside": lambda own: share(own, "inside"),
    "its error": lambda own: middle(own, "error"),
    "by least squares": lambda own: middle(own, "ls error"),
    "delay within 2 ms": lambda own: share(own, "delay", 0.002),
    "inside": lambda own: share(own, "delay inside"),
    "phase margin within 5°": lambda own: share(own, "phase error", 5.0),
    "inside ": lambda own: share(own, "phase margin"),
    "gain margin inside": lambda own: share(own, "gain margin"),
    "disk margin inside": lambda own: share(own, "disk margin"),
    "crossover inside": lambda own: share(own, "crossover"),
    "overshoot within 5 points": lambda own: share(own, "overshoot", 0.05),
    "inside  ": lambda own: share(own, "overshoot inside"),
    "law explains": lambda own: share(own, "law"),
    "bounds that hold": lambda own: share(own, "bound"),
}


def main(seed: int = 4, count: int = 200) -> None:
    rows = [row for case, log, _ in flights(seed, count) for row in rows_of(case, log)]
    groups = {"all": rows}
    for key in ("autopilot", "gusts", "sticks", "axis"):
        for value in dict.fromkeys(str(row[key]) for row in rows):
            groups[value] = [row for row in rows if str(row[key]) == value]
    cells = [[name, *(of(own) for of in COLUMNS.values())] for name, own in groups.items()]
    table("look", ["flights", *COLUMNS], cells)


if __name__ == "__main__":
    program(main)
