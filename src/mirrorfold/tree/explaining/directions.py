"""Mixed-path echoes: they leave in one direction and arrive from another.

An echo may go out by one chain of mirrors and come back by another, such as out in line of sight and back by way of a
wall, or the reverse. Its range is the mean of two path lengths, and it focuses where nothing stands. A sweep of several
transmitters and receivers shows this: with the transmitters focused on the echo's place in the image, the receivers
find that the echo arrives from another direction than that of this place.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from mirrorfold.common.kernels import njit
from mirrorfold.common.phasor import unit_phasor
from mirrorfold.common.statistics import mean_step
from mirrorfold.common.threads import cpu_count, for_each, one_thread
from mirrorfold.common.types import Array
from mirrorfold.detection import ImageView
from mirrorfold.detection.views.image_view import LARGEST_SINE
from mirrorfold.focusing.echoes.range_windows import Window
from mirrorfold.sweep import antenna_positions, wavenumber
from mirrorfold.tree.explaining.apertures import Aperture
from mirrorfold.tree.explaining.waves import SweepWaves

PHASE_SPREAD = 0.5
"""Largest phase by which any direction turns over a group of frequencies that are summed together [rad]."""

OFFSETS = np.arange(-3, 4)
"""Directions around an echo in which its leaving and arriving energy is measured, in resolution cells."""

_BETWEEN, _MIDDLE = np.abs(np.subtract.outer(OFFSETS, OFFSETS)), np.abs(np.add.outer(OFFSETS, OFFSETS)) / 2.0
SAME, APART = (_MIDDLE <= 2.0) & (_BETWEEN == 0), (_MIDDLE <= 2.0) & (_BETWEEN >= 1) & (_BETWEEN <= 3)
"""Pairs of a leaving and an arriving direction whose middle is within two cells of the echo: with both the same, and
with one to three cells between them."""

NEAREST_LENGTHS = 4.0
"""Least range of an echo whose directions are measured, in lengths of the aperture. At this range the two ends of the
aperture look at the echo from directions 14 degrees apart; nearer, an echo that is a little out of focus would seem to
arrive from elsewhere."""

SAMPLES_A_CELL = 8
"""Number of samples of a beam in one resolution cell."""

LARGEST_OWN = 0.6
"""Largest h of `confocal_share`: where beams one to three cells apart share more, they do not separate directions."""

CHUNK = 64
"""Number of points that are computed at once; bounds the memory."""

WORTH_WINDOWS = 32
"""Number of points from which on the sweep is cut into windows of range. The range profiles for that take as long as
ten or twenty points take without windows."""


def _phasors(phase: Array) -> NDArray[np.complex64]:
    """``exp(j phase)`` in single precision, after whole turns are removed."""
    phase = (phase - 2.0 * np.pi * np.rint(phase / (2.0 * np.pi))).astype(np.float32)
    out = np.empty(phase.shape, dtype=np.complex64)
    np.cos(phase, out=out.real)
    np.sin(phase, out=out.imag)
    return out


def direction_ratio(waves: SweepWaves, view: ImageView, range_: Array, u: Array) -> Array:
    """How much of each echo, at ranges [m] and u, (n,) each, arrives from the direction in which it left: 0 to 1, (n,).

    Let ``B(u, u')`` be the sum over transmitters, focused on a point at range r in direction u, and over receivers,
    focused at the same range in direction u'. The ratio is ``|B(u, u)| / max over u' of |B(u, u')|``: near one for an
    echo that came back the way it went out, small for one that arrives from elsewhere. Points lie at the height of the
    radar, the mean of the heights of its two apertures. If all transmitters, or all receivers, stand at one place,
    directions cannot be measured, and all ratios are one.
    """
    if min(aperture.places for aperture in waves.apertures) < 2:
        return np.ones(range_.size)
    # Steps of half the beam width of the receivers.
    beams = int(np.ceil(LARGEST_SINE * 2.0 * max(view.aperture_rx, 1.0)))
    ring = np.broadcast_to(np.linspace(-LARGEST_SINE, LARGEST_SINE, 2 * beams + 1), (range_.size, 2 * beams + 1))
    level = _bistatic(waves, view, range_, u[:, None], np.column_stack([ring, u]))[..., 0]
    return level[:, -1] / np.maximum(level.max(axis=1, initial=0.0), np.finfo(float).tiny)


def amplitude_at(
    waves: SweepWaves, view: ImageView, range_: Array, u: Array, sent: NDArray[np.bool_], received: NDArray[np.bool_]
) -> Array:
    """Mean amplitude of echoes at ranges [m] and u, (n,) each, focused with some of the antennas only, (n,).

    `sent` (n, tx) and `received` (n, rx) choose the transmitters and receivers for each echo.
    """
    level = _bistatic(waves, view, range_, u[:, None], u[:, None], (sent, received))[:, 0, 0]
    tx, rx = (aperture.weight for aperture in waves.apertures)
    return level / ((sent @ tx) * (received @ rx))


def confocal_share(waves: SweepWaves, view: ImageView, range_: Array, u: Array) -> Array:
    """Share of the energy around echoes at ranges [m] and u, (n,) each, that came back the way it went: 0 to 1, (n,).

    A wave that scatters once, at one place, returns from the direction in which it was sent. A wave that scatters at
    several objects leaves towards one of them and arrives from another. Take the intensity ``|B|^2``, with B as in
    `direction_ratio`, over leaving and arriving directions around an echo. Let D be its mean where both directions are
    the same, and A its mean where they are one to three resolution cells apart. Single scattering gives A = h D, with
    h < 1 due to the width of the radar's beams; waves that leave and arrive in unrelated directions give A = D. So
    single scattering has the share ``(1 - A / D) / (1 - h)`` of the energy. This is the common-midpoint profile of the
    focused reflection matrix (Lambert, Cobus, Couade, Fink and Aubry, Phys. Rev. X 10, 021048, 2020). NaN where the
    apertures cannot separate directions, or an echo is too near.
    """
    sides, share = waves.apertures, np.full(range_.size, np.nan)
    own = _beams_alone(sides, float(wavenumber(waves.sweep).mean()), view.u_cell)
    length = max(float(np.linalg.norm(np.ptp(aperture.position, axis=0))) for aperture in sides)
    far = range_ >= NEAREST_LENGTHS * length
    if own > LARGEST_OWN or not far.any():
        return share
    most = LARGEST_SINE - OFFSETS[-1] * view.u_cell
    around = np.clip(u[far], -most, most)[:, None] + OFFSETS * view.u_cell
    power = _bistatic(waves, view, range_[far], around, around) ** 2
    same, apart = power[:, SAME].mean(axis=1), power[:, APART].mean(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        share[far] = np.clip((1.0 - apart / same) / (1.0 - own), 0.0, 1.0)
    return share


def _beams_alone(sides: list[Aperture], k: float, u_cell: float) -> float:
    """The ratio h of `confocal_share`: the intensity A / D of the echo of a rough surface, at most one.

    Such a surface returns each direction with a random phase of its own, so that intensities add: h follows from how
    much beams one to three cells apart overlap.
    """
    if min(aperture.places for aperture in sides) < 2:
        return 1.0
    step, most = u_cell / SAMPLES_A_CELL, 2 * int(OFFSETS[-1]) * SAMPLES_A_CELL
    sine = step * np.arange(-most, most + 1, dtype=float)
    tx, rx = (aperture.beam(k, sine) ** 2 for aperture in sides)
    shared = np.convolve(tx, rx)
    middle = shared.size // 2
    return float(min(shared[middle + SAMPLES_A_CELL * _BETWEEN[APART]].mean() / shared[middle], 1.0))


def _group_size(k: Array, spread: float) -> int:
    """Number of frequencies in a group, from wavenumbers [rad/m] and the largest distance of a receiver [m]."""
    # The paths to the radar's middle and to the farthest receiver differ by at most the distance between these two.
    return int(k.size // np.clip(np.ceil((k[-1] - k[0]) * spread / PHASE_SPREAD), 1, k.size))


def bytes_at_once(sweep: xr.Dataset) -> tuple[float, float]:
    """Memory [bytes] that this module takes for a sweep: by range profiles, which are kept, and by its work.

    The latter is that of all cores together: windows of the profiles, phasors of the transmitters, and the fields at
    the receivers.
    """
    k, (tx, rx), windows = wavenumber(sweep), antenna_positions(sweep), SweepWaves(sweep).range_windows
    radar = 0.5 * (tx.mean(axis=0) + rx.mean(axis=0))
    reach = [float(np.linalg.norm(side - radar, axis=1).max()) for side in (tx, rx)]
    groups = np.ceil(k.size / _group_size(k, reach[1]))
    count = windows.frequencies(0.0, 2.0 * sum(reach))
    cut = 2.0 * 8.0 * count * len(tx) * len(rx) if count < k.size else 0.0
    beams = 8.0 * CHUNK * (3.0 * len(tx) + (groups + 1.0) * len(rx))
    return (windows.profile_bytes if cut else 0.0), cpu_count() * (cut + beams)


def _at_receivers(window: Window, path: Array, weight: NDArray[np.float32], size: int) -> NDArray[np.complex64]:
    """The waves that arrive at the receivers if the transmitters are focused on m points, (groups, rx, m).

    Each group is the sum over `size` neighbouring frequencies of the sweep's samples in a `window`; the last one holds
    the remaining ones. To the transmitters' waves, which have the `weight` (tx, m) or (tx, 1), the phase ``k path`` is
    added, with the `path` (tx, m) [m] that is made up for.
    """
    k, samples, taper = window
    send, turn = weight * _phasors(k[0] * path), _phasors(mean_step(k) * path)
    field = np.zeros((-(-k.size // size), samples.shape[2], path.shape[1]), dtype=np.complex64)
    arrives = np.empty(field.shape[1:], dtype=np.complex64)
    for number, share in enumerate(taper):
        np.matmul(samples[number].T, send, out=arrives)
        arrives *= share
        field[number // size] += arrives
        send *= turn
    return field


@njit(makes_arrays=True, nogil=True, error_model="numpy", fastmath=True)
def _receive(places, receivers, r, turns, field, out):  # type: ignore[no-untyped-def]
    """``|sum over g and x of field[m, g, :, x] exp(2 pi j (turns[0] + g turns[1]) (|p - x| - r))|`` at places, (n, m).

    Places p (n, 3) and receivers x (3, receivers) are relative to the radar, and all places are at the distance r from
    it. All values are in single precision. The field (m, groups, 2, receivers) holds real and imaginary parts; the sum
    over groups g is taken by Horner's rule.
    """
    beams, groups, _, count = field.shape
    square, path = np.empty((2, count), np.float32)
    cos, sin, re, im = np.empty((4, count), np.float32)
    step_cos, step_sin = np.empty((2, count), np.float32)
    for x in range(count):
        square[x] = receivers[0, x] ** 2 + receivers[1, x] ** 2 + receivers[2, x] ** 2
    for n in range(places.shape[0]):
        px, py, pz = np.float32(2.0) * places[n]
        for x in range(count):
            # |p - x| - r is computed from |p - x|^2 - r^2: the difference of the roots would lose most digits.
            beyond = square[x] - px * receivers[0, x] - py * receivers[1, x] - pz * receivers[2, x]
            path[x] = beyond / (np.sqrt(r * r + beyond) + r)
        for x in range(count):
            cos[x], sin[x] = unit_phasor(turns[0] * path[x])
        for x in range(count):
            step_cos[x], step_sin[x] = unit_phasor(turns[1] * path[x])
        for m in range(beams):
            for x in range(count):
                re[x], im[x] = field[m, groups - 1, 0, x], field[m, groups - 1, 1, x]
            for g in range(groups - 2, -1, -1):
                for x in range(count):
                    turned = re[x] * step_cos[x] - im[x] * step_sin[x] + field[m, g, 0, x]
                    im[x] = re[x] * step_sin[x] + im[x] * step_cos[x] + field[m, g, 1, x]
                    re[x] = turned
            total_re, total_im = np.float32(0.0), np.float32(0.0)
            for x in range(count):
                total_re += re[x] * cos[x] - im[x] * sin[x]
                total_im += re[x] * sin[x] + im[x] * cos[x]
            out[n, m] = np.sqrt(total_re * total_re + total_im * total_im)


def _bistatic(
    waves: SweepWaves,
    view: ImageView,
    range_: Array,
    sent: Array,
    received: Array,
    only: tuple[NDArray[np.bool_], NDArray[np.bool_]] | None = None,
) -> Array:
    """``|B(u, u')|`` of `direction_ratio` at ranges (n,) [m], for directions u (n, m) and u' (n, l): (n, l, m).

    `sent` holds the directions u of leaving, `received` those u' of arriving. `only` chooses the transmitters (n, tx)
    and receivers (n, rx) that are used for each point.
    """
    tx, rx = waves.apertures
    height = 0.5 * float(tx.centre[2] + rx.centre[2])
    radar = np.append(view.radar, height)
    spread = [float(np.linalg.norm(side.position - radar, axis=1).max()) for side in (tx, rx)]
    receivers = np.ascontiguousarray((rx.position - radar).T, dtype=np.float32)
    windows = waves.range_windows
    if range_.size * sent.shape[1] >= WORTH_WINDOWS:
        windows.transform()

    def places(range_: Array, u: Array) -> Array:
        """Positions (..., 3) [m] at ranges [m] and directions u, at the radar's height."""
        plan = view.to_points(range_, u)
        return np.concatenate([plan, np.full((*plan.shape[:-1], 1), height)], axis=-1)

    level = np.empty((range_.size, received.shape[1], sent.shape[1]))
    near_first = np.argsort(range_, kind="stable")  # neighbours in range share a window
    at_once = max(CHUNK // sent.shape[1], 1)

    def focus_points(first: int) -> None:
        """Compute `level`, |sum over transmitters, receivers and frequencies|, for the points from `first` on."""
        part = near_first[first : first + at_once]
        paths = 2.0 * range_[part]
        window = windows.window(paths.min() - sum(spread), paths.max() + sum(spread))
        k = window.k
        dk, size = mean_step(k), _group_size(k, spread[1])
        r = np.repeat(range_[part], sent.shape[1])
        # Adding the range here, which the receivers' sum subtracts again, keeps the phases there small.
        path = cdist(tx.position, places(r, sent[part].ravel())) + r
        sends, hears = (
            side.weight[:, None] * (1.0 if only is None else np.repeat(only[i][part], sent.shape[1], axis=0).T)
            for i, side in enumerate((tx, rx))
        )
        field = _at_receivers(window, path, sends.astype(np.float32), size)
        field *= hears.astype(np.float32)
        of_points = field.reshape(*field.shape[:2], -1, sent.shape[1]).transpose(2, 3, 0, 1)
        # A group is taken at its middle frequency.
        turns = (np.array([k[0] + 0.5 * (size - 1) * dk, size * dk]) / (2.0 * np.pi)).astype(np.float32)
        for point, beams in zip(part, of_points, strict=True):
            beyond, directions = range_[point], received[point]
            at = (places(np.full(directions.size, beyond), directions) - radar).astype(np.float32)
            split = np.ascontiguousarray(np.stack([beams.real, beams.imag], axis=2))
            _receive(at, receivers, np.float32(beyond), turns, split, level[point])

    with one_thread():
        for_each(focus_points, range(0, range_.size, at_once))
    return level
