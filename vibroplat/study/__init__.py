"""Studies of many motions.

* A sweep (:mod:`~vibroplat.study.sweep`) has branches of points; a point settles, is measured and classified.
* Any study simulates by chains of tasks, which run in a :mod:`~vibroplat.study.pool` and keep their results in a
  :mod:`~vibroplat.study.store`.
"""

#: Seconds for which workers of a scheduler are waited for, unless the user says otherwise.
WAIT = 60.0
