"""Step 2 in space: flat sheets of echoes are mirrors. Their extent is the set of beams that show them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_closing, binary_erosion, binary_fill_holes, binary_opening, label

from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.plane_mirror import PlaneMirror
from mirrorfold.detection.search.fit import refined
from mirrorfold.detection.search.fronts import find_front
from mirrorfold.detection.search.growing import Search
from mirrorfold.detection.search.rims import within_rim
from mirrorfold.detection.views.view import DEVIATION
from mirrorfold.detection.views.volume_view import VolumeView

MINIMUM_CELLS = 7.5
"""Least width and height of a mirror, in resolution cells: any surface is flat over a few cells, and a few single
echoes may lie in a plane by chance."""

SMALLEST_FILL = 0.5
"""Least share of a mirror's beams that must hold one of its own echoes."""

GAP_BEAMS = 3
"""Largest gap in a wall, in beams: speckle fades over one or two."""

LARGEST_DEVIATION = 1.2
"""Largest standard deviation of the centroids of power from a mirror's plane, relative to ``hypot(a, b)``, with a the
standard deviation of power in the footprint of the beam, and b that of `INSIDE_CELLS`. Walls, which average over the
footprint, have up to 0.8; the flattest parts of a body 1.3 and more."""

INSIDE_CELLS = 0.065
"""Largest standard deviation, in resolution cells, that scattering from inside a wall adds to that of its centroids."""

DEPTH_CHANGE = 0.15
"""Largest change of the depth of the centroids from one end of a wall to the other, as a share of that depth, as beams
meet the wall more and more askew: so scattering from inside turns the plane."""

EDGE_FOOTPRINTS = 2.0
"""Width of the edge of a mirror, in beam radii, of which no plane is fitted: beams show echoes of the mirror up to one
radius beyond its edge, and the footprint of a beam reaches over one more."""

SMALLEST_INNER = 0.2
"""Least share of a mirror's beams to which a plane is fitted: the standard error of the direction grows as the inverse
of the share, and edges turn planes by three to six standard errors."""

PROFILE = 1.7, 0.01, 0.01
"""Arguments `reach`, `lobe` and `clip` of `power_centroids` for planes. Unlike `lines.PROFILE`, the profiles hold the
whole footprint and all that scatters inside. All places have the same weight, because the centroids of bright ones lie
deeper."""


def find_planes(echoes: Echoes, view: VolumeView, *, minimum_length: float, tested: bool = True) -> list[PlaneMirror]:
    """Plane mirrors among the visible echoes of a volume, that of the most beams first: see `Search`."""
    found = _Planes(echoes, view, minimum_length, tested).find(enough=0.0)
    if tested:
        found = [within_rim(mirror, view) for mirror in found]
    return sorted(found, key=lambda mirror: -float(mirror.beams.sum()))


class _Planes(Search[PlaneMirror]):
    """The search for flat sheets of echoes.

    The limit `sagitta` is about half that of lines: a sheet of a hundred cells shows a bulge twice as well as a row of
    ten.
    """

    fewest, sagitta, misses = 30, 0.16, 2
    view: VolumeView

    def patch(self, normal: Array, center: Array, near: Index) -> tuple[PlaneMirror, Index]:
        """The mirror of the largest connected set of beams that show a plane, its small gaps closed."""
        beam = self.echoes.direction[near]
        # Thin strips of chance echoes, up to four beams wide, do not join two walls.
        largest = binary_fill_holes(largest_sheet(beam, self.view.shape, thinnest=2))
        beams = largest.ravel() & (self.view.meets(normal, center) <= self.view.range[-1])
        towards = normal * -np.sign((center - self.view.radar) @ normal)
        mirror = PlaneMirror(center, towards, np.empty((0, 3)), beams)
        return mirror.part_in_beams(self.view, beams) if beams.any() else mirror, near[beams[beam]]

    def along_bend(self, mirror: PlaneMirror, points: Array) -> Array:
        """Their places along the direction in which the best paraboloid through them is bent most."""
        place = (points - mirror.center) @ mirror.tangents.T
        u, v = place.T
        terms = np.column_stack([u**2, u * v, v**2, place, np.ones(len(place))])
        uu, uv, vv = np.linalg.lstsq(terms, mirror.beside(points), rcond=None)[0][:3]
        bend, direction = np.linalg.eigh([[uu, 0.5 * uv], [0.5 * uv, vv]])
        return place @ direction[:, np.argmax(np.abs(bend))]

    def passes(self, mirror: PlaneMirror) -> bool:
        """Whether enough of its beams hold echoes."""
        return mirror.fill >= SMALLEST_FILL

    def refined(self, mirror: PlaneMirror) -> PlaneMirror | None:
        """The mirror, fitted to the volume and moved to the face of the wall; None if no plane fits the centroids."""
        view, beams = self.view, mirror.beams
        mirror, deviation = refined(replace(mirror, beams=inner_beams(mirror, view)), view, *PROFILE)
        if not (np.isfinite(deviation) and np.isfinite(mirror.met(view)[beams]).all()):
            return None
        spread = DEVIATION * np.median(view.extent(mirror.places(view), mirror.normal))
        if deviation > LARGEST_DEVIATION * np.hypot(spread, INSIDE_CELLS * view.cell_at(mirror.center)):
            return None
        front = find_front(mirror, view)
        face = replace(mirror, center=mirror.center + front.depth * mirror.normal, depth=max(front.depth, 0.0))
        turned = np.degrees(DEPTH_CHANGE * face.depth / mirror.size)
        angle, offset = np.hypot([mirror.angle_error, mirror.offset_error], [turned, front.error]).tolist()
        return replace(face, angle_error=angle, offset_error=offset).part_in_beams(view, beams)


def inner_beams(mirror: PlaneMirror, view: VolumeView) -> Mask:
    """Its beams whose whole footprint lies on it, (beams,); all, if these are too few to fit a plane to them.

    At an edge, only the inner part of a footprint returns waves: seen askew, this part is nearer at the far end of a
    wall, and farther away at the near end, which turns the plane. Mirrors go on beyond the edge of a scan.
    """
    steps = int(np.ceil(EDGE_FOOTPRINTS * mirror.beam_steps(view)))
    inner = binary_erosion(mirror.beams.reshape(view.shape), iterations=steps, border_value=1).ravel()
    return inner if np.count_nonzero(inner) >= SMALLEST_INNER * np.count_nonzero(mirror.beams) else mirror.beams


def largest_sheet(beam: Index, shape: tuple[int, ...], *, thinnest: int) -> Mask:
    """The largest connected set of beams with echoes, in the shape of the scan; its gaps up to `GAP_BEAMS` are closed.

    Parts that are narrower than `thinnest` beams to either side of their middle are removed, and do not join others.
    """
    lit = np.zeros(shape, dtype=bool)
    lit.ravel()[beam] = True
    pad = GAP_BEAMS + 1
    closed = binary_closing(np.pad(lit, pad), iterations=GAP_BEAMS)[pad:-pad, pad:-pad]
    opened = binary_opening(np.pad(closed, thinnest, mode="edge"), iterations=thinnest)
    regions, _ = label(opened[thinnest:-thinnest, thinnest:-thinnest])
    return regions == 1 + np.argmax(np.bincount(regions.ravel(), minlength=2)[1:])
