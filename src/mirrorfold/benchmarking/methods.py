"""The methods that a benchmark judges: ours, the published one, and any function of a user."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from mirrorfold.common.arguments import described, in_message
from mirrorfold.errors import InputError
from mirrorfold.reconstruction import fold

Method = Callable[[xr.DataArray, xr.Dataset | None], Any]
"""Function that is called as ``method(image, sweep)``; see `as_reconstruction` for what it may return."""


STDOUT, STDERR = 1, 2
"""Handles of the standard streams."""


def ours(image: xr.DataArray, sweep: xr.Dataset | None) -> xr.DataTree:
    """`mirrorfold.fold` with its default settings."""
    return fold(image, sweep=sweep)


def published(image: xr.DataArray, sweep: xr.Dataset | None) -> xr.DataTree:
    """The algorithm as it was published."""
    return fold(image, sweep=sweep, preset="published")


def flat(image: xr.DataArray, sweep: xr.Dataset | None) -> xr.DataTree:
    """`mirrorfold.fold` without curved mirrors."""
    return fold(image, sweep=sweep, curved=False)


def opaque(image: xr.DataArray, sweep: xr.Dataset | None) -> xr.DataTree:
    """`mirrorfold.fold` without half-transparent walls."""
    return fold(image, sweep=sweep, transparent=False)


OWN: dict[str, Method] = {"ours": ours, "flat": flat, "opaque": opaque, "published": published}
"""The methods of this package, by name."""


@contextmanager
def output_to_stderr() -> Iterator[None]:
    """Send to stderr what foreign code, and the programs that it starts, write to stdout, which may be JSON."""
    with ExitStack() as undo:
        undo.enter_context(redirect_stdout(sys.stderr))
        # Compiled code and other programs write to the handles, which are closed in a process without a terminal.
        with suppress(OSError):
            kept = os.dup(STDOUT)
            undo.callback(os.close, kept)
            _flush_stdout()
            os.dup2(STDERR, STDOUT)
            undo.callback(os.dup2, kept, STDOUT)
            undo.callback(_flush_stdout)
        yield


def _flush_stdout() -> None:
    """Write out what Python holds back for the handle of stdout."""
    if sys.__stdout__ is not None:
        with suppress(OSError, ValueError):  # ValueError: it is closed
            sys.__stdout__.flush()


def load_method(name: str) -> Method:
    """A method by its name, or by the module and the name of its function.

    Parameters
    ----------
    name : str
        ``ours``, ``flat``, ``opaque``, ``published`` or ``MODULE:FUNCTION``. Modules of the working directory are
        found, too.

    Raises
    ------
    InputError
        If the module cannot be imported or has no such function.
    """
    if name in OWN:
        return OWN[name]
    module_name, colon, function_name = name.partition(":")
    if not (module_name and colon and function_name):
        raise InputError(
            f"method is {in_message(name)}, expected ours, flat, opaque, published or MODULE:FUNCTION, such as "
            "my_lab.folding:fold"
        )
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    try:
        with output_to_stderr():
            module = importlib.import_module(module_name)
    except (Exception, SystemExit) as error:  # a foreign module may raise anything when it is imported
        raise InputError(
            f"method {name!r}: the module {module_name!r} cannot be imported ({type(error).__name__}: {error}); run in "
            "its folder or install it"
        ) from None
    function = getattr(module, function_name, None)
    if not callable(function):
        found = "has no function" if function is None else f"has {described(function)}, no function,"
        raise InputError(f"method {name!r}: the module {module_name!r} {found} {function_name!r}")
    return function


def as_reconstruction(result: Any, image: xr.DataArray) -> xr.DataTree:
    """The result of a method as a Reconstruction that can be scored.

    Parameters
    ----------
    result : xarray.DataTree or mapping
        A Reconstruction as `mirrorfold.fold` returns it, or a mapping with

        * `points` (n, d) [m]: true places of what was found, d = 2 in a floor plan and 3 in space;
        * `bounces` (n,), optional: number of mirrors by which each was seen, 0 by default;
        * `initial` (n, d) [m], optional: where each stood in the image, `points` by default; only the size of the
          resolution cell depends on it;
        * `mirrors` (m, 2, 2) [m], optional: the two ends of each mirror at its true place, in a floor plan.
    image : xarray.DataArray
        The image that the method was given; its attributes tell the resolution.

    Raises
    ------
    InputError
        If the result is neither, has other shapes, or holds numbers that are not finite.
    """
    if isinstance(result, xr.DataTree):
        for group, places in (("objects", ("x", "y", "z")), ("mirrors", ("folded_",))):
            held = result.children[group].dataset.variables if group in result.children else {}
            numbers = [
                values
                for name, values in held.items()  # unknown errors may be NaN
                if str(name).startswith(places) and not str(name).endswith("_error") and values.dtype.kind == "f"
            ]
            if not all(np.isfinite(values.values).all() for values in numbers):
                raise InputError(f"the method returned a reconstruction with {group} that are not finite")
        return result
    if not isinstance(result, Mapping):
        raise InputError(
            f"the method returned {described(result)}, expected a reconstruction (xarray.DataTree) or a mapping with "
            "points"
        )
    axes_names = "xyz"[: 3 if {"range", "azimuth", "elevation"} <= set(image.dims) else 2]
    known = ("points", "bounces", "initial", "mirrors")
    unknown = [str(name) for name in result if name not in known]
    if unknown or "points" not in result:
        raise InputError(
            f"the method returned a mapping with {', '.join(map(str, result)) or 'nothing'}, expected points and maybe "
            "bounces, initial and mirrors"
        )
    points = _numbers(result, "points", (-1, len(axes_names)))
    initial = _numbers(result, "initial", points.shape) if result.get("initial") is not None else points
    bounces = np.zeros(len(points), dtype=np.int32)
    if result.get("bounces") is not None:
        counts = _numbers(result, "bounces", (len(points),))
        bounces = np.clip(counts, 0, np.iinfo(np.int32).max).astype(np.int32)
        if not (bounces == counts).all():
            raise InputError("the method returned bounces that are no whole numbers of at least 0")
    if result.get("mirrors") is not None and len(axes_names) == 3:
        raise InputError("the method returned mirrors in space, which are judged in a reconstruction alone")
    ends = _numbers(result, "mirrors", (-1, 2, 2)) if result.get("mirrors") is not None else np.empty((0, 2, 2))
    objects: dict[str, Any] = {f"{axis}_initial": ("point", initial[:, i]) for i, axis in enumerate(axes_names)}
    objects |= {axis: ("point", points[:, i]) for i, axis in enumerate(axes_names)}
    objects |= {"bounces": ("point", bounces), "amplitude": ("point", np.ones(len(points)))}
    mirrors: dict[str, Any] = {
        f"folded_{axis}{which}": ("mirror", ends[:, which, i]) for i, axis in enumerate("xy") for which in (0, 1)
    }
    mirrors["generation"] = ("mirror", np.ones(len(ends), dtype=np.int32))
    attrs: dict[str, Any] = {f"image_{name}": value for name, value in image.attrs.items()}
    radar = np.atleast_1d(image.attrs.get("radar_position", np.zeros(3)))
    attrs |= {f"radar_{axis}": float(place) for axis, place in zip(axes_names, radar, strict=False)}
    groups = {
        "/": xr.Dataset(attrs=attrs),
        "/objects": xr.Dataset(objects).set_coords(list(axes_names)),
        "/mirrors": xr.Dataset(mirrors),
    }
    return xr.DataTree.from_dict(groups)


def _numbers(result: Mapping[str, Any], name: str, shape: tuple[int, ...]) -> np.ndarray:
    """An item of a result as finite numbers of a shape, in which -1 stands for any length; an empty item fits, too."""
    try:
        if np.iscomplexobj(result[name]):
            raise TypeError("their imaginary parts would be lost")
        values = np.asarray(result[name], dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"the method returned {name} that are no real numbers: {described(result[name])}") from None
    if not values.size and -1 in shape:
        values = values.reshape([0 if size == -1 else size for size in shape])
    fits = values.ndim == len(shape) and all(b in (-1, a) for a, b in zip(values.shape, shape, strict=True))
    if not fits:
        wanted = ", ".join("n" if size == -1 else str(size) for size in shape)
        raise InputError(f"the method returned {name} of shape {values.shape}, expected ({wanted})")
    if not np.isfinite(values).all():
        raise InputError(f"the method returned {name} that are not finite")
    return values
