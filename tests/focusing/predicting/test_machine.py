"""The speed of the machine, measured once; and what is predicted with it."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from mirrorfold.focusing.fast import factorized
from mirrorfold.focusing.predicting import cost, machine


def counted_machine():
    """A machine that takes 1 s for the first thing that is timed, 2 s for the next, and so on."""
    return machine.Machine(*np.arange(1.0, 1.0 + len(fields(machine.Machine))))


def test_the_machine_is_measured_once_and_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    measured = []

    def measure():
        measured.append(1)
        return counted_machine()

    monkeypatch.setattr(machine, "measure", measure)
    monkeypatch.setattr(machine, "machine", machine.machine.__wrapped__)
    first = machine.machine()
    assert machine.machine() == first
    assert len(measured) == 1
    (tmp_path / "mirrorfold" / "machine.json").write_text("{broken")
    assert machine.machine() == first
    assert len(measured) == 2


def test_a_measurement_holds_for_the_number_of_cores_that_were_timed_at_once(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    measured = []
    for cores in (2, 2, 64):
        monkeypatch.setattr(machine, "cpu_count", lambda cores=cores: cores)
        monkeypatch.setattr(machine, "measure", lambda cores=cores: measured.append(cores) or counted_machine())
        machine.machine.__wrapped__()
    assert measured == [2, 64]


def test_a_home_that_cannot_be_written_does_no_harm(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    monkeypatch.setattr(machine, "measure", counted_machine)
    assert machine.machine.__wrapped__().pair_pixel == 1.0
    assert Path(blocked).read_text() == "no folder"


@pytest.mark.slow
@pytest.mark.timing
def test_costs_are_predicted(monkeypatch):
    """Of a dozen random geometries most are predicted within 40 %; `benchmarks/cost_model.py` prints sixty."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[3] / "benchmarks"))
    for module in (cost, factorized):
        monkeypatch.setattr(module, "machine", machine.machine)  # what the benchmark sets is put back
    from cost_model import WITHIN, compare

    ratio = np.array([row["ratio"] for row in compare(12)])
    assert np.mean((ratio > 1.0 - WITHIN) & (ratio < 1.0 / (1.0 - WITHIN))) >= 0.7
    assert 0.6 < np.median(ratio) < 1.6
