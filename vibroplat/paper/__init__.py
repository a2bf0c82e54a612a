"""Everything that exists because of one paper, that of Panovko and Shokhin.

* Scenes, sweeps and claims of the paper: :mod:`~vibroplat.paper.trial`.
* Simulated, with the means of :mod:`vibroplat.study`: sweeps, boundaries (:mod:`~vibroplat.paper.narrowing`), β of the
  non-impact model (:mod:`~vibroplat.paper.nonimpact`), time histories (:mod:`~vibroplat.paper.histories`).
* Judged from these results alone: the tables (:mod:`~vibroplat.paper.evidence`) by the claims
  (:mod:`~vibroplat.paper.claims`, whose judges are in ``boundaries``, ``comparisons`` and ``quoted``), with verdicts in
  the :mod:`~vibroplat.paper.scoreboard`.
* Commands: :mod:`~vibroplat.paper.reproduction` (``paper``) and :mod:`~vibroplat.paper.calibration` (``calibrate``).
"""
