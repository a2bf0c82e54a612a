"""The equations of motion, stated once, and what is written from them.

=================  =====================================================================================
parameters         the constants of the equations as a record, filled from a scene
source             the equations, as a person writes them
graph              expressions that the source is traced into, and their derivatives
straight           writes rows, Jacobian, mass matrix, loads, rates, torques and slopes from the source
recurrences        writes the Taylor series from the source
written            prints what is written: ``python -m vibroplat.model.written``
motor              torque of the motors and resistance to rotation, for what reads a run
springs            stiffnesses and dampings, for energies, powers and loads
platform           mass matrix of platform and exciters and its inverse, and where the model holds
systems            the systems: which unknowns each has, and where they stand in the full state
equations          rows of the differential-algebraic equations F(t, y, y′) = 0 and their Jacobian, as kernels
accelerations      y′ and F_c by a direct solve, their derivatives along the motion and by the state
impact             the impact map, and the chatter map: impacts that accumulate
energy             energies, momentum and powers
sensitivity        derivatives of F, of the accelerations and of the impact map by any key of a scene
=================  =====================================================================================

To add a force, add it to ``source.equations`` (a spring to ``source.elastic_energy`` as well) and its coefficients to
``parameters``: rows, Jacobian, series, consistent starts, loads, multipliers and derivatives by parameters follow. A
damper on a coordinate that has had none gets a line in ``springs.DAMPERS``, for the audit. Nothing here knows an
integrator, a tolerance or a scene's run.
"""
