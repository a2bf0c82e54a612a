"""The configuration: what keys there are, how files and overrides become a scene, and what is said of mistakes."""
