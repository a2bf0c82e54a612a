"""Periodic orbits by shooting: their stability, their branches over a key of the scene, boundaries over two."""
