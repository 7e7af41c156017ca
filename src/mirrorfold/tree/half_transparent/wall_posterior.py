"""A half-transparent wall, measured: its permittivity and thickness, and how well both are known.

The likelihood of a wall (`mirrorfold.tree.half_transparent.wall_glints`) has narrow peaks beside each other, one for
every turn of the phase from face to face, and each peak is a ridge: thicker walls of less permittivity have the same
phase. So the wall is not only searched, but all walls that are as likely are sampled. Walls are first tried on a
coarse grid. A population of them is then led from a flat likelihood to the true one, in stages in which its weights
stay even (Del Moral, Doucet and Jasra, J. R. Stat. Soc. B 68, 411, 2006). In every stage each wall is moved by a share
of the difference of two others, so that steps follow the ridges (ter Braak, Stat. Comput. 16, 239, 2006), and now and
then by a whole turn, so that the numbers of walls on the peaks become those that the likelihood demands. The spread of
the population about the likeliest wall is the standard error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from mirrorfold.common.types import Array
from mirrorfold.tree.half_transparent.panes import BEYOND_TRIED, PERMITTIVITY, THICKEST, Pane
from mirrorfold.tree.half_transparent.wall_glints import Glints, Walls

MOST = 40
"""Number of the brightest echoes from which the wall is measured."""

TRIED, STEP = 12, 0.4
"""Number of permittivities that are tried first; and step of the phase of one way through the wall and back [rad]."""

QUARTER_WAVE = np.pi
"""Phase of one way through the thinnest wall that is tried first, and back [rad]."""

FACES = (0.03, 0.0), (0.02, 0.2)
"""Pairs of a loss tangent and a roughness of the faces (rms height times wavenumber) that are tried first."""

MOST_LOSS, MOST_HEIGHT = 0.5, 0.6
"""Largest loss tangent; and largest roughness of faces, rms height times wavenumber: such a back face of glass leaves
3 % of a coherent wave."""

POPULATION, MOVES, LAST_MOVES = 240, 6, 40
"""Number of walls in the population, of moves of each in every stage, and of those in the last stage, from the second
half of which errors are computed."""

TURN_EVERY = 4
"""Every so many moves, walls move by a whole turn of the phase."""

EVEN = 0.5
"""Least evenness of the weights from stage to stage: effective over true number of walls."""

USUAL_STEP = 2.38 / np.sqrt(2.0 * 4.0)
"""Usual share of a difference of two walls by which others move: the best one for normal distributions of four numbers
(ter Braak 2006). It varies by a factor of e, since the likelihood may have a narrow peak on a broad hill."""

SPREAD = 0.01
"""Standard deviation of what is added to each move, over `JITTER`, so that a population can leave any plane."""

JITTER = 0.02, 0.004, 0.1, 0.02
"""Standard deviations by which walls are spread about those that were tried, about half the steps between these: of the
logarithm of permittivity, the loss tangent, the phase [rad] and the roughness."""


class _Space:
    """Walls as four numbers: logarithm of permittivity, loss tangent, phase of one way through and back, roughness."""

    def __init__(self, glints: Glints) -> None:
        self.wavenumber = float(glints.pairs.wavenumber.mean())
        self.sine = float(np.mean(np.sin(glints.pairs.angle) ** 2))

    def numbers(self, permittivity: Array, loss: Array, thickness: Array, roughness: Array) -> Array:
        """The numbers (w, 4) of walls of these properties (w,), thickness in [m]."""
        phase = 2.0 * self.wavenumber * thickness * np.sqrt(permittivity - self.sine)
        return np.stack([np.log(permittivity), loss, phase, roughness], axis=1)

    def walls(self, numbers: Array) -> Walls:
        """The walls of numbers (w, 4). Negative losses and heights count as positive ones."""
        log, loss, phase, roughness = numbers.T
        real = np.exp(log)
        thickness = phase / (2.0 * self.wavenumber * np.sqrt(np.maximum(real - self.sine, 0.1)))
        return Walls(real * (1.0 - 1j * np.abs(loss)), thickness, np.abs(roughness) / self.wavenumber)

    def possible(self, numbers: Array) -> Array:
        """Which walls are possible, (w,)."""
        log, loss, phase, roughness = numbers.T
        low, high = np.log(PERMITTIVITY[0] / BEYOND_TRIED), np.log(BEYOND_TRIED * PERMITTIVITY[1])
        within = (log > low) & (log < high) & (np.abs(loss) < MOST_LOSS)
        return within & (phase > 0.0) & (np.abs(roughness) < MOST_HEIGHT)


def measured_pane(glints: Glints, pane: Pane) -> Pane:
    """The wall `pane` as the brightest echoes behind it measure it, with standard errors and evidence."""
    glints = glints.brightest(MOST)
    space = _Space(glints)
    trials = _trials(glints, space)
    both, alone = glints.mixed_and_alone(space.walls(trials))
    walls, height = _sampled(space, trials, both, lambda some: glints.mixed(some)[0])
    # Of several turns of the phase the likeliest is stated, its likeliest wall; its error includes all others.
    # Every sixteenth wall is asked how many walls are within half a turn of it, which bounds the memory.
    turns = np.abs(walls[:, 2, None] - walls[::16, 2]) < np.pi
    turn = np.flatnonzero(turns[:, turns.sum(axis=0).argmax()])
    best = space.walls(walls[turn[height[turn].argmax()]][None])
    found = space.walls(walls)
    real, thickness = float(best.permittivity[0].real), float(best.thickness[0])
    error = np.sqrt([np.mean((found.permittivity.real - real) ** 2), np.mean((found.thickness - thickness) ** 2)])
    opaque = max(_climbed(space, start, glints.alone) for start in (trials[alone.argmax()], walls[height.argmax()]))
    measured = replace(
        pane,
        permittivity=complex(best.permittivity[0]),
        thickness=thickness,
        rms_height=float(best.rms_height[0]),
        permittivity_error=float(error[0]),
        thickness_error=float(error[1]),
        evidence=max(pane.evidence, float(height.max() - opaque)),
    )
    return replace(measured, share=float(glints.mixed(Walls.of(measured))[1][0]))


def _trials(glints: Glints, space: _Space) -> Array:
    """The numbers (w, 4) of walls that are tried first."""
    thinnest, thickest = QUARTER_WAVE / (2.0 * space.wavenumber), THICKEST * glints.pairs.cell
    optical = np.arange(thinnest, thickest, STEP / (2.0 * space.wavenumber))
    trials = np.array([
        (real, loss, width / np.sqrt(real), roughness)
        for real in np.geomspace(*PERMITTIVITY, TRIED) for loss, roughness in FACES for width in optical
    ])  # fmt: skip
    return space.numbers(*trials.T)


def _sampled(space: _Space, trials: Array, coarse: Array, likelihood: Callable[[Walls], Array]) -> tuple[Array, Array]:
    """Numbers of walls that represent a likelihood, (w, 4), and its logarithm, (w,).

    The numbers `trials` (t, 4) are of walls that were tried, with about the logarithm `coarse` (t,) of their
    likelihood; `likelihood` gives this logarithm for walls, (w,).
    """
    random = np.random.default_rng(0)
    power = _next_power(coarse, 0.0, EVEN * POPULATION / coarse.size)
    weight = np.exp(power * (coarse - coarse.max()))
    walls = trials[_resampled(random, weight)] + random.standard_normal((POPULATION, 4)) * JITTER
    walls = np.where(space.possible(walls)[:, None], walls, trials[coarse.argmax()])
    height = likelihood(space.walls(walls))
    kept: list[tuple[Array, Array]] = []
    while True:
        moves = MOVES if power < 1.0 else LAST_MOVES
        for move in range(moves):
            walls, height = _moved(
                random, space, walls, height, power, likelihood, turn=move % TURN_EVERY == TURN_EVERY - 1
            )
            if power >= 1.0 and move >= moves // 2:
                kept.append((walls, height))
        if power >= 1.0:
            return np.concatenate([each for each, _ in kept]), np.concatenate([each for _, each in kept])
        further = _next_power(height, power, EVEN)
        chosen = _resampled(random, np.exp((further - power) * (height - height.max())))
        walls, height, power = walls[chosen], height[chosen], further


def _climbed(space: _Space, start: Array, likelihood: Callable[[Walls], Array]) -> float:
    """The logarithm of the largest likelihood near a wall of the numbers `start`, (4,)."""

    def cost(numbers: Array) -> float:
        return -float(likelihood(space.walls(numbers[None]))[0]) if space.possible(numbers[None])[0] else 1e9

    corners = start + np.concatenate([np.zeros((1, 4)), np.diag(JITTER)])
    options = {"initial_simplex": corners, "maxfev": 150, "xatol": 1e-3, "fatol": 0.02}
    return -float(minimize(cost, start, method="Nelder-Mead", options=options).fun)


def _next_power(height: Array, power: float, even: float) -> float:
    """The largest power of the likelihood up to one, above the present `power`, that keeps the weights so `even`."""

    def is_even(further: float) -> bool:
        weight = np.exp((further - power) * (height - height.max()))
        return bool(weight.sum() ** 2 >= even * height.size * np.sum(weight**2))

    low, high = power, 1.0
    if is_even(high):
        return high
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_even(middle) else (low, middle)
    return high


def _resampled(random: np.random.Generator, weight: Array) -> Array:
    """Indices of `POPULATION` walls, each chosen about as often as its weight demands (systematic resampling)."""
    share = np.cumsum(weight) / np.sum(weight)
    return np.minimum(np.searchsorted(share, (np.arange(POPULATION) + random.random()) / POPULATION), weight.size - 1)


def _moved(
    random: np.random.Generator, space: _Space, walls: Array, height: Array, power: float,
    likelihood: Callable[[Walls], Array], *, turn: bool,
) -> tuple[Array, Array]:  # fmt: skip
    """The walls and the logarithm of their likelihood after one Metropolis step, half of them at a time.

    Each is moved by a share of the difference of two walls of the half at rest, or by one `turn` of the phase.
    """
    walls, height = walls.copy(), height.copy()
    order = random.permutation(POPULATION)
    for mine, others in ((order[::2], order[1::2]), (order[1::2], order[::2])):
        if turn:
            step = np.array([0.0, 0.0, 2.0 * np.pi, 0.0]) * random.choice([-1.0, 1.0], (mine.size, 1))
        else:
            one = random.integers(others.size, size=mine.size)
            two = (one + random.integers(1, others.size, size=mine.size)) % others.size
            length = USUAL_STEP * np.exp(random.standard_normal((mine.size, 1)))
            step = length * (walls[others[one]] - walls[others[two]])
        tried = walls[mine] + step + random.standard_normal((mine.size, 4)) * np.multiply(SPREAD, JITTER)
        possible = space.possible(tried)
        level = np.full(mine.size, -np.inf)
        level[possible] = likelihood(space.walls(tried[possible]))
        better = np.log(random.random(mine.size)) < power * (level - height[mine])
        walls[mine[better]], height[mine[better]] = tried[better], level[better]
    return walls, height
