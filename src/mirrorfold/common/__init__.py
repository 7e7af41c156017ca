"""Shared ground: geometry, beams, decibels, windows, memory and threads, which know nothing of radar scenes."""
