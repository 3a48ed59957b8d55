"""A model as source code and data that a controller or a simulator takes."""

from cpfls_cli.export.json_form import json_text
from cpfls_cli.export.points import Expected, expected
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.source import CSource, c_source, python_source

__all__ = ["CSource", "Expected", "Sheet", "c_source", "expected", "json_text", "python_source"]
