"""Classic mistakes are put into sweeps and must be named, with the command that undoes them; good ones stay silent."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.diagnosis import diagnose
from mirrorfold.diagnosis.direct import direct_findings
from mirrorfold.sweep.pairs import on_a_line, pairs_of

MISTAKES = {
    "none": (),
    "conjugated": ("conjugated",),
    "I and Q": ("conjugated",),
    "reversed": ("frequency-reversed",),
    "exchanged": ("tx-rx-exchanged",),
    "millimetres": ("position-unit",),
    "cable": ("range-offset",),
}


def wrong(sweep, mistake):
    """The sweep with a mistake."""
    if mistake == "millimetres":
        return sweep.assign_coords({f"{a}_position": 1e3 * sweep[f"{a}_position"] for a in ("tx", "rx")})
    if mistake == "cable":
        return mf.calibrate.remove_cable(sweep, -1.7)
    return {
        "none": lambda s: s,
        "conjugated": mf.calibrate.conjugate,
        "I and Q": mf.calibrate.swap_iq,
        "reversed": mf.calibrate.reverse_frequency,
        "exchanged": mf.calibrate.swap_tx_rx,
    }[mistake](sweep)


def waves(frequency, path):
    """``exp(-j k path)`` at one of the equal steps of frequency after the other, each from the one before."""
    k = 2 * np.pi * frequency / speed_of_light
    wave, turn = (np.exp(-1j * step * path) for step in (k[0], (k[-1] - k[0]) / (k.size - 1)))
    for _ in k:
        yield wave
        wave = wave * turn


def scene(seed, *, displaced, turned=0.0, elements=61, snr_db=20.0):
    """Scatterers along random walls, seen by arrays in any direction."""
    random = np.random.default_rng(seed)
    frequency = np.linspace(290e9, 300e9, 301)
    along = 0.5e-3 * (np.arange(elements) - (elements - 1) / 2)
    axis = np.array([np.cos(turned), np.sin(turned), 0.0])
    ahead = np.array([-np.sin(turned), np.cos(turned), 0.0])
    shift = 0.05 if displaced else 0.0
    tx, rx = (along - shift)[:, None] * axis, (along + shift)[:, None] * axis
    start, end = random.uniform([-0.8, 0.6], [0.8, 2.2], (2, 4, 2))
    place = (start + (end - start) * random.uniform(0, 1, (60, 4, 1))).reshape(-1, 2)
    place = place[:, :1] * axis + place[:, 1:] * ahead
    echo = random.standard_normal((2, len(place))).view(float)
    echo = echo[0] + 1j * echo[1]
    s = np.empty((frequency.size, elements, elements), dtype=np.complex64)
    to_tx, to_rx = (np.linalg.norm(place[:, None] - antennas, axis=2) for antennas in (tx, rx))
    for m, (there, back) in enumerate(zip(waves(frequency, to_tx), waves(frequency, to_rx), strict=True)):
        s[m] = (echo[:, None] * there).T @ back
    sweep = mf.make_sweep(s, frequency=frequency, tx_position=tx, rx_position=rx)
    return mf.add_noise(sweep, snr_db=snr_db, seed=seed)


def named(sweep):
    return tuple(sorted(finding.name for finding in diagnose(sweep)[0]))


DISPLACED_OR_NOT = [(seed, mistake) for seed in range(2) for mistake in MISTAKES if (seed, mistake) != (1, "exchanged")]
"""Of seed 1 transmitters and receivers stand at the same places, and can be exchanged."""


@lru_cache(1)
def one_of_them(seed):
    return scene(seed, displaced=seed % 2 == 0, turned=0.4 * seed, elements=61 if seed % 2 == 0 else 121)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "mistake"), [*DISPLACED_OR_NOT, (2, "none"), (3, "none"), (2, "cable"), (3, "cable")])
def test_each_mistake_is_named_and_good_sweeps_are_not_blamed(seed, mistake):
    assert named(wrong(one_of_them(seed), mistake)) == MISTAKES[mistake]


@pytest.mark.slow
@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_in_a_full_wave_sweep(shared_data, mistake):
    whole = mf.load(shared_data / "two_walls_fullwave.nc")
    sweep = whole.isel(tx=slice(0, 70), rx=slice(91, 161)) if mistake == "exchanged" else whole.isel(
        tx=slice(20, 141), rx=slice(20, 141)
    )  # fmt: skip
    assert named(wrong(sweep, mistake)) == MISTAKES[mistake]


@pytest.mark.parametrize(("name", "elements", "pitch", "seed"), [
    ("two_walls", 21, 2e-3, 0),
    ("two_walls", 31, 1e-3, 0),
    ("hidden_corner", 21, 2e-3, 1),
])  # fmt: skip
def test_coarse_arrays_with_echoes_up_to_the_ambiguous_range_are_not_accused(name, elements, pitch, seed):
    scene = mf.load_scene(f"src/mirrorfold/scenes/shipped/{name}.toml")
    array = replace(scene.array, elements=elements, pitch=pitch)
    sweep = mf.simulate(replace(scene, array=array, band=replace(scene.band, points=101)), seed=seed)
    found, judged = diagnose(sweep)
    assert (found, judged["waves"]) == ([], False)


@pytest.mark.slow
def test_the_command_that_is_proposed_puts_it_right(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    clean = scene(2, displaced=True)
    for mistake in ("conjugated", "cable"):
        mf.save(wrong(clean, mistake), "sweep.nc")
        found = mf.info("sweep.nc")["findings"]
        assert [finding["name"] for finding in found] == list(MISTAKES[mistake])
        assert 0.6 <= found[0]["sure"] <= 1.0
        program, *arguments = found[0]["fix"].split()
        assert program == "mirrorfold"
        assert main(arguments) == 0
        repaired = mf.load("sweep-repaired.nc")
        assert named(repaired) == ()
        assert len(repaired.attrs["processing"]) >= 1
        # The repair leaves the phase to within the length of cable that curvature can tell.
        spectrum, ideal = (np.abs(np.fft.ifft(one["s"].values[:, 5, 7])) for one in (repaired, clean))
        assert abs(int(np.argmax(np.correlate(spectrum, ideal, "full"))) - 300) <= (0 if mistake == "conjugated" else 4)


@pytest.mark.slow
def test_a_range_offset_is_measured():
    found, _ = diagnose(wrong(scene(0, displaced=True), "cable"))
    assert float(found[0].remedy.split()[-1]) == pytest.approx(1.7, abs=0.1)


@pytest.mark.slow
def test_a_range_offset_of_a_small_instrument_is_told_as_exactly_as_its_waves_allow():
    """Waves and lengths 20 times as small, as of sound in a tank, make the same samples; a cable of light stays."""
    large = wrong(scene(0, displaced=True), "cable")
    small = large.assign_coords({name: large[name] / 20.0 for name in ("tx_position", "rx_position")})
    found = mf.info(small.assign_attrs(wave_speed=speed_of_light / 20.0)).findings[0]
    offset, error = (float(word) for word in re.findall(r"[0-9.]+", found.what)[:2])
    assert offset == pytest.approx(0.85 / 20.0, abs=max(error, 1e-3))
    assert 1e-4 < error < 3e-3
    assert float(found.fix.split()[-1]) == pytest.approx(1.7, abs=0.1)


@pytest.fixture(scope="module")
def with_a_dead_channel():
    """A conjugated sweep with a dead transmitter, and how sure its diagnosis is of what, by name."""
    sweep = wrong(scene(2, displaced=True), "conjugated")
    sweep["s"].values[:, 3] = 0.0
    return sweep, {one.name: one.sure for one in diagnose(sweep)[0]}


@pytest.mark.slow
@pytest.mark.parametrize("level", [1e-30, 1e-22, 1e22, 1e30])
def test_the_level_of_the_samples_does_not_matter(with_a_dead_channel, level):
    sweep, usual = with_a_dead_channel
    scaled = sweep.assign(s=(sweep["s"].astype(complex) * level).astype(np.complex64))
    found = {one.name: one.sure for one in diagnose(scaled)[0]}
    assert found == {name: pytest.approx(sure, abs=0.03) for name, sure in usual.items()}
    assert set(found) == {"conjugated", "dead-channels"}
    assert mf.calibrate.find_bad(scaled).dead.sum() == sweep.sizes["rx"]


def faces(seed, elements):
    """Echoes of flat mirrors alone, each the image of the transmitter, seen by one short array."""
    random = np.random.default_rng(seed)
    frequency = np.linspace(290e9, 300e9, 301)
    place = np.zeros((elements, 3))
    place[:, 0] = 0.5e-3 * (np.arange(elements) - (elements - 1) / 2)
    s = np.zeros((frequency.size, elements, elements), dtype=complex)
    for distance, angle in zip(random.uniform(0.6, 2.5, 40), np.radians(random.uniform(-50, 50, 40)), strict=True):
        ahead = np.array([np.sin(angle), np.cos(angle), 0.0])
        image = place + 2.0 * (distance - place @ ahead)[:, None] * ahead
        for one, wave in zip(s, waves(frequency, np.linalg.norm(image[:, None] - place, axis=2)), strict=True):
            one += wave
    return mf.make_sweep(s.astype(np.complex64), frequency=frequency, tx_position=place, rx_position=place)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_flat_faces_are_not_taken_for_a_wrong_delay(seed):
    """For points, they would stand at twice their distance."""
    clean = faces(seed, 71)
    assert named(mf.add_noise(clean, snr_db=20.0, seed=seed)) == ()
    found, _ = diagnose(mf.add_noise(mf.calibrate.remove_cable(clean, -1.4), snr_db=20.0, seed=seed))
    assert [finding.name for finding in found] == ["range-offset"]
    assert float(found[0].remedy.split()[-1]) == pytest.approx(1.4, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(("first", "cable"), [(0, 1.0), (45, 2.2), (90, 4.4)])
def test_cables_show_in_three_and_a_half_centimetres_of_a_full_wave_sweep(shared_data, first, cable):
    part = slice(first, first + 71)
    sweep = mf.load(shared_data / "two_walls_fullwave.nc").isel(tx=part, rx=part)
    assert named(sweep) == ()
    found, _ = diagnose(mf.calibrate.remove_cable(sweep, -cable))
    assert [finding.name for finding in found] == ["range-offset"]
    assert float(found[0].remedy.split()[-1]) == pytest.approx(cable, abs=0.4)


@pytest.mark.slow
@pytest.mark.parametrize("step", [3, 5, 6])
def test_echoes_from_beyond_the_ambiguous_range_are_no_cable(shared_data, step):
    """Of the frequencies of a full-wave sweep few are kept: 1 to 2 m are unambiguous, and the scene is larger."""
    sweep = mf.load(shared_data / "two_walls_fullwave.nc")
    sweep = sweep.isel(frequency=slice(None, None, step), tx=slice(None, None, 2), rx=slice(None, None, 2))
    assert named(sweep) == ()
    if step == 3:
        found, _ = diagnose(mf.calibrate.remove_cable(sweep, -1.4))
        assert [finding.name for finding in found] == ["range-offset"]
        assert float(found[0].remedy.split()[-1]) == pytest.approx(1.4, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("size", [11, 31, 41])
def test_arrays_too_short_to_tell_distances_are_not_blamed(shared_data, size):
    whole = mf.load(shared_data / "two_walls_fullwave.nc")
    for first in (0, 60, 120):
        part = slice(first, first + size)
        assert named(mf.add_noise(whole.isel(tx=part, rx=part), snr_db=20.0, seed=first)) == ()


@pytest.mark.slow
def test_exchanged_antennas_at_the_same_places_do_not_matter_and_are_not_judged():
    sweep = scene(1, displaced=False, elements=41)
    assert diagnose(sweep)[1]["exchange"] is False
    assert diagnose(scene(0, displaced=True, elements=41))[1]["exchange"] is True


def ring(seed, *, direct):
    """Antennas around a few scatterers, which hear each other too, or only the scatterers."""
    random = np.random.default_rng(seed)
    frequency, turn = np.linspace(1.5e9, 6e9, 101), 2 * np.pi * np.arange(20) / 20
    place = np.stack([0.2 * np.cos(turn), 0.2 * np.sin(turn), np.zeros(20)], axis=1)
    inside = np.append(random.uniform(-0.1, 0.1, (4, 2)), np.zeros((4, 1)), axis=1)
    k = 2 * np.pi / speed_of_light * frequency[:, None, None]
    way = np.linalg.norm(place[:, None] - inside, axis=2)
    apart = np.linalg.norm(place[:, None] - place, axis=2)
    s = sum(0.1 * np.exp(-1j * k * (way[:, None, n] + way[None, :, n])) for n in range(4))
    s = s + direct * (apart > 0) * np.exp(-1j * k * (apart + 0.1))
    sweep = mf.make_sweep(s.astype(np.complex64), frequency=frequency, tx_position=place, rx_position=place)
    return mf.add_noise(sweep, snr_db=20.0, seed=seed)


@pytest.mark.parametrize("seed", range(4))
def test_direct_waves_tell_which_way_time_runs(seed):
    for direct in (False, True):
        pairs = pairs_of(ring(seed, direct=direct))
        assert direct_findings(pairs) == []
        backwards = direct_findings(replace(pairs, s=pairs.s.conj()))
        assert [finding.name for finding in backwards] == (["range-reversed"] if direct else [])


def flight(seed, degrees):
    """Point echoes seen by an antenna that flies along an arc, its delays counted from the middle of the scene."""
    random = np.random.default_rng(seed)
    frequency, angle = np.linspace(9.3e9, 9.9e9, 160), np.radians(degrees) * np.linspace(-0.5, 0.5, 90)
    place = 4000.0 * np.stack([np.sin(angle), -np.cos(angle), np.full(90, 0.5)], axis=1)
    points = np.append(random.uniform(-13, 13, (30, 2)), np.zeros((30, 1)), axis=1)
    path = 2.0 * np.linalg.norm(place[:, None] - points, axis=2)
    k = 2 * np.pi / speed_of_light * frequency
    s = sum(random.exponential() * np.exp(-1j * np.multiply.outer(k, path[:, n])) for n in range(30))
    s = s + random.standard_normal((*s.shape, 2)).view(complex)[..., 0]
    sweep = mf.make_monostatic_sweep(s.astype(np.complex64), frequency=frequency, antenna_position=place)
    return sweep.assign_attrs(scene_center=[0.0, 0.0, 0.0])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Neighbouring antennas stand")
@pytest.mark.parametrize("seed", range(2))
def test_a_smeared_image_tells_the_mistakes_of_a_moving_antenna(seed):
    for mistake in ("none", "conjugated", "reversed"):
        assert named(wrong(flight(seed, 15.0), mistake)) == MISTAKES[mistake]
        # Over a tenth of a degree nothing moves by a range cell, and nothing is said.
        assert named(wrong(flight(seed, 0.1), mistake)) == ()


@pytest.mark.slow
def test_noise_is_no_mistake():
    for seed in range(4):
        sweep = scene(seed, displaced=True, elements=31, snr_db=-60.0)
        found, judged = diagnose(sweep)
        assert found == []
        assert not judged["waves"]
        # Antennas a hundred metres apart are a mistake whatever the samples hold.
        found, judged = diagnose(wrong(sweep, "millimetres"))
        assert [finding.name for finding in found] == ["position-unit"]
        assert not judged["waves"]


def test_a_small_array_is_not_judged():
    sweep = scene(3, displaced=False, elements=5)
    found, judged = diagnose(mf.calibrate.conjugate(sweep))
    assert found == []
    assert not judged["waves"]


@pytest.mark.slow
def test_what_waves_do_not_show_is_not_judged():
    """From 20 m the waves at 9 cm of antennas are flat; apertures one above the other differ in nothing in plan."""
    random = np.random.default_rng(0)
    frequency, place = np.linspace(24e9, 24.25e9, 64), np.zeros((16, 3))
    place[:, 0] = 6e-3 * np.arange(16)
    points = random.uniform([-4.0, 5.0, 0.0], [4.0, 60.0, 0.0], (12, 3))
    ways = np.exp(
        -2j * np.pi / speed_of_light * frequency[:, None, None] * np.linalg.norm(place[:, None] - points, axis=2)
    )
    far = mf.make_sweep(
        np.einsum("fip,fkp->fik", ways, ways), frequency=frequency, tx_position=place, rx_position=place
    )
    for sweep in (far, mf.calibrate.conjugate(far), mf.calibrate.reverse_frequency(far)):
        assert diagnose(sweep) == ([], {"waves": False, "exchange": False})
    above = scene(0, displaced=False, elements=41)
    above = above.assign_coords(rx_position=above["rx_position"] + [0.0, 0.0, 0.01])
    assert diagnose(above) == ([], {"waves": True, "exchange": False})


@pytest.mark.slow
def test_a_recording_is_judged_by_its_first_frame_with_echoes():
    one = wrong(scene(2, displaced=True, elements=41), "conjugated")
    recording = one.assign(s=(("frame", *one["s"].dims), np.stack([0 * one["s"].values, one["s"].values])))
    assert "conjugated" in named(recording)


def test_of_a_planar_array_one_row_is_looked_at():
    x, z = np.meshgrid(0.5e-3 * np.arange(9), 0.5e-3 * np.arange(7))
    places = np.stack([x.ravel(), 0 * x.ravel(), z.ravel()], axis=1)
    frequency = np.linspace(290e9, 300e9, 3)
    s = np.ones((3, 63, 63), complex)
    pairs = on_a_line(pairs_of(mf.make_sweep(s, frequency=frequency, tx_position=places, rx_position=places)))
    kept = pairs.tx[np.unique(pairs.tx_of)]
    assert 9 <= len(kept) < 63
    assert np.ptp(kept[:, 2]) <= 1.1e-3
    assert np.ptp(kept[:, 0]) == pytest.approx(4e-3)


@pytest.mark.slow
def test_what_is_broken_is_said_with_its_remedy(tmp_path, monkeypatch, capsys, sweep):
    monkeypatch.chdir(tmp_path)
    samples = sweep["s"].values.copy()
    samples[3, 2, 2] = np.nan
    samples[:, 4] = 0.0
    sweep.assign(s=sweep["s"].copy(data=samples)).to_netcdf("bad.nc", engine="h5netcdf")
    found = mf.info("bad.nc")
    assert not found["valid"]
    assert {finding["name"] for finding in found["findings"]} == {"nan", "dead-channels"}
    assert main(["info", "bad.nc", "--json"]) == 2
    printed = capsys.readouterr()
    assert json.loads(printed.out)["findings"][0]["fix"] == "mirrorfold calibrate bad.nc -o bad-repaired.nc --mask"
    assert "--mask" in printed.err
    assert main(["calibrate", "bad.nc", "-o", "good.nc", "--mask"]) == 0
    masked = mf.load("good.nc")
    assert not masked["s"].values[:, 4].any()
    assert not masked["s"].values[:, 2, 2].any()


@pytest.mark.slow
def test_falling_and_unequal_frequencies(tmp_path, monkeypatch, sweep):
    monkeypatch.chdir(tmp_path)
    sweep.isel(frequency=slice(None, None, -1)).to_netcdf("falling.nc", engine="h5netcdf")
    found = mf.info("falling.nc")["findings"]
    assert [finding["name"] for finding in found] == ["falling-frequencies"]
    assert main(found[0]["fix"].split()[1:]) == 0
    np.testing.assert_allclose(mf.load("falling-repaired.nc")["s"], sweep["s"])
    sweep.isel(frequency=np.random.default_rng(0).permutation(sweep.sizes["frequency"])).to_netcdf(
        "shuffled.nc", engine="h5netcdf"
    )
    found = mf.info("shuffled.nc")["findings"]
    assert main(found[0]["fix"].split()[1:]) == 0
    np.testing.assert_allclose(mf.load("shuffled-repaired.nc")["s"], sweep["s"])
    gappy = sweep.isel(frequency=[0, 1, 2, 5, 6])
    gappy.to_netcdf("gappy.nc", engine="h5netcdf")
    (found,) = mf.info("gappy.nc")["findings"]
    assert found["name"] == "non-uniform-steps"
    missing = ", ".join(f"{one / 1e9:.6g}" for one in sweep["frequency"].values[3:5])
    assert f"{missing} GHz are missing" in found["what"]


def test_a_frequency_that_was_measured_twice_is_named(tmp_path, monkeypatch, sweep):
    monkeypatch.chdir(tmp_path)
    sweep.isel(frequency=[0, 1, 2, 2, 3, 4]).to_netcdf("twice.nc", engine="h5netcdf")
    which = f"{float(sweep['frequency'][2]) / 1e9:.6g} GHz stands twice"
    assert which in mf.info("twice.nc")["findings"][0]["what"]
    with pytest.raises(mf.InputError, match=f"expected equal rising steps; {which}: leave one out"):
        mf.load("twice.nc")


@pytest.mark.slow
@pytest.mark.parametrize("mistake", ["none", "conjugated", "reversed"])
def test_mistakes_in_a_measured_ultrasonic_array(shared_data, mistake):
    """Aluminium, some centimetres: another wave speed and another scale, and a back wall that mirrors."""
    from scipy.io import loadmat

    data = loadmat(shared_data / "arim" / "contact_notch_aluminium.mat", squeeze_me=True, struct_as_record=False)
    data = data["exp_data"]
    step = data.time[1] - data.time[0]
    frequency = np.fft.fftfreq(data.time.size, step)
    used = (frequency > 1e6) & (frequency < 9e6)
    spectrum = np.fft.fft(data.time_data, axis=0)[used]
    spectrum *= np.exp(-2j * np.pi * frequency[used] * data.time[0])[:, None]
    s = np.zeros((used.sum(), 64, 64), dtype=complex)
    s[:, data.tx - 1, data.rx - 1] = s[:, data.rx - 1, data.tx - 1] = spectrum
    place = np.outer(data.array.el_xc, [1.0, 0.0, 0.0])
    sweep = mf.make_sweep(s, frequency=frequency[used], tx_position=place, rx_position=place, wave_speed=6300.0)
    waves = [finding.name for finding in diagnose(wrong(sweep, mistake))[0] if finding.name in str(MISTAKES)]
    assert tuple(waves) == MISTAKES[mistake]
