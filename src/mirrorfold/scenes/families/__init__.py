"""Families of random scenes, on which methods are benchmarked: their names, their radars, and drawing a scene."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeVar

from mirrorfold.common.arguments import in_message, whole_number, wrong_kind
from mirrorfold.errors import InputError
from mirrorfold.scenes.families import curved, glass, raster, raster_round, raster_studs, rays, wave_mirrors, waves
from mirrorfold.scenes.families.drawing import scene_of
from mirrorfold.scenes.families.family import Family
from mirrorfold.scenes.families.radars import RADARS, Radar

if TYPE_CHECKING:
    from mirrorfold.scenes.floor_plan import Scene
    from mirrorfold.scenes.solids import Scene3D

__all__ = ["FAMILIES", "RADARS", "Family", "Radar", "draw", "family_named", "radar_named", "radars_of"]

_MODULES = rays, curved, glass, waves, wave_mirrors, raster, raster_round, raster_studs

FAMILIES = {family.name: family for module in _MODULES for family in module.FAMILIES}
"""All families, by name."""

Named = TypeVar("Named", Family, Radar)


def draw(family: str | Family, seed: int = 0, *, radar: str | Radar | None = None) -> Scene | Scene3D:
    """A random scene of a family.

    Parameters
    ----------
    family : str or Family
        Name of one of `FAMILIES`, or a family of one's own.
    seed : int, default 0
        The same seed gives the same scene.
    radar : str or Radar, optional
        Name of one of `RADARS`, or a radar of one's own; by default that of the family, or the first that can see it.

    Returns
    -------
    Scene or Scene3D

    Raises
    ------
    InputError
        If a name is not known, the seed is no whole number from 0, the radar cannot see scenes of this family, or the
        family's ranges allow no valid scene.

    Examples
    --------
    >>> scene = draw("two walls", 3)
    >>> [surface.name for surface in scene.surface][:2]
    ['wall 1', 'wall 2']
    """
    chosen = family if isinstance(family, Family) else family_named(family)
    seed = whole_number("seed", seed)
    seen_by = radars_of(chosen)[0] if radar is None else radar if isinstance(radar, Radar) else radar_named(radar)
    if not is_of_its_kind(seen_by, chosen):
        raise wrong_kind_of_radar(seen_by, chosen)
    return scene_of(chosen, seed, seen_by)


def is_of_its_kind(radar: Radar, family: Family) -> bool:
    """Whether a radar is a scanner for a family of raster scans, or an array for others."""
    return bool(radar.scanner) == (family.engine == "raster")


def wrong_kind_of_radar(radar: Radar, family: Family) -> InputError:
    """The error for a scanner where an array is needed, or the other way round."""
    suitable = ", ".join(other.name for other in RADARS.values() if is_of_its_kind(other, family))
    return InputError(f"radar {radar.name!r} cannot see family {family.name!r}, expected one of: {suitable}")


def radars_of(family: Family) -> list[Radar]:
    """The radars that can see the scenes of a family, the default one first."""
    if family.radar is not None:
        return [family.radar if isinstance(family.radar, Radar) else radar_named(family.radar)]
    return [radar for radar in RADARS.values() if is_of_its_kind(radar, family)]


def family_named(name: str) -> Family:
    """A family by its name, in which hyphens may replace spaces and case is ignored; InputError if there is none."""
    return _named("family", name, FAMILIES)


def radar_named(name: str) -> Radar:
    """A radar by its name, in which hyphens may replace spaces and case is ignored; InputError if there is none."""
    return _named("radar", name, RADARS)


def _named(what: str, name: str, known: Mapping[str, Named]) -> Named:
    """The entry of `known` with a name, ignoring hyphens and case; `what` says in messages what is looked for."""
    if not isinstance(name, str):
        raise wrong_kind(what, name, f"one of {', '.join(known)}")
    for candidate, found in known.items():
        if _plain(candidate) == _plain(name):
            return found
    raise InputError(f"{what} is {in_message(name)}, expected one of: {', '.join(known)}")


def _plain(name: str) -> str:
    return name.replace("-", " ").casefold()
