"""Scenes, measures and pictures that several experiments share, and the longer pages of single experiments."""
