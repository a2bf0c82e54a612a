"""Two engines that share no numerics check each other.

The same motion is computed by another engine from the same start, and what both give is compared: whole runs in
:mod:`~vibroplat.check.runs`, points of a sweep in :mod:`~vibroplat.check.sweeps`.

Two engines never agree to the last digit, and a motion multiplies what they differ by. How much of a difference this
explains is estimated by repetitions, not guessed. Both engines repeat the motion with another tolerance, which shows
the errors that each of them makes; the first one also repeats it from starts that are off by the tolerance, which shows
what the motion makes of any error. The error of an engine is about what a tenth of the tolerance changes, so two right
engines differ by at most about twice the largest change; ``MULTIPLE`` times that is allowed. A repetition may by chance
come close to what it repeats, so ``FLOOR`` times the tolerance is always allowed. Where classes of motion differ, some
repetitions of both engines must be of the same class.

A wrong term is the same at every tolerance, so repetitions do not show it and it is found, unless what it changes is
less than what errors of the tolerance change. A lower tolerance finds more. An engine that is right but less accurate
than its tolerance says is excused; the audit of energy and momentum is there for that.
"""
