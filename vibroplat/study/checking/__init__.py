"""Two engines that share no numerics check each other.

The same motion is computed by another engine from the same start, and what both give is compared: whole runs in
:mod:`~vibroplat.study.checking.runs`, points of a sweep in :mod:`~vibroplat.study.checking.sweeps`.

Two engines never agree to the last digit, and a motion multiplies what they differ by. How much of a difference this
explains is estimated, not guessed: the motion is repeated with another tolerance, by both engines, which shows the
errors that each of them makes; and by the first engine alone from starts that are off by the tolerance, which shows
what the motion makes of any error. ``MULTIPLE`` times the largest of these changes is allowed. One repetition may by
chance come out close to the motion that it repeats, so a small number times the tolerance is always allowed.

A wrong term in an engine's equations stays hidden only where it changes a result by less than errors of the tolerance
do: it is the same at every tolerance, so the repetitions do not show it.
"""
