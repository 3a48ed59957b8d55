"""Identification: partitions by a genetic algorithm, coefficients by least squares, judged on held-out data."""

from cpfls_cli.identification.data import Split, TorqueData, split_flight
from cpfls_cli.identification.identify import Identification, identify
from cpfls_cli.identification.model import Model
from cpfls_cli.identification.settings import IdentificationSettings

__all__ = ["Identification", "IdentificationSettings", "Model", "Split", "TorqueData", "identify", "split_flight"]
