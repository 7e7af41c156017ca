"""Limits on what expands in memory when an HDF5 file is read: texts and rows of variable length, many of which may
share the same bytes, and compressed blocks, which are expanded as a whole, however little of them an array holds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import h5py
import numpy as np

from mirrorfold.io.readers.contents import HARMLESS_BYTES, LARGEST_EXPANSION, nbytes

OBJECT_BYTES = 64
"""Memory that a text or a row takes in addition to its content [bytes]."""


class RefusedError(Exception):
    """A file must not be read; the message says why."""


class Budget:
    """The memory that all texts and rows of variable length in a file may take.

    None of them is longer than the file. Only so many are read at once that they fit even if all are as long.

    Parameters
    ----------
    size : int [bytes]
        Size of the file.
    """

    def __init__(self, size: int) -> None:
        self.limit = max(HARMLESS_BYTES, LARGEST_EXPANSION * size)
        self.taken = 0
        self._at_once = int(self.limit // max(size, 1))

    def attribute(self, attrs: h5py.AttributeManager, name: str) -> Any:
        """The value of an attribute.

        Raises
        ------
        RefusedError
            If it is a long list of texts, or takes too much memory together with what was read before.
        """
        described = attrs.get_id(name)
        varying = varies(described.dtype)
        if varying and math.prod(described.shape or ()) > self._at_once:
            raise RefusedError(f"its attribute {name!r} is a list of {math.prod(described.shape)} texts; shorten it")
        value = attrs[name]
        if varying:
            self._add(value, f"attribute {name!r}")
        return value

    def check_block(self, name: str, dataset: h5py.Dataset) -> None:
        """Refuse an array whose blocks are too large for a file of this size.

        Raises
        ------
        RefusedError
            If so; the message tells the size of a block.
        """
        size = nbytes(dataset.chunks or (), dataset.dtype.itemsize)
        if size > self.limit:
            raise RefusedError(
                f"its variable {name!r} is stored in blocks of {size:.3g} bytes, more than {self.limit:.3g}, which no "
                "measurement needs; store it in smaller blocks"
            )

    def read(self, name: str, dataset: h5py.Dataset) -> None:
        """Read an array of texts or rows, to see how much memory it takes.

        Raises
        ------
        RefusedError
            If it takes too much memory together with what was read before.
        """
        for block in _blocks(dataset.shape, self._at_once):
            self._add(dataset[block], f"variable {name!r}")

    def _add(self, value: Any, what: str) -> None:
        """Count the memory of a value, and refuse the file where the sum exceeds the limit."""
        self.taken += _weight(value)
        if self.taken > self.limit:
            raise RefusedError(
                f"its {what} would expand to more than {self.limit:.3g} bytes, which no measurement does; the file is "
                "damaged or made to fill the memory"
            )


def varies(dtype: np.dtype) -> bool:
    """Whether values of a type have a variable length.

    Raises
    ------
    RefusedError
        If such values are parts of records or of other rows, which no measurement needs.
    """
    text, row = h5py.check_string_dtype(dtype), h5py.check_vlen_dtype(dtype)
    if text is not None:
        return text.length is None
    inner = [dtype[name] for name in dtype.names or ()]
    inner += [] if row is None else [row]
    inner += [] if dtype.subdtype is None else [dtype.subdtype[0]]
    if any(map(varies, inner)):
        raise RefusedError("it holds records or rows of texts; write the texts as an array of their own")
    return row is not None


def _blocks(shape: tuple[int, ...], at_once: int) -> Iterator[tuple[Any, ...]]:
    """Slices that together cover an array, with at most `at_once` values each."""
    if not shape:
        yield ()
        return
    for leading in np.ndindex(shape[:-1]):
        for start in range(0, shape[-1], at_once):
            yield (*leading, slice(start, start + at_once))


def _weight(value: Any) -> int:
    """Memory that a value takes [bytes]."""
    if isinstance(value, np.ndarray):
        return value.nbytes + (sum(map(_weight, value.flat)) if value.dtype.hasobject else 0)
    return OBJECT_BYTES + (len(value) if isinstance(value, bytes | str) else 0)
