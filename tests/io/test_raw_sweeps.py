"""Raw files of sweeps given to verbs that take sweeps or images: they point to the import."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from mirrorfold.cli import main


@pytest.fixture
def raw(measured, tmp_path, monkeypatch):
    """Samples and what belongs to them in a file of each kind, here."""
    monkeypatch.chdir(tmp_path)
    f, tx, rx, s = measured
    content = {"S": s, "f": f, "tx": tx, "rx": rx}
    np.savez("raw.npz", **content)
    savemat("raw.mat", content)
    with h5py.File("raw.h5", "w") as file:
        for name, values in content.items():
            file[name] = values
    rows = [f"{f[n] / 1e9},{i},{k},{s[n, i, k].real},{s[n, i, k].imag}" for n, i, k in np.ndindex(3, 5, 7)]
    (tmp_path / "raw.csv").write_text("\n".join(["freq_GHz,tx,rx,re,im", *rows]))


@pytest.mark.parametrize("verb", [["info"], ["reconstruct", "-o", "d"], ["fold", "-o", "r.nc"]])
@pytest.mark.parametrize("name", ["raw.npz", "raw.mat", "raw.h5", "raw.csv"])
def test_a_raw_sweep_points_to_the_import(raw, verb, name, capsys):
    assert main([verb[0], name, *verb[1:]]) == 2
    said = capsys.readouterr().err
    assert f"`mirrorfold import --guess {name}` proposes how to read it" in said
    assert "phony_dims" not in said
    assert "--z" not in said


def test_an_image_without_coordinates_still_asks_for_them(tmp_path, capsys):
    np.savez(tmp_path / "a.npz", image=np.ones((5, 6)))
    assert main(["fold", str(tmp_path / "a.npz"), "-o", str(tmp_path / "r.nc")]) == 2
    assert "does not say the y of the pixels of 'image' (5, 6)" in capsys.readouterr().err
