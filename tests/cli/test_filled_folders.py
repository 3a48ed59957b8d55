"""A stage that fills a folder with one answer: files of its parts, a page, JSON, and what runs keep."""

import json
import sys
from pathlib import Path
from typing import ClassVar

import pytest

from cpfls_cli.artifacts.job import input_file
from cpfls_cli.config.load import validate
from cpfls_cli.errors import InputError
from cpfls_cli.report.content import Box, Text
from cpfls_cli.result import about, part, result
from cpfls_cli.stage import Filled, Run, stage
from cpfls_cli.store import read, stage_of


@result
class Thing:
    """A part of an answer."""

    FORMAT: ClassVar = "cpfls/thing"

    name: str = about("of it")


@result
class Pair:
    """An answer of two parts, the second of which may be missing."""

    first: Thing = part()
    second: Thing | None = part(default=None)


@stage(
    Pair,
    fills=Filled(
        {"first": ("look", ""), "second": ("reduce", "first")},
        {"names.txt": lambda r: r.first.name},
        kept="kept",
        grows=True,
    ),
)
def pair(run, log, *, both=True):
    """Give two things."""
    run.take({"log": log}, "first")
    run.also["new"] = 1
    run.last_words = "; one is new"
    return Pair(first=Thing(name="a"), second=Thing(name="b") if both else None)


@pytest.fixture
def filled(tmp_path, monkeypatch):
    """Run the stage, with a report that names its files."""
    (tmp_path / "templates").mkdir()
    (tmp_path / "templates" / "look.md.j2").write_text(
        "# ALL GOOD: of {{ r.first.name }} {good}\n\nAnd more.\n\n- one\n"
    )
    monkeypatch.setattr(sys.modules[__name__], "__file__", str(tmp_path / "stages" / "look.py"))
    monkeypatch.setattr(
        "cpfls_cli.stages.report.page_about",
        lambda _, paths: " ".join(path.name for path in paths),
    )
    log = tmp_path / "log.csv"
    log.write_text("1")

    def fill(output=tmp_path / "out", log=log, **given):
        run = Run(validate({}, "default"), output, False, False, lambda *_: None, lambda _: None)
        return pair.run(run, log=log, **given)

    monkeypatch.setattr(type(pair), "name", "look")
    return fill


def test_each_part_has_a_file_that_names_the_one_before(filled, tmp_path):
    outcome = filled()
    out = tmp_path / "out"
    assert {own.name for own in out.iterdir()} == {"first.h5", "second.h5", "report.html", "look.json", "names.txt"}
    assert (stage_of(out / "first.h5"), stage_of(out / "second.h5")) == ("look", "reduce")
    assert read(out / "second.h5", Thing)[1].inputs == {"first": input_file(out / "first.h5")}
    assert list(read(out / "first.h5", Thing)[1].inputs) == ["log"]
    assert (out / "report.html").read_text() == "first.h5 second.h5"
    assert (out / "names.txt").read_text() == "a"
    told = json.loads((out / "look.json").read_text())
    assert outcome.summary == {**told, "new": 1}
    assert outcome.blocks == (
        Box("ALL GOOD", "of a", ("And more.", "- one"), "good"),
        Text(f"{out / 'report.html'}: all of it, with figures; one is new"),
    )


def test_a_folder_that_it_filled_is_filled_again_and_what_is_gone_goes(filled, tmp_path):
    (tmp_path / "out" / "kept").mkdir(parents=True)
    (tmp_path / "out" / "kept" / "a").write_text("")
    filled()
    filled(both=False)
    assert {own.name for own in (tmp_path / "out").iterdir()} == {
        "first.h5",
        "kept",
        "look.json",
        "names.txt",
        "report.html",
    }


def test_what_it_must_not_replace_is_refused_before_anything_is_computed(filled, tmp_path):
    own: Path = tmp_path / "mine" / "names.txt"
    own.parent.mkdir()
    own.write_text("mine")
    with pytest.raises(InputError, match="is not empty"):
        filled(tmp_path / "mine")
    filled()
    with pytest.raises(InputError, match="is an input of this command"):
        filled(log=tmp_path / "out" / "names.txt")
