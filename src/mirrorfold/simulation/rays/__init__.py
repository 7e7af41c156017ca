"""Simulation by rays in the floor plan: diffuse scatterers at fixed places, and the specular paths to each of them."""
