"""A name of what is late, which instruments do not tell from the loop, stands where gusts do not explain it."""

from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.gap import diagnose


def named(*effects):
    chosen = [SimpleNamespace(effect=SimpleNamespace(name=name)) for name in effects]
    return SimpleNamespace(judgement=SimpleNamespace(found=SimpleNamespace(hypothesis=SimpleNamespace(chosen=chosen))))


def air(channels):
    return SimpleNamespace(told=np.arange(6) < channels)


@pytest.mark.parametrize(
    ("without", "beside", "kept"),
    [(0, 6, True), (6, 6, False), (0, 3, True), (2, 3, False), (0, 0, False)],
    ids=["without it no gusts", "gusts explain it", "fewer beside it", "fewer either way", "no gusts beside it either"],
)
def test_a_late_name_stands_only_where_without_it_what_is_left_is_no_gusts(without, beside, kept, monkeypatch):
    late = named("command_delay", "com_offset")
    monkeypatch.setattr(diagnose, "_by_instruments", lambda before, *_, late: before if late else named("com_offset"))
    monkeypatch.setattr(
        diagnose,
        "_gusts",
        lambda given, *_: air(beside if len(given.judgement.found.hypothesis.chosen) > 1 else without),
    )
    found, gusts = diagnose._beside_gusts(late, None, 6, None, np.random.default_rng(0))
    assert (found is late) is kept
    assert gusts.told.sum() == (beside if kept else without)
