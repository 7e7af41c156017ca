"""The one error type that mirrorfold raises for wrong input, and what its sentences may quote."""

from __future__ import annotations

import re

LONG_WORD = re.compile(r"(\S{300})\S{100,}(\S{100})")
"""A word of at least 500 characters: no text for people has one, but a number of a thousand digits is one."""

UNPRINTABLE = re.compile("[\0-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Characters that steer a terminal, turn the direction of writing, or stand for bytes that are no text."""

LONGEST = 2000
"""Characters of an error message at most: nobody reads a longer one."""


def printable(text: str) -> str:
    r"""The text with U+FFFD in the place of each unprintable character: a file from a stranger may hold any of them.

    Examples
    --------
    >>> printable("\x1b[2J title, \udcff") == "\ufffd[2J title, \ufffd"
    True
    """
    return UNPRINTABLE.sub("\ufffd", text)


class InputError(ValueError):
    """Wrong input: one plain sentence with what was expected, what was found, where, and the remedy.

    The command line prints the sentence and exits with code 2. Long words in the sentence are shortened, and control
    characters, which a terminal would obey, are replaced.

    Parameters
    ----------
    sentence : str
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(shortened(sentence))


class EndedError(InputError):
    """The work has failed, but the input need not be wrong: a worker process has ended, or a method fails everywhere.

    The exit code is 1.
    """


def shortened(sentence: str) -> str:
    """The sentence as `printable` text, without the middle of words and of sentences that are too long.

    Examples
    --------
    >>> shortened("scene.toml: name is " + 1000 * "x" + ", expected a text").count("x")
    401
    >>> len(shortened(1000 * "too long "))
    1985
    """
    sentence = str(sentence)
    if len(sentence) > 10 * LONGEST:  # searching megabytes for long words takes seconds
        sentence = f"{sentence[: 5 * LONGEST]}{sentence[-5 * LONGEST :]}"
    sentence = LONG_WORD.sub(r"\1 ... \2", printable(sentence))
    if len(sentence) > LONGEST:
        sentence = f"{sentence[: LONGEST - 520]} ... {sentence[-500:]}"
    return sentence
