"""How many examples property tests try, and whether they are the same ones each time.

`ci`, the default, tries the same examples in every run, so that a change is blamed for what it broke and nothing else.
`nightly` (`make test-nightly`, or ``pytest --hypothesis-profile=nightly``) tries new ones, and ten times as many.
"""

from __future__ import annotations

from hypothesis import settings

USUAL = 100
"""Examples of a property test that asks for no number, under `ci`."""

settings.register_profile("ci", max_examples=USUAL, derandomize=True, deadline=None)
settings.register_profile("nightly", max_examples=10 * USUAL, deadline=None)
settings.load_profile("ci")


def examples(count: int) -> int:
    """`count` examples under `ci`, for tests that take longer than most; under other profiles in proportion."""
    return max(1, count * settings().max_examples // USUAL)
