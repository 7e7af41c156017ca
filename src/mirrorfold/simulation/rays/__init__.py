"""Simulation by rays in the floor plan: frozen scatterers, and the specular paths to each of them."""
