from pathlib import Path

import pytest

from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.tasks import make_environment


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The slow tests first: begun last, they would keep one worker busy while the other has nothing left to do."""
    items.sort(key=lambda item: "end_to_end" not in item.path.parts and item.path.name != "test_sweep.py")


@pytest.fixture(scope="session")
def requires_rendering() -> None:
    """Skips where OpenGL is missing; a machine that can render runs every test."""
    try:
        make_environment("reacher_hard", PictureConfig(agent_size=8, video_size=8), 1).close()
    except BootifolError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def tiny_backbone(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Directory of an EfficientNet of a few thousand parameters, which nobody trained: 32 features a frame."""
    import torch
    from transformers import EfficientNetConfig, EfficientNetModel

    config = EfficientNetConfig(
        image_size=32,
        width_coefficient=0.025,
        depth_coefficient=1.0,
        hidden_dim=32,
        kernel_sizes=[3, 5],
        in_channels=[8, 8],
        out_channels=[8, 16],
        strides=[2, 2],
        num_block_repeats=[1, 1],
        expand_ratios=[1, 2],
    )
    directory: Path = tmp_path_factory.mktemp("tiny_backbone") / "tiny-efficientnet"
    with torch.random.fork_rng():
        torch.manual_seed(0)
        model = EfficientNetModel(config)
        # The library's own draw has features of 1e-15, in which no frame differs from another.
        for parameter in model.parameters():
            if parameter.ndim == 4:
                torch.nn.init.normal_(parameter, std=2 / parameter[0].numel() ** 0.5)
        for module in model.modules():
            if isinstance(module, torch.nn.BatchNorm2d):
                torch.nn.init.ones_(module.weight)
    model.save_pretrained(directory)
    return str(directory)


@pytest.fixture
def offline(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Weights & Biases writes its files and asks the network for nothing."""
    monkeypatch.setenv("WANDB_MODE", "offline")
    monkeypatch.setenv("WANDB_SILENT", "true")
    for place in ("CONFIG", "CACHE", "DATA"):
        monkeypatch.setenv(f"WANDB_{place}_DIR", str(tmp_path / "elsewhere"))
