"""From a gap to names: search, estimates, rivals, verdict."""
