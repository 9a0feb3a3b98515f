"""What all tests share: one thread a process, own folders, the renderer or a reason to skip."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

# Read by torch, OpenBLAS and numba when they are first imported: before any test module is.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"

import pytest  # noqa: E402

from artgym.errors import RendererUnavailableError  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Iterator

    import sapien


@pytest.fixture(autouse=True, scope="session")
def own_folders(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No test sees or leaves anything in the caller's caches and imported objects."""
    folder = tmp_path_factory.mktemp("artgym")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ARTGYM_CACHE", str(folder / "cache"))
        patch.setenv("ARTGYM_OBJECTS", str(folder / "objects"))
        yield


@pytest.fixture(scope="session")
def render_system() -> sapien.render.RenderSystem:
    """This process's RenderSystem; a test that asks for it is skipped where none can be had."""
    from artgym.sim import renderer

    try:
        return renderer.render_system()
    except RendererUnavailableError as error:
        pytest.skip(str(error))
