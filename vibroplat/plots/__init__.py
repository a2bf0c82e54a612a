"""Figures from result tables alone, and functions that draw tables into axes of your own.

Functions that draw take an axis, return it, and leave everything else to you:

>>> import pandas as pd
>>> from matplotlib.figure import Figure
>>> from vibroplat.plots import draw_coordinate
>>> axis = Figure().add_subplot()
>>> table = pd.DataFrame({"t_s": [0.0, 0.1], "y_m": [0.0, 1e-3]})
>>> draw_coordinate(axis, table, "y_m").get_ylabel()
'$y$ (mm)'

Figures of studies are drawn from their pictures, which :mod:`vibroplat.results.picture` explains.
"""

from vibroplat.plots.panels import draw_map
from vibroplat.plots.pictures import draw_response, draw_section
from vibroplat.plots.style import Saving, styled
from vibroplat.plots.timelines import (
    draw_contact,
    draw_coordinate,
    draw_envelope,
    draw_impacts,
    draw_impulses,
    draw_phase_difference,
    draw_speeds,
    draw_synchronous_speed,
)

__all__ = [
    "Saving",
    "draw_contact",
    "draw_coordinate",
    "draw_envelope",
    "draw_impacts",
    "draw_impulses",
    "draw_map",
    "draw_phase_difference",
    "draw_response",
    "draw_section",
    "draw_speeds",
    "draw_synchronous_speed",
    "styled",
]
