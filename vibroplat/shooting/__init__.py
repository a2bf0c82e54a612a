"""Kernels of orbits: whole periods with their derivatives, multipliers, margins of guards, and whose orbit is reached.

:mod:`~vibroplat.shooting.shots` integrates segments of exact length, :mod:`~vibroplat.shooting.orbits` solves for
periods, and :mod:`~vibroplat.shooting.assignment` finds the ellipsoid around an orbit that a motion enters.
"""
