"""What a mirror is.

`mirror` is the interface that all steps use. In an image, `line_mirror` is a straight mirror and `arc_mirror` a curved
one. In a volume, `plane_mirror` is flat, and `round_mirror` a cylinder or a sphere; `beam_mirror` holds what both have
in common. `curved` computes by how much curved mirrors dim what they show. `known_mirrors` reads mirrors that the user
gives, `plan_mirrors` takes them from a floor plan, `seen_arcs` tells which parts of given arcs the radar sees.
"""
