"""Raster scans: a focused beam is pointed in one direction after the other and hears its own echoes.

`range_profiles` turns the samples of each beam into a range profile by an inverse Fourier transform over frequency; all
together are a volume (range, azimuth, elevation). `gridding` looks the volume up on Cartesian pixels: its floor plan,
and its voxels. `imaging` does both within the memory there is, and tells beforehand what that takes.
"""
