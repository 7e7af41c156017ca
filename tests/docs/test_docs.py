"""The documentation: every link of a page leads somewhere; the site is built without warnings and needs no network."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *(ROOT / name for name in ("README.md", "CHANGELOG.md")),
    *sorted(path for path in (ROOT / "docs").rglob("*.md") if "_build" not in path.parts),
]
"""Pages as they are read on a code host; those that a build of the site has left among them are left out below."""

MADE = ("docs/gallery", "docs/explanation/index.md", "docs/reference/commands.md", "docs/reference/json.md")


def anchors(page):
    """Of the headings of a page, as code hosts make them."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    words = [re.sub(r"[^\w\- ]", "", title.lower()) for title in re.findall(r"^#+ (.*?)\s*$", text, flags=re.MULTILINE)]
    return {title.replace(" ", "-") for title in words}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files_and_headings(page):
    """Without Sphinx: what a build makes is not there on a code host."""
    if str(page.relative_to(ROOT)).startswith(MADE):
        pytest.skip("made by a build of the site")
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)", text):
        if target.startswith(("http", "mailto")):
            continue
        path, _, anchor = target.partition("#")
        led = (page.parent / path).resolve() if path else page
        assert led.exists(), f"{page.name} leads to {target}"
        assert not str(led.relative_to(ROOT)).startswith(MADE), f"{page.name} leads to {target}, which a build makes"
        assert not anchor or anchor in anchors(led), f"{page.name} leads to {target}, and no heading is called so"


def test_the_glossary_has_the_words_of_commands_and_files():
    text = (ROOT / "docs/glossary.md").read_text(encoding="utf-8")
    words = {
        word for cell in re.findall(r"^\| \*\*(.*?)\*\* \|", text, flags=re.MULTILINE) for word in cell.split(", ")
    }
    assert words >= {
        *("sweep", "fold", "chain", "strength", "fill", "range end", "cell", "generation", "mirror", "face", "echo"),
        *("view", "parent", "bounce", "shadow", "ghost", "confidence", "pitch", "aperture", "background"),
    }
    assert "glossary.md" in (ROOT / "docs/index.md").read_text(encoding="utf-8")


def test_the_readme_opens_with_the_picture_and_is_short():
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert lines[2].startswith("![")
    assert len(lines) <= 90


@pytest.mark.slow
def test_the_steps_can_be_called_one_by_one_as_the_page_on_architecture_says(capsys):
    page = (ROOT / "docs/development/architecture.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page.split("## Using one step alone")[1].split("\n## ")[0], re.DOTALL)
    left = {}
    exec(compile(code, "architecture.md", "exec"), left)
    printed = capsys.readouterr().out
    assert "radar: " in printed
    assert len(left["tree"].mirrors) >= 2
    assert left["points"].bounces.max() >= 1


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built from a copy with its gallery as text."""
    pytest.importorskip("sphinx", reason="the extra mirrorfold[docs] has Sphinx, which is absent")
    pytest.importorskip("sphinx_gallery", reason="the extra mirrorfold[docs] has it")
    folder = tmp_path_factory.mktemp("copy")
    for name in ("docs", "examples", "src", "benchmarks"):
        ignored = shutil.ignore_patterns("_build", "__pycache__", "gallery", "generated")
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", folder)
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-D", "plot_gallery=0"]
    result = subprocess.run([*command, "docs", "html"], cwd=folder, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return folder / "html"


@pytest.mark.slow
def test_the_site_fetches_nothing(site):
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 60
    fetched = re.compile(r"""<(?:script|img|link|iframe|source|video)\b[^>]*\b(?:src|href)=["'](?:https?:)?//""")
    for page in pages:
        assert not fetched.search(page.read_text(encoding="utf-8")), page
    for sheet in site.rglob("*.css"):
        assert not re.search(r"(?:url\(|@import)\s*['\"]?(?:https?:)?//", sheet.read_text(encoding="utf-8")), sheet


@pytest.mark.slow
def test_every_name_has_a_page(site):
    import mirrorfold as mf

    listed = (site / "reference" / "python.html").read_text(encoding="utf-8")
    for name in mf.__all__:
        assert re.search(rf"\b{name}\b", listed), name
    commands = (site / "reference" / "commands.html").read_text(encoding="utf-8")
    from mirrorfold.cli import VERBS

    for verb in VERBS:
        assert f'id="{verb}"' in commands


@pytest.mark.slow
def test_pages_open_without_errors_or_requests(site, chromium):
    page = chromium.new_page()
    complaints, requests = [], []
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    for name in (
        "index",
        "quickstart",
        "explanation/algorithm",
        "reference/json",
        "development/architecture",
        "search",
    ):
        page.goto((site / f"{name}.html").as_uri())
        page.wait_for_load_state("load")
        broken = page.evaluate("() => [...document.images].filter((i) => !i.naturalWidth).map((i) => i.src)")
        assert broken == []
        assert all(page.evaluate("() => [...document.images].map((i) => i.alt.length > 0)"))
    page.close()
    assert complaints == []
    assert [url for url in requests if not url.startswith(("file:", "data:"))] == []
