"""Echoes from some ranges, taken out of a sweep, for antennas that stand anywhere.

`range_gate` filters one window of range out of a sweep, at fewer frequencies (Oppenheim and Schafer, Discrete-Time
Signal Processing, section 7.6): these suffice for the near pixels of line arrays. `range_windows` cuts many windows out
of one sweep, for single echoes. `coherence` measures how well an echo adds up in phase over the pairs if it came from a
point, a flat face or a corner at a given distance (Hubral, Geophysics 48, 1051-1062, 1983).
"""
