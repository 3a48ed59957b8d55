"""How far to trust a model, in words: whether it has seen a flight that it is judged on."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence

from cpfls_cli.artifacts.learned import LearnedFlight, part_learned
from cpfls_cli.artifacts.model import ModelRecord

KnownBy = Iterable[tuple[str, Collection[str]]]
"""Flights by file name, each with the hashes of its file and of its log."""

NOT_SEEN = "a flight that it did not learn from"


def seen_words(model: ModelRecord, hashes: Collection[str]) -> str:
    """Say what part of a flight a model learned from, or that it did not.

    Parameters
    ----------
    hashes : collection of str
        SHA-256 of the flight, and of the log that it was imported from where that is known.
    """
    learned = model.learned_from
    flight = part_learned(learned, hashes)
    if flight is None:
        chosen_on = (file.sha256 for role, file in model.origin.inputs.items() if role.startswith("choose-on"))
        return "a flight that it was chosen on" if any(sha256 in hashes for sha256 in chosen_on) else NOT_SEEN
    which = "the flight" if len(learned) == 1 else "one of the flights"
    part = "" if flight.whole else f" ({_part(flight)}; the rest was held out)"
    return f"{which} that it learned from{part}"


def seen_warnings(model: str, learned: Sequence[LearnedFlight], judged: KnownBy) -> Iterator[str]:
    """Warn of flights that judge a model and that it has learned from.

    Parameters
    ----------
    model : str
        What it is called.
    judged : iterable of (str, collection of str)
        File name and hashes, as for `seen_words`, of each flight.
    """
    for name, hashes in judged:
        flight = part_learned(learned, hashes)
        if flight is not None:
            what, it = ("it", "it") if flight.whole else (_part(flight), "that")
            yield f"{name}: {model} has learned from {what}, so {it} shows nothing of flights not seen"


def _part(flight: LearnedFlight) -> str:
    return f"its first {flight.samples} of {flight.of} samples"
