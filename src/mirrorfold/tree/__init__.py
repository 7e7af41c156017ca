"""Steps 3 and 4 of the algorithm: who is seen through whom."""
