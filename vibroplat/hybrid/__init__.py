"""The hybrid automaton: modes, guards, resets, and the loop that takes a run through them.

:mod:`~vibroplat.hybrid.modes` is the table of modes. :mod:`~vibroplat.hybrid.loop` begins a segment and ends it.
:mod:`~vibroplat.hybrid.resets` has the resets at liftoff, impact and chatter; :mod:`~vibroplat.hybrid.transitions`
decides, by pure functions of numbers, what a guard's fall or an impact means. :mod:`~vibroplat.hybrid.state` holds
where a run is, what an integrator hands over, and the scales of a scene.

To add

* a contact law: its name in ``Contact.impact_law`` (:mod:`vibroplat.config.sections`) and in ``IMPACT_LAWS``
  (:mod:`vibroplat.model.parameters`), its formula in :func:`vibroplat.model.impact.impulse_response`, a case in
  ``tests/model/test_impact.py``. Modes and resets do not change.
* a spring or a damper: its key in :mod:`vibroplat.config.sections`, its coefficient in
  :mod:`vibroplat.model.parameters`, its term in :mod:`vibroplat.model.springs`. ``tests/model/test_new_force.py`` does.
* another force: its term in :func:`vibroplat.model.platform.forces`, its derivative in
  :func:`vibroplat.model.equations.jacobian`, its recurrence in :func:`vibroplat.model.series.expand` and its power in
  :func:`vibroplat.model.energy.powers`. The sympy derivation in ``tests/model/test_equations.py`` judges them.
* a mode: its name in :class:`vibroplat.config.coordinates.Mode`, its unknowns in
  :data:`vibroplat.model.systems.SYSTEMS`, its rows in :func:`vibroplat.model.equations.rows`, its guard in
  :mod:`~vibroplat.hybrid.modes`, its reset in :mod:`~vibroplat.hybrid.resets`, called by
  :func:`~vibroplat.hybrid.loop.end_segment`.
* an integrator: see :mod:`vibroplat.integrate.interface`.
"""
