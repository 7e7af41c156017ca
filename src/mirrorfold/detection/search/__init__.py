"""How mirrors are found among the echoes.

`growing` is the search that lines and planes share; `lines`, `arcs`, `planes` and `rounds` find mirrors of these
shapes. `rows` tells where a row of echoes breaks off. `fit` fits a mirror to the image itself, and `fronts` finds the
face of a wall that scatters from inside. `edge_on` finds walls along which the radar looks; `shadows` continues walls
behind the objects in front of them.
"""
