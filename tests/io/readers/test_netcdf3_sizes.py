"""Files of classic netCDF whose variables share the same bytes are refused."""

from __future__ import annotations

import struct

import numpy as np
from reading import refused

from mirrorfold.io.readers import read_contents

VALUES, DOUBLE = 100_000, 6
DIMENSIONS, VARIABLES = 10, 11
"""Tags of the lists in the header."""


def integers(*values):
    return struct.pack(f">{len(values)}i", *values)


def variable(number, begin):
    name = integers(5) + f"v{number:04}".encode() + bytes(3)
    return name + integers(1, 0, 0, 0, DOUBLE, 8 * VALUES, begin)


def save(path, count):
    """A file with `count` variables, all of which begin at the same byte."""
    head = b"CDF\x01" + integers(0, DIMENSIONS, 1, 1) + b"x\0\0\0" + integers(VALUES, 0, 0, VARIABLES, count)
    begin = len(head) + count * len(variable(0, 0))
    body = b"".join(variable(number, begin) for number in range(count))
    path.write_bytes(head + body + np.arange(VALUES, dtype=">f8").tobytes())
    return path


def test_variables_that_share_the_same_bytes_are_refused(tmp_path):
    refused(save(tmp_path / "a.nc", 100), "its variables share the same bytes")


def test_a_variable_of_its_own_is_read(tmp_path):
    values = read_contents(save(tmp_path / "a.nc", 1)).array("v0000")
    np.testing.assert_array_equal(values, np.arange(VALUES))
