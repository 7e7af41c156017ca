"""Pages played: the commands and snippets of a page run in their order, and print what the page shows."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

from mirrorfold.cli import main

ROOT = Path(__file__).resolve().parents[2]

BLOCK = re.compile(r"^(?:```(console|python)\n(.*?)^```$|((?:^ {4}mirrorfold [^\n]*\n)+))", re.DOTALL | re.MULTILINE)

NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")

TOLERANCE = 0.6
"""Of numbers that a page shows rounded, in units of their last digit."""


@dataclass(frozen=True)
class Step:
    """A command with the lines that the page shows below it, or a snippet of Python."""

    kind: str
    text: str
    shown: tuple[str, ...] = ()


def steps(page: str) -> list[Step]:
    """What a page of the docs asks its reader to run, in the page's order."""
    found = []
    for match in BLOCK.finditer((ROOT / page).read_text(encoding="utf-8")):
        kind, text = match[1] or "console", match[2] or re.sub(r"^ {4}", "$ ", match[3], flags=re.MULTILINE)
        if kind == "python":
            found.append(Step(kind, text))
        elif kind == "console":
            text = re.sub(r"\\\n\s*(?:\$ )?", "", text)
            for one in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
                command, *shown = one.rstrip().split("\n")
                found.append(Step(kind, re.sub(r"\s#\s.*", "", command).strip(), tuple(line for line in shown if line)))
    return found


def play(step: Step, capsys, names: dict) -> str:
    """Run a step as its reader would, and compare what it prints with what the page shows; returns what it printed."""
    capsys.readouterr()
    if step.kind == "python":
        exec(compile(step.text, "page", "exec"), names)
        return capsys.readouterr().out
    program, *arguments = shlex.split(step.text)
    assert program == "mirrorfold", f"{step.text}: is for another program"
    status = main(arguments)
    printed = capsys.readouterr()
    assert status == 0, f"{step.text}: {printed.err}"
    lines = [" ".join(line.split()) for line in printed.out.splitlines()]
    for line in step.shown:
        assert any(_same(" ".join(line.split()), one) for one in lines), (
            f"{step.text} does not print {line!r}:\n{printed.out}"
        )
    return printed.out


def _same(shown: str, printed: str) -> bool:
    """Whether two lines are the same but for the rounding of numbers."""
    if NUMBER.sub("0", shown) != NUMBER.sub("0", printed):
        return False
    for a, b in zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=True):
        digits = len(a.split(".")[1]) if "." in a and "e" not in a.lower() else 0
        if abs(float(a) - float(b)) > TOLERANCE * 10.0**-digits:
            return False
    return True
