"""Evaluate chromosomes here, in other processes, or on a cluster: one interface, one result."""
