"""Echoes that something else explains: no object stands where the image shows them.

Told by the sweep (`misplaced` asks the first three, each echo once):

* `directions`: it left by one way and came back by another.
* `lobes`: it is a grating lobe of a brighter echo at its range.
* `wrapped`: it comes from beyond the ambiguous range.
* `half_shadows`: antennas that look past the end of a mirror hear it, or those that look into the mirror.

Told by the order of the mirrors, in each of the `rounds`:

* `copies`: it repeats a stronger echo, by the tail of the pulse or a layer in a wall.
* `rough_walls`: a rough wall scattered it towards another wall or an object, and back.
* `short_cuts`: it went straight from a rough wall to an object, and back by way of mirrors.
* `late_walls`: it went to and fro between two walls, and comes from beyond the ambiguous range.
* `edges`: it is what a mirror shows, although it stands beside the mirror's end.
* `shadowless`: the wall behind it goes on undimmed, so that it hides little.

Told by the whole tree, in the end (`doubted` asks):

* `late_edges`: the edge of a wall sent it on from between two walls, beyond the ambiguous range.
* `behind_walls`: it would stand behind a known wall.
* `behind_objects`: it would stand behind a known object.
* `to_and_fro`: it went to and fro between an object and a wall.
* `outshone`: it may be a side lobe of a much brighter echo.
"""
