"""Proposes a mapping for a file, from the names, sizes and values of its variables, and tries it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from mirrorfold.errors import InputError
from mirrorfold.io.guessing.place_search import LARGEST_LOOKED_AT
from mirrorfold.io.guessing.proposal import OTHER_FILE_MARK, Finding, Guess
from mirrorfold.io.guessing.recognition import Search
from mirrorfold.io.mapping.assembly import assemble
from mirrorfold.io.mapping.model import Mapping
from mirrorfold.io.mapping.strict import validated
from mirrorfold.io.readers import Contents, Variable, read_contents

MOST_TABLES = 20
"""Largest number of tables beside a table that are looked at."""


def guess_mapping(path: str | Path, *, reader: str | None = None) -> Guess:
    """Guess what the variables of a file are, as a proposed mapping.

    Parameters
    ----------
    path : path
    reader : str, optional

    Returns
    -------
    Guess

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    contents = read_contents(path, reader)
    guess = Guess(contents.path)
    if contents.mapping is not None:
        guess.entries = dict(contents.mapping)
        guess.findings.append(Finding(f"a file of the reader {contents.reader!r}", "sure", "it describes itself"))
    elif contents.spectra is not None:
        names = ", ".join(contents.spectra.parameters)
        guess.findings.append(
            Finding(f"{names} against frequency", "sure", f"a file of the reader {contents.reader!r}")
        )
        guess.missing.append("such files hold no positions: import them with --positions TABLE instead of a mapping")
        return guess
    else:
        Search(_with_tables(contents), guess).run()
    _try(contents, guess)
    return guess


def _try(contents: Contents, guess: Guess) -> None:
    """Try the proposal: note the sweep that it makes, or what is missing."""
    if guess.missing or "s" not in guess.entries:
        return
    try:
        sweep = assemble(contents, validated(Mapping, guess.entries, "the proposal"))
    except InputError as error:
        guess.missing.append(str(error))
        return
    shape = ", ".join(f"{name} {size}" for name, size in zip(sweep["s"].dims, sweep["s"].shape, strict=True))
    band = sweep["frequency"].values[[0, -1]]
    guess.works = f"s({shape}), {band[0]:.6g} to {band[1]:.6g} Hz"


def _with_tables(contents: Contents) -> Contents:
    """The contents of a table, with the tables beside it and their columns by `OTHER_FILE_MARK`, file and column."""
    if contents.reader != "table":
        return contents
    variables = dict(contents.variables)
    for path in sorted(contents.path.parent.glob("*.csv"))[:MOST_TABLES]:
        if path.samefile(contents.path) or path.stat().st_size > LARGEST_LOOKED_AT:
            continue
        with suppress(InputError):  # a file beside it that is no table is ignored
            values = np.asarray(read_contents(path, "table").array("table"))
            if np.iscomplexobj(values):
                continue
            variables[f"{OTHER_FILE_MARK}{path.name}"] = Variable.of(values)
            if values.shape[1] > 1:
                for column in range(values.shape[1]):
                    variables[f"{OTHER_FILE_MARK}{path.name}{OTHER_FILE_MARK}{column}"] = Variable.of(values[:, column])
    return replace(contents, variables=variables)
