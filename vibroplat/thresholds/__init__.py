"""Values of a key at which an outcome changes: ``values`` measures at one, ``search`` narrows, ``study`` reports."""
