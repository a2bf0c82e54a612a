"""Calibration: the numbers that the paper does not print, fitted to its claims.

:mod:`~vibroplat.study.calibration.plan` says what is searched, :mod:`~vibroplat.study.calibration.search` searches,
:mod:`~vibroplat.study.calibration.reading` tells what the evaluations say about the claims and the parameters.
"""
