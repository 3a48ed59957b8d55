"""Multi-objective genetic algorithm with the operators of the Sheffield toolbox; it knows no vehicle."""
