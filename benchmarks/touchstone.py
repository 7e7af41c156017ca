"""A scan of 81 x 81 positions as 6 561 Touchstone files: written, imported, and part of it read by scikit-rf."""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

import mirrorfold as mf

ELEMENTS, POINTS = 81, 401
PEER_FILES = 200


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    warnings.simplefilter("ignore")
    rng = np.random.default_rng(0)
    place = np.zeros((2, ELEMENTS, 3))
    place[:, :, 0] = 0.5e-3 * np.arange(ELEMENTS) + np.array([[0.0], [0.06]])
    s = rng.standard_normal((POINTS, ELEMENTS, ELEMENTS, 2), dtype=np.float32).view(np.complex64)[..., 0]
    frequency = np.linspace(270e9, 300e9, POINTS)
    sweep = mf.make_sweep(s, frequency=frequency, tx_position=place[0], rx_position=place[1])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "scan"
        start = time.process_time()
        positions = mf.save_touchstone(sweep, folder)
        wrote = time.process_time() - start
        start = time.process_time()
        back = mf.import_data(folder, positions=positions)
        read = time.process_time() - start
        files = sorted(folder.glob("*.s2p"))
        from skrf import Network

        from mirrorfold.io.readers.touchstone import read_spectra

        own, peer = 0.0, 0.0
        Network(str(files[0]))
        for path in files[:: len(files) // PEER_FILES]:
            start = time.process_time()
            found = read_spectra(path)
            own += time.process_time() - start
            start = time.process_time()
            network = Network(str(path))
            peer += time.process_time() - start
            assert np.allclose(network.s[:, 1, 0], found.parameters["S21"])
        size = sum(path.stat().st_size for path in files)
    print(f"{len(files)} files, {POINTS} points, {size / 1e6:.0f} MB, CPU time of one core")
    print(f"written           {wrote:6.2f} s")
    print(f"imported          {read:6.2f} s, largest deviation {np.abs(back['s'] - sweep['s']).max().item():.1g}")
    print(f"scikit-rf takes   {peer / own:6.1f} times as long for the same files")


if __name__ == "__main__":
    main()
