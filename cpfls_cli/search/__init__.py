"""Searches that leave checkpoints and go on from them, one or a sweep of them."""
