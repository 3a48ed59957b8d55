"""A diagnosis as datasets."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.audit_file import audit_data
from cpfls_cli.artifacts.effects_file import effects_data
from cpfls_cli.artifacts.tables import table, texts
from cpfls_cli.flights.split import Split
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.before_after import BeforeAfter
from cpfls_cli.gap.diagnose import DiagnosisRun
from cpfls_cli.gap.extended import ExtendedModel
from cpfls_cli.gap.naming.results import Diagnosis, GapSize
from cpfls_cli.gap.replay import Replayed


def diagnosis_data(found: DiagnosisRun, shown: BeforeAfter, model: ExtendedModel, split: Split) -> dict[str, Any]:
    """Arrange a diagnosis as datasets."""
    diagnosis = found.diagnosis
    effects = diagnosis.effects or diagnosis.closest
    return {
        "verdict": np.array(str(diagnosis.verdict)),
        "share": diagnosis.share,
        "split": np.array(split.sentence),
        **effects_data(effects, bool(diagnosis.effects), diagnosis.parameters, model.parameters),
        **_lists(diagnosis),
        **shrunk_data(diagnosis.before, diagnosis.after, diagnosis.floor),
        **replay_data(shown.before, shown.after, shown.held),
        **_residual(found, shown),
        **_whiteness(shown),
        **_picture(shown, split),
        **_run(shown, split),
        **table("not_excited", [vars(each) for each in diagnosis.not_excited], ("name", "reason"), ()),
        **audit_data(found.audit),
        "note": texts(diagnosis.notes),
    }


def shrunk_data(before: GapSize, after: GapSize, floor: Array) -> dict[str, Any]:
    """Arrange gaps before and after as datasets.

    Parameters
    ----------
    floor : array, shape (6,), N m and N
    """
    return {
        "gap/channel": np.array(CHANNELS),
        "gap/before": before.value,
        "gap/after": after.value,
        "gap/floor": np.where(np.isfinite(before.value), floor, np.nan),
        "gap/before_floors": before.floors,
        "gap/after_floors": after.floors,
    }


def replay_data(before: Replayed, after: Replayed, held: Replayed) -> dict[str, Any]:
    """Arrange replays before and after as datasets."""
    data: dict[str, Any] = {
        "replay/horizon": np.arange(1, len(held.horizon_s) + 1),
        "replay/horizon_s": held.horizon_s,
    }
    for name, replayed in (("before", before), ("after", after), ("held", held)):
        data |= {f"replay/rate_{name}": replayed.rate, f"replay/attitude_{name}": replayed.attitude}
    return data


def _lists(diagnosis: Diagnosis) -> dict[str, Any]:
    rivals = [vars(each) for each in diagnosis.alternatives]
    unexplained = [
        {
            **vars(each),
            "signal": each.signal or "",
            "frequency": np.nan if each.frequency_hz is None else each.frequency_hz,
        }
        for each in diagnosis.unexplained
    ]
    alone = [{"name": name, "share": share} for name, share in diagnosis.torque_alone]
    return {
        **table("alternative", rivals, ("name", "instead_of", "separated_by"), ("relative_gain",)),
        **table("unexplained", unexplained, ("axis", "signal", "energy"), ("floors", "share", "frequency")),
        **table("torque_alone", alone, ("name",), ("share",)),
    }


def _residual(found: DiagnosisRun, shown: BeforeAfter) -> dict[str, Any]:
    unseen = found.held_out
    parts = {"before": unseen.before, "parameters": unseen.parameters, "after": unseen.after}
    rows = {f"residual/{name}": np.where(unseen.known, rows, np.nan) for name, rows in parts.items()}
    return {"residual/time": shown.centres, "residual/flight": shown.flight_index, **rows}


def _whiteness(shown: BeforeAfter) -> dict[str, Any]:
    lags = len(shown.white_before.autocorrelation)
    return {
        "whiteness/lag": shown.lag_s * np.arange(1, lags + 1),
        "whiteness/before": shown.white_before.autocorrelation,
        "whiteness/after": shown.white_after.autocorrelation,
        "whiteness/p_value_before": shown.white_before.p_value,
        "whiteness/p_value_after": shown.white_after.p_value,
    }


def _picture(shown: BeforeAfter, split: Split) -> dict[str, Any]:
    picture = shown.picture
    series = {name: getattr(picture, name) for name in ("time", "measured", "before", "after")}
    return {
        "picture/flight": np.array(split.held_out[picture.flight].name),
        "picture/channel": np.array(picture.channel),
        **{f"picture/{name}": values for name, values in series.items()},
    }


def _run(shown: BeforeAfter, split: Split) -> dict[str, Any]:
    run = shown.run
    return {
        "run/flight": np.array(split.held_out[shown.run_flight].name),
        "run/axis": run.axis,
        "run/time": run.time,
        "run/restart": run.restarts,
        **{f"run/{name}": getattr(run, name) for name in ("measured", "before", "after")},
    }
