"""The multirotor: its settings and its rotors."""
