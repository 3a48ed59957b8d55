"""Which models were judged on the same data: only those can be ranked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cpfls_cli.pages.judged import TRAINING, judged
from cpfls_cli.pages.source import Source


@dataclass(frozen=True)
class JudgedOn:
    """One part of the data, and the models that were judged on it.

    Attributes
    ----------
    names : tuple of str
        What each model calls it.
    hashes : tuple of str
        Of the flights that it is taken from.
    """

    names: tuple[str, ...]
    hashes: tuple[str, ...]
    models: tuple[Source, ...]

    @property
    def title(self) -> str:
        """What it is called, with the flights of a part whose name says nothing of them."""
        return " or ".join(dict.fromkeys(self.names))


def judged_on(models: Sequence[Source]) -> list[JudgedOn]:
    """Group what models were judged on by the data themselves, not by their names.

    Returns
    -------
    list of JudgedOn
        In the order of first appearance.
    """
    groups: dict[tuple[str, ...], JudgedOn] = {}
    for model in models:
        for name, identity, hashes in _parts(model):
            known = groups.get(identity, JudgedOn((), hashes, ()))
            groups[identity] = JudgedOn((*known.names, name), hashes, (*known.models, model))
    return list(groups.values())


def _parts(model: Source) -> list[tuple[str, tuple[str, ...], tuple[str, ...]]]:
    """Name each part, what tells it from all others, and the flights that it is taken from."""
    inputs = model.artifact.header.inputs
    learned = tuple(file.sha256 for role, file in inputs.items() if role.split("-")[0] == "flight")
    others = sorted((role for role in inputs if role.startswith("validate-")), key=lambda role: int(role.split("-")[1]))
    settings = model.config["identification"]
    split = (f"{settings['training_share']:g}", f"{settings['embargo_s']:g}")
    names = judged(model).parts
    own = [(name, (name, *learned, *split), learned) for name in names[: len(names) - len(others)]]
    hashes = [(inputs[role].sha256,) for role in others]
    return own + [(name, (sha256[0],), sha256) for name, sha256 in zip(names[len(own) :], hashes, strict=True)]


def learned_only(part: JudgedOn) -> bool:
    """Tell whether models learned from this part: errors there are no prediction."""
    return set(part.names) == {TRAINING}
