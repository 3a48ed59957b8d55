"""A stage is one typed function: its parameters are the command line, its result the file, its template the answer.

A module of `stages` holds one, made by the decorator `stage`; `templates` holds what a person reads of its result. The
command line finds both by the name of the module (`cli/stages.py`). A result without a ``FORMAT`` has no file: it is
only answered with, and what the stage writes are its `Run.texts`, unless the run is dry. One that is a ``dict`` is for
the template alone: ``--json`` says `Run.also`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from cpfls_cli import page, store
from cpfls_cli.artifacts.gate import InputFile, stage_module
from cpfls_cli.artifacts.job import Job, go_on, input_file, take_inputs
from cpfls_cli.artifacts.output import (
    check_folder,
    check_output,
    filled_folder,
    refuse_inputs,
    refuse_own,
    write_files,
    write_text,
)
from cpfls_cli.config.study import resolved_yaml
from cpfls_cli.errors import InputError, visible
from cpfls_cli.report.canvas import figure_html, picture_of, pictures
from cpfls_cli.report.content import Box, Command, Form, Heading, Outcome, Section, Text, caution_texts
from cpfls_cli.report.source import Source, source_of_result
from cpfls_cli.result import plain

PAGE = "report.html"
"""File of the page of a folder with one answer."""
_INDEX = "index"
"""File of the page over several results, and the end of the name of its template."""
_OTHERS = {".csv", ".html", ".json", ".md", ".yaml", ".yml"}
"""Suffixes of files that are no results."""


@dataclass
class _Taken:
    """Inputs of one result by role, and what speaks against it."""

    reads: Callable[[Path], None]
    inputs: list[Path]
    files: dict[str, InputFile] = field(default_factory=dict)
    cautions: dict[str, None] = field(default_factory=dict)


@dataclass(frozen=True)
class Filled:
    """A folder with one answer: files of results, ``report.html`` with all of them, the answer as JSON, what runs keep.

    Attributes
    ----------
    parts : mapping from str to (str, str)
        Parts of the result that lie in files of their own, in the order in which they follow from each other: of each
        the stage that it is a result of, and the part that is an input of it, or nothing. A part that is None has no
        file. Without parts the result itself lies in a file, named as the stage is.
    texts : mapping from str to callable
        Further files: text that is made of the result.
    kept : str
        Folder in it that runs of the stage keep files in for each other.
    grows : bool
        Whether a folder that the stage filled can be filled again without ``--force``.
    """

    parts: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    texts: Mapping[str, Callable[[Any], str]] = field(default_factory=dict)
    kept: str = ""
    grows: bool = False


@dataclass
class Run(Job):
    """One run of a stage; in a dry run it checks its inputs, and gives None in place of a result.

    `writes`: False where the answer is only printed; `next`: commands to go on with; `exit_code`: of an answer that a
    script has to distinguish; `with_config`: whether the stage takes a config, which its results hold; `files`:
    inputs of all results, by role; `outputs`: files that will be written, as far as they are known before, no input is
    one; `also`: what ``--json`` says besides its result; `last_words`: behind the answer; `texts`: other files that are
    written with the result; `said`: of this run alone, its file says none of it again; `until_written`: contexts that
    last until the result is written, or it is sure that it will not be; `afterwards`: done when it is; `data` gives the
    config as plain data, with what the command line changes of it.
    """

    writes: bool = True
    next: list[Command] = field(default_factory=list)
    exit_code: int = 0
    with_config: bool = True
    files: dict[str, InputFile] = field(default_factory=dict)
    outputs: list[Path] = field(default_factory=list)
    also: dict[str, Any] = field(default_factory=dict)
    last_words: str = ""
    texts: dict[Path, str | bytes] = field(default_factory=dict)
    said: list[Text] = field(default_factory=list)
    until_written: ExitStack = field(default_factory=ExitStack)
    afterwards: list[Callable[[], object]] = field(default_factory=list)
    data: Callable[[], dict[str, Any]] = dict
    _taken: dict[str, _Taken] = field(default_factory=dict)

    def take(self, roles: Mapping[str, Path], of: str = "") -> Mapping[str, InputFile]:
        """Check inputs, and take note of what they hold: those of all results, or of the one of this name."""
        own = self._of(of)
        own.files.update(take_inputs(own, roles))
        for path in self.outputs:
            refuse_inputs(path, self.inputs)
        return own.files

    def take_also(self, files: Mapping[str, InputFile], of: str = "") -> None:
        """Take note of files that an input was made from: inputs of all results, or of the one of this name."""
        self._of(of).files.update(files)

    def caution(self, text: str, of: str = "") -> None:
        """Take note of what speaks against all results, or the one of this name."""
        self._of(of).cautions[visible(text)] = None

    def say(self, text: str) -> None:
        """Add to the answer what only this run has to say."""
        self.said.append(Text(text))

    def note(self, text: str) -> None:
        """Add a note to the answer of this run."""
        self.said.append(Text(text, "warning"))

    def cautions_of(self, *names: str) -> tuple[str, ...]:
        """List what speaks against results of these names, and against all."""
        return tuple(dict.fromkeys(each for name in ("", *names) for each in self._of(name).cautions))

    def origin(self, stage: str, of: str = "") -> store.Origin:
        """Say where a result comes from."""
        return store.Origin(
            stage=stage,
            inputs={**self.files, **self._of(of).files},
            seed=self.study.seed if self.with_config else None,
            config=resolved_yaml(self.study) if self.with_config else "",
            cautions=self.cautions_of(of),
        )

    def go_on(self, command: str, *words: str | Path, output: Path) -> None:
        """Name a command that goes on with the config of this run."""
        self.next.append(go_on(self, command, *words, output=output))

    def write_text(self, path: Path, text: str, what: str) -> None:
        """Have a file of text written behind the result, or alone where none is written; `what` says what it is."""
        if self.writes:
            refuse_own(path, self.output)
        check_output(path, self.force, self.inputs)
        self.texts[path], self.also["file"] = text, str(path)
        self.say(f"{path}: {what}")

    def _of(self, name: str) -> Run | _Taken:
        return self._taken.setdefault(name, _Taken(self.reads, self.inputs)) if name else self


def _would(run: Run, stage: Stage) -> Outcome:
    """Say of a dry run that it could go on."""
    where = f"{run.output}: would be {'filled' if stage.folder or stage.fills else 'written'}; "
    named = {"output": str(run.output)} if run.writes else {}
    config = "the config and " if run.with_config else ""
    cautions = run.cautions_of(*(stage.fills.parts if stage.fills else ()))
    return Outcome(
        {"dry_run": True, **named, **({"cautions": list(cautions)} if cautions else {})},
        (Text(f"{where if run.writes else ''}{config}all inputs are good"), *run.said, *caution_texts(cautions)),
    )


@dataclass(frozen=True)
class Stage:
    """A function with everything that makes it a command.

    `function` takes a `Run` and what its command line says. It gives a result; or, of a stage that fills a folder,
    results by name, with a page each; or None in a dry run; or the outcome of a command that goes on.

    `title` is of the section of a report; `figures`: of each figure of the template its HTML, made of the result,
    `Drawn` of `report.canvas` or a function; `words`: what the template uses besides what all templates know; `folder`:
    whether its output is a folder with a page for each result (left out, the answer is only printed); `fills`: whether
    it is one with one answer; `study`: whether it takes a config, or what separates it from what else was given;
    `output`: its option where it is another than usual, False of one that only answers; `several`: whether options that
    may be repeated take all values that follow; `resumes`: whether it can go on with what was stopped, and checks
    itself whether its output may be replaced; `overrides` gives those that its options stand for; `together` gives the
    sources of a report that show its results.
    """

    function: Callable[..., Any]
    kind: Any
    title: str = ""
    figures: Mapping[str, Callable[[Any], str]] = field(default_factory=dict)
    words: Mapping[str, Any] = field(default_factory=dict)
    folder: bool = False
    fills: Filled | None = None
    study: bool | Callable[[Mapping[str, Any]], bool] = False
    output: Any = None
    several: bool = False
    resumes: bool = False
    overrides: Callable[..., list[str]] | None = None
    together: Callable[[Sequence[Source]], Sequence[Source]] = tuple

    def __call__(self, *given: Any, **named: Any) -> Any:
        """Compute, and write nothing."""
        return self.function(*given, **named)

    @property
    def name(self) -> str:
        """Of the command: that of its module."""
        return Path(str(sys.modules[self.function.__module__].__file__)).stem.strip("_").replace("_", "-")

    def text(self, given: Any, ending: str = "", about: Source | None = None) -> str:
        """Word a result, or all results by name where the ending says so.

        Parameters
        ----------
        about : Source or None
            Where the result comes from, for templates that name it: ``source``.
        """
        module = sys.modules[self.function.__module__]
        folder = Path(str(module.__file__)).parents[1] / "templates"
        template = self.name.replace("-", "_") + ending
        return page.words(template, given, folder=folder, added=self.words, source=about)

    def page(self, title: str, given: Any, about: Source | None = None) -> str:
        """Write the page of a result."""

        def html(name: str) -> str:
            picture = picture_of(self.figures[name], name, given)
            return "" if picture is None else figure_html(picture)

        figures = {name: partial(html, name) for name in self.figures}
        return page.html(title, self.text(given, about=about), figures)

    def verdict(self, about: Source) -> list[Box]:
        """Give the verdict on a result, where its template begins with one, for the summary of a report."""
        return [block for block in page.blocks(self._wording(about)) if isinstance(block, Box)]

    def _wording(self, about: Source) -> str:
        """Word a result once for the summary of a report and for its section."""
        if self.name not in about.wordings:
            about.wordings[self.name] = self.text(about.record, about=about)
        return about.wordings[self.name]

    def section(self, about: Source, number: int, *, named: bool = False, drawn: bool = True) -> Section:
        """Make the section of a report that shows a result, the first, second, ... of this stage; without its verdict.

        That is in the summary. Where several results are shown, each is named; figures are left out where another
        section has them.
        """
        prefix, anchor = f"{self.name}-{number}-", self.name if number == 1 else f"{self.name}-{number}"
        drawings = pictures(self.figures, prefix, about.record) if drawn else {}
        blocks = page.blocks(self._wording(about), drawings, prefix)
        shown = (block for block in blocks if not isinstance(block, Box))
        return Section(anchor, self.title, [*([Heading(about.label)] if named else []), *shown])

    def run(self, run: Run, **given: Any) -> Outcome:
        """Check the output, compute, write, and say what there is to say."""
        if run.writes and not self.resumes:
            self._check(run, run.output)
        with run.until_written:
            found = self.function(run, **given)
            if found is None:
                return _would(run, self)
            if isinstance(found, Outcome):
                return found
            results = dict(found) if self.folder else {"": found}
            several = len(results) > 1
            if run.writes and (self.fills or self.folder):
                first = PAGE if self.fills else f"{_INDEX if several else next(iter(results))}.html"
                run.last_words = f"{run.output / first}: all of it, with figures{run.last_words}"
            texts = [*([self.text(results, f"_{_INDEX}")] if several else [])]
            # Of what is refused among several, the index says all.
            shown = {name: each for name, each in results.items() if not (several and getattr(each, "refused", False))}
            texts += [self.text(each, about=self._source(run, name, each)) for name, each in shown.items()]
            if run.writes and (self.fills or hasattr(self.kind, "FORMAT")):
                self._write(run, run.output, results)
            elif not run.dry_run:
                write_files(run.texts)
        for act in run.afterwards:
            act()
        cautions = run.cautions_of(*results, *(self.fills.parts if self.fills else ()))
        summary: dict[str, Any] = {}
        if self.kind is not dict:
            summary = {name: plain(each) for name, each in results.items()} if several else plain(*results.values())
        return Outcome(
            {**summary, **run.also, **({"cautions": list(cautions)} if cautions else {})},
            (
                *(block for text in texts for block in page.blocks(text)),
                *([Text(run.last_words)] if run.last_words else []),
                *run.said,
                *caution_texts(cautions),
            ),
            run.exit_code,
            next=tuple(run.next),
            written=run.output if run.writes else next(iter(run.texts), None),
        )

    def report(self, path: Path, form: Form) -> str:
        """Write the page of a file in any form."""
        given, origin = store.read(path, self.kind)
        if form is Form.JSON:
            return json.dumps(plain(given), allow_nan=False, indent=2) + "\n"
        about = source_of_result(given, origin, path, path.name, "")
        return (
            page.markdown(self.text(given, about=about))
            if form is Form.MARKDOWN
            else self.page(path.stem, given, about)
        )

    def _source(self, run: Run, name: str, given: Any) -> Source:
        """Name a result of this run as its file will be."""
        label = f"{name or self.name}.h5" if self.folder or self.fills else run.output.name
        return source_of_result(given, run.origin(self.name, name), run.output, label, "", run.study)

    def _check(self, run: Run, output: Path) -> None:
        if self.fills:
            names = self._names(self.fills)
            run.outputs = [output / name for name in names]
            first = next(iter(self.fills.parts.values()), (self.name, ""))[0]
            again = self.fills.grows and store.stage_of(output / names[0]) == first
            check_folder(output, run.force or again, names, kept=self.fills.kept)
            return
        run.outputs = [output]
        if not self.folder:
            check_output(output, run.force, run.inputs)
            if hasattr(self.kind, "FORMAT") and output.suffix.lower() in _OTHERS:
                raise InputError(f"{output}: the result is an HDF5 file; let its name end in .h5")
            return
        if output.suffix in {".h5", *_OTHERS}:
            raise InputError(
                f"{output}: -o names a folder, which gets a page for each log: -o {output.with_suffix('')}"
            )
        check_folder(output, run.force, ())

    def _names(self, fills: Filled) -> list[str]:
        results = (f"{name}.h5" for name in fills.parts or (self.name,))
        return [*results, PAGE, f"{self.name}.json", *fills.texts]

    def _fill(self, run: Run, output: Path, given: Any, fills: Filled) -> None:
        """Write what one answer fills a folder with."""
        parts = fills.parts or {self.name: (self.name, "")}
        results = {name: getattr(given, name) if fills.parts else given for name in parts}
        held = {name: each for name, each in results.items() if each is not None}
        for name, each in held.items():
            store.require_sound(output / f"{name}.h5", each)
        for path in run.texts:
            refuse_inputs(path, run.inputs)
        with filled_folder(output, [*self._names(fills), *(path.name for path in run.texts)]) as folder:
            write_files({folder / path.name: text for path, text in run.texts.items()})
            made: dict[Path, tuple[Any, store.Origin]] = {}
            for name, each in held.items():
                stage, before = parts[name]
                path, origin = folder / f"{name}.h5", run.origin(stage, name)
                made_from = {before: input_file(folder / f"{before}.h5")} if before else {}
                made[path] = each, replace(origin, inputs=dict(sorted({**made_from, **origin.inputs}.items())))
                store.write(path, *made[path])
            cautions = run.cautions_of(*parts)
            summary = {**plain(given), **({"cautions": list(cautions)} if cautions else {})}
            write_text(folder / f"{self.name}.json", json.dumps(summary, indent=1, allow_nan=False) + "\n")
            for name, text in fills.texts.items():
                write_text(folder / name, text(given))
            # Above this module: a report shows results of all stages.
            report = import_module("cpfls_cli.stages.report")
            write_text(folder / PAGE, report.page_about(run.study, made))

    def _write(self, run: Run, output: Path, results: Mapping[str, Any]) -> None:
        if self.fills:
            self._fill(run, output, results[""], self.fills)
            return
        if not self.folder:
            store.write(output, results[""], run.origin(self.name))
            write_files(run.texts)
            return
        several = {f"{_INDEX}.html": results} if len(results) > 1 else {}
        names = [*several, *(name + end for name in results for end in (".h5", ".html"))]
        for name in names:
            refuse_inputs(output / name, run.inputs)
        for name, each in results.items():
            store.require_sound(output / f"{name}.h5", each)
        with filled_folder(output, names) as folder:
            for name, each in results.items():
                store.write(folder / f"{name}.h5", each, run.origin(self.name, name))
                write_text(folder / f"{name}.html", self.page(name, each, self._source(run, name, each)))
            for name, every in several.items():
                write_text(folder / name, page.html(output.name, self.text(every, f"_{_INDEX}"), {}))


def loaded(module: str) -> Stage:
    """Load the stage of a module of `stages`."""
    return next(each for each in vars(import_module(f"cpfls_cli.stages.{module}")).values() if isinstance(each, Stage))


def stage_that_made(path: Path) -> Stage:
    """Load the stage that made a file."""
    return stage_named(store.read_origin(path).stage)


def kind_of(path: Path) -> Any:
    """Give the class of the result in a file."""
    return stage_that_made(path).kind


def stage_named(name: str) -> Stage:
    """Load the stage of this name."""
    return loaded(stage_module({"stage": name}))


def stage(kind: Any, **given: Any) -> Callable[[Callable[..., Any]], Stage]:
    """Make a function a stage; what is given are attributes of `Stage`."""
    return lambda function: Stage(function, kind, **given)


def unique_names(paths: Iterable[Path]) -> dict[str, Path]:
    """Give each file a name of its own, that of the file without its ending."""
    named: dict[str, Path] = {}
    for path in paths:
        stem = path.name.partition(".")[0] or path.name
        taken = sum(1 for name in named if name == stem or name.rpartition("-")[0] == stem)
        named[f"{stem}-{taken + 1}" if taken else stem] = path
    return named
