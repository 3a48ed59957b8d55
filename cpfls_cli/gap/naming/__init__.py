"""Naming the causes of a gap: search, estimates, rivals, verdict."""
