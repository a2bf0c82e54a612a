"""What is read from a run's steps and events.

:mod:`~vibroplat.observe.trajectory` keeps them for tables and dense output, :mod:`~vibroplat.observe.statistics` sums
them up while the run goes (statistics, extremes, Poincaré section, powers), :mod:`~vibroplat.observe.audit` and
:mod:`~vibroplat.observe.summary` make the numbers of tables from these sums. An observer has a method ``read(h)``
(:class:`vibroplat.flow.motion.Observer`); it knows no method of integration and takes no step for short.
"""
