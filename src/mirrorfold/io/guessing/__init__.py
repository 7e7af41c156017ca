"""The proposal of ``mirrorfold import --guess``: what the variables of a file probably are.

`guess` runs it and tries the mapping; `recognition` finds samples and axes, `place_search` antennas; `proposal` is what
they fill in. Names of variables that are known stand in `mirrorfold.io.mapping.names`.
"""
