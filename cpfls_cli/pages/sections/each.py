"""A section that shows sources of one kind one after the other; it now lives with the sources."""

from cpfls_cli.pages.source import section_of_each

__all__ = ["section_of_each"]
