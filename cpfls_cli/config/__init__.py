"""Study configs: one YAML file, validated as a whole."""

from cpfls_cli.config.commented import commented_default
from cpfls_cli.config.load import load_study, read_config, validate
from cpfls_cli.config.resolved import resolved, resolved_yaml
from cpfls_cli.config.study import SECTIONS, Study

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
