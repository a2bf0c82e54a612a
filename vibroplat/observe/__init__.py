"""What is read from a run's steps and events.

:mod:`~vibroplat.observe.tables` copies steps for dense output, and makes the rows of the trajectory table and the event
table of them. :mod:`~vibroplat.observe.statistics` sums up during the run (statistics, extremes, Poincaré
section, powers) into :mod:`~vibroplat.observe.measures`, and :mod:`~vibroplat.report.summary` makes the numbers of
tables from these. :mod:`~vibroplat.observe.variation` carries the derivative of the state along, by
:mod:`~vibroplat.observe.collocation`. An observer has a method ``read(h)``
(:class:`vibroplat.motion.motion.Observer`); it does not know the method of integration.
"""
