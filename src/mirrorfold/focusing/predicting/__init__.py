"""Predicted time and memory of each algorithm: `cost` counts the steps and the memory, and `machine` times each kind of
step, once on each computer.
"""
