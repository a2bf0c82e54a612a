"""Numerical stability under stress: one module per kind of situation; every scene is checked.

A situation is a function of the number of scenes. It returns one row per scene: measured values, their limits
(:mod:`vibroplat.bench.stability.checks`), and the values beyond their limits. ``vibroplat bench stability`` runs all
situations listed in :mod:`vibroplat.bench.stability.situations`; the tests run them with few scenes.
"""
