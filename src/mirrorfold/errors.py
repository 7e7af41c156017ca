"""The one error type that mirrorfold raises for wrong input."""

from __future__ import annotations


class InputError(ValueError):
    """Wrong input: one plain sentence with what was expected, what was found, where, and the remedy.

    The command line prints the sentence and exits with code 2.
    """
