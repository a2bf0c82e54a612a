"""Rounds of random work that is disturbed, for as long as a release takes.

``rounds`` is what is done in a round, ``processes`` starts and kills commands and dask's workers, ``soak`` goes from
round to round.
"""
