"""Whether to fly with a model, and where: a verdict by rules, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cpfls_cli.arrays import BoolArray
from cpfls_cli.identification.findings import AXES
from cpfls_cli.identification.physics import why_unphysical
from cpfls_cli.validation.grounds import MODEL, RIGID_BODY, Grounds
from cpfls_cli.validation.reasons import AGAINST, NEITHER, Reason, numbers, reasons
from cpfls_cli.validation.region import region_in_words
from cpfls_cli.validation.steps import NOTHING_MOVES

Label = Literal["good-for-control", "good-inside-region", "not-better-than-rigid-body", "do-not-use"]


@dataclass(frozen=True)
class Verdict:
    """A verdict in words.

    Attributes
    ----------
    label : str
        ``good-for-control``, ``good-inside-region``, ``not-better-than-rigid-body`` or ``do-not-use``.
    region : str
        Attitudes that the verdict is about.
    reason : tuple of str
        One sentence each; the first is what decided.
    speaks : tuple of int
        For each reason: 1 for the model, -1 against it, 0 neither.
    """

    label: Label
    region: str
    reason: tuple[str, ...]
    speaks: tuple[int, ...]


def verdict(grounds: Grounds) -> Verdict:
    """Judge a model by rules, the first that applies.

    1. *do-not-use* where D(q) is not positive definite at an attitude that training visited: then some torque turns
       the model the wrong way, and a controller that inverts D(q) diverges.
    2. A model has to show that it is better than the rigid body, which has six parameters and holds at every
       attitude: on held-out data its error of torque, or of the body rate replayed (if replayed on held-out data), is
       lower by more than chance, and neither is higher by more than chance. Otherwise, and always if nothing was held
       out, *not-better-than-rigid-body*; or *do-not-use*, where the rigid body explains no more of the torque about
       an excited axis than a constant does (R2 of 0 or less).
    3. *do-not-use* where the held-out R2 of body torque about any axis is below `r2_min`. Instead of R2, which then
       measures noise, an axis that hardly accelerates is judged by its body rate replayed: not worse than the
       prediction that it stays what it is.
    4. *good-for-control* where the model is the same rule at every attitude, training went all round, and the samples
       determine every coefficient beyond their noise; otherwise *good-inside-region*: nothing is known outside.

    An unfinished search, wide bands, coefficients that are not determined, residuals that are not white and windows
    that were lost are told as reasons and do not decide: each of them harms a model only as far as it predicts worse,
    and that is measured.

    Parameters
    ----------
    grounds : Grounds

    Returns
    -------
    Verdict
    """
    label, decisive = _decided(grounds)
    told = (decisive, *reasons(grounds))
    return Verdict(label, _region(grounds, label), tuple(r.text for r in told), tuple(r.speaks for r in told))


def good_axes(grounds: Grounds, predictor: str) -> BoolArray:
    """Tell about which body axes a predictor is good enough for control, by rule 3 of `verdict`.

    Parameters
    ----------
    grounds : Grounds
    predictor : str
        `MODEL` or `RIGID_BODY`.

    Returns
    -------
    array of bool, shape (3,)
    """
    r2 = grounds.r2(predictor)
    not_worse = grounds.rate_error(predictor) <= grounds.rate_error(NOTHING_MOVES)
    return np.asarray((r2 >= grounds.r2_min) | ((grounds.hardly_excited | np.isnan(r2)) & not_worse))


def _decided(grounds: Grounds) -> tuple[Label, Reason]:
    if grounds.impossible:
        return "do-not-use", Reason(_no_body(grounds), AGAINST)
    if not _better(grounds):
        return _beside_rigid_body(grounds)
    r2, asked = numbers(grounds.r2(MODEL)), f"{grounds.r2_min:g} is asked for"
    if not np.all(good_axes(grounds, MODEL)):
        text = f"better than the rigid body, but not good enough for control: R2 of held-out body torque {r2}; {asked}"
        return "do-not-use", Reason(text, AGAINST)
    text = f"better than the rigid body on held-out data, and good enough for control: R2 of body torque {r2}; {asked}"
    return "good-for-control" if grounds.everywhere else "good-inside-region", Reason(text, 1)


def _better(grounds: Grounds) -> bool:
    if grounds.torque is None:
        return False
    compared = [grounds.torque]
    if grounds.steps.part in grounds.held_out:
        compared.append(grounds.steps_beside(RIGID_BODY))
    return any(one.lower for one in compared) and not any(one.higher for one in compared)


def _beside_rigid_body(grounds: Grounds) -> tuple[Label, Reason]:
    r2 = grounds.r2(RIGID_BODY)
    explains = f"R2 of body torque {numbers(r2)}"
    why = why_unphysical(grounds.identification.rigid_body)
    if np.any((r2 <= 0) & ~grounds.hardly_excited):
        text = f"neither the model nor the rigid body explains more of the torque than a constant does: {explains}"
        return "do-not-use", Reason(text, AGAINST)
    if not grounds.held_out:
        text = "nothing was held out, so nothing shows that the model is better than the rigid body, which is simpler"
        return "not-better-than-rigid-body", Reason(f"{text} (rigid body in training: {explains})", AGAINST)
    use = "use the rigid body: it is simpler, and the model is not better by more than chance on held-out data"
    if why is not None:
        return "not-better-than-rigid-body", Reason(f"{use}; yet the rigid body {why}", AGAINST)
    good = good_axes(grounds, RIGID_BODY)
    if np.all(good):
        return "not-better-than-rigid-body", Reason(f"{use}; it is itself good for control ({explains})", NEITHER)
    bad = ", ".join(np.array(AXES)[~good])
    text = f"{use}; yet about {bad} it is not good enough for control ({explains}; {grounds.r2_min:g} is asked for)"
    return "not-better-than-rigid-body", Reason(text, AGAINST)


def _no_body(grounds: Grounds) -> str:
    physics, found = grounds.physics, grounds.identification
    if physics.indefinite:
        where = " and ".join(f"{angle:.0f}" for angle in np.degrees(physics.worst_attitude))
        at = f"in {physics.indefinite} of {physics.cells} cells of attitude that training visited, worst at roll and "
        at += f"pitch of {where} degrees"
    else:
        at = f"at {found.indefinite} of {next(iter(found.samples.values()))} training samples"
    text = f"D(q) is not positive definite {at}: no body turns like that"
    if grounds.held_out and np.all(good_axes(grounds, RIGID_BODY)) and why_unphysical(found.rigid_body) is None:
        text += f"; the rigid body is good for control (R2 of body torque {numbers(grounds.r2(RIGID_BODY))})"
    return text


def _region(grounds: Grounds, label: Label) -> str:
    visited = region_in_words(grounds.identification.model.visited)
    return "every roll and pitch" if label == "good-for-control" else visited
