"""Numerical stability under stress: one module for each kind of situation, each scene with its check."""
