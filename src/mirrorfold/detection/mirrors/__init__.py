"""What a mirror is.

`mirror` is the interface that all steps ask. In an image, `line_mirror` is a straight mirror and `arc_mirror` a curved
one; in a volume, where `beam_mirror` is what both have in common, `plane_mirror` is flat and `round_mirror` a cylinder
or sphere. `curved` tells by how much curved mirrors dim what they show. `known_mirrors` reads mirrors that the user
gives, `plan_mirrors` takes them from a floor plan.
"""
