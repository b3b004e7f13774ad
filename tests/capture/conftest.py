"""Fixtures for the capture tests."""

import sys
from collections.abc import Callable

import pytest
from kernel_camera import KernelCamera
from linuxpy.video import device as linux
from played_libcamera import PlayedLibcamera


@pytest.fixture
def play_camera(monkeypatch) -> Callable[..., KernelCamera]:
    """Make a camera that answers from below linuxpy; its node is `.path`."""
    cameras = []

    def play(**kwargs) -> KernelCamera:
        camera = KernelCamera(**kwargs)
        cameras.append(camera)
        monkeypatch.setattr(linux, "ioctl", camera.ioctl)
        monkeypatch.setattr(linux, "mem_map", camera.map_memory)
        return camera

    yield play
    for camera in cameras:
        camera.close()


@pytest.fixture
def play_libcamera(monkeypatch) -> PlayedLibcamera:
    """libcamera's bindings, played: `.plug()` makes a camera."""
    played = PlayedLibcamera()
    monkeypatch.setitem(sys.modules, "libcamera", played)
    yield played
    played.manager.close()
