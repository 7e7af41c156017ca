"""The proposal of ``mirrorfold import --guess``: what the variables of a file probably are.

`guess` runs the search and tries the mapping; `recognition` finds samples and axes, `place_search` the positions of
antennas; `proposal` declares the result. Known names of variables are in `mirrorfold.io.mapping.names`.
"""
