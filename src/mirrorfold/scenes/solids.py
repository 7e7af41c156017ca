"""Three-dimensional scenes: panels, solids, bodies and patches in front of a raster scanner.

A scene file has the same TOML as in two dimensions, with ``dimensions = 3`` and a ``[scanner]`` in place of an
``[array]``. Every shape has its own frame, x to its right, y to its front and z up, in which its parts and patches are
described.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator
from pydantic.dataclasses import dataclass

from mirrorfold.common.decibels import TRUTH_COLOUR
from mirrorfold.common.geometry import Isometry, unit
from mirrorfold.common.slabs import Polarization
from mirrorfold.common.svg import Stroke, card, picture
from mirrorfold.common.types import Array
from mirrorfold.common.units import Quantity
from mirrorfold.scenes import materials
from mirrorfold.scenes.arrays import (
    STRICT,
    AnyAngle,
    Band,
    Finite,
    NonNegative,
    NonNegativeLength,
    Number,
    Point2,
    Point3,
    Positive,
    PositiveLength,
)
from mirrorfold.scenes.messages import Entries, say_plainly
from mirrorfold.scenes.scanner import Leakage, Scanner, Steps
from mirrorfold.scenes.surfaces import Roughness, check_names

Lifted = Annotated[Number, Field(ge=0, le=170), Quantity("angle")]
Bent = Annotated[Number, Field(ge=0, le=150), Quantity("angle")]
Share = Annotated[Number, Field(ge=0, le=1)]
TALLEST_BODY = 2.5
"""Largest height of a mannequin [m]: a taller one was probably given in another unit."""


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Finish:
    """Attributes that surfaces of all shapes share: material and scattering.

    Attributes
    ----------
    material : str or Substance
        A name that `mirrorfold.scenes.materials` knows, or permittivity and conductivity.
    roughness : Roughness, optional
        Scatters a part of the specular reflection diffusely; smooth by default.
    diffuse_fraction : float
        Share of the remaining reflected power that is scattered diffusely, by folds, fabric or texture.
    volume_depth : float [m]
        Depth over which the inside of a wall scatters, too.
    volume_profile : {"exponential", "uniform", "layers"}, default "exponential"
        How that scattering is distributed over the depth; see `mirrorfold.scenes.materials.VolumeProfile`.
    loss_db : float [dB]
        Additional loss of everything that the surface returns, on top of that of the material.
    """

    material: str | materials.Substance = "pec"
    roughness: Roughness | None = None
    diffuse_fraction: Share = 0.0
    volume_depth: NonNegativeLength = 0.0
    volume_profile: materials.VolumeProfile = "exponential"
    loss_db: NonNegative = 0.0

    @field_validator("material")
    @classmethod
    def _known(cls, value: str | materials.Substance) -> str | materials.Substance:
        materials.material(value)
        return value

    @property
    def substance(self) -> materials.Material:
        """The material as an object with a reflection coefficient."""
        return materials.material(self.material)


def turned(heading: float, position: Point3) -> Isometry:
    """The frame at a position [m] whose front, its y axis, is turned by `heading` [degree] from +y towards +x."""
    angle = np.radians(heading)
    cosine, sine = np.cos(angle), np.sin(angle)
    return Isometry(np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]), np.array(position))


@dataclass(frozen=True, config=STRICT, kw_only=True)
class _Solid(Finish):
    """A named shape."""

    name: str

    @property
    def frame(self) -> Isometry:
        """The isometry from the shape's own coordinates to those of the scene."""
        return Isometry.identity(3)


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Panel(_Solid):
    """A flat rectangle, seen from both sides: a wall, a floor, a board.

    Attributes
    ----------
    center : (3,) [m]
    normal : (3,)
        Direction of the front; need not have length one.
    width, height : float [m]
        The width is measured horizontally; for a horizontal panel along x.
    thickness : float [m], optional
        Thickness of a half-transparent panel, half of it on either side of its middle; by default the panel is opaque.
    """

    kind: Literal["panel"] = "panel"
    center: Point3
    normal: tuple[Finite, Finite, Finite]
    width: PositiveLength
    height: PositiveLength
    thickness: PositiveLength | None = None

    def __post_init__(self) -> None:
        if not np.linalg.norm(self.normal) > 0:
            raise ValueError("normal must have a length above zero, for example [0, -1, 0]")
        materials.check_passable(self.material, self.thickness, self.volume_depth)

    @property
    def frame(self) -> Isometry:
        """Frame with the origin at the center, and the normal as the front."""
        front = unit(self.normal)
        right = np.array([front[1], -front[0], 0.0])
        right = unit(right) if np.linalg.norm(right) > 1e-9 else np.array([1.0, 0.0, 0.0])
        return Isometry(np.stack([right, front, np.cross(right, front)], axis=1), np.array(self.center))


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Box(_Solid):
    """A box of `size` (along its x, y, z) around `center` [m], turned by `heading`; `rounding` is its edges' radius."""

    kind: Literal["box"] = "box"
    center: Point3
    size: tuple[PositiveLength, PositiveLength, PositiveLength]
    heading: AnyAngle = 0.0
    rounding: NonNegativeLength = 0.0

    def __post_init__(self) -> None:
        if 2.0 * self.rounding >= min(self.size):
            raise ValueError(f"rounding is {self.rounding:g} m, expected less than half the smallest side")

    @property
    def frame(self) -> Isometry:
        """Around the center."""
        return turned(self.heading, self.center)


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Sphere(_Solid):
    """A sphere around `center` [m] of `radius` [m]."""

    kind: Literal["sphere"] = "sphere"
    center: Point3
    radius: PositiveLength

    @property
    def frame(self) -> Isometry:
        """Around the center."""
        return turned(0.0, self.center)


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Cylinder(_Solid):
    """A closed cylinder of `radius` [m] whose axis runs from `start` to `end` [m]."""

    kind: Literal["cylinder"] = "cylinder"
    start: Point3
    end: Point3
    radius: PositiveLength

    def __post_init__(self) -> None:
        if self.start == self.end:
            raise ValueError("start and end are the same point; a cylinder needs a length")


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Mesh(_Solid):
    """A closed triangle mesh from an STL, OBJ or PLY file, z up, in `scale` metres, its origin at `position`."""

    kind: Literal["mesh"] = "mesh"
    path: Path
    scale: Positive = 1.0
    position: Point3 = (0.0, 0.0, 0.0)
    heading: AnyAngle = 0.0

    @property
    def frame(self) -> Isometry:
        """From the coordinates of the file, times `scale`, to those of the scene."""
        return turned(self.heading, self.position)


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Mannequin(_Solid):
    """A standing body.

    Attributes
    ----------
    position : (3,) [m]
        Point on the ground between the feet.
    height : float [m]
    heading : float [degree]
        Direction in which it looks, from +y towards +x.
    arms : (2,) [degree]
        Angles by which the left and the right arm are lifted sideways.
    elbows : (2,) [degree]
        Angles by which the left and the right elbow are bent, forearms to the front.
    stride : float [degree]
        Angle by which the left leg is turned to the front, and the right leg to the back.
    """

    kind: Literal["mannequin"] = "mannequin"
    position: Point3
    height: PositiveLength = 1.75
    heading: AnyAngle = 0.0
    arms: tuple[Lifted, Lifted] = (12.0, 12.0)
    elbows: tuple[Bent, Bent] = (10.0, 10.0)
    stride: Annotated[Number, Field(ge=-45, le=45), Quantity("angle")] = 0.0

    def __post_init__(self) -> None:
        if self.height > TALLEST_BODY:
            raise ValueError(
                f"height is {self.height:g} m, expected at most {TALLEST_BODY:g} m; "
                f"heights are metres, perhaps {self.height / 1000:g} m was meant"
            )

    @property
    def frame(self) -> Isometry:
        """Frame with the origin between the feet, and the direction in which it looks as the front."""
        return turned(self.heading, self.position)


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Patch(_Solid):
    """A region of another surface with another finish: the part inside a prism that faces the direction of the prism.

    Attributes
    ----------
    on : str
        Name of the surface.
    center : (3,) [m]
        Center of the outline, in the frame of that surface.
    direction : (3,)
        Axis of the prism, in the same frame, pointing out of the surface: only parts that face it are covered.
    outline : (n, 2) [m]
        Corners of the prism's cross-section relative to the center, to the right and up as seen against `direction`;
        it must not cross itself.
    """

    kind: Literal["patch"] = "patch"
    on: str
    center: Point3 = (0.0, 0.0, 0.0)
    direction: tuple[Finite, Finite, Finite] = (0.0, 1.0, 0.0)
    outline: Annotated[tuple[Point2, ...], Field(min_length=3)]

    def __post_init__(self) -> None:
        if not np.linalg.norm(self.direction) > 0:
            raise ValueError("direction must have a length above zero, for example [0, 1, 0]")

    def covers(self, points: Array, normals: Array) -> NDArray[np.bool_]:
        """Which points (n, 3) [m] with normals (n, 3), in the frame of the surface, the patch covers, (n,)."""
        from matplotlib.path import Path as Outline

        towards = unit(self.direction)
        left = np.cross([0.0, 0.0, 1.0], towards)
        # Seen against the direction, up stays up, and right is the left side of a surface that faces the viewer.
        right = unit(left) if np.linalg.norm(left) > 1e-9 else np.array([1.0, 0.0, 0.0])
        up = np.cross(towards, right)
        offset = points - np.array(self.center)
        inside = Outline(np.array(self.outline)).contains_points(np.stack([offset @ right, offset @ up], axis=1))
        return np.asarray(inside & (normals @ towards > 0.0))


Surface3D = Panel | Box | Sphere | Cylinder | Mesh | Mannequin | Patch


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Scene3D:
    """A scene in space: all that a simulation needs, and the ground truth that a score compares with.

    Attributes
    ----------
    name : str
    dimensions : int
        3.
    scanner : Scanner
    band : Band
    surface : tuple of Panel, Box, Sphere, Cylinder, Mesh, Mannequin or Patch
    polarization : {"TE", "TM", "both"}, default "TE"
        Polarization that the scanner transmits and receives: E parallel to every face that it meets ("TE"), as vertical
        E is to upright walls; H parallel to it ("TM"); or one after the other.
    """

    name: str
    dimensions: Literal[3]
    scanner: Scanner
    band: Band
    surface: tuple[Annotated[Surface3D, Field(discriminator="kind")], ...] = ()
    polarization: Polarization | Literal["both"] = "TE"

    def __post_init__(self) -> None:
        for surface in self.surface:
            if isinstance(surface, Panel) and surface.thickness is not None:
                materials.permittivity(surface.material, [self.band.start, self.band.stop])
            else:
                materials.warn_if_extrapolated(surface.material, [self.band.start, self.band.stop])
        check_names(self.surface)
        solids = [surface.name for surface in self.surface if surface.kind != "patch"]
        for surface in self.surface:
            if isinstance(surface, Patch) and surface.on not in solids:
                raise ValueError(f"patch {surface.name!r} lies on {surface.on!r}, expected one of {', '.join(solids)}")

    def _repr_html_(self) -> str:
        """Picture of the floor plan of the panels, dots for other objects, and the main facts, for notebooks."""
        strokes = []
        for surface in self.surface:
            if isinstance(surface, Patch):
                continue
            frame = surface.frame
            if isinstance(surface, Panel):
                half = 0.5 * surface.width * frame.linear[:2, 0]
                ends = np.array([frame.shift[:2] - half, frame.shift[:2] + half])
                strokes.append(Stroke(ends, TRUTH_COLOUR, label=surface.name))
            else:
                # The frame of a cylinder is that of the scene.
                axis = [surface.start, surface.end] if isinstance(surface, Cylinder) else [frame.shift]
                middle = np.mean(axis, axis=0)[None, :2]
                strokes.append(Stroke(middle, TRUTH_COLOUR, 9.0, dots=True, label=surface.name))
        azimuth, elevation = self.scanner.angles
        facts = [
            ("surfaces", ", ".join(surface.name for surface in self.surface) or "none"),
            ("beams", f"{azimuth.size} x {elevation.size}"),
            ("band", f"{self.band.start / 1e9:g} to {self.band.stop / 1e9:g} GHz, {self.band.points} frequencies"),
        ]
        return card(self.name, picture(strokes, self.scanner.origin, title=f"floor plan of {self.name}"), facts)

    def patches(self, name: str) -> list[tuple[int, Patch]]:
        """Number and patch for all patches on the surface `name`; where patches overlap, the later one applies."""
        return [(i, patch) for i, patch in enumerate(self.surface) if isinstance(patch, Patch) and patch.on == name]


ENTRIES = Entries.of(get_args(Surface3D), (Scene3D, Band, Scanner, Steps, Leakage, Roughness, materials.Substance))
"""All entries that a scene file may have."""
say_plainly(Scene3D, ENTRIES)
