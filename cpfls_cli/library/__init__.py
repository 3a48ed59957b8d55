"""The Python interface: artifacts as named arrays, models as objects, figures of matplotlib."""

from cpfls_cli.library.artifact import Artifact, read
from cpfls_cli.library.model import Model, load_model, run, stated_vehicle

__all__ = ["Artifact", "Model", "load_model", "read", "run", "stated_vehicle"]
