"""The ray solver against a slow twin, which follows each path by itself in float64."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from floor_plans import busy_scene, make_scene, segment, wavenumber
from scipy.constants import speed_of_light

from mirrorfold.common.geometry import reflect, segment_normal
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.simulation.rays.outline import Outline, outline_of
from mirrorfold.simulation.rays.scatterers import draw_scatterers, specular_coefficient
from mirrorfold.simulation.rays.sweep import scattered_field


def twin_crossings(p: np.ndarray, q: np.ndarray, outline: Outline, obstacle: int) -> int:
    """How often the way p -> q crosses an obstacle away from its ends."""
    ray = q - p
    length = np.linalg.norm(ray)
    if obstacle < len(outline.facets):
        start, end = outline.facets[obstacle]
        matrix = np.stack([ray, start - end], axis=1)
        if np.linalg.det(matrix) == 0.0:
            return 0
        t, u = np.linalg.solve(matrix, start - p)
        return int(1e-6 < t * length < length - 1e-6 and 0.0 <= u <= 1.0)
    x, y, radius, first, span = outline.arcs[obstacle - len(outline.facets)]
    offset = p - [x, y]
    count = 0
    for t in np.roots([ray @ ray, 2 * ray @ offset, offset @ offset - radius**2]):
        if np.isreal(t) and 1e-6 < t.real * length < length - 1e-6:
            hit = offset + t.real * ray
            count += (np.arctan2(hit[1], hit[0]) - first) % (2 * np.pi) <= span
    return count


def twin_path(antenna, point, chain, outline, through=-1):
    """Length, cosines at the mirrors, the last leg's other end; None where the point is not seen."""
    images = [antenna]
    for facet in chain:
        images.append(reflect(images[-1], outline.facets[facet][0], segment_normal(*outline.facets[facet])))
    corners, cosines = [point], []
    for facet, image in zip(reversed(chain), reversed(images), strict=False):
        start, end = outline.facets[facet]
        matrix = np.stack([image - corners[-1], start - end], axis=1)
        if np.linalg.det(matrix) == 0.0:
            return None
        t, u = np.linalg.solve(matrix, start - corners[-1])
        if not (1e-9 < t < 1 and 0 <= u <= 1):
            return None
        ray = image - corners[-1]
        cosines.insert(0, abs(ray @ segment_normal(start, end)) / np.linalg.norm(ray))
        corners.append(corners[-1] + t * ray)
    corners.append(antenna)
    for leg, (p, q) in enumerate(itertools.pairwise(corners)):
        for obstacle in range(len(outline.surface)):
            inside = leg == 0 and obstacle == through
            if twin_crossings(p, q, outline, obstacle) != inside:
                return None
    return np.linalg.norm(images[-1] - point), cosines, corners[1]


def twin_chains(facets: int, longest: int):
    for count in range(longest + 1):
        for chain in itertools.product(range(facets), repeat=count):
            if all(a != b for a, b in itertools.pairwise(chain)):
                yield chain


def twin_reflection(scene, outline, chain, cosines, frequency):
    product = 1.0 + 0.0j
    for facet, cosine in zip(chain, cosines, strict=True):
        product = product * specular_coefficient(scene.surface[outline.surface[facet]], frequency, cosine)
    return product


def twin_glints(scene, outline, arc_index, tx, rx, chains, frequency):
    """Glints of one arc between two antennas, from a dense scan of the path length."""
    arc = outline.arcs[arc_index]
    surface = scene.surface[outline.surface[len(outline.facets) + arc_index]]
    k = 2 * np.pi * frequency / speed_of_light
    total = 0.0

    def image(antenna, chain):
        for facet in chain:
            antenna = reflect(antenna, outline.facets[facet][0], segment_normal(*outline.facets[facet]))
        return antenna

    def at(angle):
        return arc[:2] + arc[2] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    for out, back in itertools.product(chains, repeat=2):
        a, b = image(tx, out), image(rx, back)

        def length(angle, a=a, b=b):
            return np.linalg.norm(at(angle) - a, axis=-1) + np.linalg.norm(at(angle) - b, axis=-1)

        angles = np.linspace(arc[3], arc[3] + arc[4], 3001)
        values = length(angles)
        step = angles[1] - angles[0]
        turns = np.flatnonzero(np.diff(values)[:-1] * np.diff(values)[1:] <= 0.0) + 1
        for i in turns:
            curvature = values[i + 1] - 2 * values[i] + values[i - 1]
            angle = angles[i] - step * 0.5 * (values[i + 1] - values[i - 1]) / curvature
            point, outward = at(angle), np.array([np.cos(angle), np.sin(angle)])
            if ((a - point) @ outward) * ((b - point) @ outward) <= 0.0:
                continue
            one, two = twin_path(tx, point, out, outline), twin_path(rx, point, back, outline)
            if one is None or two is None:
                continue
            cosine = abs((a - point) @ outward) / one[0]
            bend = np.sign((a - point) @ outward)
            q = one[0] + two[0] + bend * 2 * one[0] * two[0] / (arc[2] * cosine)
            limit = np.sqrt(k / (2 * np.pi)) * cosine * arc[2] * arc[4] / np.sqrt(one[0] * two[0])
            total = total + (
                twin_reflection(scene, outline, out, one[1], frequency)
                * twin_reflection(scene, outline, back, two[1], frequency)
                * specular_coefficient(surface, frequency, cosine)
                * min(1 / np.sqrt(abs(q)), limit.min())
                * (1j if q < 0 else 1)
                * np.exp(-1j * k * (one[0] + two[0]))
            )
    return total


def twin_field(scene: Scene, *, bounces: int, seed: int, spacing: float) -> np.ndarray:
    """The scattered field path by path in float64, with every amplitude evaluated at every frequency."""
    outline = outline_of(scene)
    frequency = scene.band.frequency
    k = wavenumber(scene)
    tx, rx = scene.array.tx_position[:, :2], scene.array.rx_position[:, :2]
    scatterers = draw_scatterers(scene, outline, spacing=spacing, seed=seed)
    one_way = np.zeros((frequency.size, len(tx) + len(rx), len(scatterers.weight)), complex)
    near = list(twin_chains(len(outline.facets), bounces))
    both = np.concatenate([tx, rx])
    for (n, antenna), (p, point) in itertools.product(enumerate(both), enumerate(scatterers.points.position)):
        for chain in near:
            path = twin_path(antenna, point, chain, outline, scatterers.points.enclosing_face[p])
            if path is None or (path[2] - point) @ scatterers.points.normal[p] <= 0.0:
                continue
            cosine = (path[2] - point) @ scatterers.points.normal[p] / np.linalg.norm(path[2] - point)
            factor = (
                scatterers.laws[scatterers.law[p]].factor(frequency[:, None], np.array([cosine]))[:, 0]
                * scatterers.weight[p]
            )
            reflection = twin_reflection(scene, outline, chain, path[1], frequency)
            one_way[:, n, p] += factor * reflection * np.exp(-1j * k * path[0]) / np.sqrt(path[0])
    s = one_way[:, : len(tx)] @ one_way[:, len(tx) :].transpose(0, 2, 1)
    for (n, sender), (m, receiver) in itertools.product(enumerate(tx), enumerate(rx)):
        for chain in twin_chains(len(outline.facets), 2 * bounces):
            path = twin_path(sender, receiver, chain, outline) if chain else None
            if path is not None:
                reflection = twin_reflection(scene, outline, chain, path[1], frequency)
                s[:, n, m] += reflection * np.exp(-1j * k * path[0]) / np.sqrt(path[0])
        for arc in range(len(outline.arcs)):
            s[:, n, m] += twin_glints(scene, outline, arc, sender, receiver, near, frequency)
    return s


@pytest.mark.slow
@pytest.mark.parametrize(("bounces", "spacing"), [(1, 0.04), (2, 0.1)])
def test_agrees_with_the_slow_twin(bounces: int, spacing: float) -> None:
    # Apart from the transmitters, because their own paths in a corner all meet its vertex, which the twin cannot judge.
    scene = busy_scene(elements=2, rx={"elements": 2, "pitch": 0.013, "center": (0.021, 0.004)})
    fast = scattered_field(scene, bounces=bounces, seed=5, spacing=spacing, edges=False, curved=False)
    slow = twin_field(scene, bounces=bounces, seed=5, spacing=spacing)
    assert np.abs(fast - slow).max() < 1e-5 * np.abs(slow).max()


@pytest.mark.slow
def test_phasors_stay_exact_over_many_frequencies() -> None:
    band = {"start": 270e9, "stop": 300e9, "points": 401}
    rough = {"rms_height": 0.05e-3, "correlation_length": 0.2e-3}
    scene = make_scene(segment((-0.01, 3.0), (0.01, 3.0), roughness=rough), elements=2, pitch=0.1, band=band)
    fast = scattered_field(scene, bounces=1, seed=0, spacing=4e-3, edges=False)
    slow = twin_field(scene, bounces=1, seed=0, spacing=4e-3)
    # Most of it is the interpolation of amplitudes over this band of 10 percent.
    assert np.abs(fast - slow).max() < 2e-5 * np.abs(slow).max()
