"""The command line of a stage, read from its source: help and messages do not wait for its numerics to load."""

from __future__ import annotations

import ast
import copy
import inspect
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class CommandLine:
    """What the command line of a stage is made of: parameters of its function but for the run, the rest as of `Stage`.

    `output` is the option of its output where it has one of its own.
    """

    parameters: list[inspect.Parameter]
    study: bool
    folder: bool
    fills: bool
    several: bool
    output: Any


def command_line(file: Path) -> CommandLine:
    """Read the command line of a stage: its signature, and of its module only what that needs."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    function, decorator = next(
        (node, own)
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        for own in node.decorator_list
        if isinstance(own, ast.Call) and getattr(own.func, "id", "") == "stage"
    )
    given = {own.arg: own.value for own in decorator.keywords if own.arg}
    output = given.get("output", ast.Constant(None))
    # Without its body and its decorator, which need everything else.
    bare = copy.deepcopy(function)
    bare.body, bare.decorator_list, bare.returns = [ast.Pass()], [], None
    asked = ast.Assign([ast.Name("output", ast.Store())], output)
    # What only the types of the run and the result name is not loaded.
    annotations = [own.annotation for own in _arguments(bare) if own.arg != "run" and own.annotation]
    values = [*bare.args.defaults, *(each for each in bare.args.kw_defaults if each), output]
    for own in _arguments(bare):
        own.annotation = None if own.arg == "run" else own.annotation
    needed = _needed(tree, {name for node in (*annotations, *values) for name in _names(node)})
    module = ast.fix_missing_locations(ast.Module([*needed, asked, bare], []))
    known: dict[str, Any] = {"__name__": f"cpfls_cli.stages.{file.stem}"}
    exec(compile(module, str(file), "exec", dont_inherit=True), known)
    parameters = inspect.signature(known[function.name], eval_str=True).parameters.values()
    return CommandLine(
        [each for each in parameters if each.name != "run"],
        study=_true(given, "study"),
        folder=_true(given, "folder"),
        fills=_true(given, "fills"),
        several=_true(given, "several"),
        output=known["output"],
    )


def _true(given: Mapping[str, ast.expr], name: str) -> bool:
    value = given.get(name)
    return value is not None and not (isinstance(value, ast.Constant) and not value.value)


def _arguments(function: ast.FunctionDef) -> list[ast.arg]:
    return [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]


def _names(node: ast.AST) -> set[str]:
    return {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}


def _needed(tree: ast.Module, names: set[str]) -> list[ast.stmt]:
    """Take the statements of a module that make names, and what these need, in their order."""
    made: dict[int, ast.stmt] = {}
    open_names, seen = set(names), set[str]()
    while open_names:
        name = open_names.pop()
        seen.add(name)
        for index, node in enumerate(tree.body):
            if isinstance(node, ast.Import | ast.ImportFrom):
                aliases = [own for own in node.names if (own.asname or own.name.partition(".")[0]) == name]
                kept = getattr(made.get(index), "names", [])
                if aliases and isinstance(node, ast.ImportFrom):
                    made[index] = ast.ImportFrom(node.module, [*kept, *aliases], node.level)
                elif aliases:
                    made[index] = ast.Import([*kept, *aliases])
            elif name in _defined(node):
                made[index] = node
                open_names |= _names(node) - seen
    return [made[index] for index in sorted(made)]


def _defined(node: ast.stmt) -> Iterator[str]:
    if isinstance(node, ast.ClassDef | ast.FunctionDef):
        yield node.name
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    yield from (target.id for target in targets if isinstance(target, ast.Name))
