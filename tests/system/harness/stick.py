"""A USB stick for the guest, plugged in and pulled out while it runs: an image with a partition of FAT, made and read here.

Knows QEMU's monitor, mkfs.vfat and mtools. Knows nothing of dnb-edge.
"""

from __future__ import annotations

import hashlib
import shutil
import struct
import subprocess
import time
from pathlib import Path

from harness.guest import Guest, GuestFault

_FIRST_SECTOR = 2048
_SECTOR_BYTES = 512
PATIENCE_S = 60.0
"""For the guest to let a pulled stick go."""


def obstacle() -> str | None:
    """Why no stick can be made on this machine; None where one can."""
    wanted = {"mkfs.vfat": "dosfstools", "mmd": "mtools"}
    missing = [package for program, package in wanted.items() if shutil.which(program) is None]
    return f"needs programs that are not here: apt install {' '.join(missing)}" if missing else None


class Stick:
    """A stick of `size_mb`, as they are sold: one partition with FAT32 or FAT16, by its size."""

    def __init__(self, image: Path, *, size_mb: int = 64) -> None:
        """Makes it, empty, in the file `image`."""
        self.image = image
        self._name = f"stick{hashlib.sha256(str(image).encode()).hexdigest()[:8]}"
        sectors = size_mb * 2048
        with image.open("wb") as stream:
            stream.truncate(sectors * _SECTOR_BYTES)
            entry = struct.pack("<B3sB3sII", 0, b"", 0x0C, b"", _FIRST_SECTOR, sectors - _FIRST_SECTOR)
            stream.seek(446)
            stream.write(entry.ljust(64, b"\0") + b"\x55\xaa")
        _run("mkfs.vfat", "--offset", str(_FIRST_SECTOR), "-n", "STICK", image, str((sectors - _FIRST_SECTOR) // 2))

    @property
    def digest(self) -> str:
        """Changes with any byte on it."""
        return hashlib.sha256(self.image.read_bytes()).hexdigest()

    def make_folder(self, name: str) -> None:
        """Makes a folder on it, while it is not plugged in."""
        _run("mmd", "-i", self._part, f"::{name}")

    def read(self, folder: str, to: Path) -> Path:
        """Copies a folder with all in it out of the image; where it lies then."""
        to.mkdir(parents=True, exist_ok=True)
        _run("mcopy", "-s", "-n", "-m", "-i", self._part, f"::{folder}", to)
        return to / Path(folder).name

    def plug(self, guest: Guest) -> None:
        """Plugs it into the guest, which gets a USB controller with its first stick."""
        if not any(bus["bus"] == 0 and _has_xhci(bus) for bus in guest.monitor("query-pci")):
            guest.monitor("device_add", driver="qemu-xhci", id="sticks")
        file = {"driver": "file", "filename": str(self.image)}
        guest.monitor("blockdev-add", driver="raw", **{"node-name": self._name}, file=file)
        guest.monitor(
            "device_add", driver="usb-storage", id=self._name, bus="sticks.0", drive=self._name, removable=True
        )

    def pull(self, guest: Guest) -> None:
        """Pulls it out; it can be plugged in again."""
        guest.monitor("device_del", id=self._name)
        deadline_s = time.monotonic() + PATIENCE_S
        while True:
            try:
                guest.monitor("blockdev-del", **{"node-name": self._name})
            except GuestFault:
                # Still in use: the guest has not let it go yet.
                if time.monotonic() > deadline_s:
                    raise
                time.sleep(0.1)
            else:
                return

    @property
    def _part(self) -> str:
        return f"{self.image}@@{_FIRST_SECTOR * _SECTOR_BYTES}"


def _has_xhci(bus: dict[str, object]) -> bool:
    devices = bus["devices"]
    assert isinstance(devices, list)
    return any(device["qdev_id"] == "sticks" for device in devices)


def _run(*words: str | Path) -> None:
    subprocess.run([str(word) for word in words], check=True, capture_output=True, timeout=60)
