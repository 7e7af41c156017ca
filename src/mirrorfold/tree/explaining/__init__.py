"""Echoes with another cause than an object at their place in the image. Each module tests for one cause.

With the sweep (`misplaced` calls the first three, once in each resolution cell):

* `directions`: the echo left by one way and came back by another.
* `lobes`: it is a grating lobe of a brighter echo at its range.
* `wrapped`: it comes from beyond the ambiguous range.
* `half_shadows`: only antennas that look past the end of a mirror receive it, or only those that look into the mirror.

What these need of the sweep is in `waves` and `apertures`. By the same waves `corners` finds the vertices of corners,
through which no mirror goes on.

With the order of the mirrors, in each of the `rounds`:

* `copies`: the echo repeats a stronger one, by the tail of the pulse or a layer in a wall.
* `rough_walls`: a rough wall scattered it towards another wall or an object, and back.
* `short_cuts`: it went straight from a rough wall to an object, and back by way of mirrors.
* `edges`: it stands beside the end of a mirror, and is seen by way of that mirror all the same.
* `shadowless`: it stands before a wall whose echoes go on undimmed, so that it hides little.

With the whole tree, in the end (`explained_by_tree` calls them; `true_walls` holds where its walls stand):

* `behind_walls`: its object would stand behind a known wall.
* `behind_objects`: its object would stand behind a known object.
* `to_and_fro`: it went to and fro between an object and a wall or another object.
* `in_corners`: it may be seen in a leg of a corner.
* `reflected_on`: a flat object beside its path reflected it, and its object is known elsewhere.
* `flanks`: it is the flank of a brighter echo that is explained.
* `outshone`: it may be a side lobe of a much brighter echo.
"""
