"""The experiments by name, in the order of the publication. The module of an experiment is imported when it is run."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.resources import files
from importlib.util import find_spec
from typing import TYPE_CHECKING, cast

from mirrorfold import __version__
from mirrorfold.common.arguments import in_message, listed
from mirrorfold.errors import InputError

if TYPE_CHECKING:
    from mirrorfold.reproducing.findings import Findings
    from mirrorfold.reproducing.work import Work

PACKAGE, PARTS = "mirrorfold.reproducing.experiments", "mirrorfold.reproducing.parts"

NEEDS = {"mesh": ("trimesh", "embreex", "skimage"), "sparse": ("pylops",)}
"""Modules that each extra of the package installs, by the names under which they are imported."""


@dataclass(frozen=True)
class Experiment:
    """An experiment, which the function `run` of the module of the same name carries out.

    Attributes
    ----------
    name : str
    title : str
    source : str
        The published figure; empty if nothing was published.
    purpose : str
        What is done, in one or two sentences.
    extra : str
        The extra of the package that the experiment needs; empty if it needs none.
    """

    name: str
    title: str
    source: str
    purpose: str
    extra: str = ""

    @property
    def module(self) -> str:
        """Name of the experiment's module in the folder `experiments`."""
        return self.name.replace("-", "_")

    @property
    def run(self) -> Callable[[Work], Findings]:
        """The function that carries out the experiment."""
        return cast("Callable[[Work], Findings]", import_module(f"{PACKAGE}.{self.module}").run)

    def digest(self, *, quick: bool) -> str:
        """Digest of the program that makes the result: version, name, size, the text of its module and of `parts`."""
        shared = sorted(files(PARTS).iterdir(), key=lambda file: file.name)
        texts = [file.read_bytes() for file in shared if file.name.endswith(".py")]
        texts.append(files(PACKAGE).joinpath(f"{self.module}.py").read_bytes())
        return hashlib.sha256(f"{__version__} {self.name} {quick}\n".encode() + b"".join(texts)).hexdigest()

    def check_installed(self) -> None:
        """Refuse to begin if modules that the experiment needs are not installed.

        Raises
        ------
        InputError
            If a module of the experiment's extra is missing.
        """
        missing = [name for name in NEEDS.get(self.extra, ()) if find_spec(name) is None]
        if missing:
            raise InputError(
                f"experiment {self.name!r} needs {', '.join(missing)}; install with: pip install "
                f"'mirrorfold[{self.extra}]', or name the experiments to make without it"
            )


_ALL = (
    Experiment(
        "scattering",
        "What walls mirror and what they scatter, from microwaves to light",
        "Scattering of building materials",
        "Shares of the power that walls mirror and scatter, against frequency, angle and roughness.",
    ),
    Experiment(
        "principle",
        "The principle of mirror folding",
        "The principle",
        "One mirror, then two: a ghost behind each mirror, a single and a double fold.",
    ),
    Experiment(
        "two-walls",
        "Two walls, step by step",
        "Fig. 4 (a) to (e)",
        "Two walls, a hidden corner and a hidden arc, by rays and by full wave: the initial image, what is mirror, "
        "shadow and object in it, each generation folded, and the corrected image against the truth.",
    ),
    Experiment(
        "tree",
        "The tree of mirrors",
        "The hierarchy of mirrors and objects",
        "The trees of two scenes with two walls, in the published notation, each node against the images of the true "
        "walls.",
    ),
    Experiment(
        "drywall-mannequin",
        "A mannequin around a drywall, and the foil under its shirt",
        "Fig. 5",
        "A raster scan of a drywall at an oblique angle shows a mannequin beside the field of view: where the wall is, "
        "how thick it appears and why, the body's outline and pose, and an L of foil on its chest, with a control.",
        extra="mesh",
    ),
    Experiment(
        "corridor",
        "Around the corner of a corridor",
        "Fig. 6",
        "A raster scan of two walls at right angles, one of which shows a mannequin, a wall and a metal box around the "
        "corner: the angle between the walls, what is folded where, how bright the box is and why.",
        extra="mesh",
    ),
    Experiment(
        "synthetic-aperture",
        "Drywall, carpet roll and boxes by synthetic apertures",
        "Fig. 7",
        "81 x 81 positions of two stages, through Touchstone files and calibration, folded about a drywall.",
    ),
    Experiment(
        "resolution",
        "Resolution, directly and after folds",
        "The abstract and Section II",
        "Widths of a point and errors of its place, in line of sight and after one to three folds, against theory.",
    ),
    Experiment(
        "runtime",
        "How long imaging and folding take",
        "The computing time",
        "The initial image and the folding at the published size and larger ones, on this machine, with the image's "
        "error against the float64 sum.",
    ),
    Experiment(
        "frequency",
        "Two walls from 60 GHz to 1 THz",
        "",
        "How well two-wall scenes are folded, against frequency, roughness, aperture and bandwidth.",
    ),
    Experiment(
        "bounces",
        "How far folding carries: one to five bounces",
        "",
        "Targets that are seen by way of one to five walls: accuracy and completeness, against the link budget.",
    ),
    Experiment(
        "errors",
        "Errors of mirrors and antennas, fold by fold",
        "",
        "Mirrors and antennas are displaced by known errors; what is folded then is compared with their propagation.",
    ),
    Experiment(
        "sparse",
        "Few channels and metasurfaces",
        "",
        "Random channels, frequencies, elements or modes, imaged by delay and sum and by sparse reconstruction, and "
        "folded: how few will do.",
        extra="sparse",
    ),
    Experiment(
        "convex",
        "A pillar as a mirror",
        "The remark on curved walls",
        "What a convex mirror adds to the field of view and what it costs in resolution and level; random scenes that "
        "nothing but a pillar shows, folded about the arc that was found.",
    ),
    Experiment(
        "semi-transparent",
        "In the mirror or through it",
        "The proposal of two polarizations",
        "Random scenes with a half-transparent wall: which share of the echoes behind it is rightly taken for "
        "reflected, or passed, with one polarization and with two, against incidence and noise; and where what passed "
        "stands.",
    ),
)

EXPERIMENTS = {experiment.name: experiment for experiment in _ALL}
"""All experiments by name."""


def chosen(names: str | Sequence[str]) -> list[Experiment]:
    """The experiments of these names, in the order of the catalogue; all of them for ``"all"``.

    Raises
    ------
    InputError
        If a name is not known, or an extra that one of the experiments needs is missing.
    """
    wanted = [names] if isinstance(names, str) else listed("names", names)
    if not wanted:
        raise InputError(f"names is empty, expected some of: all, {', '.join(EXPERIMENTS)}")
    for name in wanted:
        if not isinstance(name, str) or (name not in EXPERIMENTS and name != "all"):
            raise InputError(
                f"experiment {in_message(name)} is not known, expected one of: all, {', '.join(EXPERIMENTS)}"
            )
    found = [one for name, one in EXPERIMENTS.items() if name in wanted or "all" in wanted]
    for experiment in found:
        experiment.check_installed()
    return found
