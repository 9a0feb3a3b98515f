"""Holds the arrows between packages and the bans that keep the code safe to load.

The rules are functions from one module's source to complaints, so that each can be shown to fail.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("artgym", "icaf4_policy", "benchmarks")

# A module whose name starts with the left side may import of the project only the right side.
ALLOWED_IMPORTS = {
    "artgym.errors": (),
    "artgym.geometry": ("artgym.geometry", "artgym.errors"),
    "artgym.objects": (
        "artgym.objects",
        "artgym.categories",
        "artgym.geometry",
        "artgym.files",
        "artgym.errors",
    ),
    "artgym.tasks": ("artgym.tasks", "artgym.objects", "artgym.geometry", "artgym.errors"),
    "artgym.sim": ("artgym.sim", "artgym.objects", "artgym.geometry", "artgym.errors"),
    "artgym": ("artgym",),
    "artgym.files": ("artgym.files", "artgym.errors"),
    "artgym.control": ("artgym.control", "artgym.geometry", "artgym.errors"),
    "icaf4_policy": (
        "icaf4_policy",
        "artgym.control",
        "artgym.geometry",
        "artgym.datasets",
        "artgym.files",
        "artgym.errors",
    ),
    "benchmarks": ("benchmarks", "artgym", "icaf4_policy"),
}
# Who may import what others may not, by prefix of the module's name.
SOLE_USERS = {
    # The protocol is another project's, in a process of its own.
    "sapien": ("artgym.sim", "artgym.maniskill", "benchmarks.where2act_protocol"),
    "mani_skill": ("artgym.maniskill", "benchmarks.maniskill_twin"),
    # Where its compiled operators are missing, they must be registered before it is imported.
    "torchvision": ("icaf4_policy.detector.torchvision_ops",),
}
# The plain-numpy packages import nothing that is heavy or draws.
NUMPY_ONLY = ("artgym.geometry",)
NUMPY_ONLY_BANS = ("torch", "sapien", "mani_skill", "gymnasium", "trimesh")
FORBIDDEN_MODULES = ("pickle", "cPickle", "dill", "cloudpickle", "marshal", "shelve")
FORBIDDEN_CALLS = ("eval", "exec", "torch.load", "yaml.load", "yaml.unsafe_load", "joblib.load")
FORBIDDEN_NAMES = ("util", "utils", "helper", "helpers", "common", "manager", "managers", "misc")


def is_in(module: str, prefix: str) -> bool:
    return module == prefix or module.startswith(prefix + ".")


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def project_modules() -> list[Path]:
    return [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]


def imported_modules(tree: ast.AST, module: str, is_package: bool) -> list[tuple[int, str]]:
    """(line, full dotted name) of everything imported, at any depth of the file."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                up = node.level - 1 if is_package else node.level
                parents = module.split(".")
                parents = parents[: len(parents) - up]
                base = ".".join([*parents, *([base] if base else [])])
            # `from artgym import sim` imports artgym.sim as much as artgym.
            found += [(node.lineno, f"{base}.{alias.name}") for alias in node.names]
        elif isinstance(node, ast.Call) and node.args:
            literal = node.args[0]
            if (
                ast.unparse(node.func) in ("importlib.import_module", "import_module", "__import__")
                and isinstance(literal, ast.Constant)
                and isinstance(literal.value, str)
            ):
                found.append((node.lineno, literal.value))
    return found


def complaints(source: str, module: str, *, is_package: bool = False) -> list[str]:
    """Everything one module does that the architecture forbids."""
    tree = ast.parse(source)
    found = []
    rule = max((name for name in ALLOWED_IMPORTS if is_in(module, name)), key=len)
    for line, name in imported_modules(tree, module, is_package):
        where = f"{module}:{line} imports {name}"
        if name.split(".")[0] in PACKAGES and not any(
            is_in(name, allowed) for allowed in ALLOWED_IMPORTS[rule]
        ):
            found.append(f"{where}; {rule} may import {ALLOWED_IMPORTS[rule]}")
        for package, users in SOLE_USERS.items():
            if is_in(name, package) and not any(is_in(module, user) for user in users):
                found.append(f"{where}; only {users} may")
        if any(is_in(module, package) for package in NUMPY_ONLY) and any(
            is_in(name, ban) for ban in NUMPY_ONLY_BANS
        ):
            found.append(f"{where}; it is plain numpy")
        if any(is_in(name, ban) for ban in FORBIDDEN_MODULES):
            found.append(f"{where}, which can run code from a file")
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func) in FORBIDDEN_CALLS:
            found.append(f"{module}:{node.lineno} calls {ast.unparse(node.func)}")
        if (
            isinstance(node, ast.keyword)
            and node.arg == "allow_pickle"
            and ast.unparse(node.value) != "False"
        ):
            found.append(f"{module}:{node.value.lineno} allows pickles")
    if module.split(".")[-1] in FORBIDDEN_NAMES:
        found.append(f"{module} has a name that says nothing about what it holds")
    return found


@pytest.mark.parametrize("path", project_modules(), ids=module_name)
def test_module_keeps_the_architecture(path: Path) -> None:
    is_package = path.name == "__init__.py"
    assert complaints(path.read_text(), module_name(path), is_package=is_package) == []


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("artgym.envs.open", "import icaf4_policy"),
        ("artgym.envs.open", "from icaf4_policy.model import Model"),
        ("artgym.envs.open", "def f():\n    import sapien.render"),
        ("artgym.envs.open", "import importlib\nimportlib.import_module('sapien')"),
        ("artgym.sim.scene", "import mani_skill.envs"),
        ("artgym.sim.scene", "from artgym.tasks import success"),
        ("artgym.tasks.success", "from artgym import sim"),
        ("artgym.tasks.success", "from ..sim import scene"),
        ("artgym.tasks.success", "import sapien"),
        ("artgym.geometry.camera", "from artgym.objects.model import Part"),
        ("artgym.geometry.camera", "import torch"),
        ("artgym.errors", "import artgym.geometry"),
        ("icaf4_policy.policy", "from artgym.envs import articulated_env"),
        ("icaf4_policy.policy", "import artgym"),
        ("icaf4_policy.policy", "import sapien"),
        ("icaf4_policy.detector.model", "from torchvision.ops import nms"),
        ("benchmarks.rate", "import sapien"),
        ("icaf4_policy.checkpoint", "import pickle"),
        ("icaf4_policy.checkpoint", "import torch\ntorch.load('x')"),
        ("artgym.files", "import numpy as np\nnp.load('x', allow_pickle=True)"),
        ("artgym.cli", "eval('1')"),
        ("artgym.cli", "exec('1')"),
        ("artgym.objects.utils", ""),
    ],
)
def test_a_breach_is_noticed(module: str, source: str) -> None:
    assert complaints(source, module)


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("artgym.sim.scene", "import sapien\nfrom artgym.objects.model import Part"),
        ("artgym.maniskill.open", "import mani_skill.envs, sapien"),
        ("icaf4_policy.model", "from artgym.geometry import screw\nmodel.eval()"),
        ("artgym.files", "import numpy as np\nnp.load('x', allow_pickle=False)"),
        ("benchmarks.rate", "import artgym\nfrom icaf4_policy import policy"),
    ],
)
def test_what_is_allowed_passes(module: str, source: str) -> None:
    assert complaints(source, module) == []


def test_importing_artgym_is_light() -> None:
    script = (
        "import sys, time; start = time.perf_counter(); import artgym, gymnasium\n"
        "print(time.perf_counter() - start)\n"
        "print([name for name in ('sapien', 'torch', 'mani_skill', 'trimesh', 'h5py')"
        " if name in sys.modules])\n"
        "print('ArtOpen-v0' in gymnasium.registry)"
    )
    process = subprocess.run(
        [sys.executable, "-W", "error", "-c", script],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    seconds, heavy, registered = process.stdout.splitlines()
    assert heavy == "[]"
    assert registered == "True"
    # 0.2 s on an idle core; the simulator alone would take 0.5 s, ManiSkill 5 s.
    assert float(seconds) < 2.0
