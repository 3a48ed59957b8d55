"""What one ordinary log shows of a multirotor: no mass, no inertia, no second flight."""
