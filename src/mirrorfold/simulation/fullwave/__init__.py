"""Full-wave simulation of two-dimensional scenes: line sources, perfect conductors and dielectric walls.

The integral equations include all multiple scattering, diffraction and shadowing. In the order of the work: `contours`
(with `roughness` and `slabs`) describes the outlines; `discretisation` (with `kernel`) holds the equations of
conductors with E along the axis, `boundaries` (with `media`) those of everything else; `compression` and `solver` solve
them. `preparation` joins these steps for a scene, `tasks` runs many frequencies, and users call `sweep` and
`near_field`.
"""
