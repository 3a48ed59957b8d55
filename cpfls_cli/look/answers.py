"""What a log can answer and what it cannot: why, and what to log or fly for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.flightlog.logging_rates import FAST_HZ, log_faster
from cpfls_cli.look.balance import Balance
from cpfls_cli.look.effectiveness import AxisPlant
from cpfls_cli.look.flight import AXES, LogFlight
from cpfls_cli.look.gains import TunedGains
from cpfls_cli.look.gusts import AxisGusts
from cpfls_cli.look.hover import Hover
from cpfls_cli.look.loop import AxisLoop
from cpfls_cli.look.steady import FEWEST_WINDOWS, WINDOW_S
from cpfls_cli.look.vibration import Vibration
from cpfls_cli.result import about, result
from cpfls_cli.words import joined

_HOVER = "hover for 20 s in still air"
_TURN = "turn by 180 degrees while you hover for 40 s: what turns with the body is not the wind"
_PUNCH = "climb twice at nearly full throttle, for 2 s each"
_WHOLE_SPECTRUM_HZ = 900.0
"""Rate of a gyroscope whose log shows what rotors of usual sizes vibrate with."""
_SOME_SPECTRUM_HZ = 150.0
_LEAST_S = FEWEST_WINDOWS * WINDOW_S
_SLOWEST_HZ = 20.0
"""Rate of body rates and commands below which no loop of a multirotor can be seen."""
_SURE_SHARE, _SURE_HOVER, _SURE_EXPONENT = 0.05, 0.03, 0.3
"""Half widths of intervals from which on the answer is rough."""
_LACKING = {
    "autopilot": "the control law of what wrote it is not known",
    "version": "gains of this version have another meaning",
    "parameters": "it states no gains",
}
_OF_AXIS = {
    "weak": "effectiveness is not identified",
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
    log: str = about(
        "what to set in the autopilot, so that another log answers it; empty where nothing helps", default=""
    )
    fly: str = about("what to fly, so that another log answers it; empty where nothing helps", default="")


@result
class NextStep:
    """What helps most: something to log, to fly or to type."""

    what: str = about("a setting, a flight or a command")
    why: str = about("what it would answer; empty where it says so itself", default="")


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
    def sticks(self) -> str:
        """What to fly for axes that are not identified."""
        moves = [each for each in self.gains.fly if each.axis not in self.identified]
        axes = joined([each.axis for each in moves] or [axis for axis in AXES if axis not in self.identified])
        how = moves[0] if moves else None
        mode = f" in mode {how.mode}" if how else " in a mode without position hold"
        speed = (
            f", from {how.lowest:g} to {max(each.highest for each in moves):g} Hz" if how else ", slowly then faster"
        )
        return f"move the stick of {axes} to both sides{mode}{speed}, for 20 s an axis"


def answers_of(found: Found) -> tuple[Answer, ...]:
    """List all questions with their answers."""
    asked: dict[str, Callable[[Found], tuple[str, str, str, str]]] = {
        "balance of rotors": _balance,
        "hover throttle": _hover,
        "delay and effectiveness": _plants,
        "response of the loop": _loops,
        "gains": _gains,
        "vibration": _spectra,
        "thrust curve": _curve,
        "gusts": _gusts,
        "inertia": _constants("vehicle"),
        "drag": _constants("vehicle"),
        "what a model misses": _constants("gap"),
    }
    rows = {question: answer(found) for question, answer in asked.items()}
    return tuple(
        Answer(question=question, answer=answer, why=why, log=log, fly=fly)
        for question, (answer, why, log, fly) in rows.items()
    )


def _balance(found: Found) -> tuple[str, str, str, str]:
    balance = found.balance
    if balance is None:
        return "no", "commands of the rotors are not logged", "rotor commands", ""
    shares = [row.share for row in balance.rotors if row.share is not None]
    if not shares:
        return "no", f"less than {_LEAST_S:.0f} s of steady flight in it", "", _HOVER
    half = max(share.half for share in shares)
    why = f"within {100 * half:.1f} points, {balance.steady_s:.0f} s of steady flight"
    return "yes" if half < _SURE_SHARE else "roughly", why, "", _TURN if balance.uneven and balance.wind is None else ""


def _hover(found: Found) -> tuple[str, str, str, str]:
    hover = found.hover
    if found.flight.relative:
        return "no", "the log does not say what full command is", "", ""
    if hover is None or hover.throttle is None:
        missing = not np.isfinite(found.flight.collective).any()
        return (
            ("no", "commands are not logged", "rotor commands", "")
            if missing
            else ("no", f"less than {_LEAST_S:.0f} s of hover in it", "", _HOVER)
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
            "body rates and commands",
            "",
        )
    reasons: dict[str, list[str]] = {}
    for plant in found.plants:
        if not plant.identified:
            reasons.setdefault(plant.reason, []).append(plant.axis)
    missing = "; ".join(f"{joined(axes)}: {reason}" for reason, axes in reasons.items())
    return answer, missing, "", found.sticks


def _loops(found: Found) -> tuple[str, str, str, str]:
    known = [loop.axis for loop in found.loops if loop.measured]
    if known:
        return "yes" if len(known) == len(AXES) else "roughly", joined(known), "", ""
    if not np.isfinite(found.flight.rate_setpoint).any():
        return "no", "rate setpoints are not logged", "rate setpoints", ""
    if found.loop_hz < _SLOWEST_HZ:
        return (
            "no",
            f"body rates or setpoints are logged only {found.loop_hz:.0f} times a second",
            "body rates and rate setpoints",
            "",
        )
    return "no", "rate setpoints move too little", "", found.sticks


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
    why = "; ".join(f"{joined(axes)}: {reason}" for reason, axes in reasons.items())
    return "roughly" if known else "no", why, "", ""


def _spectra(found: Found) -> tuple[str, str, str, str]:
    flight, wanted = found.flight, "the gyroscope"
    rate = max(each.rate_hz for each in (flight.gyroscope, flight.gyroscope_unfiltered) if each is not None)
    if rate < _SOME_SPECTRUM_HZ:
        return "no", f"the gyroscope is logged {rate:.0f} times a second", wanted, ""
    if found.vibration is None or not found.vibration.spectra:
        return "no", "too little flight", "", ""
    if rate >= _WHOLE_SPECTRUM_HZ:
        return "yes", f"up to {rate / 2:.0f} Hz", "", ""
    return "roughly", f"up to {rate / 2:.0f} Hz; what is faster is folded below or averaged away", wanted, ""


def _curve(found: Found) -> tuple[str, str, str, str]:
    shape = None if found.hover is None else found.hover.shape
    if shape is None:
        if found.flight.accelerometer is None:
            return "no", "no accelerometer is logged that feels gravity", "the accelerometer", ""
        return "no", "throttle and thrust vary too little together", "", _PUNCH
    why = f"throttle from {shape.lowest:.2f} to {shape.highest:.2f}"
    return "yes" if shape.exponent.half < _SURE_EXPONENT else "roughly", why, "", ""


def _gusts(found: Found) -> tuple[str, str, str, str]:
    known = [each.axis for each in found.gusts]
    if known:
        return "roughly", joined(known), "", ""
    return "no", "effectiveness is not identified" if not found.identified else "too little flight", "", ""


def _constants(command: str) -> Callable[[Found], tuple[str, str, str, str]]:
    """Give the answer where constants are needed, which no log holds."""
    why = "a log holds commands, not newtons: mass and arm are needed"
    return lambda _: ("no", why, "", f"cpfls init LOG --mass KG --arm M, then cpfls {command}")


def next_steps(found: Found, answers: Sequence[Answer]) -> tuple[NextStep, ...]:
    """Choose the setting and the flights that answer most of what is open."""
    flight, open_ = found.flight, [each for each in answers if each.answer != "yes"]
    slow = [each for each in open_ if each.log]
    steps = []
    if slow:
        least = _WHOLE_SPECTRUM_HZ if all(each.question == "vibration" for each in slow) else FAST_HZ
        text = log_faster(
            joined(dict.fromkeys(each.log for each in slow)), least, flight.system, parameters=flight.parameters
        )
        steps.append(NextStep(what=text, why=f"answers {joined([each.question for each in slow])}"))
    wanted: dict[str, list[str]] = {}
    for each in open_:
        if each.fly and not each.fly.startswith("cpfls "):
            wanted.setdefault(each.fly, []).append(each.question)
    ranked = sorted(wanted.items(), key=lambda own: -len(own[1]))
    return (*steps, *(NextStep(what=text, why=f"answers {joined(questions)}") for text, questions in ranked[:2]))
