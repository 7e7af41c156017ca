"""One sector of the image of a line array: antennas on one line or nearly so; lines may be displaced, tilted or bent.

`lattice` sorts the pairs by their midpoints and defines the polar coordinates (range, direction) of the pixels. `nodes`
picks the few pixels whose curvature phases determine those of all others (interpolative decomposition, Cheng et al.,
SIAM J. Sci. Comput. 26, 1389-1404, 2005). `sector_design` chooses the polar grid and the kernels of `interpolation`.
`sector` makes the image by Fourier transforms and the loops of `kernels`; `transpose` runs the same steps backwards,
from pixels to samples, with the loops of `transposed_kernels`.
"""
