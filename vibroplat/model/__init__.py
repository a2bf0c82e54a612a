"""The equations of motion, each term written once.

=================  =====================================================================================
parameters         the constants of the equations as a record, filled from a scene
motor              torque of the motors and resistance to rotation, with their slopes
springs            forces of springs and dampers, with their slopes
platform           mass matrix and forces of platform and exciters, and where the model holds
systems            the five systems: which unknowns each has, and where they stand in the full state
equations          rows of the differential-algebraic equations F(t, y, y′) = 0 and their Jacobian
accelerations      y′ and F_c by a direct solve, their derivatives along the motion and by the state
impact             the impact map, and the chatter map: impacts that accumulate
energy             energies, momentum and powers
sensitivity        derivatives of F, of the accelerations and of the impact map by any key of a scene
=================  =====================================================================================

To add a spring or a damper, edit ``springs.restoring``: residual, Jacobian, series, energies, powers, loads and
derivatives by parameters follow. To change another force, edit ``platform.forces``, its derivatives in
``equations.jacobian`` and its terms in ``series``. Nothing here knows an integrator, a tolerance or a scene's run.
"""
