"""The version of the package, for modules below the Python interface."""

__version__ = "1.0.0"
