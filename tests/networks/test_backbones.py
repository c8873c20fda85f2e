"""Frozen networks: what they give, that nothing about them changes, and what is refused."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from transformers import (
    BertConfig,
    BertModel,
    EfficientNetModel,
    ResNetConfig,
    ResNetModel,
    ViTConfig,
    ViTMAEConfig,
    ViTMAEModel,
    ViTModel,
)

from bootifol.errors import BootifolError
from bootifol.networks.backbones import Backbone, load_backbone
from bootifol.networks.transformers_models import (
    IMAGENET,
    Normalization,
    load_transformers_model,
    normalization,
)
from bootifol.types import Video

SIZE = 32
VIT = {
    "image_size": SIZE,
    "patch_size": 8,
    "hidden_size": 16,
    "intermediate_size": 16,
    "num_hidden_layers": 1,
    "num_attention_heads": 2,
}


def pictures(count: int, size: int = SIZE) -> np.ndarray:
    return np.random.default_rng(3).integers(0, 256, (count, size, size, 3), np.uint8)


def normalized(frames: np.ndarray, with_what: Normalization = IMAGENET) -> torch.Tensor:
    """As every textbook writes it."""
    scaled = (frames / 255.0 - np.array(with_what.mean)) / np.array(with_what.standard_deviation)
    return torch.from_numpy(scaled.transpose(0, 3, 1, 2).astype(np.float32))


def test_features_are_the_models_own_pooled_output(tiny_backbone: str) -> None:
    frames = pictures(5)
    model = EfficientNetModel.from_pretrained(tiny_backbone).eval()
    with torch.inference_mode():
        expected = model(pixel_values=normalized(frames)).pooler_output.numpy()
    backbone = load_backbone(tiny_backbone, SIZE)
    features = backbone.features(frames)
    assert backbone.feature_size == 32
    assert features.dtype == np.float32 and features.shape == (5, 32)
    np.testing.assert_allclose(features, expected, rtol=1e-3, atol=1e-5)
    assert features.std(axis=0).min() > 0  # this test would see frames mixed up


def test_a_frames_features_depend_on_that_frame_alone(tiny_backbone: str) -> None:
    backbone, frames = load_backbone(tiny_backbone, SIZE), pictures(40)
    features = backbone.features(frames)
    for index in (0, 15, 16, 39):
        alone = backbone.features(frames[index : index + 1])
        np.testing.assert_allclose(alone[0], features[index], rtol=1e-4, atol=1e-5)
    changed = frames.copy()
    changed[7] = 0
    after = backbone.features(changed)
    assert (after[7] != features[7]).any()
    np.testing.assert_array_equal(np.delete(after, 7, 0), np.delete(features, 7, 0))


def test_nothing_about_it_can_learn(tiny_backbone: str) -> None:
    backbone = load_backbone(tiny_backbone, SIZE)
    before = backbone.fingerprint
    assert not any(parameter.requires_grad for parameter in backbone._network.parameters())
    assert not any(module.training for module in backbone._network.modules())
    backbone.features(pictures(3))
    again = Backbone(tiny_backbone, backbone._network, IMAGENET, SIZE)
    assert again.fingerprint == before


def test_features_are_computed_once(tiny_backbone: str, monkeypatch: pytest.MonkeyPatch) -> None:
    backbone = load_backbone(tiny_backbone, SIZE)
    video = backbone.with_features(Video("video", pictures(4)))
    monkeypatch.setattr(backbone, "_pass", None)
    assert backbone.with_features(video) is video


def test_its_key_tells_what_decides_the_features(tiny_backbone: str, tmp_path: Path) -> None:
    model = EfficientNetModel.from_pretrained(tiny_backbone)
    with torch.no_grad():
        next(model.parameters()).view(-1)[0] += 1e-3
    model.save_pretrained(tmp_path / "tiny-efficientnet")
    other = str(tmp_path / "tiny-efficientnet")
    keys = {
        load_backbone(tiny_backbone, SIZE).key,
        load_backbone(tiny_backbone, 2 * SIZE).key,
        load_backbone(tiny_backbone, SIZE, "bf16").key,
        load_backbone(other, SIZE).key,
    }
    assert len(keys) == 4
    assert all(key.startswith("tiny-efficientnet-") and "/" not in key for key in keys)


def test_bf16_gives_about_the_same(tiny_backbone: str) -> None:
    frames = pictures(4)
    exact, rounded = (load_backbone(tiny_backbone, SIZE, how).features(frames) for how in ("fp32", "bf16"))
    assert rounded.dtype == np.float32
    assert np.abs(rounded - exact).mean() < 0.05 * np.abs(exact).mean()


@pytest.mark.parametrize("pooler", [True, False])
def test_a_pooler_without_trained_weights_is_not_used(pooler: bool, tmp_path: Path) -> None:
    """Many ViT checkpoints have none; transformers then draws random ones."""
    model = ViTModel(ViTConfig(**VIT), add_pooling_layer=pooler).eval()
    model.save_pretrained(tmp_path / "vit")
    frames = pictures(2)
    with torch.inference_mode():
        output = model(pixel_values=normalized(frames))
    expected = output.pooler_output if pooler else output.last_hidden_state.mean(1)
    features = load_backbone(str(tmp_path / "vit"), SIZE).features(frames)
    np.testing.assert_allclose(features, expected.numpy(), rtol=1e-3, atol=1e-5)


def test_pooled_pictures_become_vectors(tmp_path: Path) -> None:
    config = ResNetConfig(embedding_size=8, hidden_sizes=[8, 12], depths=[1, 1], layer_type="basic")
    ResNetModel(config).save_pretrained(tmp_path / "resnet")
    assert load_backbone(str(tmp_path / "resnet"), SIZE).features(pictures(2)).shape == (2, 12)


@pytest.mark.parametrize(
    ("processor", "expected"),
    [
        ({}, IMAGENET),
        ({"image_mean": [0.5] * 3, "image_std": [0.25] * 3}, Normalization((0.5,) * 3, (0.25,) * 3)),
        ({"do_normalize": False, "image_mean": [0.5] * 3}, Normalization((0.0,) * 3, (1.0,) * 3)),
    ],
)
def test_normalization_is_what_the_model_says(processor: dict[str, object], expected: Normalization) -> None:
    assert normalization(processor) == expected


def test_a_processors_file_is_found_beside_the_model(tmp_path: Path) -> None:
    ViTModel(ViTConfig(**VIT)).save_pretrained(tmp_path)
    (tmp_path / "preprocessor_config.json").write_text(
        '{"image_processor_type": "ViTImageProcessor", "image_mean": [0.1, 0.2, 0.3], "image_std": [0.5, 0.6, 0.7]}'
    )
    _, found = load_transformers_model(str(tmp_path))
    assert found == Normalization((0.1, 0.2, 0.3), (0.5, 0.6, 0.7))


def test_pickled_weights_are_refused(tmp_path: Path) -> None:
    model = ViTModel(ViTConfig(**VIT))
    model.save_pretrained(tmp_path)
    (tmp_path / "model.safetensors").unlink()
    torch.save(model.state_dict(), tmp_path / "pytorch_model.bin")
    with pytest.raises(BootifolError, match=r"cannot be loaded .* has its weights as safetensors"):
        load_backbone(str(tmp_path), SIZE)


def test_code_that_comes_with_weights_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = {"model_type": "theirs", "auto_map": {"AutoConfig": "code_of_theirs.Config"}}
    (tmp_path / "config.json").write_text(json.dumps(config))
    (tmp_path / "code_of_theirs.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\n")
    asked: list[object] = []
    monkeypatch.setattr("builtins.input", lambda *prompt: asked.append(prompt) or "n")
    with pytest.raises(BootifolError, match=r"cannot be loaded .* contains custom code"):
        load_transformers_model(str(tmp_path))
    assert not asked, "nobody sits in front of a queue"
    assert not (tmp_path / "ran").exists()


def test_what_is_no_backbone_is_refused_with_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(BootifolError, match=r"nothing cannot be loaded .* such as google/efficientnet-b0"):
        load_backbone(str(tmp_path / "nothing"), SIZE)
    text = BertConfig(
        hidden_size=16, num_hidden_layers=1, num_attention_heads=2, intermediate_size=16, vocab_size=9
    )
    BertModel(text).save_pretrained(tmp_path / "text")
    with pytest.raises(BootifolError, match="is a BertModel, which reads no pictures; name a vision model"):
        load_backbone(str(tmp_path / "text"), SIZE)
    ViTMAEModel(ViTMAEConfig(**VIT)).save_pretrained(tmp_path / "masked")
    with pytest.raises(BootifolError, match="hides parts of pictures at random"):
        load_backbone(str(tmp_path / "masked"), SIZE)
    ViTModel(ViTConfig(**VIT)).save_pretrained(tmp_path / "vit")
    with pytest.raises(BootifolError, match=r"cannot read pictures of 40x40 .*--pictures\.video-size 224"):
        load_backbone(str(tmp_path / "vit"), 40)


def test_weights_that_are_missing_are_not_drawn_at_random(tmp_path: Path) -> None:
    from safetensors.torch import load_file, save_file

    ViTModel(ViTConfig(**VIT)).save_pretrained(tmp_path)
    weights = load_file(tmp_path / "model.safetensors")
    del weights[next(name for name in weights if name.startswith("layernorm"))]
    save_file(weights, tmp_path / "model.safetensors", {"format": "pt"})
    with pytest.raises(BootifolError, match="lacks the weights of layernorm"):
        load_backbone(str(tmp_path), SIZE)


def test_frames_of_another_size_are_refused(tiny_backbone: str) -> None:
    with pytest.raises(BootifolError, match="reads uint8 frames of 32x32 RGB pixels"):
        load_backbone(tiny_backbone, SIZE).features(pictures(2, 64))


def test_without_the_library_the_sentence_says_what_to_type(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "transformers", None)
    with pytest.raises(
        BootifolError, match=r"needs the library transformers.*type `pip install transformers`"
    ):
        load_transformers_model("google/efficientnet-b0")
