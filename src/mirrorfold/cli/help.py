"""The help of a verb as plain text, for pipes, files and screen readers: options on the left, meanings on the right."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cyclopts.help import HelpEntry, HelpPanel
    from rich.console import Console, ConsoleOptions

NAMES_WIDTH = 28
"""Width of the column with the names of options [characters]; longer names get a line of their own."""

LEAST_TEXT = 30
"""Least width of the column with the meanings, even in a narrow window [characters]."""


class PlainHelp:
    """Formats help without boxes and colours, in two columns."""

    def __call__(self, console: Console, options: ConsoleOptions, panel: HelpPanel) -> None:
        """Print one group of options or verbs."""
        if not panel.entries:
            return
        _print(console, f"{_text(panel.title)}:")
        width = max(console.width - NAMES_WIDTH - 4, LEAST_TEXT)
        for entry in panel.entries:
            names = ", ".join(entry.display_labels_with_metavar)
            lines = textwrap.wrap(_meaning(entry), width, break_on_hyphens=False) or [""]
            if len(names) > NAMES_WIDTH:
                _print(console, f"  {names}")
                names = ""
            for line in lines:
                _print(console, f"  {names:<{NAMES_WIDTH}}  {line}".rstrip())
                names = ""
        console.print()

    def render_usage(self, console: Console, options: ConsoleOptions, usage: Any) -> None:
        """Print how the verb is called."""
        text = _text(usage)
        if text:
            text = text if text.startswith("Usage:") else f"Usage: {text}"
            _print(console, textwrap.fill(text, console.width, subsequent_indent="    ", break_on_hyphens=False))
            console.print()

    def render_description(self, console: Console, options: ConsoleOptions, description: Any) -> None:
        """Print the purpose of the verb."""
        text = _text(description)
        if text:
            _print(console, textwrap.fill(text, console.width, break_on_hyphens=False))
            console.print()


def _meaning(entry: HelpEntry) -> str:
    """The meaning of an option, with its choices and its default."""
    parts = [_text(entry.description)]
    if entry.choices:
        parts.append(f"[{', '.join(entry.choices)}]")
    if entry.default not in (None, "False", False):
        parts.append(f"[default: {entry.default}]")
    if entry.required:
        parts.append("[required]")
    return " ".join(filter(None, parts))


def _text(words: Any) -> str:
    """A string, or a text or other renderable of the library rich, as one line without colours."""
    if words is None:
        return ""
    if not isinstance(words, str) and not hasattr(words, "plain") and hasattr(words, "__rich_console__"):
        import io

        from rich.console import Console

        console = Console(file=io.StringIO(), width=10_000, no_color=True, force_terminal=False)
        with console.capture() as captured:
            console.print(words, end="")
        return " ".join(captured.get().split())
    return " ".join(str(getattr(words, "plain", words)).split())


def _print(console: Console, line: str) -> None:
    """Print a line as it is, without wrapping or highlighting."""
    console.print(line, highlight=False, markup=False, soft_wrap=True)
