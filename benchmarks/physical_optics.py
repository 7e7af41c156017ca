"""Folding judged on scenes of another generator: physical optics, with the walls' mirror images by rays.

    python benchmarks/physical_optics.py [--room NAME ...] [--seeds 0:3] [--radar 300] [--pitch 0.5]

Nothing of this package draws or simulates these scenes. Every surface radiates, in proportion to the field that meets
it: so glints, edges and their fading come by themselves, as do all pairs of a way out and a way back, by none, one or
two walls each. Surfaces are rough, and hide what is behind them. What waves do between two objects is left out. The
table counts false points: farther than 2 cm, or one and a half resolution cells if that is more, from every surface. It
also says how much is found of those sides of objects that only mirrors show. A scene takes half a minute.

Source: physical optics, C. A. Balanis, *Advanced Engineering Electromagnetics*, 2nd ed., Wiley, 2012, section 7.10.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise, permutations, product

import numpy as np
from numba import njit
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.constants import speed_of_light
from scipy.spatial import cKDTree

import mirrorfold as mf

Array = NDArray[np.float64]

LOSS, ROUGHNESS, SNR_DB = 0.8, (0.3, 0.5), 25.0
"""Amplitude that a wall reflects; share of the field that walls and objects scatter at random; and noise."""

STEP = 0.25
"""Distance of the sources on a surface, in wavelengths."""


@dataclass(frozen=True)
class Radar:
    """A band [Hz], the number of its frequencies, and the length of a line of transmitters and receivers [m]."""

    low: float
    high: float
    frequencies: int
    length: float

    @property
    def wavelength(self) -> float:
        """In the middle of the band [m]."""
        return 2.0 * speed_of_light / (self.low + self.high)


RADARS = {
    "300": Radar(292e9, 308e9, 521, 0.064),
    "240": Radar(235e9, 245e9, 351, 0.08),
    "140": Radar(136e9, 144e9, 281, 0.12),
    "77": Radar(77e9, 81e9, 161, 0.18),
}


@dataclass(frozen=True)
class Surfaces:
    """Strips (s, 2, 2) [m], of which the first `walls` are two-sided mirrors, and sources on them.

    Attributes
    ----------
    place, normal : (n, 2) arrays
        Where the sources are [m], and the side to which they radiate.
    strip : (n,) array of int
        The strip that each is on.
    strength : (n,) array of complex
    """

    strips: Array
    walls: int
    place: Array
    normal: Array
    strip: NDArray[np.intp]
    strength: NDArray[np.complex128]


def outline(centre: Array, radii: Array, turn: float, corners: int) -> Array:
    """A closed polygon around a centre, (corners + 1, 2) [m], counterclockwise: an ellipse, or a box of 4 corners."""
    angle = np.linspace(0.0, 2.0 * np.pi, corners + 1) + (np.pi / 4.0 if corners == 4 else 0.0)
    round_ = np.column_stack([np.cos(angle), np.sin(angle)]) * radii * (np.sqrt(2.0) if corners == 4 else 1.0)
    return centre + round_ @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])


def thing(centre: Array, random: np.random.Generator) -> Array:
    """A box, a disc or an ellipse of random size, as a closed polygon."""
    kind, turn = random.integers(3), random.uniform(0.0, np.pi)
    if kind == 0:
        return outline(centre, random.uniform((0.06, 0.04), (0.15, 0.1)), turn, 4)
    radii = np.full(2, random.uniform(0.06, 0.14)) if kind == 1 else random.uniform((0.12, 0.07), (0.22, 0.12))
    return outline(centre, radii, turn, 48)


def wall(centre: Array, length: float, angle: float) -> Array:
    """Both ends of a wall, (2, 2) [m]."""
    half = 0.5 * length * np.array([np.cos(angle), np.sin(angle)])
    return np.array([centre - half, centre + half])


def reflected(way: Array, mirror: Array) -> Array:
    """A direction (2,) after a reflection in a wall."""
    along = (mirror[1] - mirror[0]) / np.linalg.norm(mirror[1] - mirror[0])
    return 2.0 * (way @ along) * along - way


Room = tuple[list[Array], list[Array]]
"""Walls, both ends of each, and objects, closed polygons [m]. The radar is at the origin and looks along y."""


def screen(random: np.random.Generator) -> Room:
    """A slanted wall shows what stands behind a screen."""
    side, draw = random.choice([-1.0, 1.0]), random.uniform
    mirror = wall(np.array([-0.25 * side, draw(1.5, 2.0)]), draw(1.0, 1.5), side * np.radians(draw(35.0, 50.0)))
    hides = np.array([[0.15 * side, draw(0.9, 1.1)], [side * draw(1.2, 1.6), 1.0]])
    middle = mirror.mean(axis=0)
    onward = reflected(middle / np.linalg.norm(middle), mirror)
    shown = [middle + onward * draw(0.7, 1.3) + draw((-0.1, -0.25), (0.1, 0.25)) for _ in range(random.integers(1, 3))]
    return [mirror, hides], [thing(place, random) for place in shown]


def two_mirrors(random: np.random.Generator) -> Room:
    """A wall shows another wall, and this one an object."""
    side, draw = random.choice([-1.0, 1.0]), random.uniform
    first = wall(np.array([-0.05 * side, draw(1.2, 1.5)]), draw(0.8, 1.1), side * np.radians(draw(38.0, 48.0)))
    middle = first.mean(axis=0)
    onward = reflected(middle / np.linalg.norm(middle), first)
    turn = np.arctan2(onward[1], onward[0]) + random.choice([-1.0, 1.0]) * np.radians(draw(40.0, 50.0))
    second = wall(middle + onward * draw(0.9, 1.2), draw(0.7, 1.0), turn)
    return [first, second], [thing(second.mean(axis=0) + reflected(onward, second) * draw(0.6, 0.9), random)]


def corner(random: np.random.Generator) -> Room:
    """Two walls of a room, almost at right angles, show the far sides of two objects."""
    side, draw = random.choice([-1.0, 1.0]), random.uniform
    steep = np.pi / 2.0 - side * np.radians(draw(8.0, 25.0))
    walls = [
        wall(np.array([-side * draw(0.5, 0.7), draw(1.6, 2.0)]), draw(1.2, 1.6), steep),
        wall(np.array([0.2 * side, draw(2.2, 2.6)]), draw(0.8, 1.2), -side * np.radians(draw(10.0, 25.0))),
    ]
    places = np.array([[side, 1.0]]) * draw([[0.25, 1.1], [0.0, 1.6]], [[0.45, 1.4], [0.5, 1.9]])
    return walls, [thing(place, random) for place in places]


def no_walls(random: np.random.Generator) -> Room:
    """Objects alone: there is no mirror."""
    return [], [thing(random.uniform((-0.7, 1.0), (0.7, 2.5)), random) for _ in range(random.integers(2, 5))]


ROOMS: dict[str, Callable[[np.random.Generator], Room]] = {
    "screen": screen, "two mirrors": two_mirrors, "corner": corner, "no walls": no_walls,
}  # fmt: skip


def surfaces(room: Room, wavelength: float, random: np.random.Generator) -> Surfaces:
    """The strips of a room and the sources on them; objects radiate to their outside."""
    walls, objects = room
    sides = [ends for polygon in objects for ends in pairwise(polygon)]
    strips = np.array([*walls, *(np.array(ends) for ends in sides)])
    parts = []
    for number, (start, end) in enumerate(strips):
        length, rough = float(np.linalg.norm(end - start)), ROUGHNESS[number >= len(walls)]
        count = max(int(length / (STEP * wavelength)), 2)
        place = start + (np.arange(count)[:, None] + 0.5) / count * (end - start)
        normal = np.array([end[1] - start[1], start[0] - end[0]]) / length
        for outward in (normal, -normal)[: 2 if number < len(walls) else 1]:
            white = random.standard_normal((2, count + 2))
            speckle = sum(white[:, i : i + count] for i in range(3)) / np.sqrt(6.0)  # alike over half a wavelength
            strength = (1.0 + rough * (speckle[0] + 1j * speckle[1])) * length / count / np.sqrt(wavelength)
            parts.append((place, np.tile(outward, (count, 1)), np.full(count, number), strength))
    place, normal, strip, strength = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Surfaces(strips, len(walls), place, normal, strip, strength)


@njit
def meets(ax, ay, bx, by, strip):  # type: ignore[no-untyped-def]
    """Where the way from a to b meets a strip: shares of the way and of the strip; far away if they are parallel."""
    x, y = strip[0, 0], strip[0, 1]
    dx, dy = strip[1, 0] - x, strip[1, 1] - y
    across = (bx - ax) * dy - (by - ay) * dx
    if across == 0.0:
        return 2.0, 2.0
    return ((x - ax) * dy - (y - ay) * dx) / across, ((x - ax) * (by - ay) - (y - ay) * (bx - ax)) / across


@njit
def is_free(ax, ay, bx, by, strips, own, other):  # type: ignore[no-untyped-def]
    """Whether the way from a to b meets no strip but the two that it begins and ends on."""
    for number in range(len(strips)):
        if number != own and number != other:
            way, along = meets(ax, ay, bx, by, strips[number])
            if 0.0 < way < 1.0 and 0.0 <= along <= 1.0:
                return False
    return True


@njit
def reach(antennas, place, normal, strip, strips, chain, out):  # type: ignore[no-untyped-def]
    """Length [m] of the way from each antenna to each source by a chain of walls, `out` (2, antennas, n), and the
    cosine with which it arrives; NaN where there is no such way.
    """
    seen_from = np.empty((len(chain) + 1, 2))
    for i in range(len(antennas)):
        seen_from[0] = antennas[i]
        for c in range(len(chain)):
            start, along = strips[chain[c], 0], strips[chain[c], 1] - strips[chain[c], 0]
            share = ((seen_from[c] - start) * along).sum() / (along * along).sum()
            seen_from[c + 1] = 2.0 * (start + share * along) - seen_from[c]
        for n in range(len(place)):
            x, y = seen_from[-1, 0] - place[n, 0], seen_from[-1, 1] - place[n, 1]
            length = np.hypot(x, y)
            cosine = (x * normal[n, 0] + y * normal[n, 1]) / length
            out[0, i, n] = np.nan
            if cosine <= 0.0:
                continue
            to, own, free = place[n].copy(), strip[n], True
            for c in range(len(chain) - 1, -1, -1):
                way, along = meets(to[0], to[1], seen_from[c + 1, 0], seen_from[c + 1, 1], strips[chain[c]])
                if not (0.0 < way < 1.0 and 0.0 <= along <= 1.0):
                    free = False
                    break
                hit = to + way * (seen_from[c + 1] - to)
                if not is_free(to[0], to[1], hit[0], hit[1], strips, own, chain[c]):
                    free = False
                    break
                to, own = hit, chain[c]
            if free and is_free(to[0], to[1], antennas[i, 0], antennas[i, 1], strips, own, -1):
                out[0, i, n], out[1, i, n] = length, cosine


@njit(fastmath=True)
def add_waves(antenna, source, length, amplitude, k, out):  # type: ignore[no-untyped-def]
    """Add ``amplitude exp(-j k length)`` to `out` (antennas, n), for all ways at a wavenumber [rad/m]."""
    for way in range(len(length)):
        phase = k * length[way]
        out[antenna[way], source[way]] += amplitude[way] * complex(np.cos(phase), -np.sin(phase))


def simulated(room: Room, radar: Radar, pitch: float, random: np.random.Generator):  # type: ignore[no-untyped-def]
    """The sweep of a room, its surfaces, and by which chains of walls each source is seen, by most antennas."""
    found = surfaces(room, radar.wavelength, random)
    count = int(radar.length / (pitch * radar.wavelength)) + 1
    antennas = np.column_stack([pitch * radar.wavelength * (np.arange(count) - 0.5 * (count - 1)), np.zeros(count)])
    chains = [chain for bounces in range(3) for chain in permutations(range(found.walls), bounces)]
    ways, seen = [], dict[tuple[int, ...], NDArray[np.bool_]]()
    table = np.empty((2, count, len(found.place)))
    for chain in chains:
        numbers = np.array(chain, dtype=np.intp)
        reach(antennas, found.place, found.normal, found.strip, found.strips, numbers, table)
        antenna, source = np.nonzero(np.isfinite(table[0]))
        length, cosine = table[:, antenna, source]
        ways.append((antenna, source, length, LOSS ** len(chain) * np.sqrt(cosine / length)))
        seen[chain] = np.bincount(source, minlength=len(found.place)) > 0.5 * count
    antenna, source, length, amplitude = (np.concatenate(column) for column in zip(*ways, strict=True))
    used, source = np.unique(source, return_inverse=True)
    frequency = np.linspace(radar.low, radar.high, radar.frequencies)
    s, strength = np.empty((frequency.size, count, count), complex), found.strength[used].astype(np.complex64)
    for number, k in enumerate(2.0 * np.pi * frequency / speed_of_light):
        field = np.zeros((count, used.size), np.complex64)
        add_waves(antenna, source, length, amplitude, k, field)
        s[number] = (field * strength) @ field.T
    white = random.standard_normal((2, *s.shape))
    s += 10.0 ** (-SNR_DB / 20.0) * np.sqrt(0.5 * np.mean(np.abs(s) ** 2)) * (white[0] + 1j * white[1])
    place = np.column_stack([antennas, np.zeros(count)])
    return mf.make_sweep(s, frequency=frequency, tx_position=place, rx_position=place), found, seen


def judged(room: str, seed: int, radar: Radar, pitch: float) -> tuple[int, int, int, float]:
    """Number of points and of false ones, of mirrors, and the share found of sides that only mirrors show, or NaN."""
    random = np.random.default_rng([seed, list(ROOMS).index(room)])
    sweep, found, seen = simulated(ROOMS[room](random), radar, pitch, random)
    result = mf.fold(mf.focus(sweep), sweep=sweep)
    points = result["objects"].to_dataset(inherit=False)
    points = points.isel(point=points.confidence.values >= 0.5)
    place = np.column_stack([points.x.values, points.y.values])
    across = 0.5 * radar.wavelength / radar.length * np.hypot(points.x_initial.values, points.y_initial.values)
    most = np.maximum(0.02, 1.5 * np.hypot(across, 0.5 * speed_of_light / (radar.high - radar.low)))
    false = cKDTree(found.place).query(place)[0] > most
    by_mirrors = np.any([shown for chain, shown in seen.items() if chain] or [np.zeros(len(found.place), bool)], axis=0)
    hidden = found.place[by_mirrors & ~seen[()] & (found.strip >= found.walls)]
    share = 0.0 if len(hidden) else np.nan
    if len(hidden) and len(place):
        away, nearest = cKDTree(place).query(hidden)
        share = float(np.mean(away <= most[nearest]))
    return len(place), int(false.sum()), result["mirrors"].sizes["mirror"], share


def main() -> None:
    """Judge all rooms and seeds, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--room", nargs="+", choices=ROOMS, default=list(ROOMS))
    parser.add_argument("--seeds", default="0:3", help="FIRST:END, END is left out")
    parser.add_argument("--radar", choices=RADARS, default="300", help="middle of the band in GHz")
    parser.add_argument("--pitch", type=float, default=0.5, help="distance of the antennas in wavelengths")
    given = parser.parse_args()
    table = Table(title=f"scenes of physical optics, {given.radar} GHz, antennas {given.pitch} wavelengths apart")
    for heading in ("room", "seed", "points", "false", "mirrors", "hidden sides found"):
        table.add_column(heading, justify="left" if heading == "room" else "right")
    rows, scenes = [], list(product(given.room, range(*map(int, given.seeds.split(":")))))
    for room, seed in track(scenes, "folding", console=Console(stderr=True)):
        rows.append(judged(room, seed, RADARS[given.radar], given.pitch))
        *counts, share = rows[-1]
        table.add_row(room, str(seed), *map(str, counts), "" if np.isnan(share) else f"{share:.2f}")
    points, false, _, share = np.array(rows, dtype=float).T
    known = share[np.isfinite(share)]
    mean = f"{known.mean():.2f}" if known.size else ""
    table.add_row("together", "", f"{points.sum():.0f}", f"{false.sum():.0f}", "", mean)
    Console().print(table)


if __name__ == "__main__":
    main()
