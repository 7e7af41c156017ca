"""Scenes, the ground truth: surfaces, materials, antenna arrays and scanners, in the floor plan and in space."""
