"""The section of the documentation on the published experiments, from the folder that `mirrorfold reproduce` has made.

    python docs/reproduced.py build/reproduced

`make reproduced` runs both. Pages and small pictures go to `docs/reproduced/`.
"""

from __future__ import annotations

import argparse
import re
import shutil
from pathlib import Path

from PIL import Image

from mirrorfold.reproducing import EXPERIMENTS
from mirrorfold.reproducing.findings import Result
from mirrorfold.reproducing.pages import index_markdown
from mirrorfold.reproducing.run import PAGE, RESULT, read_result

WIDTH, COLOURS = 800, 128
"""Of the pictures: as wide as a page, and as many colours as a map of levels shows [pixels]."""

HERE = Path(__file__).resolve().parent / "reproduced"


def write(source: Path) -> list[Result]:
    """Write the section; returns what is in it."""
    results = [found for name in EXPERIMENTS if (found := read_result(source / name / RESULT)) is not None]
    shutil.rmtree(HERE, ignore_errors=True)
    HERE.mkdir()
    for result in results:
        folder = source / result.name
        text = (folder / PAGE).read_text(encoding="utf-8")
        text = re.sub(r"\]\(([\w-]+)\.png\)", rf"]({result.name}-\1.png)", text)
        (HERE / f"{result.name}.md").write_text(text, encoding="utf-8")
        for picture in result.pictures:
            _shrink(folder / f"{picture.file}.png", HERE / f"{result.name}-{picture.file}.png")
    index = re.sub(r"\]\(([\w-]+)/page\.md\)", r"](\1.md)", index_markdown(results))
    toctree = ["", "```{toctree}", ":hidden:", "", *(result.name for result in results), "```", ""]
    (HERE / "index.md").write_text(index + "\n".join(toctree), encoding="utf-8")
    return results


def _shrink(source: Path, target: Path) -> None:
    """A smaller copy of a picture."""
    with Image.open(source) as picture:
        height = round(picture.height * min(1.0, WIDTH / picture.width))
        small = picture.convert("RGB").resize((min(WIDTH, picture.width), height), Image.Resampling.LANCZOS)
        small.quantize(COLOURS).save(target, optimize=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", type=Path, help="folder that `mirrorfold reproduce` has made")
    for made in write(parser.parse_args().source):
        print(f"{made.name}: {len(made.claims)} claims, {made.seconds:.0f} s")
