"""Which videos a folder stands for, what is left out of it, and that it is said."""

from pathlib import Path

import numpy as np
import pytest
from numbered_videos import TWELVE, encode, numbered, numbers
from PIL import Image

from bootifol.cli.main import main
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.import_videos import Conversion, import_videos
from bootifol.errors import BootifolError, BootifolWarning, collected_warnings
from bootifol.video_files.kinds import PICTURE_SUFFIXES
from bootifol.video_files.reading import video_paths

LITTER = [
    ".DS_Store",
    "Thumbs.db",
    "desktop.ini",
    "._a.mp4",
    ".hidden.mp4",
    "~$a.doc",
    "a.mp4~",
    "ehthumbs.db",
]


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return encode(tmp_path_factory.mktemp("video") / "a.mp4").read_bytes()


def fill(folder: Path, video: bytes, *names: str) -> Path:
    """Writes a file of each name: pictures and arrays by their suffix, videos otherwise."""
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix.lower() in PICTURE_SUFFIXES:
            Image.fromarray(numbered(1)[0]).save(path)
        elif path.suffix == ".npy":
            np.save(path, numbered(2))
        elif path.suffix in (".txt", ".json", ".heic", ".thm", ".part"):
            path.write_bytes(b"something else")
        else:
            path.write_bytes(video)
    return folder


def found(folder: Path) -> tuple[list[str], str]:
    """What a folder stands for, relative to it, and what was said."""
    with collected_warnings() as told:
        paths = video_paths([folder])
    return [str(path.relative_to(folder)) for path in paths], "; ".join(note.what for note in told)


@pytest.mark.parametrize(
    ("names", "right", "said"),
    [
        (["1.MOV", "2.MOV", "3.JPG"], ["1.MOV", "2.MOV"], "3.JPG: pictures beside videos"),
        (["1.MOV", "3.jpg", "4.png"], ["1.MOV"], "4.png: pictures beside videos"),
        (["b10.mp4", "b9.mp4", "c/a.ts", "c/d/e.mkv"], ["b9.mp4", "b10.mp4", "c/a.ts", "c/d/e.mkv"], ""),
        (["1.png", "2.png"], ["."], ""),
        (["a/1.png", "a/2.png", "b/1.webp", "c.npy"], ["a", "b", "c.npy"], ""),
        (["cover.png", "a/1.png", "a/2.png"], ["a"], "cover.png: pictures beside videos"),
        (["1.png", "2.png", "masks/1.png", "masks/2.png"], ["."], "masks: folders in a folder of pictures"),
        (["1.jpg", "2.jpg", "100MEDIA/a.mp4"], ["100MEDIA/a.mp4"], "2.jpg: pictures beside videos"),
        (["a.mp4", "notes.txt", "a.json"], ["a.mp4"], "notes.txt: no videos"),
        (["a.mp4", "a.heic"], ["a.mp4"], "a.heic: no videos, or of a kind"),
        (["GX01.MP4", "GL01.LRV", "GX01.thm"], ["GX01.MP4"], "GX01.thm: small previews that cameras make"),
        (["a.mp4", "b.mp4.part"], ["a.mp4"], "b.mp4.part: not downloaded or copied to their end"),
        (["a.mp4", ".b.mov.icloud"], ["a.mp4"], ".b.mov.icloud: not downloaded or copied to their end"),
        (["a", "b.bin"], ["a", "b.bin"], ""),
    ],
)  # fmt: skip
def test_a_folder_stands_for_its_videos_and_names_the_rest(
    tmp_path: Path, video: bytes, names: list[str], right: list[str], said: str
) -> None:
    paths, told = found(fill(tmp_path, video, *names))
    assert paths == right
    assert said in told and bool(said) == bool(told)


def test_what_systems_leave_everywhere_is_no_matter(tmp_path: Path, video: bytes) -> None:
    fill(tmp_path / "videos", video, "a.mp4", "__MACOSX/a.mp4", ".Trashes/b.mp4", "@eaDir/c.mp4")
    fill(tmp_path / "pictures", video, "1.png", "2.png")
    for folder in ("videos", "pictures"):
        for name in LITTER:
            (tmp_path / folder / name).write_bytes(b"\x00\x05\x16\x07litter")
    assert found(tmp_path / "videos") == (["a.mp4"], "")
    assert found(tmp_path / "pictures") == (["."], "")
    assert numbers(tmp_path / "pictures") == [0, 0]


def test_files_named_by_an_asterisk_are_as_those_of_the_folder(tmp_path: Path, video: bytes) -> None:
    fill(tmp_path, video, "a.mp4", "b.mov", "photo.jpg", "deep/c.mp4")
    for name in ("._a.mp4", "Thumbs.db", ".DS_Store"):
        (tmp_path / name).write_bytes(b"\x00\x05\x16\x07litter")
    with pytest.warns(BootifolWarning) as told:
        paths = video_paths(sorted(tmp_path.iterdir()))
    assert [path.name for path in paths] == ["a.mp4", "b.mov", "c.mp4"]
    said = " ".join(str(found.message) for found in told)
    assert "Thumbs.db: left there by the system" in said and "photo.jpg: pictures beside videos" in said
    stills = [tmp_path / "photo.jpg"]
    assert video_paths(stills) == stills, "and reading it says what is wrong"


def test_a_folder_without_videos_says_what_it_holds(tmp_path: Path, video: bytes) -> None:
    fill(tmp_path, video, "IMG_1.heic", "IMG_2.heic", ".DS_Store")
    with pytest.raises(
        BootifolError, match=r"holds no videos \(it holds IMG_1\.heic, IMG_2\.heic\): give video"
    ):
        video_paths([tmp_path])


def test_links_in_a_circle_and_links_to_nothing_do_no_harm(tmp_path: Path, video: bytes) -> None:
    fill(tmp_path, video, "a.mp4", "deep/b.mp4")
    (tmp_path / "deep" / "up").symlink_to(tmp_path)
    (tmp_path / "gone.mp4").symlink_to(tmp_path / "nowhere.mp4")
    paths, told = found(tmp_path)
    assert paths == ["a.mp4", "deep/b.mp4"]
    assert "gone.mp4: links to files that are missing" in told


LOSSY = {".jpg", ".jpeg", ".jpe", ".jfif", ".jp2", ".j2k", ".j2c", ".jpf", ".jpx", ".webp", ".avif"}


@pytest.mark.parametrize(
    "suffix", sorted(PICTURE_SUFFIXES - {".pbm", ".pfm", ".bw", ".rgba", ".ras", ".ico", ".pgm"})
)
def test_folders_of_pictures_of_every_common_kind(tmp_path: Path, suffix: str) -> None:
    for place, frame in enumerate(numbered(3)):
        picture = Image.fromarray(frame)
        picture.save(tmp_path / f"{place}{suffix.upper()}", **({"quality": 95} if suffix in LOSSY else {}))
    assert found(tmp_path) == (["."], "")
    assert numbers(tmp_path) == [0, 1, 2]


def test_single_gifs_are_pictures_and_several_frames_are_videos(tmp_path: Path) -> None:
    for place, frame in enumerate(numbered(3)):
        Image.fromarray(frame).save(tmp_path / f"{place}.gif")
    assert found(tmp_path) == (["."], "")
    assert numbers(tmp_path) == [0, 1, 2]
    first, *others = map(Image.fromarray, numbered(3))
    first.save(tmp_path / "film.gif", save_all=True, append_images=others, duration=100)
    paths, told = found(tmp_path)
    assert paths == ["film.gif"] and "2.gif: pictures beside videos" in told


def test_notes_are_printed_once_and_stand_in_the_manifest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "films"
    folder.mkdir()
    for name in ("a.ts", "b.ts"):
        encode(folder / name)
    Image.fromarray(numbered(1)[0]).save(folder / "me.jpg")
    words = ["demos", "import", str(folder), "--frames", "12", "--size", "16", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    said = capsys.readouterr().err
    assert f"note: left out {folder / 'me.jpg'}: pictures beside videos" in said
    assert said.count("does not say how long it is") == 1
    assert f"note: {folder / 'a.ts'}, {folder / 'b.ts'}: does not say" in said
    for entry in DemoSet.open(tmp_path / "out" / "expert").manifest.videos:
        assert [note[:26] for note in entry.source["notes"]] == ["does not say how long it is"[:26]]


def test_import_finds_the_videos_of_a_folder_in_python_too(tmp_path: Path, video: bytes) -> None:
    fill(tmp_path / "films", video, "a.mp4", "day/b.mp4")
    imported = import_videos([tmp_path / "films"], tmp_path / "out", Conversion(frames=12, size=16))
    assert [entry.length for entry in imported.manifest.videos] == [len(TWELVE)] * 2
