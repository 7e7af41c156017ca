"""Which way of focusing is taken, for any array: the fastest that is exact enough and fits into the memory.

`choice` lays out the fast ways and compares their predicted times with that of the exact sum; `facts` are the records
in which a user is told. `strips` divides an image whose tables do not fit into the memory. `caching` keeps the latest
plan for the next sweep, and `proven` measures the error of the image that a plan makes, and refines the plan until the
tolerance holds.
"""
