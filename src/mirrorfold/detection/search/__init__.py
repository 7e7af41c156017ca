"""How mirrors are found among the echoes.

`growing` is the search that lines and planes share; `lines`, `arcs`, `planes` and `round_sheets` find mirrors of these
shapes (`round_sheets`: cylinders and spheres); `circles` proposes those of `arcs`. `rows` finds unbroken rows of
echoes, `side_lobes` rejects some; `rims` finds the beams at which a plane ends. `fit` fits a mirror to the image
itself, `joined` two arcs that pass into each other; `remembered` keeps fits of rows. `fronts` and `thick_walls` find
the face of a wall that scatters from inside: where it stands, and its direction. `coherent` fits the line of a rough
wall to the complex image, speckle included. `edge_on` finds walls along which the radar looks; `shadows` continues
walls that objects hide in part.
"""
