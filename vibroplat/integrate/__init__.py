"""Integrators behind one seam, :mod:`~vibroplat.integrate.seam`.

``native`` drives IDA from compiled code, ``sundae`` through scikit-sundae; both use
:mod:`~vibroplat.integrate.multistep`. ``taylor`` is the Taylor series of the model. Any other integrator becomes an
engine by :mod:`~vibroplat.integrate.stepwise`.
"""
