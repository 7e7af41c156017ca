"""`make api` tells what the public face has lost, and nothing of modules that have moved."""

from __future__ import annotations

import importlib
import shutil
import subprocess
from pathlib import Path

import pytest

import mirrorfold as mf

ROOT = Path(__file__).parents[2]

RELEASE = {
    "__init__.py": "__all__ = ['fold', 'score']\ndef fold(image, *, depth): ...\ndef score(found): ...\n",
    "moved.py": "def fold(image): ...\n",
    "cli/__init__.py": "VERBS = {'fold': None}\ndef main(words):\n    print('''Parameters:\n  IMAGE, --image    Read.\n"
    "  --depth INT, -d   How deep,\n                    as --old.''')\n",
}
"""The sources of a small package with one verb."""


@pytest.fixture
def public_face(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    return importlib.import_module("public_face")


@pytest.mark.slow
def test_names_parameters_verbs_and_options_are_the_face(public_face):
    face = public_face.face()
    assert {f"mf.{name}" for name in mf.__all__} <= set(face)
    assert face["mf.fold"]["image"] == "place 1, required"
    assert face["mf.fold"]["threshold_db"] == "by name"  # a setting, declared in a class of its own
    assert {"mf.FoldPlan.fold", "mf.plot.before_after", "mf.calibrate.time_gate"} <= set(face)
    assert {"--output", "-o", "--mirrors"} <= set(face["mirrorfold fold"])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ({"fold": {}}, {"fold": {}, "score": {"scene": "place 1, required"}}, []),
        ({"fold": {}}, {}, ["fold is gone"]),
        ({"fold": {"depth": "by name"}}, {"fold": {}}, ["fold no longer takes depth"]),
        ({"fold": {}}, {"fold": {"depth": "by name"}}, []),
        ({"fold": {}}, {"fold": {"depth": "by name, required"}}, ["fold requires depth"]),
        ({"fold": {"x": "place 1"}}, {"fold": {"x": "place 1, required"}}, ["fold requires x"]),
        ({"fold": {"x": "place 1, required"}}, {"fold": {"x": "place 1"}}, []),
        ({"fold": {"x": "place 1"}}, {"fold": {"x": "by name"}}, ["fold takes x in another place"]),
        ({"fold": {"x": "by name"}}, {"fold": {"x": "place 1"}}, []),
    ],
)
def test_what_no_longer_works_is_lost(public_face, old, new, said):
    assert public_face.lost(old, new) == said


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("git") is None, reason="git is absent")
def test_sources_are_compared_with_those_of_the_last_tag(public_face, tmp_path, capsys):
    def write(files):
        for name, text in files.items():
            path = tmp_path / "src/mirrorfold" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    def git(*words):
        own = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false", "-c", "tag.gpgsign=false"]
        subprocess.run(["git", "-C", tmp_path, *own, *words], check=True, capture_output=True)

    write(RELEASE)
    git("init")
    git("add", ".")
    git("commit", "-m", "first")
    assert public_face.main([], tmp_path) == 0
    assert "no release yet" in capsys.readouterr().out
    git("tag", "v0.1.0")
    (tmp_path / "src/mirrorfold/moved.py").unlink()
    assert public_face.main([], tmp_path) == 0
    write({name: text.replace("depth", "floor") for name, text in RELEASE.items()})
    assert public_face.main([], tmp_path) == 1
    assert capsys.readouterr().out.splitlines()[-4:] == [
        "mf.fold no longer takes depth",
        "mf.fold requires floor",
        "mirrorfold fold no longer takes --depth",
        "3 names and parameters of v0.1.0 are lost or changed",
    ]


def test_the_reference_lists_each_name_once(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    listed = [name for names in importlib.import_module("site_pages").GROUPS.values() for name in names]
    assert len(listed) == len(set(listed))
    assert set(listed) <= set(mf.__all__)
