"""What a planned flight will tell: each question, what its outcomes mean, and how sure they will be."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from cpfls_cli.artifacts.spec import rows_of
from cpfls_cli.artifacts.trajectory import QuestionGroup
from cpfls_cli.effects.effect import Effect
from cpfls_cli.pages.effects import effect_title, unit_words
from cpfls_cli.report.content import Block, Table, Text
from cpfls_cli.report.numbers import UNKNOWN, number, whole_percent

_SETTLED = 0.975
_EVEN = 0.5
_RARE = 0.001


def size_words(effect: Effect, values: Mapping[str, float]) -> str:
    """Write the numbers of an effect that are not zero."""
    units = {each.name: unit_words(each.unit) for each in effect.numbers}
    return ", ".join(f"{name} = {number(value, 3)} {units[name]}".rstrip() for name, value in values.items() if value)


def advice_words(effect: Effect, rival: Effect | None) -> str:
    """Give the flight that the catalogue advises."""
    if rival is None:
        return effect.excitation
    return effect.rivals.get(rival.name) or rival.rivals.get(effect.name) or effect.excitation


def notes_blocks(notes: Sequence[str]) -> Iterator[Block]:
    """Give what a user should know about the planning."""
    yield from (Text(note, "warning") for note in dict.fromkeys(notes))


def question_blocks(name: str, asked: QuestionGroup) -> Iterator[Block]:
    """Say what a flight will tell and how sure, beside other flights, and what to do with it."""
    worst = float(np.nanmin(np.minimum(asked.sure, np.where(np.isnan(asked.flown), 1.0, asked.flown))))
    told = " and ".join(dict.fromkeys(_pair(row["true"], row["rival"]) for row in rows_of(asked)))
    if worst >= _SETTLED:
        yield Text(
            f"This flight tells {told}: each outcome is right in {_percent(worst)} of such flights or more.", "good"
        )
    elif worst >= _EVEN:
        yield Text(
            f"This flight probably tells {told}: right in {_percent(worst)} of such flights where it is hardest.",
            "note",
        )
    else:
        yield Text(
            f"Within this room no flight was found that surely tells {told}: where it is hardest, {_percent(worst)} of "
            "such flights do. Give it a larger --box, a longer --duration, or higher trajectory.limits.",
            "warning",
        )
    yield _table(name, asked)
    yield from (Text(sentence) for sentence in dict.fromkeys(_outcomes(asked)))
    yield Text(
        "Fly it, then diagnose it together with the flights so far, the new one among those that train: cpfls gap "
        "CONFIG FLIGHT... NEW-FLIGHT --held-out FLIGHT -o FOLDER"
    )


def _percent(share: float) -> str:
    """Write a probability in per cent; what is nearly sure is not called sure."""
    return f"{100 * (1 - _RARE):g} %" if share > 1 - _RARE else whole_percent(share)


def _pair(true: str, rival: str) -> str:
    one, other = sorted((true, rival))
    return f"{effect_title(one)} from {effect_title(other)}" if one else f"whether there is {effect_title(other)}"


def _table(name: str, asked: QuestionGroup) -> Table:
    header = (
        "If it is",
        "of",
        "told from",
        "log Bayes factor",
        "named, this flight",
        "flown in closed loop",
        "a random flight",
        "the same again",
        "sure from",
    )
    rows = [
        [
            row["true"],
            row["size"],
            row["rival"] or "nothing",
            number(row["log_bayes"], 3),
            *(UNKNOWN if np.isnan(row[key]) else _percent(row[key]) for key in ("sure", "flown", "random", "again")),
            row["smallest"] or f"{number(row['least'], 2)} of it",
        ]
        for row in rows_of(asked)
    ]
    caption = (
        "What this flight tells, together with the flights that are there: expected logarithm of the Bayes factor, and "
        "the probability that the diagnosis names the effect that is there, of this flight, of the median of random "
        "flights in the same room, and of the known flights flown once more. Sure from: the size at which it is "
        f"named with {100 * _SETTLED:g} %."
    )
    return Table(name, caption, header, rows, frozenset({0, 1, 2}))


def _outcomes(asked: QuestionGroup) -> Iterator[str]:
    """Say what each outcome will mean."""
    for row in rows_of(asked):
        true, rival = row["true"], row["rival"]
        if not rival:
            least = row["smallest"] or f"{number(row['least'], 2)} of {row['size']}"
            yield f"If {true} is named, it is there; if not, it is smaller than {least}."
            continue
        chance = max(other["wrong"] for other in rows_of(asked) if {other["true"], other["rival"]} == {true, rival})
        error = f"less than {_RARE:.1%}".replace("%", " %") if chance < _RARE else f"{100 * chance:.2g} %"
        yield (
            f"If the diagnosis then names {true} alone, it is {true} and not {rival} (by chance the wrong one of the "
            f"two is named in {error} of flights). To tell by hand: {row['advice']}."
        )
    if any(asked.rival):
        yield (
            "If it is AMBIGUOUS again, the effect is smaller than the table says; if it names neither, or is "
            "UNEXPLAINED, it is neither of them alone."
        )
