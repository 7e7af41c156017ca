"""What verbs print with ``--json``: a model for every kind of output, which tests hold the verbs to.

A field that is not in its model is a mistake, and so is a value of another type. `mirrorfold.cli.outputs` says which
verb prints what.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field

Number = float | None
"""None, which JSON calls null, stands for what is not finite or not known."""

Files = Annotated[list[str], Field(description="what was written")]
Remarks = Annotated[list[str], Field(description="sentences on what looks wrong")]
Place = Annotated[list[float], Field(min_length=2, max_length=3)]
Decibel = Annotated[Number, Field(description="[dB]")]
Title = Annotated[str, Field(description="what the file calls itself")]
Path = Annotated[str | None, Field(description="file that was asked about")]
Sizes = Annotated[dict[str, int], Field(description="length of each dimension")]


class Output(BaseModel):
    """Any JSON object that is printed."""

    model_config = ConfigDict(extra="forbid", strict=True)

    @classmethod
    def parts(cls) -> list[type[Output]]:
        """The models of objects that are inside of this one, in the order of the fields."""
        found: list[type[Output]] = []
        for field in cls.model_fields.values():
            for model in _models_in(field.annotation):
                found += [model, *model.parts()]
        return found


class Finding(Output):
    """A mistake that the data show."""

    name: str
    what: str = Field(description="what was found, one sentence")
    sure: float = Field(ge=0, le=1)
    fix: str = Field(description="the command that puts it right, or advice")


class Band(Output):
    """What a band can resolve."""

    band_hz: list[float] = Field(min_length=2, max_length=2, description="lowest and highest frequency")
    frequencies: int
    frequency_step_hz: Number
    range_resolution_m: Number = Field(description="`c / (2 B)`")
    ambiguous_range_m: Number = Field(description="`c / (2 df)`")


class Arrays(Band):
    """What a band and two arrays can resolve."""

    tx: int = Field(description="transmitters")
    rx: int = Field(description="receivers")
    aperture_m: list[float] = Field(description="of the transmitters and the receivers")
    pitch_m: list[Number] = Field(description="likewise")
    cross_range_resolution_m: dict[str, float] | None = Field(description="by range [m]")
    field_of_view_deg: Number = Field(description="the sector free of grating lobes")


class Scan(Band):
    """What a band and a raster scan can resolve."""

    azimuth_deg: list[float] = Field(description="first and last")
    elevation_deg: list[float] = Field(description="first and last")
    beams: list[int] = Field(description="in azimuth and elevation")
    scan_step_deg: list[Number]
    spot_radius_m: Number
    focus_distance_m: Number


class Measured(Output):
    """What the samples of a sweep show."""

    kind: Literal["sweep"]
    path: Path = None
    title: Title
    dimensions: Sizes
    power_db: Decibel
    snr_db: Decibel
    noise_floor_db: Decibel
    dynamic_range_db: Decibel
    valid: bool = True
    judged: dict[str, bool] | None = Field(default=None, description="which mistakes the data suffice to look for")
    findings: list[Finding] = []
    remarks: Remarks
    files: Files = []


class ArraySweep(Measured, Arrays):
    """A sweep of two arrays, or of one moving antenna."""

    range_end_db: Decibel = Field(description="what arrives near the ambiguous range, against the strongest")
    reciprocity_db: Number = Field(
        default=None, description="difference from the transpose, where antennas transmit and receive [dB]"
    )


class RasterSweep(Measured, Scan):
    """A sweep of a raster scanner."""


class BrokenSweep(Output):
    """A sweep that cannot be used, but repaired; the exit code is 2."""

    kind: Literal["sweep"]
    path: Path = None
    title: Title
    dimensions: Sizes
    valid: Literal[False]
    findings: list[Finding]
    remarks: Remarks


class Image(Output):
    """An image."""

    kind: Literal["image"]
    path: Path = None
    title: Title
    dimensions: Sizes
    type: str = Field(description="of the pixels")
    extent: dict[str, list[float]] = Field(description="first and last coordinate of each dimension")
    pixel: dict[str, Number] = Field(description="size of a pixel along each dimension")
    strongest_at: dict[str, float]
    median_below_peak_db: Decibel
    remarks: Remarks
    files: Files = []


class Mirror(Output):
    """A mirror at its true place."""

    mirror: int
    parent: int = Field(description="the mirror it was seen through, -1 for none")
    generation: int
    start_m: Place
    end_m: Place
    strength: Number


class Reconstruction(Output):
    """A reconstruction."""

    kind: Literal["reconstruction"]
    path: Path = None
    title: Title
    dimensions: Sizes
    points: int
    points_by_bounces: dict[str, int]
    mirrors: list[Mirror]
    remarks: Remarks
    files: Files = []


class Surface(Output):
    """A surface of a scene."""

    name: str
    kind: str
    material: str | dict[str, Any]


class Scene(Arrays):
    """A scene in two dimensions."""

    kind: Literal["scene"]
    path: Path = None
    title: Title
    farthest_surface_m: float
    surfaces: list[Surface]
    remarks: Remarks


class VolumeScene(Scan):
    """A scene in three dimensions."""

    kind: Literal["scene"]
    path: Path = None
    title: Title
    surfaces: list[Surface]
    remarks: Remarks


class FullWaveEstimate(Output):
    """What a full-wave simulation would take."""

    kind: Literal["estimate"]
    unknowns: int
    skeletons: int
    frequencies: int
    workers: int
    cpu_seconds_per_frequency: float
    minutes: float
    memory_per_worker_gb: float
    memory_gb: float
    disk_gb: float
    remarks: Remarks


class ScanEstimate(Output):
    """What a simulation of a raster scan would take."""

    kind: Literal["estimate"]
    scatterers: int
    chains: int
    echoes: int
    longest_return_m: float
    needed_frequencies: int
    frequencies: int
    beams: int
    sweep_bytes: int
    seconds: float
    remarks: Remarks


class InferredFact(Output):
    """One line of a proposed mapping."""

    what: str
    sure: str
    why: str


class Mapping(Output):
    """A proposed mapping, of ``import --guess``."""

    kind: Literal["mapping"]
    findings: list[InferredFact]
    missing: list[str] = Field(description="what could not be found")
    works: str | None = Field(description="what the mapping makes of the file; null if something is missing")
    mapping: str = Field(description="the text (TOML)")
    files: Files


class TouchstoneScan(Output):
    """A folder of Touchstone files."""

    kind: Literal["scan"]
    positions: str = Field(description="the table of the positions")
    files: Files


class Calibration(Output):
    """A calibrated sweep."""

    kind: Literal["sweep"]
    processing: list[str] = Field(description="every step so far")
    rx_displacement_m: list[float] | None = None
    cable_length_m: Number = None
    elements_residual_m: Number = None
    silent_tx: int | None = None
    silent_rx: int | None = None
    files: Files


class MirrorError(Output):
    """A detected mirror against the true surface that it agrees with, if any."""

    surface: str | None
    angle_error_deg: Number
    offset_error_mm: Number
    generation: int
    length_m: float


class Figures(Output):
    """Points against the truth."""

    points: int
    accuracy_m: Number = Field(description="mean distance of the points from the truth")
    precision_2cm: Number = Field(description="share of the points within 2 cm of the truth")
    completeness_2cm: Number = Field(description="share of the truth within 2 cm of the points")
    f_score_2cm: Number = Field(description="harmonic mean of both")
    precision_5cm: Number
    completeness_5cm: Number
    f_score_5cm: Number
    chamfer_m: Number = Field(description="mean of both mean distances")
    invented_fraction: Number = Field(description="share of the points far from every surface")


class PlanFigures(Figures):
    """The same in two dimensions."""

    reachable_m: float = Field(description="length of the truth that can be seen")


class VolumeFigures(Figures):
    """The same in three dimensions."""

    completeness_3cm: Number
    false_fraction: Number
    reachable_m2: float = Field(description="area of the truth that can be seen")


class HiddenPlan(PlanFigures):
    """What is out of sight."""

    mirrors: list[MirrorError]
    surfaces: list[str]


class HiddenVolume(VolumeFigures):
    """What is out of sight."""

    mirrors: list[MirrorError]
    surfaces: list[str]


class Contrast(Output):
    """A patch over its surroundings."""

    contrast_db: Decibel


class PlanScore(PlanFigures):
    """A score in two dimensions."""

    mirrors: list[MirrorError]
    hidden: HiddenPlan
    files: Files = []


class VolumeScore(VolumeFigures):
    """A score in three dimensions."""

    mirrors: list[MirrorError]
    hidden: HiddenVolume
    surfaces: dict[str, VolumeFigures] = Field(description="each hidden surface by itself")
    patches: dict[str, Contrast]
    files: Files = []


class Report(Output):
    """A page."""

    kind: Literal["report"]
    bytes: int
    files: Files


class View(Output):
    """A page that answers."""

    kind: Literal["view"]
    address: str


class Figure(Output):
    """A figure for a paper or a talk."""

    kind: Literal["figure"]
    what: str
    files: Files


class Wall(Output):
    """Shares of the power that a wall mirrors and scatters, by angle of incidence."""

    angle_deg: list[float]
    specular_te_db: list[Number]
    specular_tm_db: list[Number]
    diffuse_db: list[Number]


class BudgetRow(Output):
    """A target by way of so many mirrors."""

    bounces: int
    range_m: float
    sample_snr_db: Number
    snr_db: Number


class Plan(Arrays):
    """A plan."""

    kind: Literal["plan"]
    walls: dict[str, Wall]
    link_budget: list[BudgetRow]
    bounces_above_noise: int | None
    bounces_unambiguous: int | None
    bounces: int | None
    samples: int
    data_megabytes: float
    measuring_s: float
    image_pixels: int
    focusing_s: float
    folding_s: float
    remarks: Remarks
    files: Files


class Completion(Output):
    """A script that completes verbs and options."""

    kind: Literal["completion"]
    shell: str
    script: str


def _models_in(annotation: Any) -> list[type[Output]]:
    """The models that a type mentions."""
    if isinstance(annotation, type) and issubclass(annotation, Output):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models_in(part)]
