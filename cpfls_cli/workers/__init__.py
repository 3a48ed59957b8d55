"""Evaluate chromosomes here, in processes beside, or on a cluster: one interface, one result."""
