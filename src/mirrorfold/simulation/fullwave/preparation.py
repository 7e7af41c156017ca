"""From a scene to the system of equations: its nodes and skeletons, and checks that the solver can take the scene."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light
from scipy.spatial import cKDTree

from mirrorfold.common.arguments import in_message
from mirrorfold.common.memory import available_memory
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.materials import Dielectric, Substance, material, permittivity
from mirrorfold.scenes.surfaces import Segment, Surface
from mirrorfold.simulation.fullwave.boundaries import Boundaries, Equation
from mirrorfold.simulation.fullwave.compression import compress
from mirrorfold.simulation.fullwave.contours import Arm, contours, is_slab, outline_length
from mirrorfold.simulation.fullwave.discretisation import Nodes, discretise
from mirrorfold.simulation.fullwave.solver import System
from mirrorfold.simulation.plane import in_plane

TOLERANCES = (3e-5, 0.1)
"""Smallest and largest tolerance: single precision allows no smaller one."""

SMOOTH_NODES = 7.5
"""Number of nodes per wavelength on a smooth surface at a tolerance of 1e-3."""

ROUGH_NODES = 2.5
"""Additional nodes per wavelength on a rough surface, times ``lambda / L`` with the correlation length L, times the rms
slope."""

FEWEST_NODES = 10.0
"""Least number of nodes per wavelength: neighbours are then less than one radian of phase apart."""

NODES_PER_CORRELATION = 2.0
"""Least number of nodes per correlation length of a rough surface."""

ORDER = 5
"""Order of the quadrature: the error falls with this power of the number of nodes."""

INTERPOLATION_SHARE = 0.15
"""Tolerance of the skeletons over that of the sweep: the errors of many groups add up."""

DENSE_BELOW = 1000
"""Number of unknowns up to which the whole system is solved without skeletons."""

CLEARANCE = 2.0
"""Least distance of antennas from surfaces, in spacings of the nodes."""

NODES_PER_THICKNESS = 8.0
"""Least number of nodes on a piece of a slab's contour that is as long as the slab is thick: this resolves its rounded
ends, and keeps its two faces apart."""

TOUCH = 0.75
"""Distance, in spacings of the nodes, below which two surfaces count as crossing or touching."""

BYTES_PER_NODE = 2.5e3
"""Memory per node [B] that large scenes take while their skeletons are being chosen."""

SKELETONS_PER_WAVELENGTH = 1.0
"""Least number of skeletons per wavelength that remain of a surface: a wall seen from a few directions keeps 1.4."""

STEEPEST_SLOPE = 2.0
"""Largest rms slope of a rough surface, 63 degrees: steeper surfaces would need too many nodes in their clefts."""

NEIGHBOURHOOD = 10.0
"""Distance along a surface, in spacings of the nodes, up to which the surface may come close to itself."""


def prepare(
    scene: Scene, *, tolerance: float = 1e-3, seed: int = 0, nodes_per_wavelength: float | None = None
) -> System:
    """Discretise a scene, check it, and choose its skeletons.

    Parameters
    ----------
    scene : Scene
    tolerance : float
        Relative root-mean-square error of the sweep.
    seed : int
        Seed of the random profiles of rough surfaces.
    nodes_per_wavelength : float, optional
        Number of nodes per wavelength on all surfaces, at the highest frequency; by default as many as the tolerance
        and the roughness require.

    Raises
    ------
    InputError
        If the scene cannot be solved, with the reason and the remedy.
    """
    if not TOLERANCES[0] <= tolerance <= TOLERANCES[1]:
        raise InputError(
            f"tolerance is {in_message(tolerance)}, expected a number from {TOLERANCES[0]:g} to {TOLERANCES[1]:g}"
        )
    if not scene.surface:
        raise InputError(f"scene {scene.name!r}: there is nothing to simulate, it has no surfaces; add one")
    tx, rx = in_plane(scene.array.tx_position), in_plane(scene.array.rx_position)
    wavelength = speed_of_light / scene.band.stop
    densities = [
        density(surface, wavelength, tolerance, nodes_per_wavelength, f"surface[{index}] {surface.name!r}")
        for index, surface in enumerate(scene.surface)
    ]
    _check_size(scene, densities, wavelength)
    arms = contours(scene, seed=seed)
    nodes = discretise(arms, wavelength=wavelength, per_wavelength=[densities[arm.surface] for arm in arms])
    equation = _equation(scene, nodes, arms)
    label: Callable[[int], str] = lambda index: f"surface[{index}] {scene.surface[index].name!r}"  # noqa: E731
    _check_antennas(nodes, np.concatenate([tx, rx]), label)
    _check_apart(nodes, label)
    if isinstance(equation, Boundaries):
        _check_insides(equation, np.concatenate([tx, rx]), label)
    system = System(equation, tx, rx, ())
    if equation.size <= DENSE_BELOW:
        return system
    k = 2.0 * math.pi / wavelength
    roots = compress(equation, system.antennas, k=k, tolerance=INTERPOLATION_SHARE * tolerance)
    return System(equation, tx, rx, roots)


def _equation(scene: Scene, nodes: Nodes, arms: list[Arm]) -> Equation:
    """The equation of a scene: the nodes themselves for conductors in TE, `Boundaries` for everything else."""
    inside = tuple(made_of(surface.material) if is_slab(surface) else None for surface in scene.surface)
    if scene.polarization == "TE" and not any(inside):
        return nodes
    if scene.polarization == "both":
        raise InputError(f"scene {scene.name!r}: polarization is 'both'; choose 'TE' or 'TM' here")
    if scene.polarization == "TM":
        for arm in arms:
            if "vertex" in arm.ends:
                name = scene.surface[arm.surface].name
                raise InputError(
                    f"surface[{arm.surface}] {name!r} has sharp vertices, which the full-wave "
                    "solver takes in polarization 'TE' alone; round them, with kind = \"curve\", or take 'rays'"
                )
    return Boundaries(nodes, inside, scene.polarization)


def made_of(name: str | Substance) -> Dielectric | None:
    """The dielectric of a name or substance; None for conductors."""
    found = material(name)
    return found if isinstance(found, Dielectric) else None


def density(surface: Surface, wavelength: float, tolerance: float, chosen: float | None, label: str) -> float:
    """Number of nodes per wavelength on a surface: `chosen` by the user, or as roughness and tolerance require.

    On a slab it is set by the wavelength inside, but returned per wavelength outside.

    Raises
    ------
    InputError
        If the chosen number is too small for the equation or the roughness, or the surface is too steep.
    """
    if isinstance(surface, Segment) and surface.thickness is not None:
        frequency = speed_of_light / wavelength
        refraction = max(1.0, abs(np.sqrt(complex(permittivity(surface.material, frequency)))))
        opaque = replace(surface, material="pec", thickness=None)
        inner = density(opaque, wavelength / refraction, tolerance, chosen, label)
        return max(refraction * inner, NODES_PER_THICKNESS * wavelength / surface.thickness)
    least, reason = FEWEST_NODES, "to integrate the kernel"
    roughness = surface.roughness
    steepness = 0.0
    if roughness is not None:
        relative = wavelength / roughness.correlation_length
        slope = math.sqrt(2.0) * roughness.rms_height / roughness.correlation_length
        if slope > STEEPEST_SLOPE:
            raise InputError(
                f"{label}: roughness of rms_height {roughness.rms_height:g} m and correlation_length "
                f"{roughness.correlation_length:g} m has an rms slope of {slope:.3g}; expected at most "
                f"{STEEPEST_SLOPE:g}, lower the height or lengthen the correlation"
            )
        steepness = relative * slope
        if least < NODES_PER_CORRELATION * relative:
            least, reason = NODES_PER_CORRELATION * relative, "for spacings of half a correlation length"
    if chosen is None:
        return max(least, (SMOOTH_NODES + ROUGH_NODES * steepness) * (1e-3 / tolerance) ** (1.0 / ORDER))
    if not least <= chosen < math.inf:
        raise InputError(
            f"{label}: nodes_per_wavelength is {chosen:g}, too coarse {reason}; expected at least {least:.3g}, "
            "or leave it out to have it chosen"
        )
    return chosen


def _check_size(scene: Scene, densities: list[float], wavelength: float) -> None:
    """Refuse scenes whose nodes and whose last dense system do not fit into the memory."""
    lengths = [outline_length(surface) / wavelength for surface in scene.surface]
    nodes = sum(length * density for length, density in zip(lengths, densities, strict=True))
    needed = BYTES_PER_NODE * nodes + 8.0 * (SKELETONS_PER_WAVELENGTH * sum(lengths)) ** 2
    free = available_memory()
    if needed > free:
        raise InputError(
            f"scene {scene.name!r}: {nodes:.3g} unknowns on surfaces of {sum(lengths):.3g} wavelengths need more than "
            f"{needed / 1e9:.3g} GB of memory, but {free / 1e9:.3g} GB are free; simulate a smaller or smoother scene, "
            "or a lower band"
        )


def _check_antennas(nodes: Nodes, antennas: Array, label: Callable[[int], str]) -> None:
    """Refuse antennas on, or too close to, a surface."""
    distance, nearest = cKDTree(nodes.position).query(antennas)
    worst = int(np.argmin(distance / nodes.weight[nearest]))
    node = nearest[worst]
    if distance[worst] < CLEARANCE * nodes.weight[node]:
        x, y = antennas[worst]
        least = CLEARANCE * nodes.weight[node]
        raise InputError(
            f"array: the antenna at ({x:.6g}, {y:.6g}) m stands on {label(nodes.surface[node])}, "
            f"{distance[worst]:.2g} m from it; expected at least {least:.2g} m, move one of the two"
        )


def _check_insides(equation: Boundaries, antennas: Array, label: Callable[[int], str]) -> None:
    """Refuse antennas and other surfaces inside a dielectric body."""
    nodes = equation.nodes
    for body, filling in enumerate(equation.inside):
        if filling is None:
            continue
        within = equation.encloses(body, antennas)
        if within.any():
            x, y = antennas[np.flatnonzero(within)[0]]
            raise InputError(
                f"array: the antenna at ({x:.6g}, {y:.6g}) m stands inside {label(body)}; move one of the two"
            )
        others = np.flatnonzero(nodes.surface != body)
        within = equation.encloses(body, nodes.position[others])
        if within.any():
            other = nodes.surface[others[np.flatnonzero(within)[0]]]
            raise InputError(
                f"{label(other)} lies inside {label(body)}; expected air around every surface, move one of the two"
            )


def _check_apart(nodes: Nodes, label: Callable[[int], str]) -> None:
    """Refuse surfaces that cross or touch each other or themselves."""
    spacing = nodes.weight
    pairs = cKDTree(nodes.position).query_pairs(TOUCH * float(spacing.max()), output_type="ndarray")
    a, b = pairs[:, 0], pairs[:, 1]
    distance = np.linalg.norm(nodes.position[a] - nodes.position[b], axis=1)
    along = np.cumsum(spacing)
    apart = np.abs(along[a] - along[b])
    total = np.bincount(nodes.surface, weights=spacing)[nodes.surface[a]]
    # The two ends of a closed surface are neighbours; those of an open one are its whole length apart.
    first = np.searchsorted(nodes.surface, nodes.surface[a])
    closed = np.linalg.norm(nodes.position[first] - nodes.position[_last(nodes, a)], axis=1) < 2.0 * spacing.max()
    apart = np.where(closed, np.minimum(apart, total - apart), apart)
    largest = np.maximum(spacing[a], spacing[b])
    neighbours = (nodes.surface[a] == nodes.surface[b]) & (apart < NEIGHBOURHOOD * spacing.max())
    bad = (distance < TOUCH * largest) & ~neighbours
    if bad.any():
        worst = int(np.flatnonzero(bad)[np.argmin(distance[bad])])
        first_surface, second_surface = nodes.surface[a[worst]], nodes.surface[b[worst]]
        other = "itself" if first_surface == second_surface else label(second_surface)
        x, y = nodes.position[a[worst]]
        raise InputError(
            f"{label(first_surface)} crosses or touches {other} near ({x:.6g}, {y:.6g}) m; expected surfaces at least "
            f"{largest[worst]:.2g} m apart, move one or join both to one polyline"
        )


def _last(nodes: Nodes, of: NDArray[np.int64]) -> NDArray[np.int64]:
    """The last node of the surface to which each node `of` belongs."""
    return np.searchsorted(nodes.surface, nodes.surface[of], side="right") - 1
