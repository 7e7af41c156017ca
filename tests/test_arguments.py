"""Arguments of the wrong kind get one sentence, which never prints an array; scenes are built from dicts too."""

from __future__ import annotations

import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.common.arguments import described, in_message
from mirrorfold.plotting import volumes

GRID = {"x": np.linspace(-1, 1, 3), "y": np.linspace(0.5, 1, 3)}

CALLS = {
    "load": mf.load,
    "save": lambda value: mf.save(value, "absent/out.nc"),
    "import_data": mf.import_data,
    "import_image": mf.import_image,
    "save_touchstone": lambda value: mf.save_touchstone(value, "absent/out"),
    "load_scene": mf.load_scene,
    "parse_scene": mf.parse_scene,
    "simulate": mf.simulate,
    "make_sweep": lambda value: mf.make_sweep(value, frequency=[1e9], tx_position=[[0, 0, 0]], rx_position=[[0, 0, 0]]),
    "make_sweep positions": lambda value: mf.make_sweep(
        np.ones((1, 1, 1), complex), frequency=[1e9], tx_position=value, rx_position=[[0, 0, 0]]
    ),
    "check_sweep": mf.check_sweep,
    "add_noise": lambda value: mf.add_noise(value, snr_db=3, seed=1),
    "info": mf.info,
    "conjugate": mf.calibrate.conjugate,
    "focus": lambda value: mf.focus(value, **GRID),
    "FocusPlan": lambda value: mf.FocusPlan(value, **GRID),
    "FocusOperator": lambda value: mf.FocusOperator(value, **GRID),
    "tolerance": lambda value: mf.FocusPlan(None, tolerance=value),
    "plan_view": mf.plan_view,
    "to_voxels": lambda value: mf.to_voxels(value, **GRID, z=[0.0, 0.1]),
    "fold": mf.fold,
    "FoldPlan": mf.FoldPlan,
    "reconstruct": mf.reconstruct,
    "score": lambda value: mf.score(value, "absent.toml"),
    "export": lambda value: mf.export(value, "out.ply"),
    "report": lambda value: mf.report(value, "out.html"),
    "plot.image": mf.plot.image,
    "plot.mirrors": mf.plot.mirrors,
    "plot.shadows": mf.plot.shadows,
    "plot.scene": mf.plot.scene,
    "plot.corrected": mf.plot.corrected,
    "plot.before_after": mf.plot.before_after,
    "plot.tree": mf.plot.tree,
    "plot.sweep": mf.plot.sweep,
    "plot.score": mf.plot.score,
    "plot_volume.space": volumes.space,
}

VALUES = {
    "None": None,
    "a dict": {"a": np.arange(1000.0)},
    "a list": [object()],
    "an array": np.random.default_rng(0).random((3, 40, 4, 4, 2)),
    "a number": 3,
    "a path": "absent.nc",
    "an object": object(),
}


@pytest.mark.slow
@pytest.mark.parametrize("value", VALUES)
@pytest.mark.parametrize("call", CALLS)
def test_the_wrong_kind_is_one_sentence_without_its_content(call, value, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(mf.InputError) as refused:
        CALLS[call](VALUES[value])
    sentence = str(refused.value)
    assert "\n" not in sentence
    assert len(sentence) < 400
    assert "array(" not in sentence
    assert "object at 0x" not in sentence
    assert list(tmp_path.iterdir()) == []


def test_what_is_said_of_a_value(sweep):
    assert described(sweep["s"]) == (
        "an array of shape (41, 9, 9) and type complex64 with the dimensions ('frequency', 'tx', 'rx')"
    )
    assert in_message(np.arange(3)) == "an array of shape (3,) and type int64"
    assert in_message([1.0] * 100) == "a list"
    assert in_message("x") == "'x'"


def test_an_image_without_coordinates_is_told_what_it_needs():
    with pytest.raises(mf.InputError, match=r"got an array of shape \(4, 5\) and type float64, expected an image"):
        mf.fold(np.zeros((4, 5)))


def test_a_scene_is_built_from_a_dict_from_keywords_and_in_its_place():
    content = {
        "name": "one wall",
        "array": {"elements": 3, "pitch": "0.5 mm"},
        "band": {"start": "290 GHz", "stop": "300 GHz", "points": 11},
        "surface": [{"name": "wall", "kind": "segment", "start": [-0.2, 0.2], "end": [0.2, 0.2]}],
    }
    scene = mf.parse_scene(content)
    assert mf.Scene(**content) == scene
    np.testing.assert_array_equal(mf.simulate(content)["s"], mf.simulate(scene)["s"])
    with pytest.raises(
        mf.InputError, match=r"scene: got a dict, expected its entries by name, .* mf.parse_scene takes"
    ):
        mf.Scene(content)


@pytest.mark.parametrize("build", [lambda content: mf.Scene(**content), mf.parse_scene, mf.simulate])
def test_mistakes_in_a_dict_are_said_with_their_places(build):
    content = {
        "name": "one wall",
        "array": {"elements": 3, "pitch": np.zeros((30, 30))},
        "band": {"start": 290e9, "stop": 300e9, "points": 11, "step": 3},
        "surface": [{"name": "wall", "kind": "segment", "start": [-0.2, 0.2]}],
    }
    with pytest.raises(mf.InputError) as refused:
        build(content)
    sentence = str(refused.value)
    assert "array.pitch is an array of shape (30, 30) and type float64, expected a valid number" in sentence
    assert "band.step is not a known entry" in sentence
    assert "surface[0].end is missing, add it" in sentence
    assert sentence.startswith("scene: ")


def test_a_recording_is_a_sweep_with_frames():
    random = np.random.default_rng(1)
    s = random.standard_normal((4, 11, 3, 2, 2)).view(complex)[..., 0]
    places = np.array([[0.0, 0, 0], [0.5e-3, 0, 0], [1e-3, 0, 0]])
    frequency = np.linspace(290e9, 300e9, 11)
    sweep = mf.make_sweep(s, frequency=frequency, tx_position=places, rx_position=places[:2], time=[0, 0.1, 0.2, 0.3])
    assert sweep["s"].dims == ("frame", "frequency", "tx", "rx")
    assert sweep["time"].values.tolist() == [0.0, 0.1, 0.2, 0.3]
    assert sweep["time"].attrs["units"] == "s"
    np.testing.assert_array_equal(sweep["s"], s.astype(np.complex64))
    assert mf.check_sweep(sweep) is sweep
    first = mf.make_sweep(s[0], frequency=frequency, tx_position=places, rx_position=places[:2])
    np.testing.assert_array_equal(sweep.isel(frame=0)["s"], first["s"])
    for wrong, time in ((s[None], None), (s, [0.0]), (s[0], [0.0]), (s[0, 0], None)):
        with pytest.raises(mf.InputError, match=r"shapes do not fit together, s \(.*expected s\(frequency, tx, rx\)"):
            mf.make_sweep(wrong, frequency=frequency, tx_position=places, rx_position=places[:2], time=time)
    beams = mf.make_raster_sweep(s, frequency=frequency, azimuth=[-10, 0, 10], elevation=[0, 5])
    assert beams["s"].dims == ("frame", "frequency", "azimuth", "elevation")


def test_a_recording_is_saved_and_read_back(tmp_path):
    s = np.exp(1j * np.arange(2 * 11 * 9)).reshape(2, 11, 3, 3)
    places = np.array([[0.0, 0, 0], [0.5e-3, 0, 0], [1e-3, 0, 0]])
    sweep = mf.make_sweep(
        s, frequency=np.linspace(290e9, 300e9, 11), tx_position=places, rx_position=places, time=[0.0, 0.5]
    )
    mf.save(sweep, tmp_path / "s.nc")
    assert mf.load(tmp_path / "s.nc").equals(sweep)
