"""Echoes of some ranges, taken out of a sweep of antennas that may stand anywhere.

`range_gate` filters one window of range out of a sweep, so that fewer frequencies hold it (Oppenheim and Schafer,
Discrete-Time Signal Processing, section 7.6): the near pixels of line arrays need no more. `range_windows` cuts many
windows out of one sweep, for single echoes. `coherence` tells how well an echo adds up in phase over the pairs if it
came from a point, a flat face or a corner at some distance (Hubral, Geophysics 48, 1051-1062, 1983).
"""
