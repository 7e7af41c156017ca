"""MATLAB files whose variables would take far more memory than the file are refused before these are made."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from reading import refused

from mirrorfold.errors import InputError
from mirrorfold.io.readers import read_contents

HEAD = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"

CELL, STRUCT, TEXT, DOUBLE, COMPLEX_DOUBLE = 1, 2, 4, 6, 6 | 0x0800
U1, I4 = 2, 5
"""Types in which values are stored."""


def element(kind, body):
    return struct.pack("<II", kind, len(body)) + body + bytes(-len(body) % 8)


def array(name, flags, count, body):
    shape = element(I4, struct.pack("<2i", 1, count))
    return element(14, element(6, struct.pack("<II", flags, 0)) + shape + element(1, name) + body)


def save(path, content):
    packed = zlib.compress(content, 9)
    path.write_bytes(HEAD + struct.pack("<II", 15, len(packed)) + packed)
    return path


NUMBER = array(b"", DOUBLE, 1, element(U1, b"1"))


def test_a_long_name_counts_for_each_element_of_a_cell(tmp_path):
    cell = array(b"A" * 1_000_000, CELL, 5000, NUMBER * 5000)
    with pytest.raises(InputError, match="the names and values of its variables would expand"):
        read_contents(save(tmp_path / "a.mat", cell))


def test_a_long_field_counts_for_each_element_of_a_structure(tmp_path):
    fields = element(I4, struct.pack("<i", 500_000)) + element(1, b"f" * 500_000)
    with pytest.raises(InputError, match="the names and values of its variables would expand"):
        read_contents(save(tmp_path / "a.mat", array(b"s", STRUCT, 5000, fields + NUMBER * 5000)))


def test_values_count_with_the_size_that_they_take_in_memory(tmp_path):
    """MATLAB stores doubles that are small integers in a byte each."""
    values = array(b"s", COMPLEX_DOUBLE, 8_000_000, element(U1, bytes(8_000_000)) * 2)
    refused(save(tmp_path / "a.mat", values), "expand")
    few = array(b"s", COMPLEX_DOUBLE, 3, element(U1, bytes([1, 2, 3])) * 2)
    np.testing.assert_array_equal(read_contents(save(tmp_path / "b.mat", few)).array("s"), [[1 + 1j, 2 + 2j, 3 + 3j]])


def test_only_the_beginning_of_a_very_long_text_is_kept(tmp_path):
    text = array(b"note", TEXT, 30_000_000, element(U1, b"a" * 30_000_000))
    assert len(str(read_contents(save(tmp_path / "a.mat", text + NUMBER)).array("note"))) == 1 << 20
