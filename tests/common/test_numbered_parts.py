"""Which files of a folder are parts of unfinished work."""

from __future__ import annotations

from mirrorfold.common.parts import Parts


def test_only_files_of_exactly_the_names_of_parts_are_parts(tmp_path):
    parts = Parts(tmp_path, "0" * 64, "mark", ".npy")
    for number in (3, 12):
        parts.path(number).touch()
    for name in ("1²", "1", "7 copy", "9" * 30, "x"):
        (tmp_path / f"{name}.npy").touch()
    assert parts.numbers() == [3, 12]
