"""The one error type that mirrorfold raises for wrong input."""

from __future__ import annotations

import re

LONG_WORD = re.compile(r"(\S{300})\S{100,}(\S{100})")
"""What no text has but a value that was not meant to be read, such as a number of a thousand digits."""

LONGEST = 2000
"""Letters of a sentence that somebody reads."""


class InputError(ValueError):
    """Wrong input: one plain sentence with what was expected, what was found, where, and the remedy.

    The command line prints the sentence and exits with code 2. What it quotes is shortened where it is very long.

    Parameters
    ----------
    sentence : str
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(shortened(sentence))


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
    sentence = LONG_WORD.sub(r"\1 ... \2", sentence)
    if len(sentence) > LONGEST:
        sentence = f"{sentence[: LONGEST - 520]} ... {sentence[-500:]}"
    return sentence
