"""What is read from a run's steps and events.

:mod:`~vibroplat.observe.segments` and :mod:`~vibroplat.observe.events` keep them, :mod:`~vibroplat.observe.table` makes
the rows of the trajectory table, and :mod:`~vibroplat.observe.trajectory` holds what a run has kept.
:mod:`~vibroplat.observe.statistics` sums up while the run goes (statistics, extremes, Poincaré section, powers),
:mod:`~vibroplat.observe.audit` and :mod:`~vibroplat.observe.summary` make the numbers of tables from these sums. An
observer has a method ``read(h)``
(:class:`vibroplat.motion.motion.Observer`); it knows no method of integration and takes no step for short.
"""
