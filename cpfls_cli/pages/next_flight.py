"""What a planned flight will tell: each question, what its outcomes mean, and how sure they will be."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from cpfls_cli.artifacts.spec import rows_of
from cpfls_cli.artifacts.trajectory import QuestionGroup
from cpfls_cli.effects.effect import Effect
from cpfls_cli.pages.effects import effect_title, unit_words
from cpfls_cli.report.content import Block, Folded, Table, Text
from cpfls_cli.report.numbers import UNKNOWN, number, whole_percent
from cpfls_cli.words import joined


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
    told, right = _told(asked), f"{whole_percent(worst)} of such flights"
    if asked.settled:
        yield Text(f"This flight tells {told}: it settles each in {right} or more.", "good")
    else:
        yield Text(
            f"Within this room no flight was found that settles {told}: where it is hardest, {right} do. Give it a "
            "larger --box, a longer --duration, or higher trajectory.limits.",
            "warning",
        )
    for true, (own, rivals) in asked.expected(asked.likely).items():
        after = ", ".join(
            f"{each or 'none'} {whole_percent(likely)}" for each, likely in ({true: own} | rivals).items()
        )
        yield Text(f"Expected after this flight: {after}, if it is {true}.")
    yield _table(name, asked)
    yield Folded("what each outcome will mean", list(_meaning(asked)), shown=True)


def _meaning(asked: QuestionGroup) -> Iterator[Text]:
    yield from (Text(sentence) for sentence in dict.fromkeys(_outcomes(asked)))
    yield Text(
        "Fly it, then diagnose it together with the flights so far, the new one among those that train: cpfls gap "
        "CONFIG FLIGHT... NEW-FLIGHT --held-out FLIGHT -o FOLDER"
    )


def _told(asked: QuestionGroup) -> str:
    """Say what is told from what, each pair once, and which effects are looked for."""
    pairs = [sorted(pair) for pair in zip(asked.true, asked.rival, strict=True)]
    told = [f"{effect_title(one)} from {effect_title(other)}" for one, other in pairs if one]
    sought = [effect_title(other) for one, other in pairs if not one]
    return joined([*dict.fromkeys(told), *([f"whether there is {joined(sought, 'or')}"] if sought else [])])


def _table(name: str, asked: QuestionGroup) -> Table:
    header = ("If it is", "Told from", "This flight", "As flown", "Random", "Same again")
    shares = ("sure", "flown", "random", "again")
    rows = [
        [
            row["true"],
            row["rival"] or "nothing",
            *(UNKNOWN if np.isnan(row[key]) else whole_percent(row[key]) for key in shares),
        ]
        for row in rows_of(asked)
    ]
    caption = "How this flight, with those that are there, tells what is true."
    legend = (
        "The probability that the flight settles it: that the other one is then less than a hundredth as likely. "
        "Beside it the same along the path that the autopilot of simulation.closed_loop flies, of a middling one of "
        "random flights in the same room, and of the known flights flown once more."
    )
    return Table(name, caption, header, rows, frozenset({0, 1}), legend=legend)


def _outcomes(asked: QuestionGroup) -> Iterator[str]:
    """Say what each outcome will mean."""
    rows = rows_of(asked)
    for row in rows:
        true, rival, least = row["true"], row["rival"], str(row["smallest"])
        if not least and row["size"] and not np.isnan(row["least"]):
            least = f"{number(row['least'], 2)} of that"
        taken = f"Assumed size: {row['size']}. " if row["size"] else ""
        if not rival:
            absent = f"smaller than {least}" if least else "not there"
            yield f"If the diagnosis then names {true}, it is there; if not, it is {absent}. {taken}".rstrip()
            continue
        surely = f"Settled from {least} on. " if least else ""
        yield (
            f"If the diagnosis then names {true} alone, it is {true} and not {rival}. {taken}{surely}To fly it by "
            f"hand: {row['advice']}."
        )
    if any(asked.rival):
        yield (
            "If it is AMBIGUOUS again, the effect is smaller than that; if neither is named, or it is UNEXPLAINED, it "
            "is neither of them alone."
        )
