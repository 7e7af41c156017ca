"""Ray simulation in two dimensions: specular paths of geometrical optics and frozen diffuse scatterers.

The field of every antenna at every scatterer is the sum over the direct ray and the paths over all chains of
mirrors, ``A[n, s] = sum over paths of prod(R rho) exp(-j k d) / sqrt(d)`` times the scatterer's factor. By reciprocity
the diffuse part of the sweep is ``S = A_tx A_rx^T``, one matrix product per frequency, which holds all mixed paths
(there over one chain, back over another). To it come the purely specular returns: mirrors and corners by chains of
images, arcs and circles by their glints, and the waves from the ends of mirrors, with which a return fades instead of
stopping at once.

Walls with a thickness reflect and let through (`slabs`); everything else is opaque.

Arcs are mirrors, too: on each way there may be two mirrors with an arc among them, and any number of flat ones.

What is left out: edge waves of arcs, of shadows, and of a mirror after another has reflected the wave; light that
scatters diffusely twice; longer chains with arcs, and those that lead through a wall.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.threads import counted, products
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.simulation.rays.phasors import Paths, next_fields, points_of
from mirrorfold.simulation.rays.returns import diffuse_paths
from mirrorfold.simulation.rays.scatterers import Scatterers
from mirrorfold.simulation.rays.tiles import Lit, light, specular_paths, tiles_that_fit


def scattered_field(
    scene: Scene,
    *,
    bounces: int,
    seed: int,
    spacing: float | None = None,
    edges: bool = True,
    curved: bool = True,
    memory_limit: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> NDArray[np.complex64]:
    """What each receiver measures of each transmitter, for sources with the field ``exp(-j k d) / sqrt(d)``.

    Where the memory does not hold the paths to all scatterers at once, these are taken in tiles, whose shares of the
    sweep add up; sums in another order differ by rounding.

    Parameters
    ----------
    scene : Scene
    bounces : int
        Largest number of mirrors between an antenna and what scatters; twice as many in purely specular returns.
    seed : int
    spacing : float [m], optional
        Mean distance of the diffuse scatterers along the outlines; by default the wavelength at mid-band.
    edges : bool
        Whether the ends of mirrors radiate; without, specular returns are those of geometrical optics.
    curved : bool
        Whether arcs are mirrors on the way to something else; without, they scatter and glint alone.
    memory_limit : float [B], optional
        Of all that this process may hold; by default what is free.
    progress : callable, optional
        Called as ``progress(done, total)`` after every block of frequencies.

    Returns
    -------
    (frequencies, tx, rx) complex64 array

    Raises
    ------
    InputError
        If the scene is not a two-dimensional one of surfaces that rays can follow, or not even a tile fits.
    """
    lit = light(scene, bounces=bounces, seed=seed, spacing=spacing, edges=edges, curved=curved)
    count, field_bytes = tiles_that_fit(lit, memory_limit)
    shape = scene.band.points, len(lit.tx), len(lit.rx)
    s = np.zeros(shape, dtype=np.complex64)
    count_up = counted(progress, count * shape[0])
    for number, tile in enumerate(lit.rough.tiles(count)):
        # Specular returns go with the last tile, when they need no more room than the paths of any other.
        specular = specular_paths(lit) if number == count - 1 else []
        _add(s, lit, tile, specular, field_bytes, count_up)
    return s


def _add(
    s: NDArray[np.complex64],
    lit: Lit,
    rough: Scatterers,
    specular: list[Paths],
    field_bytes: float,
    progress: Callable[[int], None],
) -> None:
    """Add what some scatterers, and some specular paths, return to a sweep, in blocks of frequencies."""
    from_tx = diffuse_paths(lit.scene, lit.world, lit.over_tx, rough)
    from_rx = from_tx if lit.same_array else diffuse_paths(lit.scene, lit.world, lit.over_rx, rough)
    # A scatterer counts where both ways reach it.
    used = np.intersect1d(points_of(from_tx), points_of(from_rx)).astype(np.int32)
    for pieces in (from_tx,) if lit.same_array else (from_tx, from_rx):
        for index in range(len(pieces)):  # one by one, so that no two copies of all of them exist
            pieces[index] = pieces[index].renumbered(used)
    frequencies, n_tx, n_rx = s.shape
    block = lit.block(used.size, field_bytes)
    tx_field = np.empty((block, n_tx, used.size), dtype=np.complex64)
    rx_field = tx_field if lit.same_array else np.empty((block, n_rx, used.size), dtype=np.complex64)
    returned = np.empty((block, n_tx, n_rx), dtype=np.complex64)
    for first in range(0, frequencies, block):
        part = s[first : first + block]
        at = slice(0, len(part))
        next_fields(from_tx, tx_field[at])
        if not lit.same_array:
            next_fields(from_rx, rx_field[at])
        products(tx_field[at], rx_field[at].transpose(0, 2, 1), out=returned[at])
        part += returned[at]
        part += next_fields(specular, returned[at])
        progress(len(part))
