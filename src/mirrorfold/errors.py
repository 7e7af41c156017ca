"""The one error type that mirrorfold raises for wrong input, and what its sentences may quote."""

from __future__ import annotations

import re

LONG_WORD = re.compile(r"(\S{300})\S{100,}(\S{100})")
"""What no text has but a value that was not meant to be read, such as a number of a thousand digits."""

UNPRINTABLE = re.compile("[\0-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Characters that steer a terminal, turn the direction of writing, or stand for bytes that are no text."""

LONGEST = 2000
"""Letters of a sentence that somebody reads."""


def printable(text: str) -> str:
    r"""The text with a mark in the place of what is no character: a file from a stranger may hold any.

    Examples
    --------
    >>> printable("\x1b[2J title, \udcff") == "\ufffd[2J title, \ufffd"
    True
    """
    return UNPRINTABLE.sub("\ufffd", text)


class InputError(ValueError):
    """Wrong input: one plain sentence with what was expected, what was found, where, and the remedy.

    The command line prints the sentence and exits with code 2. What it quotes is shortened where it is very long, and
    holds no character that a terminal would obey.

    Parameters
    ----------
    sentence : str
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(shortened(sentence))


class EndedError(InputError):
    """A process that shared the work has ended before its time; the input need not be wrong: exit code 1."""


def shortened(sentence: str) -> str:
    """The sentence without the middle of what is too long in it.

    Examples
    --------
    >>> shortened("scene.toml: name is " + 1000 * "x" + ", expected a text").count("x")
    401
    >>> len(shortened(1000 * "too long "))
    1985
    """
    sentence = str(sentence)
    if len(sentence) > 10 * LONGEST:  # to look through megabytes takes seconds
        sentence = f"{sentence[: 5 * LONGEST]}{sentence[-5 * LONGEST :]}"
    sentence = LONG_WORD.sub(r"\1 ... \2", printable(sentence))
    if len(sentence) > LONGEST:
        sentence = f"{sentence[: LONGEST - 520]} ... {sentence[-500:]}"
    return sentence
