"""What one ordinary log tells of a multirotor: no mass, no inertia, no second flight."""
