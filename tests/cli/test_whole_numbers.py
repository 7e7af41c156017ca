"""Options that are whole numbers: fractions are refused, not cut off."""

from __future__ import annotations

import pytest

from mirrorfold.cli import main

PLAN = ["plan", "--band", "120GHz:126GHz", "--aperture", "24mm", "--pitch", "1.2mm", "--range", "1m"]


@pytest.mark.parametrize(
    ("arguments", "option", "value"),
    [
        ([*PLAN, "--points", "20.5"], "--points", "20.5"),
        ([*PLAN, "--points", "20m"], "--points", "20m"),
        (["show", "image.nc", "-o", "a.png", "--frame", "1.9"], "--frame", "1.9"),
        (["import", "a.npz", "-o", "a.nc", "--frame", "1.9"], "--frame", "1.9"),
        (["simulate", "two-walls", "-o", "a.nc", "--bounces", "2.7"], "--bounces", "2.7"),
        (["simulate", "two-walls", "-o", "a.nc", "--seed", "18446744073709551617"], "--seed", "18446744073709551617"),
        (["fold", "image.nc", "-o", "a.nc", "--generations", "1.7"], "--generations", "1.7"),
    ],
)
def test_fractions_of_whole_numbers_are_refused(arguments, option, value, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert f"{option}: {value!r} is not valid, expected a whole number" in capsys.readouterr().err


def test_whole_numbers_may_be_written_with_an_exponent(capsys):
    printed = []
    for points in ("100", "1e2", "100.0"):
        assert main([*PLAN, "--points", points]) == 0
        printed.append(capsys.readouterr().out)
    assert printed[0] == printed[1] == printed[2]
