"""Floor plans in the formats of CAD and maps: DXF (with ezdxf, the extra ``mirrorfold[cad]``) and GeoJSON.

All coordinates are those of the radar, in metres: x to the right, y where it looks. By its standard (RFC 7946), GeoJSON
holds longitude and latitude; in plans of rooms, and in those read and written here, it holds metres.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy import constants

from mirrorfold.common.arcs import Arc, arc_through, as_three_points, in_line, mirror_places
from mirrorfold.common.arguments import in_message, path_of
from mirrorfold.common.chains import mirror_chains
from mirrorfold.common.plans import FloorPlan
from mirrorfold.common.plausible import unplaced
from mirrorfold.common.reading import check_file, parsed, read_text
from mirrorfold.common.types import Array
from mirrorfold.common.units import KINDS, unit_named
from mirrorfold.errors import InputError

SUFFIXES = (".dxf", ".geojson")
"""Suffixes of floor plans."""

MIRRORS, IMAGES, POINTS = "mirrors", "mirror-images", "points"
"""Layers of a DXF file, and values of the property `layer` in GeoJSON: mirrors at their true places, mirrors where they
appear in the unfolded image, and folded points."""

SAGITTA = 1e-3
"""Largest distance of the chords of arcs and splines from the curve [m]: at most about a wavelength of the radars."""

ROUND = 0.01
"""Largest distance of the chords of arcs and circles from the curve, over the radius: they turn by 16 degrees."""

LARGEST_COUNT = 100_000
"""Largest number of lines of a floor plan; more must be a mistake, and would take hours to process."""

CURVES = ("LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE")
"""Kinds of DXF entities that are read. Dimensions and leaders consist of lines, too, but these are no walls."""

UNITS = (
    1.0, constants.inch, constants.foot, constants.mile, 1e-3, 1e-2, 1.0, 1e3, 1e-6 * constants.inch, constants.mil,
    constants.yard, constants.angstrom, 1e-9, 1e-6, 1e-1, 1e1, 1e2, 1e9, constants.au, constants.light_year,
    constants.parsec, constants.survey_foot, constants.survey_foot / 12.0, 3.0 * constants.survey_foot,
    constants.survey_mile,
)  # fmt: skip
"""Length [m] of each unit of DXF by its number `$INSUNITS`, of which 0 says no unit. Source: Autodesk, "DXF Reference",
HEADER section."""


def is_plan(path: str | Path) -> bool:
    """Whether a file is a floor plan, by the suffix of its name."""
    return Path(path).suffix.lower() in SUFFIXES


def read_plan(path: str | Path) -> FloorPlan:
    """Read the lines of a floor plan.

    Parameters
    ----------
    path : path
        DXF: lines, polylines, arcs, circles, ellipses and splines of the model space, also those in blocks and
        multilines, as far as they are visible; `$INSUNITS` tells the unit, by default metres. GeoJSON: lines and
        outlines of areas, in the unit of length that a member "units" names, by default metres. On the layer of mirror
        images, an arc, or a line of more than two points, is a curved mirror: the arc through the first, the middle and
        the last of its points.

    Returns
    -------
    FloorPlan

    Raises
    ------
    InputError
        If the file is missing or damaged, holds no line, or ezdxf is absent.
    """
    path = Path(path)
    if not is_plan(path):
        raise InputError(f"{path}: ends in {path.suffix!r}, expected a floor plan, one of {', '.join(SUFFIXES)}")
    check_file(path, "give a DXF or GeoJSON file")
    drawn = (_dxf if path.suffix.lower() == ".dxf" else _geojson)(path)
    found = list(islice(drawn, LARGEST_COUNT + 1))
    if len(found) > LARGEST_COUNT:
        raise InputError(f"{path}: holds more than {LARGEST_COUNT} lines, expected the walls of a floor plan")
    found = [(layer, line) for layer, line in found if (line != line[:1]).any()]  # of some length in the plan
    lines = tuple(line for layer, line in found if layer not in (IMAGES, POINTS))
    images = [line[[0, len(line) // 2, -1]] if len(line) > 2 else line for layer, line in found if layer == IMAGES]
    if not lines:
        raise InputError(f"{path}: holds no line or polyline, expected the walls of a floor plan")
    for line in (*lines, *images):
        wrong = unplaced(line)
        if wrong is not None:
            raise InputError(f"{path}: a line has a coordinate that {wrong}; draw it anew, in metres")
    return FloorPlan(lines, np.array(as_three_points(images)) if images else None, str(path))


def as_plan(plan: Any) -> FloorPlan:
    """A floor plan, given as such or by the path of its file.

    Raises
    ------
    InputError
        If it is neither, or the file cannot be read.
    """
    if isinstance(plan, FloorPlan):
        return plan
    return read_plan(path_of("plan", plan, "a floor plan, as mf.load returns, or the path of a DXF or GeoJSON file"))


def write_dxf(reconstruction: xr.DataTree, path: Path) -> None:
    """Write the plan of a reconstruction as DXF, in metres: mirrors, their images and points, each on a layer."""
    ezdxf = load_ezdxf(path)
    document = ezdxf.new("R2010", units=6)
    for layer, colour in ((MIRRORS, 5), (IMAGES, 8), (POINTS, 3)):
        document.layers.add(layer, color=colour)
    document.appids.add("MIRRORFOLD")
    space = document.modelspace()
    for layer, place, facts in plan_features(reconstruction):
        attribs = {"layer": layer}
        if layer == POINTS:
            drawn = space.add_point(place[0], attribs)
        elif len(place) == 3 and not in_line(*place):
            drawn = space.add_arc(**_arc(place), dxfattribs=attribs)
        else:
            drawn = space.add_line(place[0], place[-1], attribs)
        drawn.set_xdata("MIRRORFOLD", [(1000, f"{name}={value}") for name, value in facts.items()])
    document.saveas(path)


def write_geojson(reconstruction: xr.DataTree, path: Path) -> None:
    """Write the plan of a reconstruction as GeoJSON in metres: a feature with properties for each mirror and point."""
    features = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": place[0].tolist()} if layer == POINTS
            else {"type": "LineString", "coordinates": (arc_through(*place) if len(place) == 3 else place).tolist()},
            "properties": {"layer": layer, **facts},
        }
        for layer, place, facts in plan_features(reconstruction)
    ]  # fmt: skip
    content = {"type": "FeatureCollection", "units": "m", "features": features}
    path.write_text(json.dumps(content, allow_nan=False) + "\n", encoding="utf-8")


def _arc(place: Array) -> dict[str, Any]:
    """Center, radius [m] and angles [degree], counter-clockwise, of the arc through three points (3, 2) [m]."""
    arc = Arc.through(*place)
    start, end = (arc.first, arc.last) if arc.turn > 0.0 else (arc.last, arc.first)
    angles = {"start_angle": math.degrees(start), "end_angle": math.degrees(end)}
    return {"center": tuple(arc.center), "radius": arc.radius, **angles}


def plan_features(reconstruction: xr.DataTree) -> Iterator[tuple[str, Array, dict[str, Any]]]:
    """Layer, place and facts of each mirror, of its image, and of each point of a reconstruction.

    A place [m] is a point (1, d), the two ends of a line (2, d), or start, middle and end of an arc (3, 2). Images of
    mirrors are those of one unfolded image: a recording of several frames has none.
    """
    mirrors = reconstruction.children["mirrors"].to_dataset(inherit=False)
    axes = "xyz" if "z0" in mirrors else "xy"
    chains = mirror_chains(mirrors)
    recording = np.unique(mirrors["frame"]).size > 1 if "frame" in mirrors else False
    for layer, prefix in ((MIRRORS, "folded_"), *(() if recording else ((IMAGES, ""),))):
        places = mirror_places(mirrors, prefix)
        for i in range(mirrors.sizes.get("mirror", 0)):
            ends = np.array([[float(mirrors[f"{prefix}{axis}{end}"][i]) for axis in axes] for end in (0, 1)])
            place = places[i] if len(places[i]) == 3 else ends
            facts: dict[str, Any] = {"mirror": i, "chain": chains[i]}
            facts |= {
                name: int(mirrors[name].values[i]) for name in ("parent", "generation", "frame") if name in mirrors
            }
            strength = float(mirrors["strength"].values[i])
            yield layer, place, {**facts, "strength": strength if np.isfinite(strength) else None}
    objects = reconstruction.children["objects"].to_dataset(inherit=False)
    names = [
        name
        for name in ("amplitude", "bounces", "chain", "confidence", "surface", "frame")
        if name in objects.variables
    ]
    points = np.stack([objects[axis].values for axis in axes if axis in objects.variables], axis=-1)
    columns = [objects[name].values.tolist() for name in names]
    for point, *values in zip(points, *columns, strict=True):
        yield POINTS, point[None], dict(zip(names, values, strict=True))


def _geojson(path: Path) -> Iterator[tuple[str, Array]]:
    """Layer and place of every line of a GeoJSON file."""
    content = parsed(read_text(path, "export the plan again"), "JSON", str(path), "export the plan again")
    if not isinstance(content, dict) or "type" not in content:
        raise InputError(f"{path}: is no GeoJSON, which is an object with a 'type'; export the plan as GeoJSON")
    said = content.get("units", "m")
    unit = KINDS["length"].get(unit_named(str(said)) or "")
    if unit is None:
        raise InputError(f"{path}: its 'units' are {in_message(said)}, expected {', '.join(KINDS['length'])}")
    try:
        for layer, line in _lines_of(content, ""):
            yield layer, unit * np.array([point[:2] for point in line], dtype=float).reshape(-1, 2)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError, RecursionError):
        raise InputError(f"{path}: holds a geometry without proper coordinates; export the plan again") from None


def _lines_of(item: dict[str, Any], layer: str) -> Iterator[tuple[str, Any]]:
    """Layer and coordinates of all lines in a GeoJSON object."""
    kind = item["type"]
    if kind == "FeatureCollection":
        for feature in item["features"]:
            yield from _lines_of(feature, layer)
    elif kind == "Feature" and item.get("geometry"):
        yield from _lines_of(item["geometry"], str((item.get("properties") or {}).get("layer", "")))
    elif kind == "GeometryCollection":
        for geometry in item["geometries"]:
            yield from _lines_of(geometry, layer)
    elif kind == "LineString":
        yield layer, item["coordinates"]
    elif kind in ("MultiLineString", "Polygon"):
        for line in item["coordinates"]:
            yield layer, line
    elif kind == "MultiPolygon":
        for area in item["coordinates"]:
            for line in area:
                yield layer, line


def _dxf(path: Path) -> Iterator[tuple[str, Array]]:
    """Layer, in small letters, and place of every line of a DXF file that is seen."""
    ezdxf = load_ezdxf(path)
    from ezdxf import path as curves

    try:
        document = ezdxf.readfile(path)
        number = int(document.header.get("$INSUNITS", 0))
        if not 0 <= number < len(UNITS):
            raise InputError(f"{path}: its unit $INSUNITS is {number}, expected 0 to {len(UNITS) - 1}; set the unit")
        unit = UNITS[number]
        off = {layer.dxf.name.lower() for layer in document.layers if layer.is_off()}
        frozen = {layer.dxf.name.lower() for layer in document.layers if layer.is_frozen()}
        for layer, curve in _seen(document.modelspace(), off, frozen):
            outline = curves.make_path(curve)
            along: Iterable[Any] = outline.control_vertices()
            points = unit * np.array([(point.x, point.y) for point in along], dtype=float).reshape(-1, 2)
            if unplaced(points) is None:  # a curve far away would have points without end
                along = _along(curve, outline, layer, unit)
                points = unit * np.array([(point.x, point.y) for point in along], dtype=float).reshape(-1, 2)
            yield layer, points
    except (OSError, ezdxf.DXFError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{path}: is no DXF file that can be read ({error}); export the plan again as DXF") from None


def _seen(entities: Iterable[Any], off: set[str], frozen: set[str], block: str = "0") -> Iterator[tuple[str, Any]]:
    """The curves among DXF entities that are seen, those in blocks too, and their layers in small letters.

    What a block holds on the layer 0 lies on the layer `block` on which the block was inserted. A block on a frozen
    layer is not seen, one on a layer that is off only where it has layers of its own.
    """
    for entity in entities:
        own = str(entity.dxf.get("layer", "0")).lower()
        layer = block if own == "0" else own
        if layer in frozen or entity.dxf.get("invisible", 0):
            continue
        if entity.dxftype() in ("INSERT", "MLINE"):
            for one in entity.multi_insert() if getattr(entity, "mcount", 1) > 1 else (entity,):
                yield from _seen(one.virtual_entities(), off, frozen, layer)
        elif entity.dxftype() in CURVES and layer not in off:
            yield layer, entity


def _along(curve: Any, outline: Any, layer: str, unit: float) -> Iterable[Any]:
    """Points along a curve of a drawing whose path is `outline`, in the unit of the drawing [m]."""
    if curve.dxftype() == "ARC" and layer == IMAGES:  # three points on the arc itself
        return curve.vertices(curve.angles(3))
    if curve.dxftype() in ("ARC", "CIRCLE"):  # so many points that small ones stay round, too
        return curve.flattening(min(SAGITTA / unit, ROUND * curve.dxf.radius))
    return outline.flattening(SAGITTA / unit)


def load_ezdxf(path: Path) -> Any:
    """The library for DXF files.

    Raises
    ------
    InputError
        If it is absent.
    """
    try:
        import ezdxf
    except ImportError:
        raise InputError(f"{path}: DXF files need ezdxf; install it with: pip install 'mirrorfold[cad]'") from None
    return ezdxf
