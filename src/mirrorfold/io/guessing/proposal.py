"""A proposed mapping: what was found in a file, how sure that is, and the text of the mapping file."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tomli_w

CERTAINTIES = ("sure", "likely", "a guess")
"""How sure a finding is: name, size and values agree; two of these do; only a single one tells it."""


@dataclass
class Finding:
    """What was inferred about a file, how sure it is (one of `CERTAINTIES`), and why."""

    what: str
    sure: str
    why: str


@dataclass
class Guess:
    """A proposed mapping.

    Attributes
    ----------
    path : Path
    findings : list of Finding
    entries : dict
        The mapping, as its TOML file would hold it.
    missing : list of str
        What has to be added by hand, in sentences.
    works : str
        The sweep that the mapping makes, in words; empty if it does not make one yet.
    """

    path: Path
    findings: list[Finding] = field(default_factory=list)
    entries: dict[str, Any] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)
    works: str = ""

    def to_toml(self) -> str:
        """The text of the mapping file, ready to be saved."""
        lines = [f"# Proposed for {self.path.name}; check it before you trust the image."]
        lines += ["# An entry without a table goes above the first [table], a new table anywhere below."]
        lines += [f"# {finding.sure}: {finding.what} ({finding.why})" for finding in self.findings]
        lines += [f"# TO DO: {sentence}" for sentence in self.missing]
        return "\n".join([*lines, tomli_w.dumps(self.entries)])


OTHER_FILE_MARK = "|"
"""First letter of the names of variables that are in other files."""


def plain(text: str) -> str:
    """A sentence in which the names of variables in other files are written for people: file and column."""
    return re.sub(r"'\|([^'|]+)(?:\|(\d+))?'", lambda m: f"{m[1]} column {m[2]}" if m[2] else m[1], text)


def source(name: str) -> Any:
    """What a mapping file holds for a row of numbers: the name of a variable, or file and column."""
    if not name.startswith(OTHER_FILE_MARK):
        return name
    file, _, column = name[1:].partition(OTHER_FILE_MARK)
    return {"file": file, "column": int(column)} if column else {"file": file}
