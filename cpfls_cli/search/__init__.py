"""Searches that leave checkpoints and go on from them."""
