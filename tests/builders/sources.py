"""Sources as trees, each read once for all tests that look at them."""

import ast
from functools import cache


@cache
def syntax(path):
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def nodes(path):
    return list(ast.walk(syntax(path)))
