"""Simulators and libraries that vehicles are exported for, one module each: what it holds, its file, its flight."""
