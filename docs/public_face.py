"""What the public face has lost since a release: names, their parameters, verbs and their options.

    python docs/public_face.py [v0.1.0]

By default since the last tag. Modules of the package are not public, and may move without being told here.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import json
import os
import re
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

Face = dict[str, dict[str, str]]
"""Each public name, and of each of its parameters: its place where it may be given by place, else "by name", and
"required" besides where it has no default."""


def face() -> Face:
    """The public face of the mirrorfold that is imported."""
    import mirrorfold as mf
    from mirrorfold.cli import VERBS, main

    found: Face = {}
    for name in mf.__all__:
        found |= described(f"mf.{name}", getattr(mf, name))
    os.environ["COLUMNS"] = "100"
    for verb in VERBS:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            main([verb, "--help"])
        entries = re.findall(r"^  (\S.*?)(?:  |$)", printed.getvalue(), flags=re.MULTILINE)
        found[f"mirrorfold {verb}"] = {
            option: "by name" for entry in entries for option in re.findall(r"(?<![\w-])--?[a-zA-Z][\w-]*", entry)
        }
    return found


def described(name: str, value: Any) -> Face:
    """A name with its parameters, and what belongs to it: functions of a module, methods of a class."""
    if isinstance(value, ModuleType):
        own = {key for key, one in vars(value).items() if inspect.isfunction(one) and one.__module__ == value.__name__}
        members = {key: getattr(value, key) for key in getattr(value, "__all__", own)}
        found: Face = {name: {}}
    else:
        members = vars(value) if inspect.isclass(value) else {}
        found = {name: _parameters(value)}
    for key, member in members.items():
        if not key.startswith("_"):
            found |= described(f"{name}.{key}", member) if inspect.isfunction(member) else {f"{name}.{key}": {}}
    return found


def _parameters(value: Any) -> dict[str, str]:
    try:
        parameters = inspect.signature(value).parameters.values()
    except (TypeError, ValueError):  # of no function, or written in C
        return {}
    return {
        one.name: ("by name" if one.kind is one.KEYWORD_ONLY else f"place {place}")
        + (", required" if one.default is one.empty else "")
        for place, one in enumerate(parameters, start=1)
        if one.kind not in (one.VAR_POSITIONAL, one.VAR_KEYWORD)
    }


def lost(old: Face, new: Face) -> list[str]:
    """What worked with the old face and does not with the new one, a line each."""
    lines = []
    for name, before in old.items():
        if name not in new:
            lines.append(f"{name} is gone")
            continue
        now = new[name]
        lines += [f"{name} no longer takes {key}" for key in before if key not in now]
        for key, how in now.items():
            if "required" in how and "required" not in before.get(key, ""):
                lines.append(f"{name} requires {key}")
            elif before.get(key, "").startswith("place") and how.split(",")[0] != before[key].split(",")[0]:
                lines.append(f"{name} takes {key} in another place")
    return lines


def face_of(source: Path) -> Face:
    """The face of the package in a folder, in a process of its own."""
    command = [sys.executable, __file__, "--print"]
    # Bytecode tells whether it is that of a source by its size and the second it was written in, and may be stale.
    environment = {**os.environ, "PYTHONPATH": str(source), "PYTHONDONTWRITEBYTECODE": "1"}
    printed = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return dict(json.loads(printed.stdout))


def main(words: list[str], repository: Path) -> int:
    """Compare, and print what is lost; returns the exit code."""

    def git(*words: str) -> bytes:
        return subprocess.run(["git", "-C", str(repository), *words], capture_output=True, check=True).stdout

    tags = words or git("tag", "--list", "v*", "--merged=HEAD", "--sort=-creatordate").decode().split()
    if not tags:
        print("there is no release yet, and nothing to compare with")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(fileobj=io.BytesIO(git("archive", tags[0], "src"))) as sources:
            sources.extractall(folder, filter="data")
        lines = lost(face_of(Path(folder) / "src"), face_of(repository / "src"))
    print("\n".join([*lines, f"{len(lines)} names and parameters of {tags[0]} are lost or changed"]))
    return 1 if lines else 0


if __name__ == "__main__":
    if sys.argv[1:] == ["--print"]:
        print(json.dumps(face()))
        sys.exit(0)
    sys.exit(main(sys.argv[1:], Path(__file__).resolve().parents[1]))
