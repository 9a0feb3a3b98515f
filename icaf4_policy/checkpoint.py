"""Weights on disk: safetensors beside a JSON description. Nothing here is ever unpickled."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TypeVar

import safetensors
import safetensors.torch
from torch import Tensor, nn

from artgym.errors import DamagedFileError, InvalidArgumentError
from artgym.files import write_file_whole
from icaf4_policy.anchors import AnchorConfig
from icaf4_policy.backbone.pointnet2 import BackboneConfig
from icaf4_policy.model import Icaf4, ModelConfig

#: Version of the description's layout.
FORMAT = 1

#: The one entry of a safetensors header: several would be written in no fixed order.
_METADATA = "json"

_PACKAGES = ("torch", "numpy", "safetensors")

Network = TypeVar("Network", bound=nn.Module)


def save_tensors(path: Path, tensors: Mapping[str, Tensor], facts: Mapping[str, Any]) -> None:
    """Writes tensors and JSON-able facts as one safetensors file, whole."""
    contiguous = {name: tensor.detach().contiguous() for name, tensor in tensors.items()}
    text = json.dumps(facts, sort_keys=True)
    write_file_whole(path, safetensors.torch.save(contiguous, metadata={_METADATA: text}))


def load_tensors(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """The tensors and facts of a file of ``save_tensors``.

    Raises:
        DamagedFileError: the file is not one, or is cut short.
    """
    try:
        with safetensors.safe_open(path, framework="pt") as file:
            facts = json.loads((file.metadata() or {})[_METADATA])
            return {name: file.get_tensor(name) for name in file.keys()}, facts  # noqa: SIM118
    except (OSError, safetensors.SafetensorError, KeyError, ValueError) as error:
        raise DamagedFileError(
            f"{path} cannot be read as saved tensors ({error}). Delete it and make it again."
        ) from error


def description_path(weights: Path) -> Path:
    """Where the description of a weights file lies: the same name, ending in ``.json``."""
    return weights.with_suffix(".json")


def installed_versions() -> dict[str, str]:
    """Versions of the packages that a result depends on."""
    found = {}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed as a distribution"
    return found


def save_model(weights: Path, model: nn.Module, facts: Mapping[str, Any]) -> None:
    """Writes ``weights`` (safetensors) and its description (JSON, with the weights' SHA-256).

    Args:
        weights: path that ends in ``.safetensors``.
        model: what to save; its ``config`` is a dataclass.
        facts: JSON-able facts of the training.
    """
    if weights.suffix != ".safetensors":
        raise InvalidArgumentError(f"weights={str(weights)!r} must end in '.safetensors'.")
    state = {name: t.detach().contiguous() for name, t in model.state_dict().items()}
    data = safetensors.torch.save(state)
    write_file_whole(weights, data)
    description = {
        "format": FORMAT,
        "sha256": hashlib.sha256(data).hexdigest(),
        "network": type(model).__name__,
        "model": asdict(model.config),  # pyright: ignore[reportArgumentType]
        "training": dict(facts),
        "versions": installed_versions(),
    }
    text = json.dumps(description, indent=2, sort_keys=True) + "\n"
    write_file_whole(description_path(weights), text.encode())


def _config_from_json(fields: dict[str, Any]) -> ModelConfig:
    fields = {name: _as_tuples(value) for name, value in fields.items()}
    parts = {
        "anchors": AnchorConfig(**fields["anchors"]),
        "backbone": BackboneConfig(**fields["backbone"]),
    }
    # Networks from before there was a choice were given colours.
    return ModelConfig(**{"features": "color", **fields, **parts})


def _as_tuples(value: Any) -> Any:
    """A JSON value with tuples for its lists."""
    if isinstance(value, dict):
        return {name: _as_tuples(each) for name, each in value.items()}
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value


def load_model(weights: Path) -> tuple[Icaf4, dict[str, Any]]:
    """``load_network`` for the network of parts, poses, joints and grasps."""
    return load_network(weights, Icaf4, lambda fields: Icaf4(_config_from_json(fields)))


def load_network(
    weights: Path, kind: type[Network], build: Callable[[dict[str, Any]], Network]
) -> tuple[Network, dict[str, Any]]:
    """The network of a weights file, in evaluation mode, and its description.

    Args:
        weights: written by ``save_model``.
        kind: what it should hold.
        build: makes one from the JSON fields of its configuration.

    Raises:
        DamagedFileError: the weights or the description are missing, cut short, altered, of
            another kind, or do not belong together; the message names the file.
    """
    described_at = description_path(weights)
    try:
        description = json.loads(described_at.read_text(encoding="utf-8"))
        if description["format"] != FORMAT:
            raise DamagedFileError(
                f"{described_at} has format {description['format']!r}, expected {FORMAT}. "
                "Train again, or install the version that wrote it."
            )
        found_kind = description["network"]
        if found_kind != kind.__name__:
            raise DamagedFileError(
                f"{described_at} describes weights of {found_kind}, expected {kind.__name__}. "
                "Give the weights that belong here."
            )
        expected = description["sha256"]
        model = build(description["model"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise DamagedFileError(
            f"{described_at} cannot be read as the description of weights "
            f"({type(error).__name__}: {error}). Restore it from where the weights came from."
        ) from error
    try:
        data = weights.read_bytes()
    except OSError as error:
        raise DamagedFileError(
            f"{weights} cannot be read ({error}). Fetch it again, or train with 'icaf4 train'."
        ) from error
    found = hashlib.sha256(data).hexdigest()
    if found != expected:
        raise DamagedFileError(
            f"{weights} has SHA-256 {found}, but {described_at} describes {expected}: the file is "
            "damaged or the two do not belong together. Fetch both again."
        )
    try:
        model.load_state_dict(safetensors.torch.load(data))
    except (safetensors.SafetensorError, RuntimeError) as error:
        raise DamagedFileError(
            f"{weights} does not hold the network that {described_at} describes ({error})."
        ) from error
    return model.eval(), description
