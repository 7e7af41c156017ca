"""Every argument of every public function, given as something else, is refused in one sentence, or means something.

The public names and their arguments are asked for, so that a new function has to be listed here with a valid call.
"""

from __future__ import annotations

import inspect
import re

import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf

VALUES = {
    "None": None,
    "a number": 5,
    "not a number": float("nan"),
    "a text": "nothing.of.that.name",
    "a dict": {},
    "a list": [],
    "an array": np.arange(6.0).reshape(2, 3),
    "a dataset": xr.Dataset({"a": ("b", np.arange(3.0))}),
    "an object": object(),
}

UNTRIED = {"ax", "axes", "progress", "announce", "plans", "scheduler", "workers", "open_browser", "began", "finished"}
"""Axes of matplotlib, what is called back, stores of plans, and processes."""

NO_FUNCTIONS = {"calibrate.Bad", "calibrate.ElementCalibration", "InputError", "Scene", "Scene3D"}
"""What is made by other functions; scenes list all their mistakes."""


def public():
    """All public functions by name."""
    found = {name: getattr(mf, name) for name in mf.__all__} | {
        name: getattr(module, name.split(".")[1])
        for prefix, module in (("plot", mf.plot), ("calibrate", mf.calibrate))
        for name in (f"{prefix}.{one}" for one in module.__all__)
    }
    return {name: value for name, value in found.items() if callable(value) and name not in NO_FUNCTIONS}


class Calls:
    """A valid call of each, on data as small as can be."""

    def __init__(self, folder):
        places = np.zeros((4, 3))
        places[:, 0] = 0.5e-3 * np.arange(4)
        frequency = np.linspace(290e9, 300e9, 41)
        way = 2.0 * np.linalg.norm(places - [0.05, 0.3, 0.0], axis=1)
        s = np.exp(-2j * np.pi / 299792458.0 * frequency[:, None, None] * 0.5 * (way[:, None] + way))
        antennas = {"frequency": frequency, "tx_position": places, "rx_position": places}
        beams = {"frequency": frequency, "azimuth": [-5.0, 0.0, 5.0], "elevation": [0.0, 5.0]}
        pixels = {"x": np.linspace(-0.1, 0.2, 7), "y": np.linspace(0.2, 0.4, 6)}
        self.sweep, scan = mf.make_sweep(s, **antennas), mf.make_raster_sweep(s[:, :3, :2], **beams)
        image, volume = mf.focus(self.sweep, **pixels), mf.focus(scan)
        result = mf.fold(image)
        content = {
            "name": "one wall",
            "array": {"elements": 2, "pitch": 0.5e-3},
            "band": {"start": 290e9, "stop": 300e9, "points": 3},
            "surface": [{"name": "wall", "kind": "segment", "start": [-0.01, 0.2], "end": [0.01, 0.2]}],
        }
        scene = mf.parse_scene(content)
        elements = mf.calibrate.estimate_elements(self.sweep, at=(0.05, 0.3))
        noisy = mf.add_noise(self.sweep, snr_db=3.0, seed=0)
        files = {"sweep.nc": self.sweep, "scene.toml": scene}
        self.paths = {name: mf.save(value, folder / name) for name, value in files.items()}
        self.paths["elements.json"] = mf.calibrate.save_elements(elements, folder / "elements.json")
        np.savez(folder / "image.npz", image=image.values, **pixels)
        (folder / "plan.geojson").write_text('{"type": "LineString", "coordinates": [[0, 1], [1, 1]]}')
        sweep, reconstruction = {"sweep": self.sweep}, {"reconstruction": result}
        pair = {"first": result, "second": result}
        self.valid = {
            "load": {"path": self.paths["sweep.nc"]},
            "save": {"obj": image, "path": folder / "out.nc"},
            "import_data": {"files": self.paths["sweep.nc"]},
            "import_image": {"path": folder / "image.npz"},
            "save_touchstone": {**sweep, "folder": folder / "touchstone"},
            "load_scene": {"path": self.paths["scene.toml"]},
            "parse_scene": {"content": content},
            "simulate": {"scene": scene},
            "near_field": {"scene": scene, "frequency": 10e9, "grid": ([0.0], [0.1])},
            "make_sweep": {"s": s, **antennas},
            "make_monostatic_sweep": {"s": s[:, 0], "frequency": frequency, "antenna_position": places},
            "make_raster_sweep": {"s": s[:, :3, :2], **beams},
            "check_sweep": sweep,
            "join_polarizations": {"sweeps": {"TE": self.sweep, "TM": self.sweep.assign(s=-self.sweep["s"])}},
            "add_noise": {**sweep, "snr_db": 3.0, "seed": 0},
            "plan": {"band": (290e9, 300e9), "points": 101, "aperture": 0.01, "pitch": 5e-4, "range": 1.0},
            "info": {"obj": self.sweep},
            "focus": {**sweep, **pixels},
            "FocusOperator": {**sweep, **pixels},
            "FocusPlan": {**sweep, **pixels},
            "plan_view": {"volume": volume},
            "to_voxels": {"volume": volume, **pixels, "z": [0.0, 0.01]},
            "fold": {"image": image},
            "FoldPlan": {"image": image},
            "reconstruct": {**sweep, **pixels},
            "pick_frame": {"obj": self.sweep},
            "score": {**reconstruction, "scene": scene},
            "benchmark": {"families": "none"},
            "reproduce": {"names": "none", "output": folder / "out"},
            "compare": pair,
            "export": {"obj": result, "path": folder / "out.ply"},
            "report": {**reconstruction, "path": folder / "out.html"},
            "view": {"path": folder / "absent.nc"},
            "plot.before_after": reconstruction,
            "plot.benchmark": {"found": None},
            "plot.benchmark_comparison": {"found": None},
            "plot.channel_map": sweep,
            "plot.compare": pair,
            "plot.content_extent": {**reconstruction, "folded": True},
            "plot.corrected": reconstruction,
            "plot.frames": reconstruction,
            "plot.image": {"image": image},
            "plot.mirrors": reconstruction,
            "plot.plan": {"plan": folder / "plan.geojson"},
            "plot.range_profile": sweep,
            "plot.scene": {"scene": scene},
            "plot.score": {"score": mf.score(result, scene)},
            "plot.shadows": reconstruction,
            "plot.sweep": sweep,
            "plot.tree": reconstruction,
            "calibrate.apply_elements": {**sweep, "calibration": elements},
            "calibrate.autofocus": {**sweep, **pixels, "guides": 2},
            "calibrate.conjugate": sweep,
            "calibrate.displace_receivers": {**sweep, "displacement": (0.0, 0.001)},
            "calibrate.estimate_displacement": {**sweep, "at": (0.05, 0.3)},
            "calibrate.estimate_elements": {**sweep, "at": (0.05, 0.3)},
            "calibrate.find_bad": sweep,
            "calibrate.load_elements": {"path": self.paths["elements.json"]},
            "calibrate.mask_bad": sweep,
            "calibrate.normalise_by_reference": {**sweep, "reference": self.sweep, "at": (0.05, 0.3)},
            "calibrate.remove_cable": {**sweep, "length": 0.1},
            "calibrate.reverse_frequency": sweep,
            "calibrate.save_elements": {"calibration": elements, "path": folder / "saved.json"},
            "calibrate.scale_angles": {"sweep": scan, "unit": "degree"},
            "calibrate.scale_frequencies": {**sweep, "unit": "Hz"},
            "calibrate.scale_positions": {**sweep, "unit": "m"},
            "calibrate.sort_frequencies": sweep,
            "calibrate.subtract_background": {**sweep, "background": noisy},
            "calibrate.subtract_mean": {"sweep": noisy},
            "calibrate.swap_axes": {**sweep, "axes": ("tx", "rx")},
            "calibrate.swap_iq": sweep,
            "calibrate.swap_tx_rx": sweep,
            "calibrate.time_gate": {**sweep, "start": 0.1},
        }


@pytest.fixture(scope="module")
def calls(tmp_path_factory):
    return Calls(tmp_path_factory.mktemp("valid"))


def test_every_public_function_is_tried(calls):
    assert set(calls.valid) == set(public())


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", public())
def test_an_argument_of_another_kind_is_refused_in_one_sentence(name, calls, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    function = public()[name]
    wrong = []
    for argument, parameter in inspect.signature(function).parameters.items():
        if argument in UNTRIED or parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
            continue
        for kind, value in VALUES.items():
            if value is None and parameter.default is None:
                continue
            try:
                function(**calls.valid[name] | {argument: value})
            except mf.InputError as error:
                if re.search(r"\n|array\(|0x|<xarray", str(error)):
                    wrong.append(f"{argument} = {kind}: {str(error)[:200]}")
            except Exception as error:
                wrong.append(f"{argument} = {kind}: {type(error).__name__}: {str(error)[:200]}")
    assert not wrong, "\n".join(wrong)
