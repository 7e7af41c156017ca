"""Full-wave simulation of two-dimensional scenes of perfect conductors, E along the axis (TMz), line sources.

All multiple scattering, diffraction and shadowing are in it. In the order of the work: `contours` (with `roughness`),
`discretisation` (with `kernel`), `compression`, `solver`; `preparation` joins them for a scene, `tasks` runs many
frequencies, `sweep` and `near_field` are what users call.
"""
