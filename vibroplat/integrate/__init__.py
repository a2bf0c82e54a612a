"""Integrators behind one seam."""
