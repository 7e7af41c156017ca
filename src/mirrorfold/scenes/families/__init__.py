"""Families of random scenes, on which methods are judged."""
