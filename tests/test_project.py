"""Holds what the project says about itself: versions, extras and commands."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions, version
from pathlib import Path

import pytest

import artgym

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
PACKAGES = ("artgym", "icaf4_policy", "benchmarks")


def canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def requirement_name(requirement: str) -> str:
    return canonical(re.match(r"[A-Za-z0-9._-]+", requirement)[0])


def constraints() -> dict[str, str]:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pairs = [line.split("==") for line in lines if line and not line.startswith("#")]
    return {canonical(name): pinned for name, pinned in pairs}


def requirements() -> list[str]:
    extras = PROJECT["optional-dependencies"].values()
    return PROJECT["dependencies"] + [item for extra in extras for item in extra]


def extras_named_in(text: str) -> set[str]:
    """Extras in "artgym[a,b]"; a placeholder such as ``{extra}`` is not one."""
    named = re.findall(r"(?:artgym|\.)\[([a-z0-9_, -]+)\]", text)
    return {extra.strip() for group in named for extra in group.split(",")}


def make_targets_named_in(text: str) -> set[str]:
    return set(re.findall(r"(?:^|[`$\s])make ([a-z][a-z-]*)(?=[`\s]|$)", text, flags=re.MULTILINE))


def code_in(markdown: str) -> str:
    """Fenced blocks, indented blocks and code spans: prose may say "make sure"."""
    fenced = re.findall(r"```.*?\n(.*?)```", markdown, flags=re.DOTALL)
    indented = re.findall(r"^(?: {4}|\t)(.*)$", markdown, flags=re.MULTILINE)
    spans = re.findall(r"`[^`\n]+`", markdown)
    return "\n".join([*fenced, *indented, *spans])


def makefile_targets() -> set[str]:
    return set(re.findall(r"^([a-z][a-z-]*):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))


def test_the_version_is_the_metadata_s() -> None:
    assert artgym.__version__ == version("artgym") == PROJECT["version"]


def test_the_version_is_written_once() -> None:
    literal = re.compile(rf"""["']{re.escape(PROJECT["version"])}["']""")
    sources = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    assert [path for path in sources if literal.search(path.read_text())] == []


def test_exact_versions_stand_only_in_the_constraints() -> None:
    assert [requirement for requirement in requirements() if "==" in requirement] == []
    pinned = constraints()
    for script in (ROOT / "scripts").glob("*.sh"):
        assert re.findall(r"[a-z0-9_-]==\d", script.read_text()) == [], script
    assert [item for item in requirements() if requirement_name(item) not in pinned] == []


@pytest.mark.parametrize("name", sorted({requirement_name(item) for item in requirements()}))
def test_installed_version_is_the_constrained_one(name: str) -> None:
    # "+cpu" and the like name a build of the same version.
    assert version(name).split("+")[0] == constraints()[name]


def test_everything_imported_is_declared() -> None:
    declared = {requirement_name(item) for item in requirements()}
    distributions = packages_distributions()
    undeclared = []
    for path in (path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module or ""]
            for name in {name.split(".")[0] for name in names} - {
                *PACKAGES,
                *sys.stdlib_module_names,
            }:
                if not declared & {canonical(item) for item in distributions.get(name, [])}:
                    undeclared.append(f"{path.relative_to(ROOT)}:{node.lineno} {name}")
    assert undeclared == []


def test_extras_named_anywhere_exist() -> None:
    known = set(PROJECT["optional-dependencies"])
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    files += [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    unknown = {path: extras_named_in(path.read_text()) - known for path in files}
    assert {path: extras for path, extras in unknown.items() if extras} == {}
    setup = (ROOT / "scripts" / "setup.sh").read_text()
    assert set(re.search(r"^EXTRAS=(.*)$", setup, flags=re.MULTILINE)[1].split(",")) <= known


def test_extras_are_recognised_in_text() -> None:
    assert extras_named_in("pip install 'artgym[rl,train]' or -e .[dev]") == {"rl", "train", "dev"}


def test_readme_commands_exist() -> None:
    named = make_targets_named_in(code_in((ROOT / "README.md").read_text()))
    assert {"test", "bench"} <= named
    assert named <= makefile_targets()


def test_commands_are_recognised_in_text() -> None:
    text = "    make test   # runs\n`make bench` and\nto make sure\n```bash\nmake lint\n```"
    assert make_targets_named_in(code_in(text)) == {"test", "bench", "lint"}


def test_the_check_runs_the_readme_s_test_command() -> None:
    check = ROOT / ".ci" / "run"
    assert check.stat().st_mode & 0o100
    assert re.findall(r"^(?:exec )?(make [a-z-]+)$", check.read_text(), flags=re.MULTILINE) == [
        "make test"
    ]


@pytest.mark.parametrize("script", [".ci/run", "scripts/setup.sh", "scripts/system_packages.sh"])
def test_scripts_parse(script: str) -> None:
    subprocess.run(["bash", "-n", script], cwd=ROOT, check=True)
