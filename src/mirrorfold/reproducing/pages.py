"""Pages on the experiments: one in Markdown for each, an index, and one HTML page with everything, to read offline."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path

from mirrorfold.reproducing.findings import PAPER, Claim, Result, Table

TITLE = "The published experiments, made anew"

LEGEND = (
    "agrees: our number agrees with the claim; differs: it does not, and the page of the experiment says why; "
    "new: the publication leaves it open."
)

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
img { max-width: 100%; } table { border-collapse: collapse; margin: 1rem 0; font-size: 0.9em; }
th, td { border: 1px solid #bbb; padding: 0.3rem 0.6rem; text-align: left; vertical-align: top; }
figure { margin: 1.5rem 0; } figcaption { font-size: 0.9em; color: #555; } code { background: #f0f0f0; }
.agrees { color: #0a6b2e; } .differs { color: #b3261e; } .new { color: #0b57d0; } section { margin-top: 4rem; }
.wide { overflow-x: auto; }
"""


def page_markdown(result: Result) -> str:
    """The page on one experiment, as Markdown."""
    lines = [
        f"# {result.title}",
        "",
        _source(result),
        "",
        result.purpose,
        "",
        f"    {result.command}",
        "",
        _cost(result),
    ]
    lines += ["", "## Claims", "", *_table(_claims(result.claims))]
    for picture in result.pictures:
        lines += ["", f"![{_plain(picture.caption)}]({picture.file}.png)", "", f"*{picture.caption}*"]
    for table in result.tables:
        lines += ["", f"## {table.title}", "", *_table(table)]
    if result.text:
        lines += ["", "## What can be learnt"]
        lines += [line for paragraph in result.text for line in ("", paragraph)]
    if result.assumptions:
        lines += ["", "## What was assumed", "", *(f"* {one}" for one in result.assumptions)]
    return "\n".join(lines) + "\n"


def index_markdown(results: Sequence[Result]) -> str:
    """The index as Markdown: the claims of all experiments in one table, with links to the pages."""
    lines = [f"# {TITLE}", "", f"The publication is {PAPER}.", "", LEGEND, ""]
    rows = [
        [f"[{one.name}]({one.name}/page.md)" if first else "", claim.claim, claim.measured, claim.verdict]
        for one in results
        for first, claim in _marked(one.claims)
    ]
    lines += _table(Table(title="", columns=["experiment", "claim", "here", "verdict"], rows=rows))
    quick = [one.name for one in results if one.quick]
    if quick:
        lines += ["", f"At reduced size: {', '.join(quick)}."]
    return "\n".join(lines) + "\n"


def to_html(results: Sequence[Result], folder: Path) -> str:
    """One HTML page with the index, all experiments and their pictures, which are read from `folder`."""
    rows = [
        [f'<a href="#{one.name}">{one.name}</a>' if first else "", escape(claim.claim), escape(claim.measured),
         _coloured(claim)]
        for one in results
        for first, claim in _marked(one.claims)
    ]  # fmt: skip
    body = [f"<h1>{TITLE}</h1>", f"<p>The publication is {escape(PAPER)}. {escape(LEGEND)}</p>"]
    body += [_html_table(["experiment", "claim", "here", "verdict"], rows)]
    for result in results:
        body += [f'<section id="{result.name}"><h2>{escape(result.title)}</h2>']
        body += [f"<p>{escape(text)}</p>" for text in (_source(result), result.purpose, _cost(result))]
        body += [f"<p><code>{escape(result.command)}</code></p>"]
        table = _claims(result.claims)
        cells = [
            [*map(escape, row[:3]), _coloured(claim), escape(row[4])]
            for row, claim in zip(table.rows, result.claims, strict=True)
        ]
        body += [_html_table(table.columns, cells)]
        for picture in result.pictures:
            data = base64.b64encode((folder / result.name / f"{picture.file}.png").read_bytes()).decode("ascii")
            caption = escape(picture.caption)
            body += [f'<figure><img alt="{caption}" src="data:image/png;base64,{data}">']
            body += [f"<figcaption>{caption}</figcaption></figure>"]
        for one in result.tables:
            body += [f"<h3>{escape(one.title)}</h3>"]
            body += [_html_table(one.columns, [list(map(escape, row)) for row in one.rows])]
        body += [f"<p>{escape(text)}</p>" for text in result.text]
        if result.assumptions:
            body += ["<h3>What was assumed</h3><ul>", *(f"<li>{escape(one)}</li>" for one in result.assumptions)]
            body += ["</ul>"]
        body += ["</section>"]
    policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
    head = f'<meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="{policy}">'
    head += '<meta name="viewport" content="width=device-width, initial-scale=1">'
    head += f"<title>{TITLE}</title><style>{STYLE}</style>"
    return f'<!doctype html>\n<html lang="en"><head>{head}</head>\n<body>\n' + "\n".join(body) + "\n</body></html>\n"


def _source(result: Result) -> str:
    """The sentence that names the published figure, or says that the publication leaves the question open."""
    return f"{result.source} of {PAPER}." if result.source else f"A question that {PAPER}, leave open."


def _cost(result: Result) -> str:
    """The sentence that tells the size of the run, the version of mirrorfold, and the time that the run took."""
    minutes, seconds = divmod(round(result.seconds), 60)
    took = f"{minutes} min {seconds} s" if minutes else f"{seconds} s"
    size = "at reduced size" if result.quick else "at full size"
    return f"Made {size} by mirrorfold {result.version} in {took}."


def _claims(claims: Sequence[Claim]) -> Table:
    """The claims of an experiment as a table."""
    rows = [[claim.claim, claim.source, claim.measured, claim.verdict, claim.why] for claim in claims]
    return Table(title="Claims", columns=["claim", "where", "here", "verdict", "why"], rows=rows)


def _marked(claims: Sequence[Claim]) -> list[tuple[bool, Claim]]:
    """Each claim, after a mark that is true for the first claim: its row in the index names the experiment."""
    return [(number == 0, claim) for number, claim in enumerate(claims)]


def _table(table: Table) -> list[str]:
    """The lines of a table in Markdown."""
    rows = [table.columns, ["---"] * len(table.columns), *table.rows]
    return ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]


def _html_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table as HTML. The cells of `rows` are HTML already; the names of the columns are plain text."""
    head = "".join(f"<th>{escape(column)}</th>" for column in columns)
    lines = "\n".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return f'<div class="wide"><table><tr>{head}</tr>\n{lines}</table></div>'


def _coloured(claim: Claim) -> str:
    """The verdict on a claim, as HTML in its colour."""
    return f'<b class="{claim.verdict}">{claim.verdict}</b>'


def _plain(text: str) -> str:
    """A caption without square brackets, because Markdown puts it into square brackets before a picture's address."""
    return text.replace("[", "(").replace("]", ")")
