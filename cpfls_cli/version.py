"""The version of the package, for modules below the Python interface."""

__version__ = "0.1.0"
