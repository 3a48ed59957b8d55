"""cpfls: grey-box identification of multirotor rotational dynamics with continuous periodic fuzzy systems."""

from cpfls_cli.errors import CpflsError
from cpfls_cli.library import Artifact, Model, load_model, read, run, stated_vehicle
from cpfls_cli.version import __version__

__all__ = ["Artifact", "CpflsError", "Model", "__version__", "load_model", "read", "run", "stated_vehicle"]
