"""The command that the live page gives to make a result again."""

from __future__ import annotations

from pathlib import Path

import pytest

from mirrorfold.focusing.settings import TOLERANCE_TO_FOLD
from mirrorfold.viewing.repeating import command_to_repeat

VIEWED, OUTPUT = Path("a/my sweep.nc"), Path("a/out.nc")
FOCUS = f"mirrorfold focus 'a/my sweep.nc' -o 'a/my sweep.image.nc' --tolerance {TOLERANCE_TO_FOLD!r}"
FOLD = "mirrorfold fold 'a/my sweep.image.nc'"


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, "mirrorfold fold 'a/my sweep.nc' -o a/out.nc"),
        ({"frame": 2}, "mirrorfold fold 'a/my sweep.nc' -o a/out.nc --frame 2"),
        ({"mirrors": Path("m.json"), "preset": "published"},
         "mirrorfold fold 'a/my sweep.nc' -o a/out.nc --mirrors m.json --preset published"),
        ({"focused": True, "tested": True, "frame": 2},
         f"{FOCUS} --frame 2 && {FOLD} --sweep 'a/my sweep.nc' -o a/out.nc --frame 2"),
        # A raster scan does not test the echoes of its image, which holds the frame alone.
        ({"focused": True, "frame": 2}, f"{FOCUS} --frame 2 && {FOLD} -o a/out.nc"),
    ],
)  # fmt: skip
def test_the_command_names_all_that_is_needed(given, expected):
    assert command_to_repeat(VIEWED, OUTPUT, {}, **given) == expected


def test_settings_of_the_preset_are_left_out():
    command = command_to_repeat(VIEWED, OUTPUT, {"threshold_db": -16.5, "opaque": True, "generations": None})
    assert command == "mirrorfold fold 'a/my sweep.nc' -o a/out.nc --threshold-db -16.5"
