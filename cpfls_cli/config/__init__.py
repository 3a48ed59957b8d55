"""Study configs: one YAML file, validated as a whole."""

from cpfls_cli.config.keys import commented_default
from cpfls_cli.config.load import load_study, read_config, validate
from cpfls_cli.config.study import SECTIONS, Study, resolved, resolved_yaml

__all__ = [
    "SECTIONS",
    "Study",
    "commented_default",
    "load_study",
    "read_config",
    "resolved",
    "resolved_yaml",
    "validate",
]
