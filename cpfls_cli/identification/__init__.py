"""Identification: partitions by a genetic algorithm, coefficients by least squares, judged on held-out data."""
