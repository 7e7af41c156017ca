"""Simulation of a raster scan by rays in three dimensions."""
