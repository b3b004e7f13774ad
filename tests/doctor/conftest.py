"""What the doctor's tests share: a camera played below the kernel's calls, and trees that look like Linux's."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from linuxpy.video import device as linux

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "capture"))

from kernel_camera import KernelCamera


@pytest.fixture
def play_camera(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., KernelCamera]]:
    """Makes a camera that answers from below linuxpy; its node is `.path`."""
    cameras = []

    def play(**kwargs: object) -> KernelCamera:
        camera = KernelCamera(**kwargs)
        cameras.append(camera)
        monkeypatch.setattr(linux, "ioctl", camera.ioctl)
        monkeypatch.setattr(linux, "mem_map", camera.map_memory)
        return camera

    yield play
    for camera in cameras:
        camera.close()


@pytest.fixture
def plant(tmp_path: Path) -> Callable[[dict[str, str]], Path]:
    """Writes files with their texts below a root, which it gives."""

    def make(files: dict[str, str]) -> Path:
        for name, text in files.items():
            path = tmp_path / "root" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(f"{text}\n", encoding="utf-8")
        return tmp_path / "root"

    return make
