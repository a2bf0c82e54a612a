"""What is reported of a motion, from what :mod:`vibroplat.observe` has measured.

:mod:`~vibroplat.report.summary` makes the numbers of tables, :mod:`~vibroplat.report.data_sheet` loads and strokes,
:mod:`~vibroplat.report.notes` the warnings.
"""
