"""A scan that was left as one file for each position of the antennas, or as networks of scikit-rf.

`positions` reads the table or description that says where they stood, `networks` takes the place of files in memory,
and `scan` makes the sweep.
"""
