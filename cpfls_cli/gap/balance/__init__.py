"""The two sides of the balance over smooth windows, and the noise in them."""
