"""The equations of motion, stated once, and what is written from them.

=================  =====================================================================================
parameters         the constants of the equations as a record, filled from a scene
source             the equations, as a person writes them
graph              expressions that the source is traced into, and their derivatives
straight           writes rows, Jacobian, mass matrix, loads, rates, torques and slopes from the source
recurrences        writes the Taylor series from the source
balances           writes what balances of energy and momentum, and loads of the foundation, take from the source
written            prints what is written: ``python -m vibroplat.model.written``
motor              torque of the motors and resistance to rotation, for what reads a run
springs            powers of dampers and forces into the foundation, slopes of springs and dampers
platform           mass matrix of platform and exciters and its inverse, and where the model holds
systems            the systems: which unknowns each has, and where they stand in the full state
equations          rows of the differential-algebraic equations F(t, y, y′) = 0 and their Jacobian, as kernels
accelerations      y′ and F_c by a direct solve, their derivatives along the motion and by the state
impact             the impact map, and the chatter map: impacts that accumulate
energy             energies, momentum and powers
sensitivity        derivatives of F, of the accelerations and of the impact map by any key of a scene
=================  =====================================================================================

To add a force, add it to ``source.holds``, a torque to ``source.motor``, any other to ``source.equations``, and its
coefficients to ``parameters``: rows, Jacobian, series, consistent starts, multipliers and derivatives by parameters
follow, and of what resists a coordinate the elastic energy, its line of the audit, the momentum and the load of the
foundation. Nothing here knows an integrator, a tolerance or a scene's run.
"""
