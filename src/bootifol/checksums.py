"""A checksum inside of the file that it is of, so that whoever reads the file knows that every byte was written so.

It stands in JSON, or in the JSON at the head of a safetensors file, as `"checksum": "xxh3-…"`; its own digits count as
zeros. Either half of that is enough to see that a checksum was there: no byte can be changed so that a file passes for
one of an older version, which had none and is read as it is.
"""

from __future__ import annotations

import re
from pathlib import Path

import xxhash

from bootifol.errors import BootifolError

NAME = "checksum"
BLANK = "xxh3-" + 32 * "0"
"""What stands in a file's JSON under `NAME` until `seal` puts the checksum there."""

_SEALED = re.compile(rb'"checksum": ?"xxh3-([0-9a-f]{32})"')
_TRACE = re.compile(rb'"checksum"|"xxh3-')
_MOST_HEAD = 100_000_000
"""Bytes of the JSON at the head of a safetensors file, which its format allows no more of."""
_PIECE = 1 << 22


def seal(path: Path) -> None:
    """Puts a file's checksum where `BLANK` stands in it."""
    head = _head(path)
    found = _SEALED.search(head)
    assert found is not None, path
    digest = _digest(path, head, found)
    with path.open("r+b") as file:
        file.seek(found.start(1))
        file.write(digest.encode())


def is_as_written(path: Path) -> bool:
    """Whether a file's bytes are those that its checksum is of; True where it has none."""
    head = _head(path)
    found = _SEALED.search(head)
    if found is None:
        return _TRACE.search(head) is None
    return _digest(path, head, found).encode() == found.group(1)


def require_as_written(path: Path, what: str) -> None:
    """Refuses a file whose bytes are not the ones written.

    Args:
        path: the file.
        what: it is to the user, for the sentence.

    Raises:
        BootifolError: a byte was changed.
    """
    if not is_as_written(path):
        raise BootifolError(
            f"{what} is damaged or incomplete: {path}: its bytes are not those its checksum is of; restore it from "
            'a copy (who changed it on purpose takes its "checksum" out)'
        )


def _head(path: Path) -> bytes:
    """The part of a file that is JSON."""
    with path.open("rb") as file:
        start = file.read(8)
        if start[:1] == b"{" or path.suffix != ".safetensors":
            return start + file.read(_MOST_HEAD)
        return start + file.read(min(int.from_bytes(start, "little"), _MOST_HEAD))


def _digest(path: Path, head: bytes, found: re.Match[bytes]) -> str:
    """Hexadecimal, of the bytes with zeros for the checksum's digits."""
    first, last = found.span(1)
    digest = xxhash.xxh3_128(head[:first])
    digest.update((last - first) * b"0")
    digest.update(head[last:])
    with path.open("rb") as file:
        file.seek(len(head))
        while piece := file.read(_PIECE):
            digest.update(piece)
    return digest.hexdigest()
