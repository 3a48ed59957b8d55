"""A stage is a file and a template; one that fills a folder writes files, page and JSON."""

import importlib
import json
import sys
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
import typer

import cpfls_cli.stages
from cpfls_cli.artifacts.job import input_file
from cpfls_cli.cli.stages import AllCommands, stage_commands
from cpfls_cli.config.load import validate
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.report.content import Box, Text
from cpfls_cli.result import about, part, result
from cpfls_cli.stage import Filled, Run, stage, unique_names
from cpfls_cli.store import read, stage_of
from tests.builders.studies import TINY, VEHICLE, put_file
from tests.builders.unknown_logs import flat_log, flight, write_csv

STAGE = '''\
"""Weigh a craft.

More of it.
"""

from pathlib import Path
from typing import Annotated, ClassVar

import typer

from cpfls_cli.errors import ComputationError
from cpfls_cli.result import about, result
from cpfls_cli.stage import stage


@result
class Weighed:
    """What a craft weighs."""

    FORMAT: ClassVar = "cpfls/weigh-it"

    mass: float = about("of the craft", unit="kg")
    seed: int = about("that the config has", default=0)


@stage(Weighed, figures={"scale": lambda r: f"<svg><title>{r.mass}</title></svg>"}, study=STUDY)
def weigh(
    run,
    craft: Annotated[Path, typer.Argument(metavar="CRAFT")],
    factor: Annotated[float, typer.Option("--factor", help="Times as much.")] = 1.0,
) -> Weighed | None:
    """Weigh."""
    run.take({"craft": craft})
    if run.dry_run:
        return None
    words = craft.read_text().split()
    if not words:
        raise ComputationError(f"{craft}: weighs nothing")
    run.progress(1, 1)
    run.caution("a rough scale")
    run.next.append(("cpfls", "info", run.output))
    return Weighed(mass=factor * float(words[0]), seed=run.study.seed if run.study else 0)
'''
TEMPLATE = """\
# It weighs {{ r.mass | number(2) }} kg {good}
![A scale](scale)
::: More
Seed {{ r.seed }}.
:::
"""


@pytest.fixture(params=[False, True], ids=["alone", "with a study"])
def house(request, tmp_path, monkeypatch):
    """A folder with a stage and its template, and the commands of it."""
    stages, templates = tmp_path / "house" / "stages", tmp_path / "house" / "templates"
    stages.mkdir(parents=True)
    templates.mkdir()
    (stages / "weigh_it.py").write_text(STAGE.replace("STUDY", str(request.param)))
    (templates / "weigh_it.md.j2").write_text(TEMPLATE)
    (tmp_path / "craft.txt").write_text("1.25")
    (tmp_path / "study.yaml").write_text(TINY + VEHICLE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cpfls_cli.stages, "__path__", [str(stages)])
    importlib.invalidate_caches()
    yield stages, ["study.yaml"] if request.param else []
    importlib.sys.modules.pop("cpfls_cli.stages.weigh_it", None)


def called(house, capsys, *words):
    """Run the command; give its exit code and what it printed."""
    stages, config = house
    command = stage_commands(stages)["weigh-it"]
    try:
        command.main([*config, *map(str, words)], prog_name="cpfls weigh-it", standalone_mode=True)
    except SystemExit as end:
        code = end.code
    said = capsys.readouterr()
    return code or 0, said.out, said.err


def test_it_is_listed_without_being_loaded(house):
    command = stage_commands(house[0])["weigh-it"]
    assert command.get_short_help_str() == "Weigh a craft."
    assert "cpfls_cli.stages.weigh_it" not in importlib.sys.modules
    assert {"craft", "factor", "output", "as_json", "dry_run"} <= {own.name for own in command.params}
    assert "cpfls_cli.stages.weigh_it" not in importlib.sys.modules


def test_it_computes_writes_and_answers(house, capsys, tmp_path):
    code, out, err = called(house, capsys, "craft.txt", "-o", "w.h5", "--factor", "2")
    assert code == 0, err
    assert out.splitlines() == ["It weighs 2.5 kg", "next:", "  cpfls info w.h5", "more with -v: More"]
    assert err == "cpfls: note: a rough scale\n"
    first = (tmp_path / "w.h5").read_bytes()
    code, out, _ = called(house, capsys, "craft.txt", "-o", "w.h5", "--factor", "2", "--force", "--json")
    answer = json.loads(out)
    assert (answer["mass"], answer["cautions"]) == (2.5, ["a rough scale"])
    assert (tmp_path / "w.h5").read_bytes() == first


def test_common_options(house, capsys, tmp_path):
    assert "Seed" in called(house, capsys, "craft.txt", "-o", "w.h5", "-v")[1]
    code, _, err = called(house, capsys, "craft.txt", "-o", "w.h5")
    assert (code, err) == (2, "cpfls: error: w.h5: exists already; --force replaces it\n")
    assert called(house, capsys, "craft.txt", "-o", "w.h5", "--force", "-q") == (0, "", "")
    code, out, _ = called(house, capsys, "craft.txt", "-o", "x.h5", "--dry-run")
    config = "the config and " if house[1] else ""
    assert (code, out) == (0, f"x.h5: would be written; {config}all inputs are good\n")
    assert not (tmp_path / "x.h5").exists()
    code, _, err = called(house, capsys, "craft.txt", "-o", "x.h5", "--set", "seed=9")
    assert code == (0 if house[1] else 2)
    assert ("this command reads no config" in err) != bool(house[1])


def test_what_a_user_can_cause_ends_in_one_sentence(house, capsys, tmp_path):
    (tmp_path / "empty.txt").write_text("")
    assert called(house, capsys, "empty.txt", "-o", "x.h5")[::2] == (1, "cpfls: error: empty.txt: weighs nothing\n")
    assert called(house, capsys, "none.txt", "-o", "x.h5")[::2] == (2, "cpfls: error: none.txt: no such file\n")
    assert called(house, capsys, "craft.txt", "-o", "craft.txt", "--force")[0] == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["craft.txt", "empty.txt", "house", "study.yaml"]


def test_look_stands_first_and_help_loads_no_stage(cpfls):
    commands = typer.main.get_command(importlib.import_module("cpfls_cli.cli.stages").app)
    assert isinstance(commands, AllCommands)
    assert next(iter(commands.commands)) == "look"
    assert "\nCommands:\n  look  " in cpfls("--help").stdout


@result
class Named:
    """A thing."""

    FORMAT: ClassVar = "cpfls/look"

    name: str = about("of it")
    system: str = about("that wrote it", default="")


@stage(Named, folder=True)
def several(run, names):
    """Give a thing for each name."""
    run.progress(0, len(names))
    return {name: Named(name=None if name == "nothing" else name) for name in names}


@pytest.fixture
def at_home(monkeypatch, tmp_path):
    """Templates of the stage above."""
    folder = tmp_path / "templates"
    folder.mkdir()
    (folder / "look.md.j2").write_text("# A {{ r.name }}\n")
    (folder / "look_index.md.j2").write_text(
        "# {{ r | length | plural('thing') }}\n"
        "{% for name in r %}\n- [{{ name }}]({{ name | address }})\n{% endfor %}\n"
    )
    monkeypatch.setattr(sys.modules[__name__], "__file__", str(tmp_path / "stages" / "look.py"))


def run_to(output=None):
    """Make a run of a stage without a config."""
    return Run(
        validate({}, "default"),
        output or Path("look"),
        force=False,
        dry_run=False,
        progress=lambda *_: None,
        reads=lambda _: None,
        writes=output is not None,
        with_config=False,
    )


@pytest.mark.usefixtures("at_home")
def test_several_results_have_a_page_each_and_an_index(tmp_path):
    run = run_to(tmp_path / "out")
    run.caution("all")
    run.caution("of b", "b")
    outcome = several.run(run, names=["a", "b"])
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "a.h5",
        "a.html",
        "b.h5",
        "b.html",
        "index.html",
    ]
    assert "<h1>2 things</h1>" in (tmp_path / "out" / "index.html").read_text()
    assert "<h1>A b</h1>" in (tmp_path / "out" / "b.html").read_text()
    page = f"{tmp_path / 'out' / 'index.html'}: all of it, with figures"
    assert [block.text for block in outcome.blocks] == ["2 things", "- a", "- b", "A a", "A b", page, "all", "of b"]
    assert outcome.summary["b"]["name"] == "b"
    assert run.origin("look", "a").cautions == ("all",)
    assert run.origin("look", "b").cautions == ("all", "of b")


@pytest.mark.usefixtures("at_home")
def test_names_of_files_that_are_no_text_are_written_and_linked(tmp_path):
    several.run(run_to(tmp_path / "out"), names=["a\udcff", "[b](c) <i>"])
    assert "a%FF" in (page := (tmp_path / "out" / "index.html").read_text())
    assert "%5Bb%5D%28c%29%20%3Ci%3E" in page
    assert read(tmp_path / "out" / "a\udcff.h5", Named)[0].name == "a\\udcff"


@pytest.mark.usefixtures("at_home")
def test_one_result_is_the_answer_and_without_output_nothing_is_written(tmp_path):
    assert several.run(run_to(), names=["a"]).summary == {"name": "a", "system": ""}
    several.run(run_to(tmp_path / "out"), names=["a"])
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a.h5", "a.html"]


def test_names_of_files_are_unique(tmp_path):
    paths = [
        tmp_path / "1" / "a.bbl",
        tmp_path / "2" / "a.bbl",
        tmp_path / "b.csv.gz",
        tmp_path / "3" / "a.ulg",
        tmp_path / ".x",
    ]
    assert list(unique_names(paths)) == ["a", "a-2", "b", "a-3", ".x"]
    assert np.array_equal(list(unique_names(paths).values()), paths)


@pytest.fixture
def looked(cpfls, tmp_path, monkeypatch):
    """What `look` wrote of a log."""
    monkeypatch.chdir(tmp_path)
    write_csv(tmp_path / "log.csv", flat_log(flight(seconds=12.0)))
    (tmp_path / "study.yaml").write_text(TINY + VEHICLE)
    cpfls.done("look", "log.csv", "-o", "out")
    return tmp_path / "out" / "log.h5"


def test_info_check_and_report_know_results(cpfls, looked):
    answer = cpfls.summary("info", looked)
    assert (answer["format"], answer["result"]["name"]) == ("cpfls/look", "log.csv")
    assert "log.csv (sha256 " in cpfls("info", looked, "-v").stdout
    assert cpfls("check", looked).stdout.startswith(f"{looked}: good (cpfls/look)\n")
    for name in ("r.html", "r.md", "r.json"):
        cpfls.done("report", "study.yaml", looked, "-o", name)
        assert "log.csv" in (looked.parents[1] / name).read_text()
    assert (looked.parents[1] / "r.html").read_text() == looked.with_suffix(".html").read_text()


def test_look_ends_with_the_page_to_open(cpfls, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("log.csv", "other.csv"):
        write_csv(tmp_path / name, flat_log(flight(seconds=12.0)))
    for folder, logs, first in (("one", ("log.csv",), "log.html"), ("two", ("log.csv", "other.csv"), "index.html")):
        assert f"\n{folder}/{first}: all of it, with figures\n" in cpfls.done("look", *logs, "-o", folder).stdout
        assert (tmp_path / folder / first).is_file()
    assert "all of it" not in cpfls.done("look", "log.csv").stdout


def test_other_commands_refuse_results_in_one_sentence(cpfls, looked):
    log = looked.parents[1] / "log.csv"
    for words, message in (
        (("export", looked, "-o", "x.json"), "is a cpfls/look; this command needs a model"),
        (("look", looked), f"{looked}: is a cpfls/look, not a log"),
        (("look", log, "-o", "x.html"), "-o x\n"),
        (("look", log, "-o", "out"), "--force"),
    ):
        result = cpfls(*words)
        assert result.exit_code == 2
        assert message in result.stderr
        assert result.stderr.count("\n") == 1


@pytest.mark.usefixtures("at_home")
def test_a_result_that_breaks_its_description_is_refused_by_the_name_of_its_file(tmp_path):
    with pytest.raises(ComputationError) as error:
        several.run(run_to(tmp_path / "out"), names=["nothing"])
    assert str(error.value) == f"{tmp_path / 'out' / 'nothing.h5'}: not written: name: is missing"
    assert not (tmp_path / "out").exists()


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
    monkeypatch.setattr("cpfls_cli.stages.report.page_about", lambda _, paths: " ".join(path.name for path in paths))
    log = put_file(tmp_path / "log.csv", "1")

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
    assert outcome.summary == {**json.loads((out / "look.json").read_text()), "new": 1}
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
