"""The flight that settles what a diagnosis leaves open."""
