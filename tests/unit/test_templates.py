"""Templates have no types: each variable, filter and attribute of a result that one names has to exist."""

import ast
import dataclasses
from functools import cached_property
from types import NoneType
from typing import get_args, get_origin, get_type_hints

import pytest
from jinja2 import nodes

from cpfls_cli.cli.stages import PARTS, STAGES, stage_commands
from cpfls_cli.page import TEMPLATES, environment
from cpfls_cli.report.source import Source
from cpfls_cli.result import described_fields
from cpfls_cli.stage import loaded, stage_named

NAMES = sorted(file.stem.strip("_") for file in STAGES.glob("[a-z]*.py"))
GIVEN = {"r", "source", "loop", "caller"}
SAME_ROWS = {"first", "last", "list", "sort", "selectattr", "rejectattr"}
CONTEXTS = ("load", "store", "param")


def inner(hint):
    """Class of what a field holds: a result, or the rows of a table of results; None for others, mappings too."""
    parts = get_args(hint) if NoneType in get_args(hint) else (hint,)
    for kind in parts:
        if dataclasses.is_dataclass(kind):
            return kind
        if get_origin(kind) is tuple and dataclasses.is_dataclass(get_args(kind)[0]):
            return get_args(kind)[0]
    return None


def keys_of(stage):
    """Names that a module writes: keys of what it only answers with, a dict of plain data."""
    tree = list(ast.walk(ast.parse((STAGES / f"{stage.function.__module__.rpartition('.')[2]}.py").read_text("utf-8"))))
    texts = (node.value for node in tree if isinstance(node, ast.Constant) and isinstance(node.value, str))
    return frozenset([*texts, *(node.arg for node in tree if isinstance(node, ast.keyword))])


def attribute(kind, name):
    """Type of an attribute of a class, None where it is nothing of ours; what does not exist is an error."""
    if isinstance(kind, frozenset):
        assert name in {*kind, "items", "rstrip"}, f"nothing writes {name}"
        return kind
    try:
        hints = get_type_hints(kind)
    except NameError:
        # What is imported for types alone cannot be looked into.
        assert name in kind.__annotations__, f"{kind.__name__} has no {name}"
        return None
    if name in hints:
        return inner(hints[name])
    own = getattr(kind, name, None)
    assert own is not None, f"{kind.__name__} has no {name}"
    made = own.fget if isinstance(own, property) else own.func if isinstance(own, cached_property) else None
    return inner(get_type_hints(made).get("return")) if made else None


class Walk:
    """Follow results through a template: from ``r`` along attributes, loops and assignments."""

    def __init__(self, kind):
        self.known, self.seen = {"r": kind, "source": Source}, 0

    def kind(self, node):
        """Class of what an expression gives, or None."""
        if isinstance(node, nodes.Name):
            return self.known.get(node.name)
        if isinstance(node, nodes.Getattr):
            kind = self.kind(node.node)
            if kind is None:
                return None
            self.seen += 1
            return attribute(kind, node.attr)
        if isinstance(node, nodes.Getitem):
            return self.kind(node.node)
        if isinstance(node, nodes.Filter) and node.name in SAME_ROWS:
            return self.kind(node.node) if node.node is not None else None
        return None

    def __call__(self, node):
        """Look at a node and all in it, names of a loop or an assignment first."""
        if isinstance(node, nodes.For) and isinstance(node.target, nodes.Name):
            self.known[node.target.name] = self.kind(node.iter)
        if isinstance(node, nodes.Assign) and isinstance(node.target, nodes.Name):
            self.known[node.target.name] = self.kind(node.node)
        if isinstance(node, nodes.Macro):
            # Its arguments may be anything.
            self.known |= {argument.name: None for argument in node.args}
        if isinstance(node, nodes.Call) and isinstance(node.node, nodes.Name) and node.node.name == "column":
            rows, name = node.args[:2]
            kind = self.kind(rows)
            if kind is not None and isinstance(name, nodes.Const):
                attribute(kind, name.value)
        self.kind(node)
        for child in node.iter_child_nodes():
            self(child)


def imported(tree):
    """Names that a template imports from others."""
    named = [each for own in tree.find_all(nodes.FromImport) for each in own.names]
    return {each if isinstance(each, str) else each[1] for each in named} | {
        own.target for own in tree.find_all(nodes.Import)
    }


def templates(name):
    """Templates of a stage, by the names of their files."""
    return sorted(path.name for path in TEMPLATES.glob(f"{name}*.md.j2"))


def test_each_stage_has_a_template_and_each_template_a_stage():
    assert sorted([*PARTS, *(name.replace("-", "_") for name in stage_commands())]) == NAMES
    assert [name for name in NAMES if f"{name}.md.j2" not in templates(name)] == []


@pytest.mark.parametrize("name", NAMES)
def test_what_templates_name_exists(name):
    stage = stage_named(name)
    own = environment(TEMPLATES, stage.words)
    for template in templates(name):
        text, _, _ = own.loader.get_source(own, template)
        # Filters and tests that do not exist are refused here.
        own.compile(text)
        tree = own.parse(text)
        names = {context: {n.name for n in tree.find_all(nodes.Name) if n.ctx == context} for context in CONTEXTS}
        made = names["store"] | names["param"] | {macro.name for macro in tree.find_all(nodes.Macro)} | imported(tree)
        assert names["load"] - made - GIVEN - own.globals.keys() == set(), template
        if template == f"{name}.md.j2":
            walk = Walk(keys_of(stage) if stage.kind is dict else stage.kind)
            walk(tree)
            assert walk.seen, "it shows nothing of its result"


def test_a_name_that_does_not_exist_is_found():
    kind = loaded("reduce").kind
    own = environment(TEMPLATES, {})
    with pytest.raises(AssertionError, match="has no selektion"):
        Walk(kind)(own.parse("{{ r.selektion }}"))
    for text in (
        "{% notes r.selektion %}",
        '{% paragraphs [r.selektion] | map("string"), "note" %}',
        "{% list x = r.selektion for y in [1] %}",
        "{% list x = y for y in r.selektion if y %}",
        "{% list x = y for y in [1] if r.selektion %}",
    ):
        with pytest.raises(AssertionError, match="has no selektion"):
            Walk(kind)(own.parse(text))
    with pytest.raises(AssertionError, match="nothing writes sentense"):
        Walk(keys_of(loaded("effects")))(own.parse("{% for each in r.effects %}{{ each.sentense }}{% endfor %}"))
    look = loaded("look").kind
    field = next(each for each in described_fields(look) if each.table)
    with pytest.raises(AssertionError, match="has no nothing"):
        Walk(look)(own.parse(f"{{% for row in r.{field.name} %}}{{{{ row.nothing }}}}{{% endfor %}}"))
    with pytest.raises(AssertionError, match="has no nothing"):
        Walk(look)(own.parse(f"{{% list x = row.nothing for row in r.{field.name} %}}"))


def test_what_loops_leave_out_does_not_depend_on_places():
    """There ``loop`` is the loop around."""
    own = environment(TEMPLATES, {})
    for file in sorted(TEMPLATES.glob("*.md.j2")):
        tests = [each.test for each in own.parse(file.read_text("utf-8")).find_all(nodes.For) if each.test is not None]
        assert "loop" not in {name.name for test in tests for name in test.find_all(nodes.Name)}, file.name
