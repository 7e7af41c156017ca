"""What each way of focusing will take: `cost` counts its steps and its memory, and `machine` knows how long each step
takes on this computer, where it was timed once.
"""
