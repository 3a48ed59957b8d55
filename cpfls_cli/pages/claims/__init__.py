"""The claims of the paper, each held against what was measured here."""

from cpfls_cli.pages.claims.checked import claims_of
from cpfls_cli.pages.claims.claim import Claim, Verdict

__all__ = ["Claim", "Verdict", "claims_of"]
