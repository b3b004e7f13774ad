"""Cameras as files: lasting names, who uses one, whose it is. On real links, processes and modes in a folder of the test."""

import grp
import os
import subprocess
import sys

import pytest

from dnb_edge.capture.v4l2_nodes import (
    busy_words,
    camera_id,
    first_camera,
    known_cameras,
    node_of,
    permission_words,
    picture_node,
)
from dnb_edge.capture.v4l2_setup import open_device, refusal
from dnb_edge.errors import InputError

NAME = "usb-Acme_Webcam_SN7-video-index0"


class Known:
    """The part of an open device that its identity is made of."""

    class info:  # noqa: N801
        card, bus_info = "Acme Webcam", "usb-0000:01:00.0-1.3"


@pytest.fixture
def machine(tmp_path):
    """A /dev and a /sys: make(node, links, serial) plugs a camera in there."""
    dev, sys_ = tmp_path / "dev", tmp_path / "sys"
    dev.mkdir()

    def make(node, *, links=(), serial=None):
        for folder, name in links:
            link = dev / "v4l" / folder / name
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(node)
        number = node.stat().st_rdev
        usb = tmp_path / "usb" / "1-1.3" / "1-1.3:1.0"
        usb.mkdir(parents=True, exist_ok=True)
        if serial is not None:
            (usb.parent / "serial").write_text(f"{serial}\n")
        entry = sys_ / "dev" / "char" / f"{os.major(number)}:{os.minor(number)}"
        entry.mkdir(parents=True)
        (entry / "device").symlink_to(usb)

    make.dev, make.sys = dev, sys_
    return make


def test_a_serial_number_names_the_camera(machine, play_camera):
    """With a serial number the identity is the by-id name, which goes with the camera to any socket and node."""
    node = play_camera().path
    machine(node, links=[("by-id", NAME)], serial="SN7")
    assert camera_id(node, Known(), dev=machine.dev, sys=machine.sys) == NAME
    link = machine.dev / "v4l" / "by-id" / NAME
    assert camera_id(link, Known(), dev=machine.dev, sys=machine.sys) == NAME
    assert node_of(NAME, dev=machine.dev, sys=machine.sys) == link


@pytest.mark.parametrize("serial", [None, "", "  "])
def test_without_a_serial_number_the_socket_names_it(machine, play_camera, serial):
    """All cameras of a make share the by-id name then: card and bus tell two of them apart."""
    node = play_camera().path
    machine(node, links=[("by-id", "usb-Acme_Webcam-video-index0")], serial=serial)
    assert camera_id(node, Known(), dev=machine.dev, sys=machine.sys) == "Acme Webcam (usb-0000:01:00.0-1.3)"


def test_a_camera_is_found_by_its_socket_whatever_its_node(machine, play_camera):
    """Card and bus are looked for among all nodes; another camera's identity finds nothing."""
    node = play_camera().path
    (machine.dev / "video4").symlink_to(node)
    assert node_of("Played Camera (usb-test-1)", dev=machine.dev, sys=machine.sys) == machine.dev / "video4"
    assert node_of("Played Camera (usb-test-2)", dev=machine.dev, sys=machine.sys) is None
    assert node_of("../video4", dev=machine.dev, sys=machine.sys) is None


def test_a_metadata_node_is_not_found_by_its_camera(machine, play_camera):
    """A camera's two nodes have one card and bus: only the one that gives pictures counts."""
    node = play_camera(caps=0x04800000).path
    (machine.dev / "video1").symlink_to(node)
    assert node_of("Played Camera (usb-test-1)", dev=machine.dev, sys=machine.sys) is None


def test_the_first_camera_is_taken_where_nobody_names_one(machine, play_camera):
    """By its lasting name where it has one, else by its node; what cannot be opened is passed over; on USB only, or any."""
    (machine.dev / "video0").symlink_to(machine.dev / "gone")
    assert first_camera(dev=machine.dev, usb=False) is None
    node = play_camera().path
    (machine.dev / "video10").symlink_to(node)
    (machine.dev / "video4").symlink_to(node)
    assert first_camera(dev=machine.dev, usb=False) == machine.dev / "video4"
    machine(node, links=[("by-id", NAME), ("by-id", "usb-Acme_Webcam_SN7-video-index1")])
    assert first_camera(dev=machine.dev, usb=False) == machine.dev / "v4l" / "by-id" / NAME
    assert first_camera(dev=machine.dev, usb=True) is None


def test_a_metadata_node_is_nobodys_first_camera(machine, play_camera):
    """It gives no pictures."""
    (machine.dev / "video1").symlink_to(play_camera(caps=0x04800000).path)
    assert first_camera(dev=machine.dev, usb=False) is None


def test_cameras_are_listed_by_their_lasting_names(tmp_path):
    """Lasting names first, metadata nodes left out, what udev does not name by its node."""
    assert known_cameras(tmp_path) == "no camera is connected to this machine"
    for name in ("video0", "video1", "video9"):
        (tmp_path / name).touch()
    (tmp_path / "v4l" / "by-id").mkdir(parents=True)
    first, second = (tmp_path / "v4l" / "by-id" / f"usb-Acme-video-index{number}" for number in (0, 1))
    first.symlink_to(tmp_path / "video0")
    second.symlink_to(tmp_path / "video1")
    (tmp_path / "v4l" / "by-id" / "usb-Gone-video-index0").symlink_to(tmp_path / "video7")
    assert known_cameras(tmp_path) == f"this machine has {first} (video0), {tmp_path / 'video9'}"
    assert picture_node(tmp_path / "video1", dev=tmp_path) == first
    assert picture_node(second, dev=tmp_path) == first
    assert picture_node(first, dev=tmp_path) is None


def test_a_link_opens_as_its_node_does(tmp_path, play_camera):
    """A source named by /dev/v4l/by-id opens; one whose camera is gone is told as no camera."""
    link = tmp_path / NAME
    link.symlink_to(play_camera().path)
    open_device(link).close()
    gone = tmp_path / "usb-Gone-video-index0"
    gone.symlink_to(tmp_path / "video7")
    with pytest.raises(InputError, match="usb-Gone-video-index0: there is no such camera"):
        open_device(gone)


def test_the_program_that_uses_a_camera_is_named(play_camera):
    """Another process that holds the node open is told by name and number, our own is not."""
    camera = play_camera()
    hold = f"import sys; held = open({str(camera.path)!r}, 'rb'); print('open', flush=True); sys.stdin.read()"
    with subprocess.Popen([sys.executable, "-c", hold], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"open\n"
        text = str(refusal(camera.path, OSError(16, "busy")))
        assert f"process {other.pid})" in text
        assert f"process {os.getpid()}" not in text
    assert f"process {os.getpid()}" not in busy_words(camera.path)


def test_programs_that_may_not_be_looked_into_are_admitted(tmp_path, monkeypatch):
    """Where another user's process may hold the camera, the line says so and how to find out."""
    (tmp_path / "12" / "fd").mkdir(parents=True)
    (tmp_path / "12" / "comm").write_text("guvcview\n")
    (tmp_path / "12" / "fd" / "3").symlink_to("/dev/video0")
    (tmp_path / "self").symlink_to("12")
    video = tmp_path.__class__("/dev/video0")
    assert busy_words(video, proc=tmp_path) == "another program is using the camera (guvcview, process 12): close it"
    (tmp_path / "12").rename(tmp_path / str(os.getpid()))
    assert "this program itself" in busy_words(video, proc=tmp_path)
    (tmp_path / str(os.getpid())).rename(tmp_path / "12")
    (tmp_path / "12" / "fd" / "3").unlink()
    assert "one that cannot be seen from here" in busy_words(video, proc=tmp_path)
    refused = tmp_path.__class__.iterdir

    def iterdir(path):
        if path.name == "fd":
            raise PermissionError(13, "Permission denied")
        return refused(path)

    monkeypatch.setattr(tmp_path.__class__, "iterdir", iterdir)
    assert busy_words(video, proc=tmp_path).endswith(
        "one of another user: close it (`sudo fuser -v /dev/video0` names it)"
    )


def test_the_group_that_owns_a_camera_is_named(tmp_path):
    """No permission: the line names the node's own group and how to join it, or that only its owner may."""
    node = tmp_path / "video0"
    node.touch()
    node.chmod(0o660)
    group = grp.getgrgid(node.stat().st_gid).gr_name
    assert f"it belongs to group {group}: add the user (`sudo usermod -aG {group} $USER`" in permission_words(node)
    node.chmod(0o600)
    assert "(mode 600)" in permission_words(node)
    if os.getuid() == 0:
        os.chown(node, 0, 61234)
        node.chmod(0o660)
        assert "group 61234" in permission_words(node)


@pytest.mark.skipif(os.getuid() != 0, reason="gives a folder and itself away, for which it must be root")
def test_a_camera_without_permission_is_bad_input(tmp_path, play_camera):
    """The kernel's own refusal, as another user: one line, no traceback."""
    camera = play_camera()
    os.chown(camera.path, 0, grp.getgrnam("video").gr_gid)
    camera.path.chmod(0o660)
    code = (
        "import os, sys; from pathlib import Path\n"
        "from dnb_edge.capture.source import open_source; from dnb_edge.errors import InputError\n"
        "os.setgroups([]); os.setgid(65534); os.setuid(65534)\n"
        "try: open_source('v4l2:' + sys.argv[1])\n"
        "except InputError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(camera.path)], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.stdout == (
        f"{camera.path}: no permission: it belongs to group video: add the user (`sudo usermod -aG video $USER`, "
        "log in anew)\n"
    )
