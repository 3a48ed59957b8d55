"""What the sensors of a flight say of each other, before any torque is looked at."""
