"""How far to trust an identified model: bands, residuals, prediction by horizon, physics, a verdict."""
