"""Steps 5 and 6 of the algorithm: every ghost back to its true place, and the folded scene."""
