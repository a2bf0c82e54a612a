"""Basins of attraction: which motions a scene comes to from a box of starts, and from which share of it."""
