"""Raster scans: a lens focuses the beam, which is pointed in one direction after the other and receives its own echoes.

`range_profiles` turns the samples of each beam into a range profile by an inverse Fourier transform over frequency; the
profiles of all beams are a volume (range, azimuth, elevation). `gridding` interpolates the volume to Cartesian pixels:
a floor plan, or voxels. `imaging` does both within the available memory, and predicts time and memory.
"""
