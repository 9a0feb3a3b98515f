"""`artgym doctor`, and what stands behind it: the Vulkan report, the remedies, the renderer."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from artgym import cli, doctor
from artgym.sim import vulkan

ROOT = Path(__file__).resolve().parents[1]
LAVAPIPE = vulkan.VulkanDevice(name="llvmpipe (LLVM 15)", kind="cpu", mesa=(25, 0, 7))
OLD_LAVAPIPE = vulkan.VulkanDevice(name="llvmpipe (LLVM 15)", kind="cpu", mesa=(22, 3, 6))
GPU = vulkan.VulkanDevice(name="GPU", kind="discrete", pci="0000:01:00.0")


def run_python(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        env=os.environ | variables,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize(
    ("devices", "missing", "mentioned"),
    [
        ([], [], "no driver"),
        ([OLD_LAVAPIPE], [], "22.3.6"),
        ([LAVAPIPE], ["libGL.so.1"], "libGL.so.1"),
    ],
)
def test_a_problem_is_named(
    devices: list[vulkan.VulkanDevice], missing: list[str], mentioned: str
) -> None:
    assert mentioned in (vulkan.problem(devices, missing) or "")


@pytest.mark.parametrize("devices", [[LAVAPIPE], [GPU], [OLD_LAVAPIPE, GPU]])
def test_a_usable_device_is_no_problem(devices: list[vulkan.VulkanDevice]) -> None:
    assert vulkan.problem(devices, []) is None


@pytest.mark.parametrize(
    ("system", "mentioned"),
    [
        (("debian", "12"), "-t bookworm-backports mesa-vulkan-drivers"),
        (("debian", "13"), "libgl1 libegl1 libglib2.0-0 mesa-vulkan-drivers"),
        (("debian", ""), "libgl1 libegl1 libglib2.0-0 mesa-vulkan-drivers"),
        (("ubuntu", "24.04"), "libgl1 libegl1 libglib2.0-0 mesa-vulkan-drivers"),
        (("ubuntu", "22.04"), "Mesa's Vulkan drivers >= 24.3"),
        (("debian", "11"), "Mesa's Vulkan drivers >= 24.3"),
        (("fedora", "42"), "Mesa's Vulkan drivers >= 24.3"),
        (("arch", ""), "Mesa's Vulkan drivers >= 24.3"),
    ],
)
def test_the_remedy_fits_the_system(system: tuple[str, str], mentioned: str) -> None:
    assert mentioned in vulkan.remedy(system)


def test_set_up_asks_what_the_remedy_says() -> None:
    packages = run_python("artgym/sim/vulkan.py", "--packages").stdout.split()
    assert packages == [*vulkan.LIBRARY_PACKAGES.values(), vulkan.DRIVER_PACKAGE]
    assert set(packages) <= set(vulkan.remedy(("debian", "12")).replace("`", " ").split())
    suite = run_python("artgym/sim/vulkan.py", "--suite").stdout.strip()
    assert suite in ("bookworm-backports", "own", "none")


def test_no_driver_is_reported_with_the_remedy() -> None:
    process = run_python("artgym/sim/vulkan.py", VK_ICD_FILENAMES=os.devnull)
    report = json.loads(process.stdout)
    assert process.returncode == 1
    assert report["devices"] == []
    assert report["remedy"] == vulkan.remedy()


def test_nvidia_machine_keeps_the_software_renderer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tool = tmp_path / "nvidia-smi"
    tool.write_text("#!/bin/sh\n")
    tool.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setenv("VK_ICD_FILENAMES", "")
    monkeypatch.setenv("VK_DRIVER_FILES", "")
    before = vulkan.driver_manifests()
    vulkan.offer_every_driver()
    offered = os.environ["VK_ICD_FILENAMES"].split(os.pathsep)
    assert set(before) <= set(offered)
    assert any("nvidia" in Path(path).name for path in offered)


def test_a_choice_of_driver_is_respected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VK_ICD_FILENAMES", "mine.json")
    vulkan.offer_every_driver()
    assert os.environ["VK_ICD_FILENAMES"] == "mine.json"
    assert vulkan.driver_manifests() == ["mine.json"]


def test_renderer_without_a_driver_says_what_to_install() -> None:
    process = run_python("-m", "artgym.sim.renderer", VK_ICD_FILENAMES=os.devnull)
    assert process.returncode == 1
    error = json.loads(process.stdout.splitlines()[-1])["error"]
    assert vulkan.remedy() in error
    assert "State and point-cloud observations work" in error


def test_renderer_is_one_a_process(render_system: object) -> None:
    from artgym.sim import renderer

    assert renderer.render_system() is render_system
    assert renderer.find_device() in ("cuda", "cpu") or renderer.find_device().startswith("pci:")


def test_healthy_machine(render_system: object, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["doctor", "--json"]) == 0
    findings = json.loads(capsys.readouterr().out)
    assert findings["healthy"]
    assert findings["problems"] == []
    assert findings["renderer"]["first_picture_s"] > 0


def test_machine_without_a_driver(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("VK_ICD_FILENAMES", os.devnull)
    assert cli.main(["doctor"]) == 1
    text = capsys.readouterr().out
    assert text.count("PROBLEM") == 1
    assert vulkan.remedy() in text


def test_a_missing_package_is_a_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "REQUIRED_PACKAGES", ("no-such-package",))
    monkeypatch.setattr(doctor, "PACKAGES", ("no-such-package",))
    monkeypatch.setattr(doctor, "_json_from", lambda arguments: {})
    assert "no-such-package" in doctor.examine().problems[0]


@pytest.mark.parametrize(
    ("script", "mentioned"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "signal 11"),
        ("raise RuntimeError('why')", "why"),
        ("print('no object')", "no object"),
    ],
)
def test_what_crashes_is_reported(script: str, mentioned: str) -> None:
    assert mentioned in doctor._json_from(["-c", script])["error"]


def test_what_hangs_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "RENDER_TIMEOUT_S", 0.5)
    assert "no answer" in doctor._json_from(["-c", "import time; time.sleep(60)"])["error"]


def test_unknown_subcommand_names_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["docter"]) == 2
    assert "Nearest: 'doctor'" in capsys.readouterr().err


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("artgym ")
