"""Import of a scan that consists of one file for each position of the antennas, or of networks of scikit-rf.

`positions` reads the table or description of the antennas' positions, `networks` represents networks in memory as
files, and `scan` makes the sweep.
"""
