"""YAML in: files that extend files, command-line overrides, one scene out."""

from __future__ import annotations
from vibroplat.scene import Scene
def load_config(path): ...
