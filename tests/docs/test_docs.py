"""The documentation: every link of a page leads somewhere, the program understands the commands that are shown,
promises name tests that exist, the files of a release agree with the package; the site is built without warnings and
needs no network.
"""

from __future__ import annotations

import pkgutil
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from cyclopts import CycloptsError, MissingArgumentError

import mirrorfold as mf
from mirrorfold.cli import VERBS

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *sorted(ROOT.glob("*.md")),
    ROOT / ".github/pull_request_template.md",
    *sorted(path for path in (ROOT / "docs").rglob("*.md") if "_build" not in path.parts),
]
"""Pages as they are read on a code host; those that a build of the site has left among them are left out below."""

NONE_YET = ("examples/plot_NAME.py", "src/mirrorfold/_version.py")
"""Files that are named and need not exist: one to write, one that comes with an installation."""

TEMPLATES = sorted((ROOT / ".github").rglob("*.yml"))
"""Forms for issues, and workflows, which run commands."""

MADE = ("docs/gallery", "docs/explanation/index.md", "docs/reference/commands.md", "docs/reference/json.md")


def skip_if_made(page):
    if str(page.relative_to(ROOT)).startswith(MADE):
        pytest.skip("made by a build of the site")


def anchors(page):
    """Of the headings of a page, as code hosts make them."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    words = [re.sub(r"[^\w\- ]", "", title.lower()) for title in re.findall(r"^#+ (.*?)\s*$", text, flags=re.MULTILINE)]
    return {title.replace(" ", "-") for title in words}


def links(page):
    """Where the links of a page lead, those in examples left out."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.findall(r"\]\(([^)\s]+)", text)


def test_pages_hold_links():
    """Many pages have none, so it is the sum that tells that they are found."""
    assert sum(len(links(page)) for page in PAGES) > 100


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files_and_headings(page):
    """Without Sphinx: what a build makes is not there on a code host."""
    skip_if_made(page)
    for target in links(page):
        if target.startswith(("http", "mailto")):
            continue
        path, _, anchor = target.partition("#")
        assert path or not anchor[:1].isdigit(), f"{page.name} leads to {target}, which the site does not find: a digit"
        led = (page.parent / path).resolve() if path else page
        assert led.exists(), f"{page.name} leads to {target}"
        assert not str(led.relative_to(ROOT)).startswith(MADE), f"{page.name} leads to {target}, which a build makes"
        assert not anchor or anchor in anchors(led), f"{page.name} leads to {target}, and no heading is called so"


def test_files_that_pages_and_settings_name_exist():
    files = [*PAGES, *(ROOT / ".github").rglob("*.yml"), ROOT / "pyproject.toml", ROOT / "Makefile"]
    folders = "asv_bench|benchmarks|conda|docs|examples|src|tests"
    named = re.compile(rf"(?<![\w./-])(?:{folders})/[\w./-]+\.(?:py|toml|json|yaml)\b")
    names = [(file, name) for file in files for name in named.findall(file.read_text(encoding="utf-8"))]
    assert len(names) > 10
    for file, name in names:
        assert (ROOT / name).exists() or name in NONE_YET, f"{file.name} names {name}"


def test_modules_and_functions_that_pages_name_exist():
    package = ROOT / "src/mirrorfold"
    modules = {path.name for path in ROOT.rglob("*.py") if ".venv" not in path.parts[len(ROOT.parts)]}
    folders = "|".join(sorted(path.name for path in package.iterdir() if (path / "__init__.py").exists()))
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for name in re.findall(r"`(?:[a-z_]+/)*([a-z_]+\.py)`", text):
            assert name in modules, f"{page.name} names {name}"
        for name in re.findall(rf"`(?:mirrorfold\.)?((?:{folders})(?:\.[A-Za-z_]+)+)`", text):
            if name.endswith((".py", ".jsonl")):
                continue
            try:
                pkgutil.resolve_name(f"mirrorfold.{name}")
            except (AttributeError, ImportError):
                pytest.fail(f"{page.name} names {name}")


def commands(text):
    """The commands of a page, as words: lines of its blocks, and what stands in back quotes among its sentences."""
    text = re.sub(r"\\\n\s*", " ", text)
    lines = re.findall(r"^(?:\$ | {4}|\s*- run: )(mirrorfold .*)$", text, flags=re.MULTILINE)
    quoted = re.findall(r"`(mirrorfold [^`]+)`", re.sub(r"```.*?```", "", text, flags=re.DOTALL))
    whole = [re.split(r" [|>;&]", command)[0] for command in (*lines, *quoted)]
    return [words for command in whole for words in [shlex.split(command, comments=True)[1:]] if words]


def complaint(words):
    """What the program says of the words of a command, without running it; None if it understands them.

    A command that is shortened with ``...`` or is only named may lack arguments, and one with placeholders in
    brackets is not for typing.
    """
    from mirrorfold.cli.program import app

    verb, *rest = words
    if verb.startswith("--") or verb == verb.upper() or any(word.startswith("[") for word in rest):
        return None
    if verb not in VERBS:
        return f"{verb!r} is no verb"
    try:
        app.parse_args([word for word in words if word != "..."], print_error=False, exit_on_error=False)
    except MissingArgumentError:
        return None
    except CycloptsError as error:
        return " ".join(str(error).split())
    return None


def test_pages_show_commands():
    assert sum(len(commands(page.read_text(encoding="utf-8"))) for page in (*PAGES, *TEMPLATES)) > 100


@pytest.mark.parametrize("page", [*PAGES, *TEMPLATES], ids=lambda page: str(page.relative_to(ROOT)))
def test_the_program_understands_what_pages_show(page):
    skip_if_made(page)
    for words in commands(page.read_text(encoding="utf-8")):
        assert complaint(words) is None, f"{page.name}: {shlex.join(['mirrorfold', *words])}"


@pytest.mark.parametrize(
    ("shown", "said"),
    [
        ("$ mirrorfold unfold image.nc -o out.nc", "'unfold' is no verb"),
        ("$ mirrorfold fold image.nc \\\n    -o out.nc --thresholds -20  # dB", "--thresholds"),
        ("    mirrorfold simulate scene.toml -o sweep.nc --solver waves", "waves"),
        ("is written by `mirrorfold focus\nsweep.nc --tolerance small`.", "small"),
    ],
)
def test_what_the_program_does_not_understand_is_found(shown, said):
    (words,) = commands(shown)
    assert said in complaint(words)


def test_what_pages_show_as_toml_is_toml():
    shown = [
        (page, block)
        for page in PAGES
        for block in re.findall(
            r"^```toml\n(.*?)^```", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
        )
    ]
    assert len(shown) > 5
    for page, block in shown:
        try:
            tomllib.loads(block)
        except tomllib.TOMLDecodeError as error:
            pytest.fail(f"{page.name}: {error} in\n{block}")


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


def test_every_picture_is_shown_by_a_page():
    pages = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    pictures = [*(ROOT / "docs/pictures").glob("*.png"), *(ROOT / "docs/reproduced").glob("*.png")]
    assert [picture.name for picture in pictures if picture.name not in pages] == []


def test_the_readme_opens_with_the_picture_and_is_short():
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert lines[2].startswith("![")
    assert len(lines) <= 90


def test_every_promise_names_tests_that_exist():
    page = (ROOT / "docs/reliability.md").read_text(encoding="utf-8")
    rows = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| ")]
    assert all(len(cells) == 4 for cells in rows)
    promises = [(tested, command) for name, tested, _, command in rows if name != "promise"]
    assert len(promises) > 30
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE)
    for tested, command in promises:
        program, *words = shlex.split(command.strip("`"))
        if program == "make":
            assert words[0] in targets, command
            continue
        files, _, choice = " ".join(words).partition(" -k ")
        files, choices = files.split(), (choice or "test_").split(" or ")
        texts = {file: (ROOT / file).read_text("utf-8") for file in files}
        names = {file: re.findall(r"^def (test_\w+)", text, re.MULTILINE) for file, text in texts.items()}
        # Tests that `make test` leaves out.
        apart = re.compile(r"^@pytest\.mark\.(?:timing|replay)\b.*\n(?:(?!def ).*\n)*def (test_\w+)", re.MULTILINE)
        left_out = [name for text in texts.values() for name in apart.findall(text) if any(k in name for k in choices)]
        assert bool(left_out) == ("on an idle machine" in tested), f"{command}: {left_out or 'no test'} needs that"
        for file in files:
            assert any(part in name for part in choices for name in names[file]), f"{command}: nothing of {file}"
        for part in choices:
            assert any(part in name for file in files for name in names[file]), f"{command}: no test is called {part}"


def test_the_citation_is_of_this_package():
    yaml = pytest.importorskip("yaml", reason="PyYAML comes with dask, which is absent")
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert citation["cff-version"] == "1.2.0"
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    (latest, *_) = re.findall(r"^## \[(\d+\.\d+\.\d+)\]", changes, flags=re.MULTILINE)
    assert citation["version"] == latest
    assert "version" in project["dynamic"]
    assert re.match(r"\d+\.\d+", mf.__version__)
    for there, here in (("title", "name"), *((name, name) for name in ("authors", "license", "keywords"))):
        assert citation[there] == project[here], there
    assert citation["abstract"] == project["description"]
    (paper,) = citation["references"]
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    for words in (paper["title"], f"doi {paper['doi']}", "{volume}({issue}), {start}-{end}, {year}".format(**paper)):
        assert words in readme


def test_the_package_says_that_it_has_types():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert (Path(mf.__file__).parent / "py.typed").is_file()
    assert project["tool"]["hatch"]["build"]["targets"]["wheel"] == {"packages": ["src/mirrorfold"]}  # all of it
    assert "Typing :: Typed" in project["project"]["classifiers"]


def test_files_for_hosts_are_yaml():
    yaml = pytest.importorskip("yaml", reason="PyYAML comes with dask, which is absent")
    files = [*(ROOT / ".github").rglob("*.yml"), ROOT / ".pre-commit-config.yaml", ROOT / ".readthedocs.yaml",
             ROOT / "conda/recipe.yaml"]  # fmt: skip
    assert len(files) >= 11
    assert all(isinstance(yaml.safe_load(path.read_text(encoding="utf-8")), dict) for path in files)


def test_the_conda_recipe_asks_for_the_same_packages():
    yaml = pytest.importorskip("yaml", reason="PyYAML comes with dask, which is absent")
    recipe = yaml.safe_load((ROOT / "conda/recipe.yaml").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = {one.replace(" ", "").replace("matplotlib-base", "matplotlib") for one in recipe["requirements"]["run"]}
    assert asked == {f"python{project['requires-python']}", *project["dependencies"]}
    assert recipe["about"]["summary"] == project["description"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert f'default="{citation["version"]}"' in recipe["context"]["version"]


@pytest.mark.replay
@pytest.mark.slow
@pytest.mark.usefixtures("remembered_rays")
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
