"""Calibration: the numbers that the paper does not print are fitted to its claims.

:mod:`~vibroplat.paper.calibration.plan` is the plan of a search, :mod:`~vibroplat.paper.calibration.search` runs it,
and :mod:`~vibroplat.paper.calibration.reading` evaluates what it shows about claims and parameters.
"""
