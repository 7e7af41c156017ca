"""Texts that are read: how large, and what is refused before a library takes it apart."""

from __future__ import annotations

import pytest

from mirrorfold.common import reading
from mirrorfold.common.reading import DEEPEST, MOST_PARTS, parsed, read_text
from mirrorfold.errors import InputError


def toml(text):
    return parsed(text, "TOML", "a.toml", "correct it")


@pytest.mark.parametrize("part", ["a", '"a.b"', "'\"'", r'"\"."'])
@pytest.mark.parametrize("dot", [".", " . "])
def test_names_have_so_many_parts_at_most(part, dot):
    assert len(toml(dot.join([part] * MOST_PARTS) + " = 1\n")) == 1
    with pytest.raises(InputError, match="a name has more than 100 parts"):
        toml(dot.join([part] * (MOST_PARTS + 1)) + " = 1\n")


def test_texts_and_numbers_are_no_names():
    text = f'''a = [{", ".join(["1.5"] * 1000)}]\nb = "{". . " * 1000}"\nc = "{"mirrorfold." * 90}"\n'''
    assert len(toml(text)["a"]) == 1000


@pytest.mark.parametrize("text", ["a" * 2_000_000, '"' * 2_000_001, "a." * 90 + "=" + " " * 2_000_000, "a.=" * 700_000])
def test_long_lines_without_such_a_name_are_looked_through_once(text):
    with pytest.raises(InputError, match="is not valid TOML"):
        toml(text)


@pytest.mark.parametrize(("opening", "closing"), [("[", "]"), ('{"a": ', "}")])
@pytest.mark.parametrize("inside", ["1", "[]"])
def test_lists_and_tables_have_so_many_levels_at_most(opening, closing, inside):
    levels = DEEPEST - (inside == "[]")
    parsed(opening * levels + inside + closing * levels, "JSON", "a.json", "correct it")
    for deep in (levels + 1, 700, 950, 100_000):
        with pytest.raises(InputError, match="nested too deeply"):
            parsed(opening * deep + inside + closing * deep, "JSON", "a.json", "correct it")
    with pytest.raises(InputError, match="nested too deeply"):
        toml(f"a = {'[' * 200}{']' * 200}")


def test_a_text_without_end_is_refused(tmp_path, monkeypatch):
    (tmp_path / "a.toml").write_text("a = 1\n")
    monkeypatch.setattr(reading, "LARGEST_TEXT", 5)
    with pytest.raises(InputError, match="has 6 bytes, expected a text of at most 5; shorten it"):
        read_text(tmp_path / "a.toml", "shorten it")
