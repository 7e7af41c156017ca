"""The choice of the algorithm: the fastest one that keeps to the tolerance and fits into the memory.

`choice` compares the predicted times of the fast algorithms with that of the exact sum; `facts` holds the records that
report this to a user. `strips` divides an image whose tables do not fit into the memory. `caching` keeps the latest
plan for the next sweep. `proven` measures the error of the image that a plan makes, and refines the plan until the
tolerance holds.
"""
