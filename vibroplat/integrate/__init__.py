"""Integrators behind one seam, :mod:`~vibroplat.integrate.seam`.

``native`` drives IDA from compiled code, ``sundae`` through scikit-sundae; both use
:mod:`~vibroplat.integrate.multistep`. ``taylor`` is the Taylor series of the model. :mod:`~vibroplat.integrate.stepwise` makes an engine of any other integrator.
"""
