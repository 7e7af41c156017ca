"""Plan of a measurement, before it is made: resolution, ambiguity, walls, bounces, amount of data, and time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from scipy.constants import Boltzmann, speed_of_light

from mirrorfold.common.arguments import wrong_kind
from mirrorfold.common.decibels import power_ratio_of
from mirrorfold.common.plausible import reach, shorter_unit
from mirrorfold.common.records import Number, Record, fact
from mirrorfold.common.settings import takes
from mirrorfold.common.types import Array
from mirrorfold.describing.plan_settings import Instrument, PlanSettings
from mirrorfold.describing.quality import ExpectedQuality, expected_quality
from mirrorfold.describing.resolution import Arrays, resolution
from mirrorfold.describing.walls import ANGLES, Wall, wall
from mirrorfold.focusing.grid import default_grid
from mirrorfold.focusing.settings import TOLERANCE_TO_FOLD
from mirrorfold.scenes.materials import FITTED, is_fitted

if TYPE_CHECKING:
    from mirrorfold.focusing.choosing.facts import Choice

DIAGONAL = ANGLES.index(45.0)
"""Index of 45 degrees among the angles of incidence of a wall; it represents bounces in a room."""

TEMPERATURE = 290.0
"""Reference temperature of noise figures, by definition [K]."""

BYTES_PER_SAMPLE = 8
"""Size of a complex64 sample [bytes]."""

MOST_BOUNCES = 12
"""Largest number of bounces in the link budget; no scene was ever folded by so many."""

INVISIBLE_DB = -60.0
"""Scattered share of the power [dB] below which a wall can only be found by its specular reflection at broadside."""

DULL_DB = -25.0
"""Mirrored share of the power [dB] below which a single bounce, 50 dB there and back, is lost in most scenes."""

MOST_REMARKED = 3
"""Largest number of bounces for which wrapping around the ambiguous range is remarked: as many as `mirrorfold.simulate`
follows by default."""

FOLDING_PIXELS_PER_SECOND = 1e6
"""Speed of steps 2 to 6 on two cores, from `mirrorfold benchmark`: two to three seconds for three million pixels."""


class BudgetRow(Record):
    """A target that is seen by a number of bounces: its range, and signal over noise of a sample and of the image."""

    bounces: int
    range_m: float
    sample_snr_db: Number
    snr_db: Number


class PlanHead(Record):
    """The field by which a plan is distinguished from other records."""

    kind: Literal["plan"]


class Plan(Arrays, PlanHead):
    """A plan."""

    walls: dict[str, Wall]
    link_budget: list[BudgetRow]
    bounces_above_noise: int | None
    bounces_unambiguous: int | None
    bounces: int | None
    samples: int
    data_megabytes: float
    measuring_s: float
    image_pixels: int
    focusing_s: float = fact("predicted by the cost model that also chooses the algorithm")
    focusing_algorithm: str
    memory_gb: float = fact("for focusing, samples and image included")
    folding_s: float
    hidden_quality: ExpectedQuality = fact("to expect behind a wall of 1 m at `range`, by one bounce")
    remarks: list[str] = fact("sentences on what looks wrong")
    files: list[str] = fact("what was written")


@takes(PlanSettings)
def plan(*, instrument: Instrument | None = None, **given: Any) -> Plan:
    """Predict what a radar with two line arrays will resolve in a room, and how many bounces it will see.

    *Walls.* The surface of a wall mirrors the share ``|R|^2 rho^2`` of the power, and scatters ``|R|^2 (1 - rho^2)``.
    R is Fresnel's coefficient of the half-space, and ``rho = exp(-(4 pi h cos(t) / lambda)^2 / 2)`` the factor of the
    roughness, with the rms height h and the angle of incidence t (Ament 1953; Recommendation ITU-R P.2040 for the
    materials).

    *Link budget.* A target of cross section sigma at the range r returns ``P G^2 lambda^2 sigma / ((4 pi)^3 r^4)``.
    Seen by way of n mirrors, it returns ``(|R|^2 rho^2)^(2 n)`` times as much, at ``r = range + n leg``. The noise of a
    sample is ``k T F`` times the bandwidth of the receiver. Focusing adds up all samples in phase, which multiplies
    signal over noise by their number.

    *Quality.* The F-score to expect for what a wall of 1 m at `range` shows by one bounce, from a table that is made by
    ``mirrorfold reproduce frequency``; see `expected_quality`.

    Parameters
    ----------
    **given
    instrument : mirrorfold.describing.planning.Instrument, optional
        The radar's electronics. Every frequency, length and time, here and in it, may be a text such as "80 mm".

    Returns
    -------
    Plan
        Facts to read as attributes or as items, with names as in `mirrorfold.info`, and `remarks`.

    Raises
    ------
    InputError
        If an argument makes no sense.
    """
    asked = PlanSettings(**given)
    if instrument is not None and not isinstance(instrument, Instrument):
        raise wrong_kind("instrument", instrument, "an Instrument of mirrorfold.describing.planning", reader="")
    instrument = instrument or Instrument()
    band, points, range = asked.band, asked.points, asked.range
    leg = 0.5 * range if asked.leg is None else asked.leg
    frequency = np.linspace(band[0], band[1], points)
    (aperture, pitch), (rx_aperture, rx_pitch) = asked.lines
    tx, rx = _line(aperture, pitch), _line(rx_aperture, rx_pitch)
    facts, remarks = resolution(frequency, tx, rx, ranges=[range])
    wavelength = speed_of_light / float(frequency.mean())
    ambiguous = facts.ambiguous_range_m or np.inf
    walls = {name: wall(name, float(frequency.mean()), asked.roughness) for name in asked.materials}
    first = walls[asked.materials[0]]
    budget = _link_budget(first, range, leg, asked.target, wavelength, len(tx) * len(rx), points, instrument)
    by_noise = sum(1 for row in budget if row.snr_db is not None and row.snr_db >= asked.detection_db) - 1
    by_ambiguity = sum(1 for row in budget if row.range_m <= ambiguous) - 1
    samples = len(tx) * len(rx) * points
    x, y = default_grid(frequency, tx, rx)
    measuring = samples * (1.0 / instrument.if_bandwidth + instrument.settling)
    measuring += instrument.moving * (len(tx) * len(rx) - 1)
    pixels = x.size * y.size
    focusing = _focusing(frequency, tx, rx, x, y)
    remarks += _remarks(asked, leg, ambiguous, by_noise, by_ambiguity, first)
    return Plan(
        kind="plan",
        **facts,
        walls=walls,
        link_budget=budget,
        bounces_above_noise=by_noise if by_noise >= 0 else None,
        bounces_unambiguous=by_ambiguity if by_ambiguity >= 0 else None,
        bounces=min(by_noise, by_ambiguity) if min(by_noise, by_ambiguity) >= 0 else None,
        samples=samples,
        data_megabytes=samples * BYTES_PER_SAMPLE / 1e6,
        measuring_s=measuring,
        image_pixels=pixels,
        focusing_s=focusing.focusing_s,
        focusing_algorithm=focusing.algorithm,
        memory_gb=focusing.memory_gb,
        folding_s=pixels / FOLDING_PIXELS_PER_SECOND,
        hidden_quality=expected_quality(
            frequency=float(frequency.mean()),
            bandwidth=band[1] - band[0],
            aperture=float(np.hypot(aperture, rx_aperture) / np.sqrt(2.0)),
            range=range + leg,
            wall_range=range,
            mirrored_db=first.specular_te_db[DIAGONAL],
        ),
        remarks=remarks,
        files=[],
    )


def _remarks(
    asked: PlanSettings, leg: float, ambiguous: float, by_noise: int, by_ambiguity: int, wall: Wall
) -> list[str]:
    """Remarks on what will go wrong.

    `by_noise` and `by_ambiguity` are the largest numbers of bounces that stay above the noise and within the ambiguous
    range [m]; -1 where not even the line of sight does.
    """
    remarks = [
        f"The fit of {name} holds from {FITTED[0] / 1e9:g} to {FITTED[1] / 1e9:g} GHz; what is said of it here is "
        "extrapolated."
        for name in asked.materials
        if not is_fitted(name, asked.band)
    ]
    limit = reach(ambiguous, speed_of_light / asked.band[1])
    if by_ambiguity < 0:
        meant = shorter_unit(asked.range, limit) if asked.range > limit else ""
        remarks.append(
            f"The ambiguous range, {ambiguous:.3g} m, is shorter than the room, {asked.range:g} m{meant}; "
            f"measure at least {_points_for(asked.range, asked.band)} frequencies."
        )
    elif by_ambiguity < min(by_noise, MOST_REMARKED):
        needed = _points_for(asked.range + leg * min(by_noise, MOST_REMARKED), asked.band)
        remarks.append(
            f"Echoes of more than {by_ambiguity} bounces arrive beyond the ambiguous range, "
            f"{ambiguous:.3g} m, and wrap around into the scene; measure at least {needed} frequencies."
        )
    if by_noise < 0:
        remarks.append(
            "Not even the line of sight stands above the noise; transmit more power, narrow the bandwidth, or come "
            "nearer."
        )
    diffuse, mirrored = wall.diffuse_db[0], wall.specular_te_db[DIAGONAL]
    if diffuse is None or diffuse < INVISIBLE_DB:
        remarks.append("The walls are so smooth that they scatter next to nothing: away from broadside they stay dark.")
    if mirrored is None or mirrored < DULL_DB:
        remarks.append("The walls mirror so little at 45 degrees that bounces fade quickly; choose a lower band.")
    return remarks


def _focusing(frequency: Array, tx: Array, rx: Array, x: Array, y: Array) -> Choice:
    """The algorithm that will focus the pixels x, y, accurately enough for folding, with its time and memory."""
    from mirrorfold.focusing.choosing.choice import explain
    from mirrorfold.focusing.problem import Problem

    problem = Problem.usual(frequency, tx, rx, x, y, np.zeros(1))
    return explain(problem, TOLERANCE_TO_FOLD)


def _link_budget(
    wall: Wall, range_: float, leg: float, target: float, wavelength: float, pairs: int, points: int,
    instrument: Instrument,
) -> list[BudgetRow]:  # fmt: skip
    """Range and signal over noise of a target for 0 to `MOST_BOUNCES` bounces, at 45 degrees on every wall."""
    noise = sample_noise(instrument)
    power = transmitted_power(instrument) * 10.0 ** (instrument.gain_dbi / 5.0)
    loss = wall.specular_te_db[DIAGONAL]
    rows = []
    for bounces in np.arange(MOST_BOUNCES + 1):
        distance = range_ + leg * bounces
        sample = None
        if loss is not None or not bounces:
            received = power * wavelength**2 * target / ((4.0 * np.pi) ** 3 * distance**4)
            sample = float(10.0 * np.log10(received / noise) + 2.0 * bounces * (loss or 0.0))
        rows.append(
            BudgetRow(
                bounces=int(bounces),
                range_m=float(distance),
                sample_snr_db=sample,
                snr_db=None if sample is None else sample + 10.0 * float(np.log10(pairs * points)),
            )
        )
    return rows


def transmitted_power(instrument: Instrument) -> float:
    """Transmitted power [W]."""
    return 1e-3 * power_ratio_of(instrument.power_dbm)


def sample_noise(instrument: Instrument) -> float:
    """Power of the noise of a sample [W], ``k T B F``, with the noise figure F and the filter's bandwidth B."""
    return Boltzmann * TEMPERATURE * instrument.if_bandwidth * power_ratio_of(instrument.noise_figure_db)


def _line(aperture: float, pitch: float) -> Array:
    """Positions of antennas on a line along x, around zero, (n, 3) [m]."""
    count = round(aperture / pitch) + 1
    return np.outer(pitch * (np.arange(count) - (count - 1) / 2), [1.0, 0.0, 0.0])


def _points_for(range_: float, band: tuple[float, float]) -> int:
    """Number M of frequencies for an ambiguous range R [m], ``M > 1 + 2 B R / c``, with the bandwidth B."""
    return int(np.floor(2.0 * (band[1] - band[0]) * range_ / speed_of_light)) + 2


__all__ = ["Instrument", "Plan", "plan"]
