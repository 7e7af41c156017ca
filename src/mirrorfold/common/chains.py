"""Names of the chains of mirrors by which echoes were seen."""

from __future__ import annotations

import xarray as xr

from mirrorfold.common.types import Chain


def chain_name(chain: Chain) -> str:
    """The name of a chain, such as "1/0"; empty for the chain of what is in line of sight."""
    return "/".join(map(str, chain))


def mirror_chains(mirrors: xr.Dataset) -> list[str]:
    """The name of the chain of every mirror of a table, such as "1/0"; its last number is that of the mirror itself.

    Parameters
    ----------
    mirrors : xarray.Dataset
        The group `mirrors` of a Reconstruction. Older ones hold only the `parent` of each mirror: mirrors with the same
        parent are then numbered in the order of the table.
    """
    if "chain" in mirrors:
        return [str(chain) for chain in mirrors["chain"].values]
    names: list[str] = []
    frames = mirrors["frame"].values.tolist() if "frame" in mirrors.variables else [0] * mirrors.sizes.get("mirror", 0)
    siblings: dict[tuple[int, int], int] = {}
    for frame, parent in zip(frames, mirrors["parent"].values.astype(int).tolist(), strict=True):
        place = siblings.setdefault((frame, parent), 0)
        siblings[frame, parent] += 1
        names.append(f"{names[parent]}/{place}" if 0 <= parent < len(names) else str(place))
    return names
