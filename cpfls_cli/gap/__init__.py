"""The gap between simulation and flight: where it is, which effect is missing, the model with the effect in it."""
