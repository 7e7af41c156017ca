"""Scenes: surfaces, materials, arrays and scanners of the truth, in the floor plan and in space."""
