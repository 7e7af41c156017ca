"""A Reconstruction is folded again as its image was, without the sweep."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest
import xarray as xr
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.common.phases import PHASE_STEP
from mirrorfold.detection.finding import see
from mirrorfold.folding.earlier import KEPT, initial_image, kept_measurements
from mirrorfold.folding.frames import join_frames, pick_frame

GRID = {"x": np.arange(-1.2, 1.2, 0.005), "y": np.arange(0.2, 2.3, 0.0075)}


@pytest.fixture(scope="module")
def first():
    """The image of a hidden corner, and its Reconstruction by way of the sweep."""
    scene = mf.load_scene(files("mirrorfold") / "scenes/shipped/hidden_corner.toml")
    sweep = mf.simulate(scene)
    image = mf.focus(sweep, **GRID)
    return image, mf.fold(image, sweep=sweep)


def ends(reconstruction):
    mirrors = reconstruction["mirrors"].to_dataset(inherit=False)
    return np.column_stack([mirrors[name] for name in ("x0", "y0", "x1", "y1")])


def reasons(reconstruction):
    return set(reconstruction["objects"].to_dataset(inherit=False)["explanation"].values.tolist()) - {""}


@pytest.mark.slow
def test_mirrors_and_points_are_the_same_however_often_it_is_folded(first, tmp_path):
    """The phase of the image is kept to 0.4 degrees, and survives in a file."""
    image, once = first
    mf.save(once, tmp_path / "once.nc")
    again = mf.fold(mf.load(tmp_path / "once.nc"))
    thrice = mf.fold(again)
    assert len(ends(once)) == 2
    for other in (again, thrice):
        np.testing.assert_allclose(ends(other), ends(once), atol=5e-5)
        assert other["objects"].sizes["point"] == pytest.approx(once["objects"].sizes["point"], rel=0.01)
    kept = initial_image(once).sel(x=image.x, y=image.y, method="nearest").values
    seen = np.abs(kept) > 0.0
    turn = np.angle(kept[seen] / image.values[seen])
    assert np.abs(turn).max() <= 0.501 * PHASE_STEP + 1e-5


@pytest.mark.slow
def test_what_was_folded_without_the_sweep_is_not_taken_for_measured(first):
    image, once = first
    view = see(initial_image(once))
    assert kept_measurements(once)(view).confocal_share is not None
    assert kept_measurements(mf.fold(image))(view).confocal_share is None


@pytest.mark.slow
def test_without_mirrors_no_reason_needs_one(first):
    _, once = first
    assert reasons(once)
    unfolded = mf.fold(once, mirrors=[])
    assert reasons(unfolded) <= set(KEPT)
    drawn = unfolded["intensity"].values > 0.0  # what is doubted is not
    assert drawn.mean() > 0.9
    np.testing.assert_array_equal(unfolded["intensity"].values[drawn], unfolded["initial/initial"].values[drawn])


def test_the_height_of_the_image_is_kept(image):
    """A radar that stands 1.2 m high, and an image at that height."""
    lifted = image.assign_coords(z=1.2).assign_attrs(radar_position=[0.0, 0.0, 1.2])
    known = initial_image(mf.fold(lifted))
    assert float(known["z"]) == 1.2
    assert known.attrs["radar_position"] == [0.0, 0.0, 1.2]
    # Files of earlier versions do not tell it: the image is at the height of the radar.
    older = mf.fold(lifted)
    del older.attrs["image_z"]
    assert float(initial_image(older)["z"]) == 1.2


def test_the_picture_of_the_unfolded_scene_has_the_pixels_of_the_image(image):
    """Normalised by their distance from the radar, on a grid that may have grown."""
    reconstruction = mf.fold(image)
    initial = reconstruction["initial/initial"].sel(x=image.x, y=image.y, method="nearest")
    expected = np.abs(image) * np.hypot(image.x, image.y).transpose("y", "x")
    seen = initial.values > 0.0
    assert seen.mean() > 0.9
    np.testing.assert_allclose(initial.values[seen], expected.values[seen], rtol=1e-5)


def test_frames_keep_their_phases_if_all_have_one(reconstruction):
    shape = reconstruction["initial/initial"].shape
    phase = (("y", "x"), np.linspace(0.0, 6.0, int(np.prod(shape)), dtype=np.float32).reshape(shape))
    nodes = {node.path: node.to_dataset(inherit=False) for node in reconstruction.subtree}
    phased = xr.DataTree.from_dict(nodes | {"/initial": nodes["/initial"].assign(phase=phase)})
    joined = join_frames([phased, phased], {})
    np.testing.assert_array_equal(pick_frame(joined, 1)["initial/phase"], phase[1])
    assert "phase" not in join_frames([phased, reconstruction], {})["initial"]


@pytest.mark.slow
@pytest.mark.parametrize("height", [0.0, 0.6])
def test_an_image_below_the_antennas_is_not_tested_by_the_sweep(height):
    """In the plane of the antennas, paths to these three points have other directions."""
    places = np.array([[-0.3, 1.2, 0.0], [0.0, 1.5, 0.0], [0.4, 1.3, 0.0]])
    x = (np.arange(41) - 20) * 1e-3
    antennas = np.column_stack([x, np.zeros(41), np.full(41, height)])
    frequency = np.linspace(290e9, 300e9, 201)
    k = 2.0 * np.pi * frequency / speed_of_light
    way = np.linalg.norm(antennas[:, None] - places, axis=2)
    s = sum(np.exp(-1j * k[:, None, None] * (d[:, None] + d)) for d in way.T)
    sweep = mf.make_sweep(s, frequency=frequency, tx_position=antennas, rx_position=antennas)
    image = mf.focus(sweep, x=np.arange(-0.6, 0.7, 0.005), y=np.arange(0.9, 1.8, 0.005), z=0.0)
    folded = mf.fold(image, sweep=sweep)
    assert reasons(folded) == set()
    assert ("0.6 m off the plane of the antennas: echoes are not tested" in folded.attrs["remark"]) == (height > 0.0)
