"""What all tests share: one thread a process, and the renderer or a reason to skip."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

# Read by torch, OpenBLAS and numba when they are first imported: before any test module is.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"

import pytest  # noqa: E402

from artgym.errors import RendererUnavailableError  # noqa: E402

if TYPE_CHECKING:
    import sapien


@pytest.fixture(scope="session")
def render_system() -> sapien.render.RenderSystem:
    """This process's RenderSystem; a test that asks for it is skipped where none can be had."""
    from artgym.sim import renderer

    try:
        return renderer.render_system()
    except RendererUnavailableError as error:
        pytest.skip(str(error))
