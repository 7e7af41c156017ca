"""What every folder may use: geometry, beams, decibels, windows, memory, threads; nothing here knows radar scenes."""
