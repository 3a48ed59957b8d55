"""The verdict on a model, by rules: whether to control with it, at which attitudes, and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import BoolArray
from cpfls_cli.consistency.findings import as_contradiction
from cpfls_cli.dynamics.rigid_body import why_unphysical
from cpfls_cli.identification.findings import AXES, loop_in_words
from cpfls_cli.playback.loop import LoopBounds
from cpfls_cli.result import about, part
from cpfls_cli.validation.evidence import MODEL, RIGID_BODY, Evidence
from cpfls_cli.validation.reasons import AGAINST, DEFINITE_SHARE, FOR, NEITHER, Reason, numbers, reasons
from cpfls_cli.validation.trust import Trust, capped


@dataclass(frozen=True, eq=False)
class Verdict:
    """How far to trust a model, and why; what decided comes first."""

    label: str = about("good-for-control, good-inside-region, shows-the-loop, not-better-than-rigid-body, do-not-use")
    region: str = about("region of attitudes that the verdict is about, in words")
    reasons: tuple[Reason, ...] = part()


def verdict(evidence: Evidence) -> Verdict:
    """Judge a model by the first rule that applies.

    1. *do-not-use* where D(q) is not positive definite at an attitude that training visited: then some torque turns
       the model the wrong way, and a controller that inverts D(q) diverges.
    2. A model has to show that it is better than the rigid body, which has six parameters and holds at every
       attitude: in one held-out part at least its error of torque, or of the body rate replayed, is lower by more than
       chance, and neither is higher by more than chance in any. Both are compared with the constant torque that they
       miss in training, which is not inertia's, and which a fuzzy part can imitate and a rigid body cannot. Otherwise,
       and always if nothing was held out, *not-better-than-rigid-body*; or *do-not-use*, where the rigid body is no
       body, or explains no more of the torque about an excited axis than a constant does (R2 of 0 or less).
    3. *do-not-use* where the model loses more than one in twenty windows of a held-out part; where less than 97.5 % of
       the bootstrap draws of D(q) are positive definite at all attitudes visited that are 17 degrees from a vertical
       pitch; or where the held-out R2 of body torque about any axis is below `r2_min` in any part, or its body rate,
       replayed, is farther off than if nothing moved: R2 of torque alone is no evidence of prediction. Instead of R2,
       which then measures noise, an axis that hardly accelerates is judged by its body rate replayed: better by more
       than chance, in every part, than the prediction that it stays what it is.
    4. *good-for-control* where the model is the same rule at every attitude, training went all round, the samples
       determine every coefficient beyond their noise, D(q) is positive definite at every roll and pitch, and R2
       confirms every axis; otherwise *good-inside-region*: nothing is known outside.

    An unfinished search, wide bands, residuals that are not white and a few windows that were lost are reported as
    reasons and do not decide: each of them harms a model only as far as it predicts worse, and that is measured.
    """
    label, decisive = _decided(evidence)
    listed = (decisive, *reasons(evidence))
    everywhere = label == "good-for-control"
    region = "every roll and pitch" if everywhere else region_in_words(evidence.identification.model.visited)
    return Verdict(label, region, listed)


def contradicted(found: Verdict, contradictions: Sequence[str]) -> Verdict:
    """Take back the verdict on a model whose flights contradict themselves: it repeats what is wrong with them.

    Parameters
    ----------
    contradictions : sequence of str
        Sentences on the flights; nothing is taken back where there are none.
    """
    if not contradictions:
        return found
    wrong = tuple(as_contradiction(each) for each in contradictions)
    against = (Reason(each, AGAINST) for each in wrong)
    return replace(found, label=capped(Trust(found.label), wrong), reasons=(*against, *found.reasons))


def beside_loop(found: Verdict, loop: LoopBounds | None, *, by_past: bool = False) -> Verdict:
    """Take back a good verdict on a model whose flights show the loop, unless the past identifies it.

    `loop` is None where something from outside separates the vehicle from its autopilot.
    """
    if loop is None or not loop.shows_loop:
        return found
    label = capped(Trust(found.label), (), loop=True)
    # What decided stays first.
    first = 0 if label is Trust.LOOP else 1
    against = Reason(loop_in_words(loop, by_past=by_past), AGAINST)
    return replace(found, label=label, reasons=(*found.reasons[:first], against, *found.reasons[first:]))


def good_axes(evidence: Evidence, predictor: str) -> BoolArray:
    """Flag the body axes about which a predictor is good enough for control, by rule 3 of `verdict`; shape (3,)."""
    unexcited = evidence.hardly_excited | np.isnan(evidence.r2(predictor))
    return confirmed_axes(evidence, predictor) | (unexcited & evidence.beats_nothing_moves(predictor))


def confirmed_axes(evidence: Evidence, predictor: str) -> BoolArray:
    """Flag the body axes, shape (3,), whose held-out R2 of torque is at least `r2_min` and not denied by playback."""
    return np.asarray((evidence.r2(predictor) >= evidence.r2_min) & evidence.predicts(predictor))


def _decided(evidence: Evidence) -> tuple[Trust, Reason]:
    if evidence.impossible:
        return Trust.DO_NOT_USE, Reason(_no_body(evidence), AGAINST)
    if not _better(evidence):
        return _beside_rigid_body(evidence)
    why = _not_good_enough(evidence)
    if why is not None:
        return Trust.DO_NOT_USE, Reason(f"better than the rigid body, but {why}", AGAINST)
    confirmed = bool(np.all(confirmed_axes(evidence, MODEL)))
    label = Trust.CONTROL if evidence.everywhere and confirmed else Trust.INSIDE
    text = "better than the rigid body on held-out data, and good enough for control"
    return label, Reason(f"{text}: {_r2_in_words(evidence, MODEL)}", FOR)


def _better(evidence: Evidence) -> bool:
    replayed = [evidence.replay_beside(part, MODEL, RIGID_BODY) for part in evidence.held_out]
    compared = [*evidence.torque.values(), *replayed]
    return any(one.lower for one in compared) and not any(one.higher for one in compared)


def _not_good_enough(evidence: Evidence) -> str | None:
    """Explain why a model that is better than the rigid body is not to be used; None where it is."""
    if evidence.loses_many:
        return f"{evidence.lost(MODEL)} of {evidence.windows} replayed windows do not run to the end"
    if evidence.definite is not None and evidence.definite < DEFINITE_SHARE:
        share = f"only {100 * evidence.definite:.3g} % of the bootstrap draws"
        return (
            f"{share} have a D(q) that is positive definite wherever training was; {100 * DEFINITE_SHARE:g} % are "
            "required"
        )
    if np.all(good_axes(evidence, MODEL)) and np.any(confirmed_axes(evidence, MODEL)):
        return None
    r2 = numbers(evidence.r2(MODEL))
    denied = (evidence.r2(MODEL) >= evidence.r2_min) & ~evidence.predicts(MODEL)
    if np.any(denied):
        return f"its replayed body rate about {_names(denied)} is farther off than if nothing moved (R2 of torque {r2})"
    return f"not good enough for control: R2 of held-out body torque {r2}; {evidence.r2_min:g} is required"


def _r2_in_words(evidence: Evidence, predictor: str) -> str:
    """Format the R2 of the axes that it confirms, and name those that nothing confirms."""
    confirmed, r2 = confirmed_axes(evidence, predictor), evidence.r2(predictor)
    text = f"R2 of body torque {numbers(r2, confirmed)}; {evidence.r2_min:g} is required"
    return text if np.all(confirmed) else f"{text}; nothing confirms it about {_names(~confirmed)}"


def _beside_rigid_body(evidence: Evidence) -> tuple[Trust, Reason]:
    r2 = evidence.r2(RIGID_BODY)
    explains = f"R2 of body torque {numbers(r2)}"
    why = why_unphysical(evidence.identification.rigid_body)
    if np.any((r2 <= 0) & ~evidence.hardly_excited):
        text = f"neither the model nor the rigid body explains more of the torque than a constant does: {explains}"
        return Trust.DO_NOT_USE, Reason(text, AGAINST)
    if why is not None:
        return Trust.DO_NOT_USE, Reason(
            f"the model is not shown to be better than the rigid body, and that {why}", AGAINST
        )
    if not evidence.held_out:
        text = "nothing was held out, so nothing shows that the model is better than the rigid body, which is simpler"
        return Trust.RIGID_BODY, Reason(f"{text} (rigid body in training: {explains})", AGAINST)
    return Trust.RIGID_BODY, _rigid_body_instead(evidence)


def _rigid_body_instead(evidence: Evidence) -> Reason:
    """Explain whether the rigid body is to be used in place of a model that is not better."""
    bad = ~good_axes(evidence, RIGID_BODY)
    if not np.any(bad):
        use = "use the rigid body: it is simpler, and the model is not better by more than chance on held-out data"
        return Reason(f"{use}; it is itself good for control ({_r2_in_words(evidence, RIGID_BODY)})", NEITHER)
    neither = bad & ~good_axes(evidence, MODEL)
    who, where = ("neither is", neither) if np.any(neither) else ("the latter is not", bad)
    text = f"the model is not better than the rigid body by more than chance, and {who} "
    explains = f"rigid body: R2 of body torque {numbers(evidence.r2(RIGID_BODY))}; {evidence.r2_min:g} is required"
    return Reason(f"{text}good enough for control about {_names(where)} ({explains})", AGAINST)


def _names(axes: BoolArray) -> str:
    return ", ".join(np.array(AXES)[axes])


def _no_body(evidence: Evidence) -> str:
    physics, result = evidence.physics, evidence.identification
    if physics.indefinite:
        where = " and ".join(f"{angle:.0f}" for angle in np.degrees(physics.worst_attitude))
        at = f"in {physics.indefinite} of {physics.cells} cells of attitude that training visited, worst at roll and "
        at += f"pitch of {where} degrees"
    else:
        at = f"at {result.indefinite} of {next(iter(result.samples.values()))} training samples"
    text = f"D(q) is not positive definite {at}: no body turns like that"
    if evidence.held_out and np.all(confirmed_axes(evidence, RIGID_BODY)) and why_unphysical(result.rigid_body) is None:
        text += f"; the rigid body is good for control (R2 of body torque {numbers(evidence.r2(RIGID_BODY))})"
    return text


def region_in_words(visited: BoolArray) -> str:
    """Describe the attitudes that training visited: the shortest ranges that hold all visited cells, and their share.

    Roll is along the first axis of the cells, from -180 degrees.
    """
    roll, pitch = (_range(np.asarray(visited.any(axis=other))) for other in (1, 0))
    return f"roll {roll}, pitch {pitch} ({100 * np.mean(visited):.3g} % of all roll and pitch)"


def _range(marked: BoolArray) -> str:
    """Describe the shortest arc that holds all marked cells of a circle."""
    cells, index = len(marked), np.flatnonzero(marked)
    if len(index) == cells:
        return "all round"
    if len(index) == 0:
        return "nowhere"
    # The arc ends where the longest pause begins, and starts behind it.
    pauses = np.diff(np.append(index, index[0] + cells))
    longest = int(np.argmax(pauses))
    start = int(index[(longest + 1) % len(index)])
    end = start + cells - int(pauses[longest]) + 1
    return f"{_degrees(start, cells)} to {_degrees(end, cells)} degrees"


def _degrees(edge: int, cells: int) -> str:
    return f"{360 * edge / cells - 180:g}"
