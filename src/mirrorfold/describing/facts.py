"""What is in a file, what can be resolved with it, and what looks wrong."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.constants import speed_of_light
from scipy.spatial import cKDTree
from scipy.special import gammaincinv

from mirrorfold.common.types import Array
from mirrorfold.common.windows import hann
from mirrorfold.errors import InputError
from mirrorfold.io import load
from mirrorfold.io.netcdf import check_image, check_reconstruction, image_axes, read_unchecked
from mirrorfold.sweep import antenna_positions, check_sweep, is_monostatic, is_raster, wave_speed

if TYPE_CHECKING:
    from mirrorfold.diagnosis import Finding
    from mirrorfold.scenes.floor_plan import Scene
    from mirrorfold.scenes.solids import Scene3D


RANGES = (1.0, 2.0, 4.0)
"""Where the cross-range resolution is stated [m]."""

QUIET_SHARE = 0.1
"""Share of the range profile that is taken to hold noise alone."""

END_SHARE = 0.1
"""Share of the range profile, at its end, where strong echoes suggest that others have wrapped around."""

END_LEVEL_DB = -30.0
"""Level of such an echo against the strongest one [dB]; weaker ones wrap around without harm."""

SIDE_LOBES = 3
"""Bins at the end of the range profile that the Hann window fills with leakage from range zero."""

PITCH_TOLERANCE = 0.01
"""How far the pitch may exceed half a wavelength, as a share of it: grating lobes then stay beyond 80 degrees."""

RECIPROCITY_DB = -40.0
"""Difference between a sweep and its transpose, against its mean power [dB], that calibration should not leave."""


def info(
    obj: xr.Dataset | xr.DataArray | xr.DataTree | Scene | Scene3D | str | Path, *, diagnose: bool = True
) -> dict[str, Any]:
    """What a sweep, image, reconstruction or scene holds, what it can resolve, and what looks wrong.

    Parameters
    ----------
    obj : xarray.Dataset, xarray.DataArray, xarray.DataTree, Scene, Scene3D or path
        The thing itself, or the path of its file.
    diagnose : bool, default True
        Look for classic mistakes in a sweep, which takes a second or two.

    Returns
    -------
    dict
        Plain numbers, strings, lists and dicts; `kind` is "sweep", "image", "reconstruction" or "scene", lengths end
        in ``_m``, frequencies in ``_hz``, angles in ``_deg``, levels in ``_db``. `remarks` is a list of sentences on
        what looks wrong; of a sweep, `findings` is a list of dicts with `name`, `what`, `sure` (0 to 1) and `fix`, the
        command that puts it right, or advice; see `mirrorfold.diagnosis`.

    Raises
    ------
    InputError
        If the object is none of these or not valid.
    """
    if isinstance(obj, str | Path):
        return {"path": str(obj), **_file_info(Path(obj), diagnose)}
    if isinstance(obj, xr.DataTree):
        return _reconstruction_info(check_reconstruction(obj))
    if isinstance(obj, xr.DataArray):
        return _image_info(check_image(obj))
    if isinstance(obj, xr.Dataset):
        return _diagnosed(obj, "SWEEP.nc", diagnose)
    from mirrorfold.scenes.floor_plan import Scene

    if isinstance(obj, Scene):
        return _scene_info(obj)
    if getattr(obj, "dimensions", None) == 3:
        return _scene3d_info(obj)
    raise InputError(f"info: got a {type(obj).__name__}, expected a sweep, an image, a reconstruction or a scene")


def _file_info(path: Path, diagnose: bool) -> dict[str, Any]:
    """The same of a file; a sweep that is not valid is described as far as it can be."""
    try:
        content = load(path)
    except InputError:
        if path.suffix.lower() == ".toml":
            raise
        raw = read_unchecked(path)
        if "s" not in raw or raw["s"].dtype.kind != "c":
            raise
        return _diagnosed(raw, str(path), diagnose)
    return _diagnosed(content, str(path), diagnose) if isinstance(content, xr.Dataset) else info(content)


def _diagnosed(sweep: xr.Dataset, path: str, diagnose: bool) -> dict[str, Any]:
    """A sweep with its findings; what is not valid is described where a repair is known, and refused otherwise."""
    found: list[Finding] = []
    try:
        valid = check_sweep(sweep, source=path)
    except InputError as error:
        if "s" not in sweep or sweep["s"].dtype.kind != "c" or not sweep["s"].size:
            raise
        from mirrorfold.diagnosis import sample_findings

        found = sample_findings(sweep)
        if not found:
            raise
        facts: dict[str, Any] = {
            "kind": "sweep",
            "title": str(sweep.attrs.get("title", "")),
            "dimensions": {str(name): int(size) for name, size in sweep["s"].sizes.items()},
            "valid": False,
            "remarks": [str(error)],
        }
    else:
        facts = {**_sweep_info(valid), "valid": True}
        if diagnose:
            from mirrorfold.diagnosis import diagnose as find_mistakes

            found, judged = find_mistakes(valid)
            facts["judged"] = judged
    facts["findings"] = [{"name": f.name, "what": f.what, "sure": f.sure, "fix": f.command(path)} for f in found]
    facts["remarks"] = [*facts["remarks"], *(f"{f.sentence()} Remedy: {f.command(path)}" for f in found)]
    return facts


def resolution(
    frequency: Array, tx_position: Array, rx_position: Array, speed: float = speed_of_light
) -> tuple[dict[str, Any], list[str]]:
    """What a band and two arrays can resolve, and remarks on what they cannot.

    Parameters
    ----------
    frequency : (frequencies,) array [Hz]
    tx_position, rx_position : (tx, 3) and (rx, 3) arrays [m]
    speed : float [m/s]
        Of the waves, by default of light in vacuum.

    Returns
    -------
    facts : dict
        Cross-range resolution is ``lambda r / D`` at the centre of the band, D the longer aperture: the first zero
        of the focus. The field of view, ``2 arcsin(lambda / (2 p))`` at the top of the band with the finer pitch p,
        is the widest sector around broadside that holds no grating lobe of anything in it.
    remarks : list of str
    """
    step = float(frequency[-1] - frequency[0]) / (frequency.size - 1) if frequency.size > 1 else None
    wavelength = speed / float(frequency.mean())
    shortest = speed / float(frequency[-1])
    aperture = max(_extent(tx_position), _extent(rx_position))
    pitches = [pitch for pitch in (_pitch(tx_position), _pitch(rx_position)) if pitch is not None]
    field_of_view = 2.0 * float(np.degrees(np.arcsin(min(1.0, shortest / (2.0 * min(pitches)))))) if pitches else None
    facts = {
        "band_hz": [float(frequency[0]), float(frequency[-1])],
        "frequencies": int(frequency.size),
        "frequency_step_hz": step,
        "tx": len(tx_position),
        "rx": len(rx_position),
        "aperture_m": [_extent(tx_position), _extent(rx_position)],
        "pitch_m": [_pitch(tx_position), _pitch(rx_position)],
        "range_resolution_m": speed / (2.0 * step * frequency.size) if step else None,
        "ambiguous_range_m": speed / (2.0 * step) if step else None,
        "cross_range_resolution_m": {f"{r:g}": wavelength * r / aperture for r in RANGES} if aperture else None,
        "field_of_view_deg": field_of_view,
    }
    remarks = []
    if step is None:
        remarks.append("There is a single frequency, so ranges cannot be told apart; sweep a band.")
    if not aperture:
        remarks.append("All antennas stand at one place, so directions cannot be told apart; move them.")
    if pitches and min(pitches) > (1.0 + PITCH_TOLERANCE) * shortest / 2.0:
        remarks.append(
            f"The pitch of {min(pitches) * 1e3:.3g} mm exceeds half a wavelength, {shortest * 500:.3g} mm: grating "
            f"lobes will show things at wrong places outside a field of view of {field_of_view:.0f} degrees."
        )
    return facts, remarks


def scan_resolution(
    frequency: Array,
    azimuth: Array,
    elevation: Array,
    beam: tuple[float, float] | None,
    speed: float = speed_of_light,
) -> tuple[dict[str, Any], list[str]]:
    """What a band and a raster scan can resolve, and remarks on what they cannot.

    Parameters
    ----------
    frequency : (frequencies,) array [Hz]
    azimuth, elevation : 1D arrays [degree]
    beam : (radius of the focus, its distance) [m], optional
        Where it is known.
    speed : float [m/s]
        Of the waves, by default of light in vacuum.
    """
    step = float(frequency[-1] - frequency[0]) / (frequency.size - 1) if frequency.size > 1 else None
    steps = [float(np.diff(angle).max()) if angle.size > 1 else None for angle in (azimuth, elevation)]
    facts = {
        "band_hz": [float(frequency[0]), float(frequency[-1])],
        "frequencies": int(frequency.size),
        "frequency_step_hz": step,
        "azimuth_deg": [float(azimuth[0]), float(azimuth[-1])],
        "elevation_deg": [float(elevation[0]), float(elevation[-1])],
        "beams": [int(azimuth.size), int(elevation.size)],
        "scan_step_deg": steps,
        "spot_radius_m": beam[0] if beam else None,
        "focus_distance_m": beam[1] if beam else None,
        "range_resolution_m": speed / (2.0 * step * frequency.size) if step else None,
        "ambiguous_range_m": speed / (2.0 * step) if step else None,
    }
    remarks = [] if step else ["There is a single frequency, so ranges cannot be told apart; sweep a band."]
    if beam is not None:
        widest = 2.0 * float(np.degrees(beam[0] / beam[1]))
        if any(angle is not None and angle > widest for angle in steps):
            remarks.append(
                f"The scan steps are wider than the beam, {widest:.2g} degrees: things between two beams are seen by "
                "neither."
            )
    return facts, remarks


def _raster_info(sweep: xr.Dataset) -> dict[str, Any]:
    known = "spot_radius" in sweep.attrs and "focus_distance" in sweep.attrs
    beam = (float(sweep.attrs["spot_radius"]), float(sweep.attrs["focus_distance"])) if known else None
    axes = [sweep[name].values.astype(float) for name in ("frequency", "azimuth", "elevation")]
    facts, remarks = scan_resolution(axes[0], axes[1], axes[2], beam, wave_speed(sweep))
    s = sweep["s"].values.reshape((-1, *sweep["s"].shape[-3:]))
    # What leaks inside the instrument is the same in all beams.
    s = s - s.mean(axis=(2, 3), keepdims=True)
    power = _mean_power(part for frame in s for part in frame)
    profile = _range_profile(s)
    noise = _noise_power(profile, pairs=s.size // profile.size)
    facts["power_db"] = _decibel(power)
    facts["snr_db"] = _decibel((power - noise) / noise) if 0.0 < noise < power else None
    facts |= _levels(profile, noise)
    return {
        "kind": "sweep",
        "title": str(sweep.attrs.get("title", "")),
        "dimensions": {str(name): int(size) for name, size in zip(sweep["s"].dims, sweep["s"].shape, strict=True)},
        **facts,
        "remarks": remarks,
    }


def _scene3d_info(scene: Scene3D) -> dict[str, Any]:
    azimuth, elevation = scene.scanner.angles
    beam = (scene.scanner.spot_radius, scene.scanner.focus_distance)
    facts, remarks = scan_resolution(scene.band.frequency, azimuth, elevation, beam)
    if not scene.surface:
        remarks.append("The scene has no surfaces.")
    surfaces = [
        {
            "name": surface.name,
            "kind": surface.kind,
            "material": surface.material
            if isinstance(surface.material, str)
            else f"permittivity {surface.material.permittivity:g}, {surface.material.conductivity:g} S/m",
        }
        for surface in scene.surface
    ]
    return {"kind": "scene", "title": scene.name, **facts, "surfaces": surfaces, "remarks": remarks}


def _sweep_info(sweep: xr.Dataset) -> dict[str, Any]:
    if is_raster(sweep):
        return _raster_info(sweep)
    tx_position, rx_position = antenna_positions(sweep)
    facts, remarks = resolution(sweep["frequency"].values.astype(float), tx_position, rx_position, wave_speed(sweep))
    s = sweep["s"].values[..., None] if is_monostatic(sweep) else sweep["s"].values
    s = s.reshape((-1, *s.shape[-3:]))
    power = _mean_power(part for frame in s for part in frame)
    profile = _range_profile(s)
    noise = _noise_power(profile, pairs=s.size // profile.size)
    facts["power_db"] = _decibel(power)
    facts["snr_db"] = _decibel((power - noise) / noise) if noise < power else None
    facts |= _levels(profile, noise)
    end = profile[int((1.0 - END_SHARE) * profile.size) : profile.size - SIDE_LOBES]
    facts["range_end_db"] = _decibel(end.max() / profile.max()) if end.size and profile.max() > 0 else None
    noise_in_profile = noise / power * profile.mean() if power > 0 else 0.0
    if (
        facts["range_end_db"] is not None
        and facts["range_end_db"] > END_LEVEL_DB
        and end.max() > 10.0 * noise_in_profile
    ):
        remarks.append(
            f"Echoes in the last part of the unambiguous range, {facts['ambiguous_range_m']:.3g} m, are only "
            f"{abs(facts['range_end_db']):.0f} dB below the strongest: later ones have probably wrapped around and "
            "stand at wrong places; measure with smaller frequency steps."
        )
    if not is_monostatic(sweep) and np.array_equal(tx_position, rx_position):
        difference = _mean_power(part - part.T for frame in s for part in frame) / 2.0
        facts["reciprocity_db"] = _decibel(difference / power)
        if difference > 4.0 * noise and difference > 10.0 ** (RECIPROCITY_DB / 10.0) * power:
            remarks.append(
                "Exchanging transmitter and receiver changes the samples by more than the noise "
                f"({facts['reciprocity_db'] + 0.0:.0f} dB of their power): the sweep is not reciprocal; "
                "check the calibration, the positions, and that nothing moved."
            )
    return {
        "kind": "sweep",
        "title": str(sweep.attrs.get("title", "")),
        "dimensions": {str(name): int(size) for name, size in zip(sweep["s"].dims, sweep["s"].shape, strict=True)},
        **facts,
        "remarks": remarks,
    }


def _image_info(image: xr.DataArray) -> dict[str, Any]:
    amplitude = np.abs(image.values)
    peak = np.unravel_index(int(amplitude.argmax()), amplitude.shape)
    axes = image_axes(image)
    at = {str(name): int(i) for name, i in zip(image.dims, peak, strict=True)}
    remarks = []
    if not amplitude.any():
        remarks.append("Every pixel is zero; there is nothing to see.")
    elif any(image.sizes[name] > 1 and at[name] in (0, image.sizes[name] - 1) for name in axes):
        remarks.append("The strongest pixel lies on the border; the grid probably cuts off part of the scene.")
    return {
        "kind": "image",
        "title": str(image.attrs.get("title", "")),
        "dimensions": {str(name): int(size) for name, size in image.sizes.items()},
        "type": str(image.dtype),
        "extent": {name: [float(image[name].min()), float(image[name].max())] for name in axes},
        "pixel": {name: float(np.diff(image[name]).mean()) if image[name].size > 1 else None for name in axes},
        "strongest_at": {name: float(image[name].values[i]) if name in axes else i for name, i in at.items()},
        "median_below_peak_db": _decibel(float(np.median(amplitude) / amplitude.max()) ** 2)
        if amplitude.any()
        else None,
        "remarks": remarks,
    }


def _reconstruction_info(reconstruction: xr.DataTree) -> dict[str, Any]:
    objects = reconstruction.children["objects"].to_dataset(inherit=False)
    bounces, counts = np.unique(objects["bounces"].values, return_counts=True)
    mirrors = mirror_table(reconstruction)
    remarks = []
    if not mirrors:
        remarks.append("No mirror was found; the image is unfolded.")
    if not objects.sizes.get("point", 0):
        remarks.append("No object was found.")
    return {
        "kind": "reconstruction",
        "title": str(reconstruction.attrs.get("title", "")),
        "dimensions": {str(name): int(size) for name, size in reconstruction.dataset["intensity"].sizes.items()},
        "points": int(objects.sizes.get("point", 0)),
        "points_by_bounces": {str(int(bounce)): int(count) for bounce, count in zip(bounces, counts, strict=True)},
        "mirrors": mirrors,
        "remarks": remarks,
    }


def mirror_table(reconstruction: xr.DataTree) -> list[dict[str, Any]]:
    """The mirrors of a reconstruction, one dict each: number, parent, generation, true place [m] and strength."""
    mirrors = reconstruction.children["mirrors"].to_dataset(inherit=False)
    return [
        {
            "mirror": index,
            "parent": int(mirror["parent"]),
            "generation": int(mirror["generation"]),
            "start_m": [float(mirror["folded_x0"]), float(mirror["folded_y0"])],
            "end_m": [float(mirror["folded_x1"]), float(mirror["folded_y1"])],
            "strength": float(mirror["strength"]),
        }
        for index in range(mirrors.sizes.get("mirror", 0))
        for mirror in [mirrors.isel(mirror=index)]
    ]


def _scene_info(scene: Scene) -> dict[str, Any]:
    facts, remarks = resolution(scene.band.frequency, scene.array.tx_position, scene.array.rx_position)
    radar = 0.5 * (scene.array.tx_position.mean(axis=0) + scene.array.rx_position.mean(axis=0))[:2]
    farthest = max(
        (float(np.linalg.norm(surface.sample(0.01)[0] - radar, axis=1).max()) for surface in scene.surface), default=0.0
    )
    if farthest > facts["ambiguous_range_m"]:
        remarks.append(
            f"The farthest surface, {farthest:.3g} m away, lies beyond the unambiguous range of "
            f"{facts['ambiguous_range_m']:.3g} m and will appear at a wrong place; use more frequency points."
        )
    if not scene.surface:
        remarks.append("The scene has no surfaces.")
    return {
        "kind": "scene",
        "title": scene.name,
        **facts,
        "farthest_surface_m": farthest,
        "surfaces": [
            {"name": surface.name, "kind": surface.kind, "material": surface.material} for surface in scene.surface
        ],
        "remarks": remarks,
    }


def _levels(profile: Array, noise: float) -> dict[str, float | None]:
    """Noise floor of a sample, and how far the strongest range bin stands above the floor of the profile [dB]."""
    floor = float(np.quantile(profile, QUIET_SHARE))
    return {
        "noise_floor_db": _decibel(noise),
        "dynamic_range_db": _decibel(float(profile.max()) / floor) if floor > 0 else None,
    }


def _mean_power(parts: Iterable[NDArray[np.complex64]]) -> float:
    """Of samples, one frequency at a time: copies of a whole sweep cost more than the arithmetic."""
    energy, size = 0.0, 0
    for part in parts:
        energy, size = energy + float(np.vdot(part, part).real), size + part.size
    return energy / size


def _range_profile(s: NDArray[np.complex64]) -> Array:
    """Mean power over all pairs in each range bin, Hann window over frequency, shape (frequencies,)."""
    window = hann(s.shape[1]).astype(np.float32)
    profile = np.zeros(s.shape[1])
    for tx in range(s.shape[2]):
        profile += np.sum(np.abs(np.fft.ifft(s[:, :, tx] * window[:, None], axis=1)) ** 2, axis=(0, 2), dtype=float)
    return profile * s.shape[1] ** 2 / np.sum(window**2, dtype=float) * s.shape[1] / s.size


def _noise_power(profile: Array, *, pairs: int) -> float:
    """Power of the noise in each sample, at most, from the quietest part of the range profile.

    Where that part holds white noise alone, its mean over n pairs follows a gamma distribution of shape n, which
    says how far the quantile lies below the mean.
    """
    below_mean = gammaincinv(pairs, QUIET_SHARE) / pairs
    return float(max(np.quantile(profile, QUIET_SHARE) / below_mean, np.finfo(np.float32).eps ** 2 * profile.max()))


def _extent(position: Array) -> float:
    """Length [m] of an array along its longest direction."""
    centred = position - position.mean(axis=0)
    longest = np.linalg.svd(centred, full_matrices=False)[2][0]
    return float(np.ptp(centred @ longest))


def _pitch(position: Array) -> float | None:
    """Median distance [m] between nearest neighbours; None for a single place."""
    places = np.unique(position, axis=0)
    if len(places) < 2:
        return None
    return float(np.median(cKDTree(places).query(places, k=2)[0][:, 1]))


def _decibel(power: float) -> float | None:
    """A ratio of powers in dB; None for zero."""
    return 10.0 * float(np.log10(power)) if power > 0 else None
