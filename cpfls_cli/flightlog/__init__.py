"""Import of flight logs: columns become signals on one clock, aligned, filtered and differentiated."""
