"""What readers say of the files that they refuse, and that these took little memory."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import pytest

from mirrorfold.errors import InputError
from mirrorfold.io.readers import read_contents

LARGE = 32 << 20
"""No refused file may make a reader allocate so many bytes."""


def refused(path: Path, *words: str) -> str:
    """The sentence with which a file is refused, having taken little memory."""
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as caught:
            contents = read_contents(path)
            for name in contents.variables:
                contents.array(name)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    sentence = str(caught.value)
    assert peak < LARGE
    assert str(path) in sentence
    assert "\n" not in sentence
    for word in words:
        assert word in sentence
    return sentence
