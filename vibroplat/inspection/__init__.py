"""What follows from a configuration without a run: closed formulas and averaged equations, with their ranges."""
