"""Any pretrained vision model of the `transformers` library, as a network from pictures to one vector each.

Weights are read from safetensors files alone, and code that comes with them is not run. The library's image processors
are not used (they want torchvision): videos have their size already, and `Normalization` does the rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple, cast

import torch
from torch import nn

from bootifol.errors import BootifolError


class Normalization(NamedTuple):
    """What is taken off every channel of pictures in [0, 1], and what they are then divided by."""

    mean: tuple[float, ...]
    standard_deviation: tuple[float, ...]


IMAGENET = Normalization((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))


class PooledOutput(nn.Module):
    """A vision model's pooled output, whatever its class.

    That is the model's own `pooler_output` where it has one with trained weights, else the mean over the places (or
    tokens) of its last layer.

    Args:
        model: of transformers, called with `pixel_values`.
        own_pooler: whether the model's own pooling may be used.
    """

    def __init__(self, model: nn.Module, own_pooler: bool) -> None:
        super().__init__()
        self.model = model
        self.own_pooler = own_pooler

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        """Normalized pictures `[N, 3, H, W]` to `[N, features]`."""
        output = self.model(pixel_values=pictures)
        pooled: torch.Tensor | None = getattr(output, "pooler_output", None) if self.own_pooler else None
        if pooled is None:
            last = cast(torch.Tensor, output.last_hidden_state)
            pooled = last.mean(dim=1) if last.ndim == 3 else last.flatten(2).mean(dim=2)
        return pooled.flatten(1)


def load_transformers_model(name: str) -> tuple[PooledOutput, Normalization]:
    """A vision model by its name on the Hugging Face hub, or from a directory that `save_pretrained` wrote.

    Of a model that also reads text (CLIP, SigLIP), its vision part.

    Raises:
        BootifolError: transformers is not installed, the model cannot be had, or it reads no pictures.
    """
    try:
        from transformers import AutoModel
        from transformers.image_processing_base import ImageProcessingMixin
    except ImportError:
        raise BootifolError(
            f"the backbone {name} needs the library transformers, which is not installed; type `pip install "
            "transformers`, or bootifol with its extra `backbone`"
        ) from None
    try:
        with _quiet(), torch.random.fork_rng(devices=[]):
            model, loaded = AutoModel.from_pretrained(
                name, use_safetensors=True, trust_remote_code=False, output_loading_info=True
            )
    # The hub's client raises errors of its own beside OSError, a file that is no model many kinds.
    except Exception as error:
        raise BootifolError(
            f"the backbone {name} cannot be loaded ({_first_line(error)}); name a vision model of the Hugging Face hub "
            "that has its weights as safetensors, such as google/efficientnet-b0, or a directory with one (without "
            "a network: `hf download NAME --local-dir DIRECTORY` elsewhere); efficientnet_lite0 needs no download"
        ) from error
    vision = getattr(model, "vision_model", model)
    if getattr(vision, "main_input_name", None) != "pixel_values":
        raise BootifolError(
            f"the backbone {name} is a {type(model).__name__}, which reads no pictures; name a vision model, such as "
            "google/efficientnet-b0 or facebook/dinov2-small"
        )
    missing = sorted(loaded["missing_keys"])
    unknown = [key for key in missing if "pooler" not in key]
    if unknown:
        raise BootifolError(
            f"the backbone {name} lacks the weights of {', '.join(unknown[:3])}, so it is not a whole pretrained "
            f"{type(model).__name__}; choose another"
        )
    if model.config.model_type == "efficientnet":
        # Its processor's file holds the root of ImageNet's deviation, which the processor divides by twice.
        return PooledOutput(vision.float(), own_pooler=True), IMAGENET
    try:
        with _quiet():
            processor, _ = ImageProcessingMixin.get_image_processor_dict(name)
    except Exception:  # a model without a processor; as above
        processor = {}
    return PooledOutput(vision.float(), own_pooler=not missing), normalization(processor)


def normalization(processor: dict[str, Any]) -> Normalization:
    """What a model's `preprocessor_config.json` says of normalization; ImageNet's where it says nothing."""
    if not processor.get("do_normalize", True):
        return Normalization((0.0,) * 3, (1.0,) * 3)
    return Normalization(
        tuple(processor.get("image_mean") or IMAGENET.mean),
        tuple(processor.get("image_std") or IMAGENET.standard_deviation),
    )


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0].rstrip(".") if lines else type(error).__name__


@contextmanager
def _quiet() -> Iterator[None]:
    """Without the library's report on weights that a backbone has no use for, such as a classifier's."""
    from transformers.utils import logging

    verbosity = logging.get_verbosity()
    logging.set_verbosity_error()
    try:
        yield
    finally:
        logging.set_verbosity(verbosity)
