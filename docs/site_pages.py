"""The pages that are written by the code itself, so that they cannot disagree with it.

The reference of Python is one list of the flat face, the reference of the command line is what `--help` prints, and
the picture of the dependencies is drawn from the imports. None of them is kept in the repository.
"""

from __future__ import annotations

import inspect
import re
import shutil
from pathlib import Path
from types import ModuleType

import mirrorfold as mf
from mirrorfold.cli import VERBS

GROUPS = {
    "Files": ("load", "save", "import_data", "import_image", "save_touchstone", "export"),
    "Scenes and simulation": ("load_scene", "parse_scene", "Scene", "Scene3D", "simulate", "near_field"),
    "Sweeps": (
        "make_sweep", "make_monostatic_sweep", "make_raster_sweep", "check_sweep", "join_polarizations", "add_noise",
    ),
    "Before and after a measurement": ("plan", "info"),
    "From the sweep to the folded scene": (
        "focus", "FocusPlan", "FocusOperator", "plan_view", "to_voxels", "fold", "FoldPlan", "reconstruct",
        "pick_frame", "score", "benchmark", "reproduce", "compare",
    ),
    "Pages": ("report", "view"),
    "Errors": ("InputError",),
}  # fmt: skip
"""The flat face by topic; whatever is in none of them comes last."""


SITE = ("index", "quickstart", "performance", "reliability", "glossary")
"""Pages beside those of the topics."""

ORDER = (
    "focusing",
    "folding",
    "explaining",
    "curved",
    "transparent",
    "aluminium",
    "benchmarks",
    "raster",
    "fullwave",
    "plan",
    "import",
    "diagnose",
    "calibrate",
    "looking",
)
"""Topics in the order of reading; others follow by name."""


def write(folder: Path) -> None:
    """Write all of them.

    Parameters
    ----------
    folder : Path
        That of the documentation.
    """
    from dependencies import draw

    _write(folder / "explanation" / "index.md", topics(folder))
    reference = folder / "reference"
    shutil.rmtree(reference / "generated", ignore_errors=True)  # names that are gone must not keep their pages
    _write(reference / "python.rst", python_reference())
    _write(reference / "commands.md", command_reference())
    _write(reference / "json.md", json_reference())
    draw(folder / "development" / "dependencies.svg")


def to_the_gallery(text: str) -> str:
    """A page whose links to the examples, which are right in the repository, lead to their pages in the gallery."""
    text = re.sub(r"\]\(((?:\.\./)*)\.\./examples/(plot_\w+)\.py\)", r"](\1gallery/\2.rst)", text)
    return re.sub(r"\]\(((?:\.\./)*)\.\./examples\)", r"](\1gallery/index.rst)", text)


def topics(folder: Path) -> str:
    """The list of the topics that there are."""
    found = {path.stem for path in folder.glob("*.md")} - set(SITE)
    names = [name for name in ORDER if name in found] + sorted(found - set(ORDER))
    lines = [
        "# How it works",
        "",
        "Start with [the six steps](algorithm.md), which a student can follow. The other pages",
    ]
    lines += ["say how each part is done, why, and what it costs.", "", "```{toctree}", ":maxdepth: 1", "", "algorithm"]
    return "\n".join([*lines, *(f"../{name}" for name in names), "```", ""])


def python_reference() -> str:
    """The flat face, every name of it, and its modules."""
    names = [name for name in mf.__all__ if not isinstance(getattr(mf, name), ModuleType)]
    modules = [getattr(mf, name) for name in mf.__all__ if isinstance(getattr(mf, name), ModuleType)]
    groups = {title: [name for name in members if name in names] for title, members in GROUPS.items()}
    known = {name for members in GROUPS.values() for name in members}
    groups["More"] = [name for name in names if name not in known]
    lines = [*_title("Python"), "", "Everything below is a name of ``import mirrorfold as mf``.", ""]
    for title, members in groups.items():
        if members:
            lines += [*_title(title, "-"), "", *_summary("mirrorfold", list(map(_described, members))), ""]
    for module in modules:
        face = next(name for name in mf.__all__ if getattr(mf, name) is module)
        lines += [*_title(f"mf.{face}", "-"), "", _first_line(module), "", *_summary(module.__name__, _public(module))]
        lines += [""]
    return "\n".join(lines)


def command_reference() -> str:
    """What each verb's help prints."""
    import contextlib
    import io
    import os

    from mirrorfold.cli import main

    os.environ["COLUMNS"] = "68"
    lines = ["# Command line", "", "Exit codes: 0 done; 1 the work failed; 2 the arguments or the input are wrong; 130"]
    lines += ["interrupted. A wrong input gets one sentence, and nothing is left half-written. Progress goes to the"]
    lines += ["terminal alone; pipes and files get plain text, and `--json` prints [one JSON object](json.md)."]
    lines += [
        "",
        "`-o` replaces a file, or the file that a link leads to, and says so; never a folder, a device, a pipe",
    ]
    lines += [
        "or a socket. `--no-clobber` refuses to overwrite. Numbers may have [units](../units.md): `80mm`, `300GHz`."
    ]
    for name, verb in VERBS.items():
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            main([name, "--help"])
        text = printed.getvalue().strip()
        lines += ["", f"## {name}", "", verb.purpose, "", "```text", text, "```"]
    return "\n".join(lines) + "\n"


def json_reference() -> str:
    """The fields of what each verb prints with `--json`."""
    from mirrorfold.cli.schema import describe_fields, models, outputs, parts

    lines = [
        "# JSON",
        "",
        "With `--json` a verb prints one JSON object on stdout and nothing else. Numbers that are not",
    ]
    lines += [
        "finite are `null`. Lengths end in `_m`, frequencies in `_hz`, angles in `_deg`, levels in `_db`, times in"
    ]
    lines += ["`_s`. `mirrorfold schema VERB` prints the JSON Schema of a verb's output."]
    lines += ["", "A failure of any verb is one JSON object on stderr, in one line, with the exit code as always:"]
    lines += [
        "`error`, the sentence that people get; `exit_code`, 1 if the work failed, 2 if the arguments or the input"
    ]
    lines += ["are wrong, 130 if it was interrupted; `remarks`, what would have been noted on the way."]
    known: dict[type, list[str]] = {}
    for verb, output in outputs().items():
        for model in models(output):
            known.setdefault(model, []).append(verb)
    lines += ["", "| verb | prints |", "|---|---|"]
    for verb, output in outputs().items():
        names = [f"[{_heading(model)}](#{_heading(model).replace(' ', '-')})" for model in models(output)]
        lines += [f"| `{verb}` | {' or '.join(names)} |"]
    inner = [part for model in known for part in parts(model) if part not in known]
    for model in [*known, *dict.fromkeys(inner)]:
        lines += [
            "",
            f"## {_heading(model)}",
            "",
            (model.__doc__ or "").strip(),
            "",
            "| field | type | |",
            "|---|---|---|",
        ]
        lines += [f"| `{name}` | {kind} | {text} |" for name, kind, text in describe_fields(model)]
    return "\n".join(lines) + "\n"


def _heading(model: type) -> str:
    from mirrorfold.cli.schema import type_name

    return type_name(model)


def _described(name: str) -> str:
    """Where a name is described: itself, or what it stands for, where its docstring says no more than that."""
    text = inspect.getdoc(getattr(mf, name)) or ""
    found = re.search(r"see `mirrorfold\.([\w.]+)`", text)
    return f"~{found[1]}" if found and "Parameters" not in text else name


def _public(module: ModuleType) -> list[str]:
    """The functions and classes that a module means for others."""
    if hasattr(module, "__all__"):
        return sorted(module.__all__)
    return [
        name
        for name, value in vars(module).items()
        if inspect.isfunction(value) and value.__module__.startswith(module.__name__) and not name.startswith("_")
    ]


def _summary(module: str, names: list[str]) -> list[str]:
    head = [f".. currentmodule:: {module}", "", ".. autosummary::", "   :toctree: generated", "   :nosignatures:", ""]
    return [*head, *(f"   {name}" for name in names)]


def _first_line(module: ModuleType) -> str:
    return (module.__doc__ or "").strip().partition("\n\n")[0].replace("`", "``")


def _title(text: str, line: str = "=") -> list[str]:
    return [text, line * len(text)]


def _write(path: Path, text: str) -> None:
    """Write a page, but only where it has changed: Sphinx reads changed pages alone."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
