"""Numerical stability under stress: one module for each kind of situation, each scene with its check.

A situation is a function of a number of scenes that returns a row for each: what was measured, what is
allowed of it (:mod:`vibroplat.bench.stability.checks`), and what is beyond. What stands in
:mod:`vibroplat.bench.stability.situations` is run by ``vibroplat bench stability`` and, with few scenes, by the tests.
"""
