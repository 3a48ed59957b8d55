"""Figures 1 to 4 of the paper: the seesaw, the path, the torques."""

from __future__ import annotations

import numpy as np

from cpfls_cli.fuzzy.inputs import seesaw
from cpfls_cli.pages.claims.claim import Verdict
from cpfls_cli.pages.claims.compared import ComparedFigure, agreement, not_shown, reading
from cpfls_cli.pages.claims.path import move_claim
from cpfls_cli.pages.printed import PRINTED_RELATIVE_ERROR, PRINTED_SEESAW
from cpfls_cli.pages.source import Sources
from cpfls_cli.pages.table_5 import SMALLEST_MAX_ERROR
from cpfls_cli.report.numbers import number


def seesaw_compared() -> ComparedFigure:
    """Compare Figure 1: the seesaw."""
    angles, printed = np.pi * np.array(list(PRINTED_SEESAW)), np.array(list(PRINTED_SEESAW.values()))
    off = float(np.max(np.abs(seesaw(angles)[0] - printed)))
    agrees = off < 1e-12
    why = (
        "A check of how the paper is read, not of any model. Equation (11) as printed has a condition that no angle "
        "meets (3π/2 < q > π/2); read as between them it is this curve."
    )
    values = ", ".join(f"{value:g} at {angle:g}π" for angle, value in PRINTED_SEESAW.items())
    return ComparedFigure("1: seesaw", values, f"largest difference {number(off, 2)}", reading(agrees), why)


def derivatives_compared(sources: Sources) -> ComparedFigure:
    """Compare Figure 2: the derivatives of the base move."""
    claim = move_claim(sources.trajectories)
    printed = "peaks 2π, 2, 1, 1, 2, 8, 64; 16 s; integral of |jerk| 8 m/s²"
    title = "2: pop to displacement"
    if claim.verdict == Verdict.NOT_MEASURED:
        return not_shown(title, printed, claim.why)
    agrees = claim.verdict == Verdict.PASS
    why = (
        "The move is defined in full, with all its numbers."
        if agrees
        else "The path is planned under other limits than P = 1 s."
    )
    return ComparedFigure(title, printed, f"largest difference {claim.ours}", agreement(agrees), why)


def attitude_compared(sources: Sources) -> ComparedFigure:
    """Compare Figure 3: roll and pitch."""
    title, printed = "3: roll and pitch", "about 55 s; no angle in the text"
    drawn = [s for s in sources.trajectories if "position" in s.artifact.data]
    if not drawn:
        return not_shown(title, printed, "Missing: a trajectory.")
    artifact = drawn[0].artifact
    time, attitude = artifact.array("time"), np.degrees(artifact.array("attitude"))
    largest = np.max(np.abs(attitude[:, :2]), axis=0)
    ours = f"{time[-1] - time[0]:.2f} s; up to {largest[0]:.1f}° and {largest[1]:.1f}°"
    why = (
        "The paper gives the moves, the yaw turn and the number of samples, but neither the number of moves nor their "
        "pauses; equation (18) is used in its physical form, as the printed one lacks a square root."
    )
    return ComparedFigure(title, printed, ours, "cannot be compared", why)


def torque_compared(sources: Sources) -> ComparedFigure:
    """Compare Figure 4: the torques."""
    least = SMALLEST_MAX_ERROR / PRINTED_RELATIVE_ERROR
    title = "4: torques"
    printed = f"more than {number(least, 2)} N m (an error of {SMALLEST_MAX_ERROR} N m is below 10 %)"
    flights = [flight for flight in sources.flights if "torque" in flight.artifact.data]
    if not flights:
        return not_shown(title, printed, "Missing: a flight.")
    largest = float(np.max(np.abs(flights[0].artifact.array("torque"))))
    agrees = largest > least
    why = (
        "Along the printed path the vehicle of Table 3 tilts little and needs little torque; where the paper's larger "
        "torques come from it does not say, so only relative errors can be compared."
    )
    return ComparedFigure(title, printed, f"up to {number(largest, 2)} N m", agreement(agrees), "" if agrees else why)
