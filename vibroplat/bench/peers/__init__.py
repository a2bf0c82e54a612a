"""What users would integrate the same scenes with instead, side by side with vibroplat.

Each peer advances one mode at a time; :mod:`vibroplat.bench.peers.hybrid` does the transitions for all
of them, with the package's own impact law, so that only the integration differs. Their libraries come
with the optional extra ``bench``.
"""
