"""Calibration: the numbers that the paper does not print, fitted to its claims.

:mod:`~vibroplat.paper.calibration.plan` says what is searched, :mod:`~vibroplat.paper.calibration.search` searches,
:mod:`~vibroplat.paper.calibration.reading` tells what the evaluations say about the claims and the parameters.
"""
