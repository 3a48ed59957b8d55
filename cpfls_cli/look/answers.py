"""What a log can answer and what it cannot: why, and what to log or fly for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from cpfls_cli.flightlog.logging_rates import FAST_HZ, log_faster
from cpfls_cli.look.balance import Balance
from cpfls_cli.look.effectiveness import AxisPlant
from cpfls_cli.look.flight import LogFlight
from cpfls_cli.look.gains import TunedGains
from cpfls_cli.look.gusts import AxisGusts
from cpfls_cli.look.hover import Hover
from cpfls_cli.look.vibration import Vibration
from cpfls_cli.result import about, result
from cpfls_cli.words import joined

_HOVER = "hover for 20 s in still air"
_PUNCH = "climb twice at nearly full throttle, for 2 s each"
_STICKS = (
    "move one stick at a time, there and back, slowly then faster, for 20 s an axis, in a mode without position hold"
)
_MOST_STEPS = 3
_WHOLE_SPECTRUM_HZ = 900.0
"""Rate of a gyroscope whose log shows what rotors of usual sizes vibrate with."""


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


class Found:
    """All that a log has shown so far, for the answers."""

    def __init__(
        self,
        flight: LogFlight,
        balance: Balance | None,
        hover: Hover | None,
        plants: Sequence[AxisPlant],
        loops: Sequence[Any],
        vibration: Vibration | None,
        gusts: Sequence[AxisGusts],
        gains: TunedGains,
    ) -> None:
        self.flight, self.balance, self.hover, self.plants, self.loops = flight, balance, hover, plants, loops
        self.vibration, self.gusts, self.gains = vibration, gusts, gains

    def faster(self, what: str, least_hz: float = FAST_HZ) -> str:
        """Say what to set so that a signal is logged fast enough."""
        return log_faster(what, least_hz, self.flight.system, parameters=self.flight.parameters)

    @property
    def identified(self) -> list[AxisPlant]:
        """Axes whose plant is identified."""
        return [plant for plant in self.plants if plant.identified]


def answers_of(found: Found) -> tuple[Answer, ...]:
    """List all questions with their answers."""
    rows: dict[str, Callable[[Found], Answer]] = {
        "balance of rotors": _balance,
        "hover throttle": _hover,
        "delay and effectiveness": _plants,
        "response of the loop": _loops,
        "gains": _gains,
        "vibration": _spectra,
        "thrust curve": _curve,
        "gusts": _gusts,
    }
    return tuple([*(make(found) for make in rows.values()), *_with_constants(found)])


def _balance(found: Found) -> Answer:
    balance, question = found.balance, "balance of rotors"
    if balance is None or not len(found.flight.rotors.time):
        return Answer(
            question=question,
            answer="no",
            why="commands of the rotors are not logged",
            log=found.faster("rotor commands"),
        )
    shares = [row.share for row in balance.rotors if row.share is not None]
    if not shares:
        return Answer(question=question, answer="no", why="no steady flight in it", fly=_HOVER)
    half = max(share.half for share in shares)
    sure = "yes" if half < 0.05 else "roughly"
    why = f"within {100 * half:.0f} points, over {balance.steady_s:.0f} s of steady flight"
    cause = "turn by 180 degrees while you hover, to part wind from the centre of mass" if balance.wind is None else ""
    return Answer(question=question, answer=sure, why=why, fly=cause)


def _hover(found: Found) -> Answer:
    hover, question = found.hover, "hover throttle"
    if hover is None or hover.throttle is None:
        missing = (
            "no hover in it"
            if len(found.flight.rotors.time) or np.isfinite(found.flight.collective).any()
            else "commands are not logged"
        )
        return Answer(question=question, answer="no", why=missing, fly=_HOVER)
    why = f"{hover.hover_s:.0f} s of hover, seen by {hover.found_by}"
    return Answer(question=question, answer="yes" if hover.throttle.half < 0.03 else "roughly", why=why)


def _plants(found: Found) -> Answer:
    question = "delay and effectiveness"
    known = [plant.axis for plant in found.identified]
    if len(known) == len(found.plants):
        by = joined(dict.fromkeys(plant.instrument for plant in found.plants))
        return Answer(question=question, answer="yes", why=f"all axes, by {by}")
    missing = joined([f"{plant.axis}: {plant.reason}" for plant in found.plants if not plant.identified])
    log = "" if np.isfinite(found.flight.stick).any() else found.faster("sticks and rate setpoints", 10.0)
    return Answer(question=question, answer="roughly" if known else "no", why=missing, log=log, fly=_STICKS)


def _loops(found: Found) -> Answer:
    question = "response of the loop"
    known = [loop for loop in found.loops if loop.step is not None]
    if known:
        return Answer(
            question=question,
            answer="yes" if len(known) == len(found.plants) else "roughly",
            why=joined([f"{loop.axis} up to {loop.ends_hz:.0f} Hz" for loop in known]),
        )
    if not np.isfinite(found.flight.rate_setpoint).any():
        return Answer(
            question=question, answer="no", why="rate setpoints are not logged", log=found.faster("rate setpoints")
        )
    return Answer(question=question, answer="no", why="rate setpoints move too little", fly=_STICKS)


def _gains(found: Found) -> Answer:
    gains, question = found.gains, "gains"
    lacking = {
        "autopilot": "the control law of what wrote it is not known",
        "version": "gains of this version mean something else",
        "parameters": "it states no gains",
    }
    if gains.reason:
        return Answer(question=question, answer="no", why=lacking[gains.reason])
    known = [axis.axis for axis in gains.axes if not axis.reason]
    if len(known) == len(gains.axes):
        return Answer(question=question, answer="yes", why="all axes")
    reasons = {
        "weak": "effectiveness is not identified",
        "law": "law and effectiveness do not fit each other",
        "margins": "no gains keep the margins",
        "band": "the loop would be faster than what is identified",
    }
    why = joined([f"{axis.axis}: {reasons.get(axis.reason, axis.reason)}" for axis in gains.axes if axis.reason])
    return Answer(
        question=question,
        answer="roughly" if known else "no",
        why=why,
        fly=_STICKS if any(axis.reason == "weak" for axis in gains.axes) else "",
    )


def _spectra(found: Found) -> Answer:
    flight, question = found.flight, "vibration"
    rate = max(flight.gyroscope.rate_hz, flight.gyroscope_unfiltered.rate_hz if flight.gyroscope_unfiltered else 0.0)
    if found.vibration is None or not found.vibration.spectra:
        return Answer(question=question, answer="no", why="too little flight")
    if rate >= _WHOLE_SPECTRUM_HZ:
        return Answer(question=question, answer="yes", why=f"up to {rate / 2:.0f} Hz")
    why = f"up to {rate / 2:.0f} Hz; what is faster is folded below or averaged away"
    return Answer(
        question=question,
        answer="roughly" if rate > 150.0 else "no",
        why=why,
        log=found.faster("the gyroscope", _WHOLE_SPECTRUM_HZ),
    )


def _curve(found: Found) -> Answer:
    question = "thrust curve"
    shape = None if found.hover is None else found.hover.shape
    if shape is None:
        missing = "no accelerometer" if found.flight.accelerometer is None else "throttle varies too little"
        return Answer(question=question, answer="no", why=missing, fly=_PUNCH)
    why = f"throttle from {shape.lowest:.2f} to {shape.highest:.2f}"
    return Answer(question=question, answer="yes" if shape.exponent.half < 0.3 else "roughly", why=why)


def _gusts(found: Found) -> Answer:
    question = "gusts"
    if found.gusts:
        return Answer(question=question, answer="roughly", why=joined([each.axis for each in found.gusts]))
    return Answer(
        question=question,
        answer="no",
        why="effectiveness is not identified",
        fly=_STICKS if not found.identified else "",
    )


def _with_constants(found: Found) -> Iterator[Answer]:
    """List what needs what no log holds."""
    why = "a log holds commands, not newtons: mass and arm are needed"
    then = "cpfls init LOG --mass KG --arm M, then cpfls "
    for question, command in (("inertia", "vehicle"), ("drag", "vehicle"), ("what a model misses", "gap")):
        yield Answer(question=question, answer="no", why=why, fly=then + command)


def next_steps(found: Found, answers: Sequence[Answer]) -> tuple[NextStep, ...]:
    """Choose the two or three flights and settings that answer most of what is open."""
    open_ = [each for each in answers if each.answer != "yes"]
    steps: list[NextStep] = []
    for kind in ("log", "fly"):
        wanted: dict[str, list[str]] = {}
        for each in open_:
            text = getattr(each, kind)
            if text and not text.startswith("cpfls "):
                wanted.setdefault(text, []).append(each.question)
        ranked = sorted(wanted.items(), key=lambda own: -len(own[1]))
        steps += [NextStep(what=text, why=f"answers {joined(questions)}") for text, questions in ranked[:2]]
    return tuple(steps[:_MOST_STEPS])
