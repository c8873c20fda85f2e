"""Where a video file should end, by its own bytes: formats that play on without their last ones say so there."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Literal

_FIRST_BOXES = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot")

_LONG_BOXES = (b"moov", b"mdat", b"moof", b"mfra")


def promised_bytes(path: Path) -> int:
    """How long an avi, webm, mkv, mp4 or mov file says it is; 0 when it does not say."""
    with path.open("rb") as file:
        head = file.read(4096)
        if head[4:8] in _FIRST_BOXES:
            return max((end for name, _, end in _boxes(file) if name in _LONG_BOXES), default=0)
    if head[:4] == b"RIFF":
        riff = int.from_bytes(head[4:8], "little")
        return 8 + riff if riff < 0xFFFFFFFF else 0
    if head[:4] != b"\x1aE\xdf\xa3":
        return 0
    # EBML: an element is its name, its size as a number whose leading zero bits tell its length, and its contents.
    header, header_bytes = _ebml_size(head, 4)
    segment = header + (header_bytes or 0)
    if head[segment : segment + 4] != b"\x18S\x80g":
        return 0
    start, size = _ebml_size(head, segment + 4)
    return start + size if size is not None else 0


def lacks_its_end(path: Path, kind: str) -> str:
    """What is missing at the end of a gif or an Ogg file; "" for nothing.

    Args:
        path: the file.
        kind: FFmpeg's name of its format.
    """
    if kind == "gif":
        return "" if gif_is_whole(path) else "the mark at a gif's end is missing"
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - 65536))
        tail = file.read()
    page = tail.rfind(b"OggS")
    if kind == "ogg" and page >= 0 and not tail[page + 5] & 4:
        return "its last page is not marked as the last"
    return ""


def gif_is_whole(path: Path) -> bool:
    """Whether the blocks of a gif lead to the mark at its end."""
    data = path.read_bytes()
    try:
        place = 13 + _colors(data[10])
        while data[place] != ord(";"):
            if data[place] == ord("!"):  # an extension: its kind, then blocks
                place += 2
            elif data[place] == ord(
                ","
            ):  # a picture: where it lies, perhaps colors, the size of a code, then blocks
                place += 11 + _colors(data[place + 9])
            else:
                return False
            while data[place]:
                place += 1 + data[place]
            place += 1
    except IndexError:
        return False
    return True


def _colors(flags: int) -> int:
    """Bytes of a gif's table of colors."""
    return 3 << (flags & 7) + 1 if flags & 128 else 0


def fragments_end(path: Path) -> Literal["there", "missing"] | None:
    """Whether an mp4 or mov file in fragments ends with the index of them; None for files in one piece."""
    with path.open("rb") as file:
        names = [name for name, _, _ in _boxes(file)]
    if b"moof" not in names:
        return None
    return "there" if b"mfra" in names else "missing"


def _boxes(file: BinaryIO) -> Iterator[tuple[bytes, int, int]]:
    """Names, beginnings and ends of the outermost boxes of an mp4 or mov file."""
    size = file.seek(0, 2)
    place = 0
    while place + 8 <= size and (box := _box(file, place)) is not None:
        name, length = box
        yield name, place, place + (length or size - place)
        place += length or size - place


def _box(file: BinaryIO, place: int) -> tuple[bytes, int] | None:
    """Name and length of a box of ISO 14496-12, 0 for "to the end"; None for what is none."""
    file.seek(place)
    head = file.read(16)
    length = int.from_bytes(head[:4], "big")
    if length == 1:
        length = int.from_bytes(head[8:16], "big")
    return None if 0 < length < 8 else (head[4:8], length)


def _ebml_size(head: bytes, place: int) -> tuple[int, int | None]:
    """Where an element's contents begin, and their size; None when it was not known (a live recording)."""
    length = 9 - head[place].bit_length() if place < len(head) else 9
    if length > 8:
        return place, None
    unmarked = int.from_bytes(head[place : place + length], "big") - (1 << 7 * length)
    return place + length, unmarked if unmarked != (1 << 7 * length) - 1 else None
