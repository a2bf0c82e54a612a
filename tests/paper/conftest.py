"""Fixtures that these tests share with those of sweeps."""

from __future__ import annotations

from study.conftest import command, kernels

__all__ = ["command", "kernels"]
