"""Reading and writing of files: `load` and `save`, whatever a file holds, and imports and exports.

| folder or file | what it does |
|---|---|
| `files.py`, `suffixes.py` | writes files and folders completely or not at all; which names they may have |
| `own/` | reads and writes sweeps, images, reconstructions (netCDF-4) and scenes (TOML) |
| `plans.py` | reads and writes floor plans (DXF, GeoJSON) |
| `readers/` | reads the contents of files of other tools, `Contents`; one reader for each format |
| `mapping/` | makes a sweep of such contents, by a mapping that tells which variable is what |
| `guessing/` | proposes a mapping |
| `scans/` | makes a sweep of many files, one for each position |
| `importing.py`, `images.py` | choose among these: measured data to sweeps; images and clouds to images |
| `exports/` | writes results for other programs |

To add a reader, see `readers/`.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from mirrorfold.common.arguments import path_of
from mirrorfold.common.lazy import lazy
from mirrorfold.common.reading import check_file
from mirrorfold.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from mirrorfold.common.plans import FloorPlan
    from mirrorfold.io.exports.results import export
    from mirrorfold.io.exports.scan_folder import save_touchstone
    from mirrorfold.io.images import import_image
    from mirrorfold.io.importing import import_data
    from mirrorfold.scenes.floor_plan import Scene
    from mirrorfold.scenes.solids import Scene3D


def load(path: str | Path) -> xr.Dataset | xr.DataArray | xr.DataTree | Scene | Scene3D | FloorPlan:
    """Read a sweep, an image, a reconstruction, a scene or a floor plan, checked and completely in memory.

    Parameters
    ----------
    path : path
        A netCDF-4 file; a scene if the name ends in ``.toml``; a floor plan if it ends in ``.dxf`` or ``.geojson``.
        Also an image or point cloud of another tool in ``.npy``, ``.npz``, ``.mat``, ``.h5``, ``.ply``, ``.pcd`` or
        ``.csv`` (see `import_image`), or a sweep that `import_data` reads without further arguments.

    Returns
    -------
    xarray.Dataset, xarray.DataArray, xarray.DataTree, Scene, Scene3D or FloorPlan
        A sweep, an image, a reconstruction, a scene or a floor plan.

    Raises
    ------
    InputError
        If the file is missing, damaged, or holds something else.
    """
    path = path_of("load", path)
    if path.suffix.lower() == ".toml":
        from mirrorfold.scenes.floor_plan import load_scene

        return load_scene(path)
    if path.suffix.lower() in (".dxf", ".geojson"):
        from mirrorfold.io.plans import read_plan

        return read_plan(path)
    prepare_to_read(path)
    from mirrorfold.io.own.netcdf import is_foreign, read

    if is_foreign(path):
        from mirrorfold.io.images import import_image
        from mirrorfold.io.importing import import_data

        try:
            return import_image(path)
        except InputError as error:
            with suppress(InputError):  # a sweep that says what it holds, or is one of the known kinds
                return import_data(path)
            raise _as_sweep_to_import(path) or error from None
    return read(path)


def _as_sweep_to_import(path: Path) -> InputError | None:
    """The error that advises how to import a file of another tool with samples over frequency or time.

    None for all other files.
    """
    from mirrorfold.io.mapping.names import FREQUENCY, TIME
    from mirrorfold.io.readers import read_contents

    with suppress(InputError):
        for name, variable in read_contents(path).variables.items():
            last = name.rpartition(".")[2].lower()
            if max(variable.shape, default=1) > 1 and (FREQUENCY.search(last) or TIME.search(last)):
                what = f"holds {name!r}, so probably a sweep, and does not say all that an import needs"
                return InputError(f"{path}: {what}; `mirrorfold import --guess {path}` proposes how to read it")
    return None


def load_geometry(path: str | Path) -> xr.Dataset:
    """Read frequencies, positions and attributes of a sweep's netCDF file, without its samples, and unchecked.

    Raises
    ------
    InputError
        If the file is missing or damaged.
    """
    prepare_to_read(Path(path))
    from mirrorfold.io.own.netcdf import read_geometry

    return read_geometry(Path(path))


def prepare_to_read(path: Path) -> None:
    """Check that a file is there; start the process that opens netCDF files, while libraries are loaded here.

    Raises
    ------
    InputError
        If the file is missing, or is none that can be read.
    """
    check_file(path, "give the path of a netCDF file")
    if path.suffix.lower() == ".nc":
        from mirrorfold.io.readers import hdf5

        hdf5.prepare()


def save(obj: xr.Dataset | xr.DataArray | xr.DataTree | Scene | Scene3D, path: str | Path) -> Path:
    """Write a sweep, an image or a reconstruction to a netCDF-4 file, or a scene to a TOML file.

    The file gets its name once it is complete. If writing fails, an older file of this name stays as it was.

    Parameters
    ----------
    obj : xarray.Dataset, xarray.DataArray, xarray.DataTree, Scene or Scene3D
        A sweep, an image, a reconstruction or a scene.
    path : path
        Its directory must exist; the name of a scene's file ends in ``.toml``.

    Returns
    -------
    Path
        The path of the file.

    Raises
    ------
    InputError
        If the object is none of these or not valid, or the file cannot be written.
    OSError
        If the disk is full or fails.
    """
    import xarray as xr

    if not isinstance(obj, xr.Dataset | xr.DataArray | xr.DataTree):
        from mirrorfold.io.own.scene_files import write_scene

        return write_scene(obj, path_of("save", path))
    from mirrorfold.io.own.netcdf import write
    from mirrorfold.io.suffixes import NETCDF, check_suffix

    check_suffix(path_of("save", path), NETCDF)
    return write(obj, path_of("save", path))


__getattr__, __dir__ = lazy(
    __name__,
    {
        "exports.results": ("export",),
        "exports.scan_folder": ("save_touchstone",),
        "images": ("import_image",),
        "importing": ("import_data",),
    },
)


__all__ = ["export", "import_data", "import_image", "load", "save", "save_touchstone"]
