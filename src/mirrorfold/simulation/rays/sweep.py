"""Ray simulation in two dimensions: specular paths of geometrical optics, and diffuse scatterers at fixed places.

The field of every antenna at every scatterer is the sum over the direct ray and the paths over all chains of mirrors,
``A[n, s] = sum over paths of prod(R rho) exp(-j k d) / sqrt(d)``, times the factor of the scatterer for one way. By
reciprocity the diffuse part of the sweep is ``S = A_tx A_rx^T``, one matrix product per frequency. It contains all
mixed paths, which go out over one chain and back over another. The purely specular returns are added: mirrors and
corners by chains of images, arcs and circles by their glints, and edge waves from the ends of mirrors, which make a
specular return fade instead of stopping abruptly. All other waves fade in penumbras (`penumbras`) at the edges of
shadows, and of what mirrors show.

Walls with a thickness reflect and transmit (`slabs`); everything else is opaque.

Arcs are mirrors, too. Chains on each way are of flat mirrors only, up to the number of bounces, or of at most two
mirrors with an arc among them.

Not simulated: edge waves of arcs; beyond penumbras, those of shadows, and those that go out over one chain and back
over another; what several edges do in turn; paths that are scattered diffusely twice; longer chains with arcs, and
those that lead through a wall.
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
from mirrorfold.simulation.rays.tiles import VisibleScene, find_visible, specular_paths, tiles_that_fit


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
    """The scattered field at each receiver for each transmitter, whose own field is ``exp(-j k d) / sqrt(d)``.

    If the memory does not hold the paths to all scatterers at once, the scatterers are processed in tiles, and the
    sweeps of the tiles are added. The result then differs by rounding.

    Parameters
    ----------
    scene : Scene
    bounces : int
        Largest number of mirrors between an antenna and a scatterer; twice as many in purely specular returns.
    seed : int
    spacing : float [m], optional
        Mean distance of the diffuse scatterers along the outlines; by default the wavelength at mid-band.
    edges : bool
        Whether waves fade at edges; if not, the sweep is that of geometrical optics.
    curved : bool
        Whether arcs reflect waves on to other surfaces; if not, they only scatter and glint themselves.
    memory_limit : float [B], optional
        Total memory that this process may hold; by default what is free.
    progress : callable, optional
        Called as ``progress(done, total)`` after every block of frequencies.

    Returns
    -------
    (frequencies, tx, rx) complex64 array

    Raises
    ------
    InputError
        If the scene is not two-dimensional, has surfaces that rays cannot follow, or does not fit even in tiles.
    """
    visible = find_visible(scene, bounces=bounces, seed=seed, spacing=spacing, edges=edges, curved=curved)
    count, field_bytes = tiles_that_fit(visible, memory_limit)
    shape = scene.band.points, len(visible.tx), len(visible.rx)
    s = np.zeros(shape, dtype=np.complex64)
    count_up = counted(progress, count * shape[0])
    for number, tile in enumerate(visible.scatterers.tiles(count)):
        # Specular paths are made for the last tile only: made earlier, they would take memory from every tile.
        specular = specular_paths(visible) if number == count - 1 else []
        _add(s, visible, tile, specular, field_bytes, count_up)
    return s


def _add(
    s: NDArray[np.complex64],
    visible: VisibleScene,
    scatterers: Scatterers,
    specular: list[Paths],
    field_bytes: float,
    progress: Callable[[int], None],
) -> None:
    """Add the returns of some scatterers and of some specular paths to the sweep `s`, in blocks of frequencies."""
    from_tx = diffuse_paths(visible.scene, visible.outline, visible.over_tx, scatterers)
    from_rx = (
        from_tx if visible.same_array else diffuse_paths(visible.scene, visible.outline, visible.over_rx, scatterers)
    )
    # Only scatterers that both a transmitter and a receiver see contribute.
    used = np.intersect1d(points_of(from_tx), points_of(from_rx)).astype(np.int32)
    for pieces in (from_tx,) if visible.same_array else (from_tx, from_rx):
        for index in range(len(pieces)):  # one by one, so that no two copies of all of them exist
            pieces[index] = pieces[index].renumbered(used)
    frequencies, n_tx, n_rx = s.shape
    block = visible.block(used.size, field_bytes)
    tx_field = np.empty((block, n_tx, used.size), dtype=np.complex64)
    rx_field = tx_field if visible.same_array else np.empty((block, n_rx, used.size), dtype=np.complex64)
    returned = np.empty((block, n_tx, n_rx), dtype=np.complex64)
    for first in range(0, frequencies, block):
        part = s[first : first + block]
        at = slice(0, len(part))
        next_fields(from_tx, tx_field[at])
        if not visible.same_array:
            next_fields(from_rx, rx_field[at])
        products(tx_field[at], rx_field[at].transpose(0, 2, 1), out=returned[at])
        part += returned[at]
        part += next_fields(specular, returned[at])
        progress(len(part))
