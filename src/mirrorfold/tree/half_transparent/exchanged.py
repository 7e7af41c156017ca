"""Whether TE and TM have changed places in the data: no wall reflects TM better than TE, and none passes TE better.

At one face ``|r_TM| < |r_TE|`` at all angles but 0 and 90 degrees, most so at Brewster's angle; so a slab without
losses has ``|R_TM| <= |R_TE|`` and ``|T_TM| >= |T_TE|``. With exchanged names, reflected echoes seem to have passed,
but over angles and frequencies no wall passes waves as another one reflects them. So the likeliest wall with the names
as they are is compared with the likeliest wall with the names exchanged (`mirrorfold.tree.half_transparent.panes`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import xarray as xr

from mirrorfold.detection import View
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.half_transparent.panes import Pairs, find_pane
from mirrorfold.tree.half_transparent.transparent import (
    AGAINST_METAL,
    EVIDENCE,
    FEWEST,
    MOST_PAIRS,
    echoes_behind,
    flat_walls,
    pairs_of,
)

AGAINST_NAMES = 10.0
"""Least logarithm of the odds that the names are exchanged: objects may return one polarization stronger."""


def exchanged(walls: Iterable[Pairs]) -> bool:
    """Whether TE and TM have each other's name, by what is seen behind each of some walls."""
    odds, against_metal = 0.0, 0.0
    for pairs in walls:
        # A metal mirror is as likely with either name, so that its likelihood cancels.
        as_named = find_pane(pairs).against_metal
        otherwise = find_pane(replace(pairs, te=pairs.tm, tm=pairs.te)).against_metal
        if max(as_named, otherwise) > EVIDENCE:  # behind a metal mirror, both walls are unlikely
            odds, against_metal = odds + otherwise - as_named, max(against_metal, otherwise)
    return odds > AGAINST_NAMES and against_metal > AGAINST_METAL


def seen_behind_walls(found: Found, view: View, images: Mapping[str, xr.DataArray]) -> list[Pairs]:
    """What the image "TM" shows behind each flat wall in line of sight, in both polarizations.

    If the names are exchanged, this image shows what walls reflect; near Brewster's angle, the image "TE" does not.
    `found` and `view` are those of the image "TM"; both `images` are complex.
    """
    behind = []
    for index, mirror in flat_walls(found):
        echoes = echoes_behind(found, view, index)
        brightest = view.brightest(echoes.position, echoes.amplitude)
        if brightest.size >= FEWEST:
            pairs = pairs_of(view, images, echoes.take(brightest), mirror)
            behind.append(pairs.take(pairs.evenly(MOST_PAIRS)))
    return behind
