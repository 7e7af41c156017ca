"""Step 2 of the algorithm: the radar's own view, its echoes, and the mirrors among them."""
