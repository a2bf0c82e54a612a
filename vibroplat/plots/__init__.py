"""Figures from result tables alone: each is drawn from its picture, which :mod:`vibroplat.results.picture` explains."""
