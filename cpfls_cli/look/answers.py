"""What a log can answer and what it cannot: why, and what to log or fly for it; and gusts."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.estimation.spectra import most_likely, transforms, window_starts
from cpfls_cli.flightlog.stated_vehicle import FAST_HZ, SLOW_HZ, log_faster
from cpfls_cli.look.balance import Balance
from cpfls_cli.look.effectiveness import AxisPlant, PlantModel
from cpfls_cli.look.flight import AXES, LogFlight
from cpfls_cli.look.gains import TunedGains
from cpfls_cli.look.hover import Hover
from cpfls_cli.look.loop import AxisLoop
from cpfls_cli.look.steady import FEWEST_WINDOWS, WINDOW_S, jackknifed, windows_of
from cpfls_cli.look.vibration import Vibration
from cpfls_cli.result import Estimate, about, part, result
from cpfls_cli.words import joined

_PIECE_S = 8.0
_BAND_HZ, _OF_RATE = (0.2, 6.0), 0.2
"""Band of the fit: above what a piece resolves, and below where plant and sensors count; share of the sampling rate
it stays below."""
_HANN, _NEIGHBOURS = 0.375, {-1: 1 / 6, 0: 2 / 3, 1: 1 / 6}
"""Mean square of Hann's taper, and shares of a frequency and its neighbours in the power that it shows."""
_MEMORY_S, _SEEN_S = (0.02, 5.0), (0.04, 0.8)
"""Time constants that are tried, and what an interval of them has to lie within, for corners in the band."""


@result
class AxisGusts:
    """Gusts about one axis: root mean square from 0.2 to 6 Hz, and of the process of first order that has it."""

    axis: str = about("roll, pitch or yaw")
    in_band: Estimate = part()
    size: Estimate | None = part(default=None)
    memory: Estimate | None = part(default=None)


def gusts_of(flight: LogFlight, plants: Mapping[str, PlantModel]) -> tuple[AxisGusts, ...]:
    """Estimate the gusts about each axis whose plant is known, from an estimate that gusts do not bias."""
    found = (_about(flight, axis, plants[name]) for axis, name in enumerate(AXES) if name in plants)
    return tuple(each for each in found if each)


def _about(flight: LogFlight, axis: int, plant: PlantModel) -> AxisGusts | None:
    signals, period = (flight.body_rate[:, axis], flight.command[:, axis]), 1 / flight.rate_hz
    length = round(_PIECE_S * flight.rate_hz)
    begins = window_starts(flight.usable & np.isfinite(signals).all(axis=0), length)
    # They overlap by half.
    if len(begins) < 2 * FEWEST_WINDOWS - 1:
        return None
    frequency = np.asarray(np.fft.rfftfreq(length, period), dtype=float)
    band = (frequency >= _BAND_HZ[0]) & (frequency <= min(_BAND_HZ[1], _OF_RATE * flight.rate_hz))
    rate, command = map(np.nan_to_num, signals)
    turned, moved = (each[:, band] for each in transforms(rate, begins, length, period, 1))
    driven = transforms(command, begins, length, period)[0][:, band]
    scale = 2 / (_HANN * length * flight.rate_hz)
    power = scale * np.abs(moved + plant.damping * turned - plant.torque(frequency[band]) * driven) ** 2
    known = jackknifed(lambda kept: _fitted(frequency[band], power[kept].mean(axis=0)), len(power))
    if known is None:
        return None
    size, memory, in_band = (
        Estimate(value=float(np.exp(each.value)), low=float(np.exp(each.low)), high=float(np.exp(each.high)))
        for each in (known.estimate(k) for k in (0, 1, 3))
    )
    inside = _SEEN_S[0] < memory.low and memory.high < _SEEN_S[1]
    return AxisGusts(axis=AXES[axis], in_band=in_band, size=size if inside else None, memory=memory if inside else None)


def _spectrum(frequency: Array, logs: Array) -> tuple[Array, Array]:
    """Evaluate the spectrum of gusts and noise as windows under Hann's taper show it, and its slopes by logarithms.

    `logs`: of size, memory and noise.
    """
    size, memory, noise = np.exp(logs)
    near = frequency + (frequency[1] - frequency[0]) * np.array(list(_NEIGHBOURS))[:, None]
    turning = 2 * np.pi * near
    late = (turning * memory) ** 2
    gusts, sensor = 4 * size**2 * memory / (1 + late), noise * turning**2
    shares = np.array(list(_NEIGHBOURS.values()))
    slopes = [shares @ each for each in (2 * gusts, gusts * (1 - late) / (1 + late), sensor)]
    return np.asarray(shares @ (gusts + sensor)), np.array(slopes)


def _fitted(frequency: Array, power: Array) -> Array:
    """Fit size, memory and noise to a spectrum; logarithms of them, and of the size within the band."""
    spacing = frequency[1] - frequency[0]
    whole = float(power.sum() * spacing)
    floor = float(np.median(power / (2 * np.pi * frequency) ** 2))
    begin = np.log([np.sqrt(whole), 0.3, 0.1 * floor])
    shortest, longest = np.log(_MEMORY_S)
    ends = [(begin[0] - 6, begin[0] + 3), (shortest, longest), (begin[2] - 12, begin[2] + 6)]

    def spectrum(logs: Array) -> tuple[Array, Callable[[Array], Array]]:
        expected, slopes = _spectrum(frequency, logs)
        return expected, lambda slope: slopes @ slope[0]

    logs = most_likely(spectrum, power[None], [begin], ends)
    size, memory = np.exp(logs[:2])
    # A sum over frequencies would begin below the band, where long gusts are largest.
    band = np.arctan(2 * np.pi * memory * np.array(_BAND_HZ))
    return np.array([*logs, np.log(size) + 0.5 * np.log(2 / np.pi * (band[1] - band[0]))])


_HOVER = "hover for 20 s in still air"
_TURN = "hover for 40 s and turn by 180 degrees halfway: what turns with the body is not the wind"
_SWAP = (
    "swap the propellers of M{} and M{}, which turn the same way, and hover for 40 s: what moves with the propeller is "
    "the propeller"
)
_PAUSES, _WHOLE = "also what falls into its pauses", 0.5
"""What to log where pauses leave less than this share of the windows of a flight."""
_TRIED = 2
"""Flights that are proposed at most."""
_PUNCH = "climb twice at nearly full throttle, for 2 s each"
_NO_NEWTONS = "a log holds commands, not newtons: mass and arm are needed"
_WHOLE_SPECTRUM_HZ = 900.0
"""Rate of a gyroscope whose log shows what rotors of usual sizes vibrate with."""
_SOME_SPECTRUM_HZ = 150.0
_LEAST_HZ = 200.0
"""Rate that is asked for where no parameter of the autopilot is known that sets it."""
_LEAST_S = FEWEST_WINDOWS * WINDOW_S
_SLOWEST_HZ = 20.0
"""Rate of body rates and commands below which no loop of a multirotor can be seen."""
_SURE_SHARE, _SURE_HOVER, _SURE_EXPONENT = 0.05, 0.03, 0.3
"""Half widths of intervals from which on the answer is rough."""
_LACKING = {
    "autopilot": "the control law of what wrote it is not known",
    "version": "gains of this version have another meaning",
    "parameters": "the log states no gains",
}
_OF_AXIS = {
    "weak": "what a command does is not identified",
    "law": "the stated law does not explain the response",
    "feedback": "the feedback that flew is not that of the stated gains",
    "margins": "no gains keep the margins",
    "band": "the loop would be faster than what is identified",
}


@result
class Answer:
    """One question, and whether the log answers it."""

    question: str = about("what is asked")
    answer: str = about("yes, roughly, or no")
    why: str = about("what the answer rests on, or what is missing")
    log: str = about("signals to log, or to log faster; empty where nothing helps", default="")
    settings: tuple[str, ...] = about(
        "parameters of the autopilot that log them, with their values", "setting", default=()
    )
    fly: str = about("what to fly, so that another log answers it; empty where nothing helps", default="")


@result
class NextStep:
    """What helps most: something to log, to fly or to type."""

    what: str = about("a flight, or what to log")
    settings: tuple[str, ...] = about("parameters of the autopilot with their values", "setting", default=())
    command: str = about("to type; empty where nothing is", default="")
    why: str = about("what it would answer")


@dataclass(frozen=True, kw_only=True)
class Found:
    """All that a log has shown so far."""

    flight: LogFlight
    balance: Balance | None
    hover: Hover | None
    plants: Sequence[AxisPlant]
    loops: Sequence[AxisLoop]
    vibration: Vibration | None
    gusts: Sequence[AxisGusts]
    gains: TunedGains

    @property
    def identified(self) -> list[str]:
        """Axes whose effectiveness is identified."""
        return [plant.axis for plant in self.plants if plant.identified]

    @property
    def loop_hz(self) -> float:
        """Rate of the slower of body rate and command."""
        return 0.5 * self.flight.rate_hz

    @property
    def settings(self) -> tuple[str, ...]:
        """Parameters that make this autopilot log faster, with their values; none where it has them already."""
        said = log_faster("", FAST_HZ, self.flight.system, parameters=self.flight.parameters)
        pairs = re.findall(r"\b([A-Za-z]\w*_\w+) = ([\d/]+)", said)
        has = self.flight.parameters
        return tuple(f"{name} = {value}" for name, value in pairs if not _is(has.get(name), value))

    def too_short(self, what: str, fly: str = "") -> tuple[str, str, str, str]:
        """Say that it flies for too short a time, or that pauses of the log leave too little of it whole."""
        flight = self.flight
        begins = np.searchsorted(flight.time, flight.gaps_s[:, 0]).clip(max=len(flight.time) - 1)
        pauses = int(flight.flown[begins].sum())
        left, whole = (len(windows_of(each).begin) for each in (flight, replace(flight, usable=flight.flown)))
        if pauses and left < _WHOLE * whole:
            several = "1 pause of the log leaves" if pauses == 1 else f"{pauses} pauses of the log leave"
            return "no", f"{several} too little of the flight whole", _PAUSES, ""
        return "no", what, "", fly

    @property
    def sticks(self) -> str:
        """What to fly for axes that are not identified."""
        moves = [each for each in self.gains.fly if each.axis not in self.identified]
        axes = [each.axis for each in moves] or [axis for axis in AXES if axis not in self.identified]
        low, high = (min(each.lowest for each in moves), max(each.highest for each in moves)) if moves else (0.0, 0.0)
        first = f"in mode {moves[0].mode}, " if moves else ""
        each = "for 20 s" if len(axes) == 1 else "one after the other, 20 s each"
        speed = f"from slow ({low:g} Hz) to fast ({high:g} Hz)" if moves else "from slow to fast"
        return f"{first}move the {joined(axes)} stick to both sides, {each}, {speed}"


def _is(has: float | str | None, value: str) -> bool:
    """Tell whether a parameter has a value already."""
    try:
        return has is not None and float(has) == float(value)
    except ValueError:
        return str(has) == value


def answers_of(found: Found) -> tuple[Answer, ...]:
    """List all questions with their answers."""
    asked: dict[str, Callable[[Found], tuple[str, str, str, str]]] = {
        "rotor balance": _balance,
        "hover throttle": _hover,
        "effectiveness and delay": _plants,
        "loop response": _loops,
        "gains": _gains,
        "vibration": _spectra,
        "thrust curve": _curve,
        "gusts": _gusts,
        "inertia, drag, what a model misses": _constants,
    }
    rows = {question: answer(found) for question, answer in asked.items()}
    settings = found.settings
    return tuple(
        Answer(
            question=question,
            answer=answer,
            why=why,
            log=log,
            settings=settings if log and not log.startswith("also ") else (),
            fly=fly,
        )
        for question, (answer, why, log, fly) in rows.items()
    )


def _balance(found: Found) -> tuple[str, str, str, str]:
    balance = found.balance
    if balance is None:
        return "no", "commands of the rotors are not logged", "also rotor commands", ""
    shares = [row.share for row in balance.rotors if row.share is not None]
    if not shares:
        return found.too_short(f"less than {_LEAST_S:.0f} s of steady flight in it", _HOVER)
    half = max(share.half for share in shares)
    why = f"within {100 * half:.1f} points, {balance.steady_s:.0f} s of steady flight"
    return "yes" if half < _SURE_SHARE else "roughly", why, "", _parting(found, balance)


def _parting(found: Found, balance: Balance) -> str:
    """Say what parts the causes that are left, if more than one is; neither hover nor climb does."""
    causes = [cause for cause in balance.causes if cause.alone] or balance.causes
    kinds = {cause.kind for cause in causes}
    rotors = [cause.rotor - 1 for cause in causes if cause.kind == "rotor"]
    if "wind" in kinds and balance.wind is None:
        return _TURN
    spins = found.flight.spins
    alike = (
        [] if spins is None or not rotors else [k for k in np.flatnonzero(spins == spins[rotors[0]]) if k != rotors[0]]
    )
    return _SWAP.format(rotors[0] + 1, alike[0] + 1) if alike and len(kinds) > 1 else ""


def _hover(found: Found) -> tuple[str, str, str, str]:
    hover = found.hover
    if found.flight.relative:
        return "no", "the log does not say what full command is", "", ""
    if hover is None or hover.throttle is None:
        missing = not np.isfinite(found.flight.collective).any()
        return (
            ("no", "commands are not logged", "also rotor commands", "")
            if missing
            else found.too_short(f"less than {_LEAST_S:.0f} s of hover in it", _HOVER)
        )
    why = f"{hover.hover_s:.0f} s of hover, seen by {hover.found_by}"
    return "yes" if hover.throttle.half < _SURE_HOVER else "roughly", why, "", ""


def _plants(found: Found) -> tuple[str, str, str, str]:
    if len(found.identified) == len(found.plants):
        return "yes", f"all axes, by {joined(dict.fromkeys(plant.instrument for plant in found.plants))}", "", ""
    answer = "roughly" if found.identified else "no"
    if found.loop_hz < _SLOWEST_HZ:
        return (
            answer,
            f"body rates or commands are logged only {found.loop_hz:.0f} times a second",
            "body rates, commands",
            "",
        )
    return answer, _missing((own.axis, own.reason) for own in found.plants if not own.identified), "", found.sticks


def _missing(lacking: Iterable[tuple[str, str]]) -> str:
    """Say why something is not known about axes, each with its reason."""
    reasons: dict[str, list[str]] = {}
    for axis, reason in lacking:
        reasons.setdefault(reason, []).append(axis)
    return "; ".join(f"about {joined(axes)}, {reason}" for reason, axes in reasons.items())


def _loops(found: Found) -> tuple[str, str, str, str]:
    known = [loop.axis for loop in found.loops if loop.measured]
    if known:
        return "yes" if len(known) == len(AXES) else "roughly", joined(known), "", ""
    if not np.isfinite(found.flight.rate_setpoint).any():
        if found.flight.unfollowed:
            return "no", "the body rate does not follow what is called a rate setpoint", "", found.sticks
        return "no", "rate setpoints are not logged", "also rate setpoints", ""
    if found.loop_hz < _SLOWEST_HZ:
        return (
            "no",
            f"body rates or setpoints are logged only {found.loop_hz:.0f} times a second",
            "body rates, rate setpoints",
            "",
        )
    return "no", _missing((own.axis, own.reason) for own in found.loops), "", found.sticks


def _gains(found: Found) -> tuple[str, str, str, str]:
    gains = found.gains
    if gains.reason:
        return "no", _LACKING[gains.reason], "", ""
    known = [axis.axis for axis in gains.axes if not axis.reason]
    if len(known) == len(gains.axes):
        return "yes", "all axes", "", ""
    reasons: dict[str, list[str]] = {}
    for axis in gains.axes:
        if axis.reason:
            reasons.setdefault(_OF_AXIS[axis.reason], []).append(axis.axis)
    why = "; ".join(f"{reason} about {joined(axes)}" for reason, axes in reasons.items())
    return "roughly" if known else "no", why, "", ""


def _gyroscope_hz(flight: LogFlight) -> float:
    return max(each.rate_hz for each in (flight.gyroscope, flight.gyroscope_unfiltered) if each is not None)


def _spectra(found: Found) -> tuple[str, str, str, str]:
    flight, wanted = found.flight, "the gyroscope"
    rate = _gyroscope_hz(flight)
    if rate < _SOME_SPECTRUM_HZ:
        return "no", f"the gyroscope is logged {rate:.0f} times a second", wanted, ""
    if found.vibration is None or not found.vibration.spectra:
        return found.too_short("too little flight")
    if rate >= _WHOLE_SPECTRUM_HZ:
        return "yes", f"up to {rate / 2:.0f} Hz", "", ""
    return "roughly", f"up to {rate / 2:.0f} Hz; what is faster is folded below or averaged away", wanted, ""


def _curve(found: Found) -> tuple[str, str, str, str]:
    shape = None if found.hover is None else found.hover.shape
    if shape is None:
        if found.flight.accelerometer is None:
            return "no", "no accelerometer is seen to feel gravity, as if it were off or not logged", "", ""
        if not np.isfinite(found.flight.specific_force).any():
            return "no", f"the accelerometer reads {found.flight.reads_at_rest:.2f} g at rest", "", ""
        return "no", "throttle and thrust vary too little together", "", _PUNCH
    why = f"throttle from {shape.lowest:.2f} to {shape.highest:.2f}"
    return "yes" if shape.exponent.half < _SURE_EXPONENT else "roughly", why, "", ""


def _gusts(found: Found) -> tuple[str, str, str, str]:
    known = [each.axis for each in found.gusts]
    if known:
        return "roughly", joined(known), "", ""
    return "no", "what a command does is not identified" if not found.identified else "too little flight", "", ""


def _constants(found: Found) -> tuple[str, str, str, str]:
    if found.loop_hz >= SLOW_HZ:
        return "no", _NO_NEWTONS, "", ""
    slow = ["commands"] if _gyroscope_hz(found.flight) >= SLOW_HZ else ["body rates", "commands"]
    return "no", f"{_NO_NEWTONS}, and {joined(slow)} at {FAST_HZ:g} Hz or more", ", ".join(slow), ""


def next_steps(found: Found, answers: Sequence[Answer]) -> tuple[NextStep, ...]:
    """Choose the setting and the flights that answer most of what is open, and the command that goes on to a model."""
    open_ = [each for each in answers if each.answer != "yes"]
    wanted: dict[str, list[str]] = {}
    for each in open_:
        if each.fly:
            wanted.setdefault(each.fly, []).append(each.question)
    # What is asked first comes first among equals; why rotors are uneven, first of all.
    cause = _parting(found, found.balance) if found.balance and found.balance.uneven else ""
    ranked = sorted(wanted.items(), key=lambda own: (own[0] != cause, -len(own[1])))
    flights = [NextStep(what=text, why=", ".join(questions)) for text, questions in ranked]
    slow = [each for each in open_ if each.log and not each.log.startswith("also ")]
    least = _LEAST_HZ if _gyroscope_hz(found.flight) < _LEAST_HZ else _WHOLE_SPECTRUM_HZ
    asked = any("gyroscope" in each.log for each in slow) or least == _LEAST_HZ
    how = f"at {least:g} Hz or more" if asked and not found.settings else "faster"
    logged = [
        NextStep(
            what=f"log {joined(dict.fromkeys(signal for each in slow for signal in each.log.split(', ')))} {how}",
            settings=found.settings,
            why=", ".join(each.question for each in slow),
        )
    ] * bool(slow and (found.settings or not found.flight.parameters))
    missing: dict[str, list[str]] = {}
    for each in open_:
        if each.log.startswith("also "):
            missing.setdefault(each.log, []).append(each.question)
    logged += [NextStep(what=f"log {text}", why=", ".join(questions)) for text, questions in missing.items()]
    # What is roughly known can wait.
    urgent = any(each.answer == "no" and each.log for each in open_)
    first = flights[:1] if cause else []
    steps = [*first, *logged, *flights[len(first) :]] if urgent else [*flights[:_TRIED], *logged]
    file = shlex.quote(found.flight.name.partition(", flight ")[0])
    model = NextStep(
        what="for a model, with mass and arm",
        command=f"cpfls init {file} --mass KG --arm M -o study.yaml",
        why=answers[-1].question,
    )
    return (*steps[:_TRIED], model)
