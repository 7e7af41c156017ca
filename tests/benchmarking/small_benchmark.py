"""A radar and families so small that a scene takes a fraction of a second, and methods to judge on them."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np

from mirrorfold.scenes.families import Family, Radar
from mirrorfold.scenes.families.parts import circle, wall

RADAR = Radar(
    name="small",
    what="290-300 GHz, 41 antennas",
    band={"start": 290e9, "stop": 300e9, "points": 61},
    array={"kind": "linear", "elements": 41, "pitch": 0.5e-3},
)


def one_wall(random, radar):
    return [wall("wall", (random.uniform(-0.05, 0.05), 0.4), random.uniform(-5.0, 5.0), 0.3)]


def in_sight(random, radar):
    return [circle("disc", (0.0, 0.4), 0.05)]


WALL = Family(name="small wall", what="a wall across the view", engine="rays", make=one_wall, snr_db=30.0)
IMPOSSIBLE = Family(name="impossible", what="a disc that cannot be hidden", engine="rays", make=in_sight)

calls: list[str] = []
"""Methods that were called, in this process."""


def nothing(image, sweep):
    calls.append("nothing")
    return {"points": []}


class UnspeakableError(Exception):
    def __str__(self):
        raise ValueError("no words")


def unspeakable(image, sweep):
    raise UnspeakableError


def strongest(image, sweep):
    """The strongest pixel alone."""
    calls.append("strongest")
    row, column = np.unravel_index(np.abs(image.values).argmax(), image.shape)
    return {"points": [[float(image["x"][column]), float(image["y"][row])]], "bounces": [0]}


def spoils(image, sweep):
    image.values[:] = np.nan
    sweep["s"].values[:] = 0.0
    return {"points": []}


def raises(image, sweep):
    raise RuntimeError("out\nof luck")


def leaves(image, sweep):
    sys.exit(3)


def interrupted(image, sweep):
    calls.append("interrupted")
    if len(calls) >= 3:
        raise KeyboardInterrupt
    return {"points": []}


def a_number(image, sweep):
    return 3.0


def flat(image, sweep):
    return {"points": [1.0, 2.0]}


def infinite(image, sweep):
    return {"points": [[np.inf, 1.0]]}


def other_words(image, sweep):
    return {"point": [[0.0, 1.0]]}


def short(image, sweep):
    return {"points": [[0.0, 1.0]], "bounces": [0, 1]}


def in_words(image, sweep):
    return {"points": "everywhere"}


def imaginary(image, sweep):
    return {"points": [[0.0, 1.0 + 1.0j]]}


def half_a_bounce(image, sweep):
    return {"points": [[0.0, 1.0]], "bounces": [0.5]}


def far_away(image, sweep):
    return {"points": [[1e300, 1.0]]}


class OfItsOwn(BaseException):
    pass


def raises_its_own(image, sweep):
    raise OfItsOwn


def crashes(image, sweep):
    os._exit(1)


def wanders(image, sweep):
    print("where am I?")
    os.chdir("/")
    np.seterr(all="raise")
    return {"points": []}


def shouts(image, sweep):
    """Print past Python's stdout, as compiled code and other programs do."""
    os.write(1, b"compiled\n")
    print("held back", file=sys.__stdout__)
    subprocess.run([sys.executable, "-c", "print('program')"], check=True)
    return {"points": []}


NOT_CALLABLE = 3
