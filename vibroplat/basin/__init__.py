"""Basins of attraction: the attractors of a scene, and the fractions of initial conditions that converge to them."""
