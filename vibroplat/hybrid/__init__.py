"""The hybrid automaton: modes, guards, resets, and the loop that takes a run through them.

:mod:`~vibroplat.hybrid.modes` is the table of modes. :mod:`~vibroplat.hybrid.loop` begins a segment and ends it.
:mod:`~vibroplat.hybrid.starts` prepares the start of a mode and closes a piece, :mod:`~vibroplat.hybrid.resets` has the
resets; :mod:`~vibroplat.hybrid.transitions` decides, by pure functions of numbers, what a guard's fall or an impact
means. :mod:`~vibroplat.hybrid.state` holds where a run is, what an integrator hands over, and the scales of a scene.

To add

* a contact law: its name in ``Contact.impact_law`` (:mod:`vibroplat.config.sections`) and in ``IMPACT_LAWS``
  (:mod:`vibroplat.model.parameters`), its formula in :func:`vibroplat.model.impact.impulse_response`, a case in
  ``tests/model/test_impact.py``. Modes and resets do not change.
* a force: its key in :mod:`vibroplat.config.sections`, its coefficient in :mod:`vibroplat.model.parameters`, its term
  in :mod:`vibroplat.model.source`. ``tests/model/test_new_force.py`` does. The sympy derivation in
  ``tests/model/test_equations.py`` judges the equations.
* a mode: its name in :class:`vibroplat.config.coordinates.Mode`, its unknowns in
  :data:`vibroplat.model.systems.SYSTEMS`, what it has in :mod:`vibroplat.model.straight`, its guard in
  :mod:`~vibroplat.hybrid.modes`, its reset in :func:`vibroplat.hybrid.resets.apply_reset`.
* an integrator: see :mod:`vibroplat.integrate.interface`.
"""
