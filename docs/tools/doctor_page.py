"""docs/doctor.md: what the doctor looks at, when it complains, and what to do then.

Knows the doctor's table of checks, and Markdown. Knows no limit by itself.
"""

from __future__ import annotations

from page_text import cell, made_by, paragraphs

from dnb_edge.doctor.check import Group
from dnb_edge.doctor.checks import CHECKS

PAGE = "docs/doctor.md"

_ABOUT = """
`dnb-edge doctor` looks at everything that a race needs and says of each fault what to type. Run it after the set-up, after the
box was carried somewhere, and whenever something is odd.

```sh
dnb-edge doctor                          # all checks; a few seconds
sudo dnb-edge doctor                     # sees who has the camera, and what only root may read, too
dnb-edge doctor --only picture           # all of one group: set-up, camera, picture, detector, disk, machine, display, service
dnb-edge doctor --only gaps --seconds 20 # one check, for longer
dnb-edge doctor --json                   # for scripts
```
"""

_HOW = """
Each check ends as **OK**; **WARN**: a race can be run, and will be worse for it; **FAIL**: it cannot, or its numbers
cannot be trusted; or **SKIP**: it cannot be made here, and the line says why. Every WARN and FAIL has a sentence
below it with what to type. Exit code 0 where nothing fails, 1 where something does, 2 where the command itself is
wrong.

It works beside a running service and never takes its camera: pictures, rate, lost frames and the camera's place then
come over the [live socket](live-socket.md). Where no service runs it opens the camera itself for two seconds
(`--seconds`), with the configuration's settings. Nothing is changed: the disk is measured with a file that has no
name, and a serial display shows an empty board for a moment.

`--json` prints one object: `{"version", "well", "counts": {"ok", "warn", "fail", "skip"}, "checks": [{"name",
"group", "status", "found", "fix"}]}`; `fix` is null where nothing is amiss.
"""

_MEASURED = """
## How it measures

- **Rate, gaps, stamps**: from the kernel's stamps and the driver's frame numbers, as a race does
  ([cameras](cameras.md)). A camera's first half second does not count: it is still finding its exposure.
- **Exposure**: what the driver says now. The smear is `--speed` (2 m/s unless told otherwise) times the exposure.
- **Sharpness**: of the edges over 40 levels high, the width that a fifth stay below. A perfect step is 2 px wide, one
  blurred by a Gaussian of s px 2.5 s px. It needs something with edges in view: print, tape, markers.
- **Flicker**: lamps go bright and dark 100 or 120 times a second; at 30 frames a second 100 Hz show as a beat of 10
  Hz. Each row's brightness is projected on the lamps' own frequency at the frames' stamps, so that a rolling shutter
  does not hide it; the share is the beat's amplitude. Lamps on 60 Hz stand still in 30 frames a second: they make
  bands, and no beat.
- **USB**: what the line was agreed at and what hangs on the same bus, from `/sys`. A USB 2 camera can be given about
  190 Mbit/s. A hub inside the machine is none: a Raspberry Pi 4 has all its sockets behind one.
- **Detector**: medians of decoding and detecting in a picture of this camera. Of a running race, what it says itself.
- **Disk**: 8 MB written and synced, then twenty small writes, each synced, as for laps; less while a race runs.
- **Room**: pictures at `record.image_fps` until their ring is full, besides 15 kB a second of detections and events.
"""


def page() -> str:
    """The whole page, Markdown."""
    lines = ["# The doctor", "", made_by(__file__), "", _ABOUT.strip(), "", paragraphs(_HOW), "", "## The checks", ""]
    lines += [f"{len(CHECKS)} checks, in the order in which they are made."]
    for group in Group:
        lines += ["", f"### {group.value}", "", "| check | looks at | complains | what to do |", "|---|---|---|---|"]
        lines += [
            f"| `{check.name}` | {cell(check.looks_at)} | {cell(check.amiss)} | {cell(check.remedy)} |"
            for check in CHECKS
            if check.group is group
        ]
    return "\n".join([*lines, "", _MEASURED.strip()]) + "\n"
