"""Networks of scikit-rf, which are in memory already, used in place of files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mirrorfold.errors import InputError
from mirrorfold.io.readers.contents import Spectra
from mirrorfold.io.readers.touchstone import SUFFIX, parameter_name


@dataclass(frozen=True, eq=False)
class SpectraInMemory:
    """Spectra in memory, with the name that a file of them would have.

    Attributes
    ----------
    name : str
    spectra : Spectra
    """

    name: str
    spectra: Spectra

    def __str__(self) -> str:
        return self.name

    @property
    def parent(self) -> Path:
        """A path in place of the folder of a file, for messages."""
        return Path(self.name)


def is_network(value: Any) -> bool:
    """Whether a value is a Network or a NetworkSet of scikit-rf, which need not be installed."""
    return type(value).__module__.split(".")[0] == "skrf" and (hasattr(value, "s") or hasattr(value, "ntwk_set"))


def networks_by_name(value: Any) -> dict[str, SpectraInMemory] | None:
    """The Networks in a Network, a NetworkSet or a list of both, by names of files; None for any other value.

    A network without a name gets its number as name, from zero.

    Raises
    ------
    InputError
        If two networks have the same name, or the frequencies and samples of one do not fit together.
    """
    members = value if isinstance(value, list | tuple) and value and all(map(is_network, value)) else [value]
    if not all(map(is_network, members)):
        return None
    networks = [network for one in members for network in (one.ntwk_set if hasattr(one, "ntwk_set") else [one])]
    found: dict[str, SpectraInMemory] = {}
    for number, network in enumerate(networks):
        frequency, s = np.asarray(network.f, dtype=float), np.asarray(network.s)
        ports = s.shape[-1]
        name = str(network.name or number)
        name = name if SUFFIX.search(name) else f"{name}.s{ports}p"
        if s.shape != (frequency.size, ports, ports):
            raise InputError(f"network {name!r}: has {frequency.size} frequencies and samples of shape {s.shape}")
        if name in found:
            raise InputError(f"two networks are called {name!r}; give each its own name, as in the table of positions")
        parameters = {
            parameter_name(out, into, ports): s[:, out, into] for into in range(ports) for out in range(ports)
        }
        found[name] = SpectraInMemory(name, Spectra(frequency, parameters))
    return found
