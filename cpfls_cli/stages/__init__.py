"""Stages: one function each, which is a command with its result, its figures and its template."""
