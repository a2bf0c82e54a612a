"""Measured data: files as people have them, their numbers, times and units, and how they differ from curves."""
