"""Examines this machine: Python, packages, Vulkan, and whether a picture can be rendered.

What may crash (graphics drivers, the simulator) runs in processes of its own.
"""

from __future__ import annotations

import importlib.metadata
import json
import platform
import subprocess
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from artgym.sim import vulkan

PACKAGES = (
    "artgym",
    "numpy",
    "scipy",
    "gymnasium",
    "sapien",
    "mani_skill",
    "trimesh",
    "embreex",
    "h5py",
    "torch",
    "numba",
    "stable_baselines3",
)
# Without one of these the package does nothing; the others belong to extras.
REQUIRED_PACKAGES = (
    "numpy",
    "scipy",
    "gymnasium",
    "sapien",
    "mani_skill",
    "trimesh",
    "embreex",
    "h5py",
)
# A first picture takes 4 s on two idle cores.
RENDER_TIMEOUT_S = 120.0


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What was found on this machine.

    Args:
        python: version and path of the interpreter.
        system: operating system and its version.
        packages: version of each package of interest, None where it is not installed.
        vulkan: what `artgym/sim/vulkan.py` reports: libraries, drivers, devices.
        renderer: device, name and seconds of the first picture, or ``error``.
        problems: one sentence a problem, with its remedy; empty if all is well.
    """

    python: str
    system: str
    packages: dict[str, str | None]
    vulkan: dict[str, Any]
    renderer: dict[str, Any]
    problems: list[str] = field(default_factory=list)

    def is_healthy(self) -> bool:
        """Whether nothing needs mending."""
        return not self.problems

    def to_json(self) -> str:
        """The findings as an indented JSON object."""
        return json.dumps(asdict(self) | {"healthy": self.is_healthy()}, indent=2)


def examine() -> Findings:
    """Look at everything; takes about five seconds, most of them for the first picture."""
    packages = {name: _version(name) for name in PACKAGES}
    absent = [name for name in REQUIRED_PACKAGES if packages[name] is None]
    vulkan_report = _json_from([str(Path(vulkan.__file__).resolve())])
    renderer = _json_from(["-m", "artgym.sim.renderer"])
    problems = []
    if absent:
        problems.append(
            f"packages are missing: {', '.join(absent)}. To mend it: `pip install artgym`, or "
            "`make setup` in a clone."
        )
    reason = vulkan_report.get("problem") or vulkan_report.get("error") or renderer.get("error")
    if reason is not None:
        remedy = vulkan.remedy()
        advice = "" if remedy in reason else f" To mend it: {remedy}"
        problems.append(f"no pictures: {reason}{advice}")
    return Findings(
        python=f"{platform.python_version()} ({sys.executable})",
        system=" ".join(vulkan.operating_system()).strip(),
        packages=packages,
        vulkan=vulkan_report,
        renderer=renderer,
        problems=problems,
    )


def text_from_findings(findings: Findings) -> str:
    """The findings for a person to read."""
    report = findings.vulkan
    missing = report.get("libraries_missing", [])
    loader = "unknown"
    if "libraries_missing" in report:
        loader = "missing" if "libvulkan.so.1" in missing else "found"
    devices = ", ".join(
        device["name"] + (f" [Mesa {'.'.join(map(str, device['mesa']))}]" if device["mesa"] else "")
        for device in report.get("devices", [])
    )
    renderer = findings.renderer
    picture = (
        f"no: {renderer['error']}"
        if "error" in renderer
        else f"yes, on {renderer['device']!r} ({renderer['name']}); "
        f"first picture after {renderer['first_picture_s']} s"
    )
    rows = [
        ("python", findings.python),
        ("system", findings.system),
        *((name, version or "not installed") for name, version in findings.packages.items()),
        ("Vulkan loader", loader),
        ("Vulkan drivers", ", ".join(Path(path).name for path in report.get("drivers", []))),
        ("Vulkan devices", devices),
        ("renders", picture),
    ]
    lines = [f"{name:<18} {value or 'none'}" for name, value in rows]
    verdict = [f"PROBLEM  {problem}" for problem in findings.problems] or ["All is well."]
    return "\n".join([*lines, "", *verdict])


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _json_from(arguments: list[str]) -> dict[str, Any]:
    """Run Python on something whose last line is a JSON object; ``error`` says what went wrong."""
    command = [sys.executable, *arguments]
    try:
        process = subprocess.run(
            command, capture_output=True, text=True, timeout=RENDER_TIMEOUT_S, check=False
        )
    except subprocess.TimeoutExpired:
        return {"error": f"no answer after {RENDER_TIMEOUT_S:.0f} s from {' '.join(arguments)}."}
    # Graphics libraries write log lines of their own before it.
    lines = process.stdout.strip().splitlines() or [""]
    try:
        answer = json.loads(lines[-1])
    except ValueError:
        answer = None
    if isinstance(answer, dict):
        return answer
    last = (process.stderr.strip().splitlines() or lines)[-1] or "no output"
    status = f"signal {-process.returncode}" if process.returncode < 0 else process.returncode
    return {"error": f"{' '.join(arguments)} ended with {status}: {last}"}
