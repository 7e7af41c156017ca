"""One moving antenna: its steps count on both ways, so that echoes from the side have grating lobes on the other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.diagnosis import diagnose


def moved_past_posts(places, posts, *, nearest=0.9, seed=0):
    """A right sweep of posts about 30 degrees aside, measured at 77-81 GHz in steps of 1.8 mm, with noise."""
    random = np.random.default_rng(seed)
    frequency = np.linspace(77e9, 81e9, 161)
    place = np.outer(1.8e-3 * (np.arange(places) - (places - 1) / 2), [1.0, 0.0, 0.0])
    distance, sine = random.uniform(nearest, 2.7, posts), random.uniform(0.4, 0.6) + random.uniform(-0.01, 0.01, posts)
    post = distance[:, None] * np.stack([sine, np.sqrt(1.0 - sine**2), 0.0 * sine], axis=1)
    path = 2.0 * np.linalg.norm(place[:, None] - post, axis=2)
    s = np.exp(-2j * np.pi / speed_of_light * frequency[:, None, None] * path).sum(axis=2)
    sweep = mf.make_monostatic_sweep(s, frequency=frequency, antenna_position=place)
    return mf.add_noise(sweep, snr_db=20.0, seed=seed)


@pytest.mark.parametrize("posts", [2, 4])
@pytest.mark.parametrize("places", [45, 90])
def test_echoes_with_grating_lobes_do_not_feign_a_reversed_order_of_frequencies(places, posts):
    for seed in range(10):
        assert diagnose(moved_past_posts(places, posts, seed=seed))[0] == []


def test_the_curvature_of_waves_tells_a_reversed_order_where_a_path_is_long_enough():
    for seed in range(4):
        sweep = mf.calibrate.reverse_frequency(moved_past_posts(120, 12, nearest=0.7, seed=seed))
        assert [one.name for one in diagnose(sweep)[0]] == ["frequency-reversed"]
