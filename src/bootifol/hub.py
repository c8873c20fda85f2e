"""Repositories of the Hugging Face hub by their address, as huggingface_hub writes them.

    hf://user/name                         a model: its policy.safetensors
    hf://datasets/user/name                a data set: its videos
    hf://datasets/user/name@v1/kitchen     the folder `kitchen` of its revision `v1`

What is fetched are files to read: no code of a repository is run, and nothing is unpickled.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bootifol.errors import BootifolError
from bootifol.plugins import told

# One slash where `Path` has been at it.
_ADDRESS = re.compile(
    r"hf:/{1,2}(?P<kind>datasets/)?(?P<name>(?!datasets/)[\w.-]+/[\w.-]+)(@(?P<revision>[\w.-]+))?(/(?P<inside>.+?))?/?",
    re.ASCII,
)


@dataclass(frozen=True)
class HubAddress:
    """What `hf://…` names."""

    name: str
    """`user/name`."""

    is_data_set: bool
    revision: str | None
    """Branch, tag or commit; None: the newest of the main branch."""

    inside: str
    """A folder or file of the repository; empty: all of it."""

    def __str__(self) -> str:
        kind, revision = "datasets/" * self.is_data_set, f"@{self.revision}" if self.revision else ""
        return f"hf://{kind}{self.name}{revision}{f'/{self.inside}' if self.inside else ''}"


def is_hub_address(path: os.PathLike[str] | str) -> bool:
    """Whether a path is meant as an address, right or wrong."""
    return os.fspath(path).startswith("hf:/")


def hub_address(path: os.PathLike[str] | str) -> HubAddress:
    """What an address names.

    Raises:
        BootifolError: it is none.
    """
    text = os.fspath(path)
    match = _ADDRESS.fullmatch(text)
    inside = (match["inside"] or "") if match is not None else ""
    if match is None or ".." in inside.split("/"):
        raise BootifolError(
            f"{text} is no address of the Hugging Face hub: type hf://USER/NAME for a model, hf://datasets/USER/NAME "
            "for a data set, with @REVISION behind the name for another than its newest files"
        )
    return HubAddress(match["name"], match["kind"] is not None, match["revision"], inside)


def fetched_file(address: HubAddress, name: str) -> Path:
    """One file of a model's repository, from this machine's cache where it is there already.

    Args:
        address: of the model; a file inside of it goes before `name`.
        name: of the file.

    Raises:
        BootifolError: huggingface_hub is missing, the address is a data set's, or the file cannot be fetched.
    """
    if address.is_data_set:
        raise BootifolError(f"{address} is a data set, not a policy: type hf://USER/NAME of a model")
    hub = _library()
    with _errors(address):
        return Path(hub.hf_hub_download(address.name, address.inside or name, revision=address.revision))


def fetched_folder(address: HubAddress, suffixes: Sequence[str], folders: Sequence[str] = ()) -> Path:
    """The files of a data set that have one of these suffixes, in a folder laid out as the repository is.

    Args:
        address: of the data set.
        suffixes: with their dot, in lower case; a file may have them in capitals.
        folders: names of folders of which all files are wanted.

    Raises:
        BootifolError: huggingface_hub is missing, the address is a model's, it cannot be fetched, or it has no such
            files.
    """
    if not address.is_data_set:
        raise BootifolError(
            f"{address} names a model, which has no videos to import: type hf://datasets/{address.name} for the data "
            "set of that name"
        )
    hub = _library()
    inside = _literal(address.inside)
    wanted = [f"*{one}" for suffix in suffixes for one in dict.fromkeys((suffix, suffix.upper()))]
    of_folders = [f"{start}{folder}/*" for folder in folders for start in ("", "*/")]
    patterns = [f"{inside}/{pattern}" if inside else pattern for pattern in (*wanted, *of_folders)]
    with _errors(address):
        root = Path(
            hub.snapshot_download(
                address.name,
                repo_type="dataset",
                revision=address.revision,
                # The file itself, where the address names one.
                allow_patterns=[inside, *patterns] if inside else patterns,
            )
        )
    found = root / address.inside
    if not found.is_file() and not (found.is_dir() and any(path.is_file() for path in found.rglob("*"))):
        raise BootifolError(
            f"{address} holds no videos or pictures of a kind that bootifol reads: look at it in a browser, and name "
            "the folder that has them behind the repository's name"
        )
    return found


def _literal(path: str) -> str:
    """A path as a pattern of itself."""
    return re.sub(r"([*?[])", r"[\1]", path)


def _library() -> Any:
    try:
        import huggingface_hub
    except ImportError as error:
        raise BootifolError(
            "addresses that begin with hf:// need huggingface_hub, which is missing: install bootifol with its extra "
            "`hub`, or `pip install huggingface_hub`"
        ) from error
    return huggingface_hub


@contextmanager
def _errors(address: HubAddress) -> Iterator[None]:
    from huggingface_hub import errors

    try:
        yield
    # Errors of the network, of names, of what is not there, and of the disk.
    except (OSError, ValueError, errors.EntryNotFoundError, errors.HfHubHTTPError) as error:
        raise BootifolError(
            f"{address} cannot be fetched ({told(error)[:500]}): look whether the name is right and the network is up; "
            "who may not see it without an account logs in with `hf auth login` first"
        ) from error
