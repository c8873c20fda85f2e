from pathlib import Path

import numpy as np
import pytest
from awkward_files import Awkward, make_all

from bootifol.demos.import_videos import Conversion, import_videos
from bootifol.errors import BootifolError
from bootifol.video_files.reading import stream_video


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> list[Awkward]:
    return make_all(tmp_path_factory.mktemp("awkward") / "files")


def test_there_are_many(corpus: list[Awkward]) -> None:
    assert len([file for file in corpus if file.pictures is not None]) >= 15
    assert len([file for file in corpus if file.pictures is None]) >= 10


def test_readable_files_give_exactly_their_pictures(corpus: list[Awkward]) -> None:
    wrong = []
    for file in corpus:
        if file.pictures is None:
            continue
        try:
            timed = list(stream_video(file.path))
        except BootifolError as error:
            wrong.append(f"{file.path.name}: {error}")
            continue
        shapes = {picture.frame.shape for picture in timed}
        if len(timed) != len(file.pictures) or shapes != {file.pictures.shape[1:]}:
            wrong.append(f"{file.path.name}: {len(timed)} of {shapes} instead of {file.pictures.shape}")
            continue
        for place in (0, -1):
            error = np.abs(timed[place].frame.astype(int) - file.pictures[place]).mean()
            if error > file.tolerance:
                wrong.append(f"{file.path.name}: picture {place} differs by {error:.1f} levels")
        if file.seconds is not None:
            assert [picture.seconds for picture in timed] == pytest.approx(file.seconds, abs=0.001)
    assert not wrong, "\n".join(wrong)


def test_broken_files_are_refused_by_name(corpus: list[Awkward]) -> None:
    for file in corpus:
        if file.pictures is None:
            with pytest.raises(BootifolError, match=file.refusal) as error:
                list(stream_video(file.path))
            assert str(file.path) in str(error.value)


def test_all_readable_files_make_one_set(corpus: list[Awkward], tmp_path: Path) -> None:
    files = [file for file in corpus if file.pictures is not None]
    imported = import_videos([file.path for file in files], tmp_path / "set", Conversion(frames=12, size=16))
    lengths = [len(file.pictures) for file in files if file.pictures is not None]
    assert [entry.length for entry in imported.manifest.videos] == lengths


def test_every_broken_file_is_named_and_nothing_is_written(corpus: list[Awkward], tmp_path: Path) -> None:
    with pytest.raises(BootifolError) as error:
        import_videos([file.path for file in corpus], tmp_path / "set", Conversion(frames=12, size=16))
    sentences = str(error.value).split("\n")
    broken = [file.path.name for file in corpus if file.pictures is None]
    assert len(sentences) == len(broken)
    assert all(name in sentence for name, sentence in zip(broken, sentences, strict=True))
    assert list(tmp_path.iterdir()) == []
