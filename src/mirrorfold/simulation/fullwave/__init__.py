"""Full-wave simulation of two-dimensional scenes of perfect conductors and dielectric walls, line sources.

All multiple scattering, diffraction and shadowing are in it. In the order of the work: `contours` (with `roughness` and
`slabs`), `discretisation` (with `kernel`) of conductors with E along the axis, `boundaries` (with `media`) of all else,
`compression`, `solver`; `preparation` joins them for a scene, `tasks` runs many frequencies, `sweep` and `near_field`
are what users call.
"""
