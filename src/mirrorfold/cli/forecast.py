"""What focusing and reconstructing a sweep would take, before it is begun."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mirrorfold.cli.results import read
from mirrorfold.cli.terminal import show_info, show_json, show_options
from mirrorfold.focusing.settings import FocusSettings

if TYPE_CHECKING:
    from mirrorfold.focusing.choice_facts import Choice


def forecast(path: Path, given: dict[str, Any], *, folded: bool = False) -> Choice:
    """The choice of an algorithm for the sweep in a file; with the time of steps 2 to 6 where it is to be folded.

    Raises
    ------
    InputError
        If the sweep cannot be read, or not be imaged as is asked.
    """
    from mirrorfold.describing.planning import FOLDING_PIXELS_PER_SECOND
    from mirrorfold.focusing import choose_algorithm

    sweep = read(path, "sweep")
    own = {name: value for name, value in given.items() if name in FocusSettings.__dataclass_fields__}
    found = choose_algorithm(sweep, frames=int(sweep.sizes.get("frame", 1)), **own)
    return found.but(folding_s=found.pixels / FOLDING_PIXELS_PER_SECOND) if folded else found


def show_forecast(found: Choice, *, json: bool) -> None:
    """Print a forecast: the grid, the algorithms, and what they would take."""
    if json:
        show_json(found)
        return
    show_info({name: value for name, value in found.items() if name not in ("kind", "options")})
    if found.options:
        show_options(found.options)
