"""The cache folder of this user, and a secret key in it that signs texts, so that forged ones are recognised."""

from __future__ import annotations

import hmac
import os
import secrets
import stat
from contextlib import suppress
from pathlib import Path

KEY_BYTES = 32
"""Length of the key [bytes]: that of the digests made with it."""


def cache_folder() -> Path:
    """The folder of this program in the user's cache; it need not exist."""
    folder = os.environ.get("XDG_CACHE_HOME")
    return (Path(folder) if folder else Path(os.path.expanduser("~")) / ".cache") / "mirrorfold"


def signature(text: str) -> str | None:
    """A keyed digest (HMAC-SHA256) of a text, which only this user can make; None if the key cannot be kept."""
    with suppress(OSError):
        return hmac.digest(_key(), text.encode(), "sha256").hex()
    return None


def is_signed(text: str, found: str) -> bool:
    """Whether the digest `found` is the one that `signature` makes of the text."""
    made = signature(text)
    return made is not None and hmac.compare_digest(made.encode(), found.encode())


def _key() -> bytes:
    """The user's key; it is made if there is none.

    Raises
    ------
    OSError
        If the key cannot be read or written, or if other users may read or replace it.
    """
    path = cache_folder() / "key"
    with suppress(FileNotFoundError):
        state = path.lstat()
        own = os.name != "posix" or (state.st_uid == os.getuid() and not state.st_mode & 0o077)
        if not (own and stat.S_ISREG(state.st_mode)):
            raise PermissionError("others may know the key")
        key = path.read_bytes()
        if len(key) == KEY_BYTES:
            return key
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"key-{secrets.token_hex(4)}")
    handle = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        os.write(handle, secrets.token_bytes(KEY_BYTES))
    finally:
        os.close(handle)
    os.replace(partial, path)
    return path.read_bytes()
