"""An identified model as source code and data that a controller takes."""

from cpfls_cli.export.c_form import CSource, c_source
from cpfls_cli.export.evidence import evidence_of
from cpfls_cli.export.json_form import json_text
from cpfls_cli.export.points import Expected, expected, reference_points
from cpfls_cli.export.python_form import python_source
from cpfls_cli.export.sheet import Evidence, Provenance, Sheet, Verdict

__all__ = [
    "CSource",
    "Evidence",
    "Expected",
    "Provenance",
    "Sheet",
    "Verdict",
    "c_source",
    "evidence_of",
    "expected",
    "json_text",
    "python_source",
    "reference_points",
]
