"""Estimators: rows or bands with instruments, weights and blocks give values, their covariance and strength."""
