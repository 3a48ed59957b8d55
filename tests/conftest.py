"""Fixtures of all packages of tests."""

import pytest

from tests.builders import command_line


@pytest.fixture
def undrawn():
    """Leave the pictures of pages away."""
    with command_line.undrawn():
        yield
