"""Which Vulkan devices this machine has, and what to install when none can render.

Standard library only, and runnable as a plain script: the set-up asks it before anything is
installed. Loading a broken driver can kill the process, so callers that must survive run it in a
process of its own (``python artgym/sim/vulkan.py`` prints JSON).
"""

from __future__ import annotations

import ctypes
import importlib.util
import json
import os
import platform
import re
import shutil
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

# Older lavapipe lacks the device features that SAPIEN's renderer asks for.
MIN_MESA = (24, 3)

# What sapien and opencv load at import (libGL brings libX11), and the Vulkan loader.
LIBRARY_PACKAGES = {
    "libvulkan.so.1": "libvulkan1",
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libgthread-2.0.so.0": "libglib2.0-0",
}
DRIVER_PACKAGE = "mesa-vulkan-drivers"

_ICD_FOLDERS = (
    "/etc/vulkan/icd.d",
    "/usr/local/share/vulkan/icd.d",
    "/usr/share/vulkan/icd.d",
)
_DEVICE_TYPES = {0: "other", 1: "integrated", 2: "discrete", 3: "virtual", 4: "cpu"}
_MAX_DEVICES = 64


@dataclass(frozen=True, kw_only=True)
class VulkanDevice:
    """One device a Vulkan driver offers.

    Args:
        name: as the driver gives it.
        kind: "discrete", "integrated", "virtual", "cpu" or "other".
        mesa: (major, minor, patch) of a Mesa driver, None for anything else.
        pci: PCI address ``domain:bus:device.function`` of a real GPU, None if unknown.
    """

    name: str
    kind: str
    mesa: tuple[int, int, int] | None = None
    pci: str | None = None

    def can_render(self) -> bool:
        """Whether SAPIEN is expected to render on it."""
        return self.kind != "cpu" or (self.mesa is not None and self.mesa[:2] >= MIN_MESA)


class _InstanceCreateInfo(ctypes.Structure):
    _fields_ = (
        ("structure_type", ctypes.c_int),
        ("next", ctypes.c_void_p),
        ("flags", ctypes.c_uint32),
        ("application_info", ctypes.c_void_p),
        ("layer_count", ctypes.c_uint32),
        ("layers", ctypes.c_void_p),
        ("extension_count", ctypes.c_uint32),
        ("extensions", ctypes.c_void_p),
    )


class _ApplicationInfo(ctypes.Structure):
    _fields_ = (
        ("structure_type", ctypes.c_int),
        ("next", ctypes.c_void_p),
        ("application_name", ctypes.c_char_p),
        ("application_version", ctypes.c_uint32),
        ("engine_name", ctypes.c_char_p),
        ("engine_version", ctypes.c_uint32),
        ("api_version", ctypes.c_uint32),
    )


class _PciBusInfo(ctypes.Structure):
    _fields_ = (
        ("structure_type", ctypes.c_int),
        ("next", ctypes.c_void_p),
        ("domain", ctypes.c_uint32),
        ("bus", ctypes.c_uint32),
        ("device", ctypes.c_uint32),
        ("function", ctypes.c_uint32),
    )


class _DriverInfo(ctypes.Structure):
    _fields_ = (
        ("structure_type", ctypes.c_int),
        ("next", ctypes.c_void_p),
        ("driver_id", ctypes.c_int),
        ("driver_name", ctypes.c_char * 256),
        ("driver_info", ctypes.c_char * 256),
        ("conformance", ctypes.c_uint32),
    )


class _DeviceProperties(ctypes.Structure):
    """VkPhysicalDeviceProperties2; of the nested properties only the head is read."""

    _fields_ = (
        ("structure_type", ctypes.c_int),
        ("next", ctypes.c_void_p),
        ("api_version", ctypes.c_uint32),
        ("driver_version", ctypes.c_uint32),
        ("vendor_id", ctypes.c_uint32),
        ("device_id", ctypes.c_uint32),
        ("device_type", ctypes.c_uint32),
        ("device_name", ctypes.c_char * 256),
        ("rest", ctypes.c_uint64 * 256),
    )


def devices() -> list[VulkanDevice]:
    """All devices the installed Vulkan drivers offer; empty without a loader or a driver."""
    try:
        loader = ctypes.CDLL("libvulkan.so.1")
    except OSError:
        return []
    api_1_1 = (1 << 22) | (1 << 12)
    application = _ApplicationInfo(structure_type=0, api_version=api_1_1)
    create_info = _InstanceCreateInfo(
        structure_type=1, application_info=ctypes.addressof(application)
    )
    instance = ctypes.c_void_p()
    if loader.vkCreateInstance(ctypes.byref(create_info), None, ctypes.byref(instance)) != 0:
        return []
    try:
        handles = (ctypes.c_void_p * _MAX_DEVICES)()
        count = ctypes.c_uint32(_MAX_DEVICES)
        if loader.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), handles) < 0:
            return []
        return [_describe(loader, handles[i]) for i in range(count.value)]
    finally:
        loader.vkDestroyInstance(instance, None)


def _describe(loader: ctypes.CDLL, handle: int | None) -> VulkanDevice:
    driver = _DriverInfo(structure_type=1000196000)
    pci_info = _PciBusInfo(structure_type=1000212000, next=ctypes.addressof(driver))
    properties = _DeviceProperties(structure_type=1000059001, next=ctypes.addressof(pci_info))
    loader.vkGetPhysicalDeviceProperties2(ctypes.c_void_p(handle), ctypes.byref(properties))
    kind = _DEVICE_TYPES.get(properties.device_type, "other")
    name = properties.device_name.decode(errors="replace")
    # lavapipe's driver_version is always 1; its text reads "Mesa 25.0.7-2 (LLVM 15.0.6)".
    version = re.match(rb"Mesa (\d+)\.(\d+)\.(\d+)", driver.driver_info)
    address = (pci_info.domain, pci_info.bus, pci_info.device, pci_info.function)
    return VulkanDevice(
        name=name,
        kind=kind,
        mesa=(int(version[1]), int(version[2]), int(version[3])) if version else None,
        pci="{:04x}:{:02x}:{:02x}.{:x}".format(*address) if any(address) else None,
    )


def driver_manifests() -> list[str]:
    """The driver manifests (ICD files) that the Vulkan loader will read."""
    chosen = os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")
    if chosen:
        return [path for path in chosen.split(os.pathsep) if path]
    return [str(path) for folder in _ICD_FOLDERS for path in sorted(Path(folder).glob("*.json"))]


def offer_every_driver() -> None:
    """Keep sapien from hiding the software renderer on an NVIDIA machine; changes os.environ.

    Where ``nvidia-smi`` works and no NVIDIA manifest lies in /usr/share, sapien points the loader
    at a manifest of its own and at nothing else. If the driver then lacks its graphics half (many
    containers), not even lavapipe is found. A list that holds both is left alone by sapien.
    """
    chosen = os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")
    if chosen or shutil.which("nvidia-smi") is None:
        return
    manifests = driver_manifests()
    if any("nvidia" in Path(path).name for path in manifests):
        os.environ["VK_ICD_FILENAMES"] = os.pathsep.join(manifests)
        return
    sapien = importlib.util.find_spec("sapien")
    if sapien is not None and sapien.origin is not None:
        own = Path(sapien.origin).parent / "vulkan_library" / "nvidia_icd.json"
        os.environ["VK_ICD_FILENAMES"] = os.pathsep.join([*manifests, str(own)])


def missing_libraries() -> list[str]:
    """The shared libraries of LIBRARY_PACKAGES that cannot be loaded."""
    missing = []
    for library in LIBRARY_PACKAGES:
        try:
            ctypes.CDLL(library)
        except OSError:
            missing.append(library)
    return missing


def problem(found: list[VulkanDevice], missing: list[str]) -> str | None:
    """Why nothing here can render, in one sentence; None if something can.

    Args:
        found: what `devices` gave.
        missing: what `missing_libraries` gave.
    """
    wanted = ".".join(map(str, MIN_MESA))
    if missing:
        return f"system libraries are missing: {', '.join(missing)}."
    if not found:
        return "the Vulkan loader found no driver that offers a device."
    if any(device.can_render() for device in found):
        return None
    names = ", ".join(
        device.name + (f" of Mesa {'.'.join(map(str, device.mesa))}" if device.mesa else "")
        for device in found
    )
    return f"the only Vulkan device is {names}; needed is a GPU driver or Mesa >= {wanted}."


def operating_system() -> tuple[str, str]:
    """(id, version) as /etc/os-release gives them, such as ("debian", "12")."""
    try:
        release = platform.freedesktop_os_release()
    except OSError:
        return (platform.system().lower(), platform.release())
    return (release.get("ID", ""), release.get("VERSION_ID", ""))


def needs_backports(system: tuple[str, str]) -> bool:
    """Whether this system's own Mesa is too old while its backports have a newer one."""
    return system == ("debian", "12")


def ships_recent_mesa(system: tuple[str, str]) -> bool:
    """Whether this system's own Mesa is new enough, by plain apt."""
    distribution, version = system
    first_good = {"debian": (13, 0), "ubuntu": (24, 4)}.get(distribution)
    try:
        number = tuple(int(part) for part in version.split("."))
    except ValueError:
        # Debian's testing and unstable state no version.
        return distribution == "debian" and not version
    return first_good is not None and (*number, 0)[:2] >= first_good


def remedy(system: tuple[str, str] | None = None) -> str:
    """What to type on this machine so that images can be rendered.

    Args:
        system: (id, version) of the operating system; by default the one this runs on.
    """
    system = operating_system() if system is None else system
    libraries = " ".join(LIBRARY_PACKAGES.values())
    install = "apt-get update && apt-get install -y --no-install-recommends"
    if needs_backports(system):
        return (
            "as root, `make system` in a clone of this project; or add the suite "
            "bookworm-backports of your Debian mirror to /etc/apt/sources.list.d, then "
            f"`{install} {libraries} && apt-get install -y --no-install-recommends "
            f"-t bookworm-backports {DRIVER_PACKAGE}`."
        )
    if ships_recent_mesa(system):
        return f"as root: `{install} {libraries} {DRIVER_PACKAGE}`."
    wanted = ".".join(map(str, MIN_MESA))
    return (
        f"install the Vulkan loader, libGL, libEGL, glib and Mesa's Vulkan drivers >= {wanted} "
        "from your system's packages, or the Vulkan driver of your GPU (in a container of an "
        "NVIDIA machine: start it with NVIDIA_DRIVER_CAPABILITIES=all)."
    )


def report() -> dict[str, Any]:
    """All of the above as plain data, for people and for the set-up script."""
    found, missing = devices(), missing_libraries()
    system = operating_system()
    return {
        "libraries_missing": missing,
        "drivers": driver_manifests(),
        "devices": [asdict(device) for device in found],
        "problem": problem(found, missing),
        "system": " ".join(system).strip(),
        "remedy": remedy(system),
    }


def main() -> int:
    """Print the report as JSON, or what the set-up script asks for.

    ``--packages`` prints the system packages, ``--suite`` the suite they need beyond the system's
    own ("bookworm-backports", "own", or "none" if apt cannot provide them), ``--remedy`` the
    problem and the remedy. Exit status 0 if something can render, 1 if not.
    """
    question = sys.argv[1] if len(sys.argv) > 1 else ""
    offer_every_driver()
    system = operating_system()
    found = report()
    if question == "--packages":
        print(" ".join(LIBRARY_PACKAGES.values()), DRIVER_PACKAGE)
    elif question == "--suite":
        own = "own" if ships_recent_mesa(system) else "none"
        print("bookworm-backports" if needs_backports(system) else own)
    elif question == "--remedy":
        if found["problem"]:
            print(f"{found['problem']} To mend it: {found['remedy']}")
    else:
        print(json.dumps(found))
    return 0 if found["problem"] is None else 1


if __name__ == "__main__":
    sys.exit(main())
