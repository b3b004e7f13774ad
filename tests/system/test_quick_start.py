"""The quick start as it is written: its commands, read out of the page, in a Debian 13 on which dnb-edge is not installed.

The guest has no network: git finds this checkout under the page's word for its address, pip its wheels, apt its own archive.
"""

import itertools
import re

from harness.appliance import note
from harness.image import REPOSITORY, WHEELS
from harness.recipe import REPOSITORY as CHECKOUT

PAGE = CHECKOUT / "docs" / "quick-start.md"
LIMIT_S = 600.0
"""All commands of the page together."""
PROCESSORS = 2
"""Of the guest. On a host that is busy with other things the clock says nothing: its work for both of them is limited."""
PATIENCE_S = 1800.0
HOME = "/home/racer"
PREPARE = (
    "useradd --create-home --shell /bin/bash racer",
    "echo 'racer ALL=(ALL) NOPASSWD: ALL' > /etc/sudoers.d/racer",
    f"printf '[global]\\nno-index = true\\nfind-links = {WHEELS}\\n' > /etc/pip.conf",
    f"ln -s {REPOSITORY} {HOME}/REPOSITORY",
    "git config --system safe.directory '*'",
)
"""A user who may use sudo, as Raspberry Pi OS makes one; and what stands in for the network."""
LAP = re.compile(r"^ *(?:lap )?1 +(\d+\.\d{3}) s", flags=re.MULTILINE)


def commands(page):
    """The grey boxes that are to be typed, in order."""
    return re.findall(r"^```sh\n(.*?)^```$", page, flags=re.MULTILINE | re.DOTALL)


def test_the_quick_start_leads_to_the_first_timed_lap(boot_clean_guest, logs):
    """Every command of the page succeeds, top to bottom, in ten minutes together; the simulated car's first lap is timed."""
    boxes = commands(PAGE.read_text(encoding="utf-8"))
    assert any("install.sh" in box for box in boxes)
    guest = boot_clean_guest()
    for command in PREPARE:
        guest.run(command)
    said = "set -euo pipefail\n"
    for number, box in enumerate(boxes):
        said += f"echo \"#### box {number} $(cut -d' ' -f1 /proc/uptime)\"\n{box}"
    before_s = guest.processor_s
    guest.put(said + "echo \"#### end $(cut -d' ' -f1 /proc/uptime)\"\n", f"{HOME}/quick-start.sh")
    output = guest.run(f"su - racer -c 'bash {HOME}/quick-start.sh'", timeout_s=PATIENCE_S, check=False)
    (logs / "output.txt").write_text(output)
    marks = re.findall(r"^#### (box \d+|end) ([\d.]+)$", output, flags=re.MULTILINE)
    assert marks, output
    assert marks[-1][0] == "end", output[-3000:]
    at_s = [float(mark[1]) for mark in marks]
    note(
        logs,
        quick_start_s=round(at_s[-1] - at_s[0]),
        processors_s=round(guest.processor_s - before_s),
        boxes_s=[round(b - a) for a, b in itertools.pairwise(at_s)],
    )
    laps = LAP.findall(output)
    assert laps, output[-3000:]
    assert len(set(laps)) == 1, laps
    assert guest.run("systemctl is-active dnb-edge dnb-edge-web").split() == ["active", "active"]
    assert guest.processor_s - before_s <= LIMIT_S * PROCESSORS
