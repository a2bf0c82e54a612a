"""Everything that exists because of one paper, that of Panovko and Shokhin.

* Its scenes and claims, and the machines they are tried with: :mod:`~vibroplat.paper.scenes`.
* What is simulated: sweeps and time histories (:mod:`~vibroplat.paper.reproduction`), boundaries of regimes and β of
  the non-impact model (:mod:`~vibroplat.paper.root_finding`).
* What follows from these results alone, the :mod:`~vibroplat.paper.evidence`: verdicts on all
  :mod:`~vibroplat.paper.claims` by their :mod:`~vibroplat.paper.judges`, and other :mod:`~vibroplat.paper.tables`.
"""
