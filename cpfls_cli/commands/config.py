"""`config`: print the config as it is resolved, or a commented default."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cpfls_cli.config.keys import commented_default
from cpfls_cli.config.load import load_study, validate
from cpfls_cli.config.study import resolved, resolved_yaml
from cpfls_cli.errors import ConfigError
from cpfls_cli.report.content import Listing
from cpfls_cli.report.outcome import Outcome


def run(path: Path | None, sections: Sequence[str], overrides: Sequence[str], seed: int | None) -> Outcome:
    """Show a resolved config, or a commented default."""
    if path is None:
        if sections or overrides or seed is not None:
            raise ConfigError("--section, --set and --seed need a CONFIG; without one the commented default is printed")
        return Outcome(resolved(validate({}, "default")), (Listing("Default config", commented_default()),))
    study = load_study(path, overrides, seed, sweep=True)
    return Outcome(resolved(study, sections), (Listing("Resolved config", resolved_yaml(study, sections)),))
