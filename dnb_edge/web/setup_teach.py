"""How to teach the detector one's own car: the commands, with this box's own files in them.

Teaching takes a quarter of an hour of a computer's whole power and its labels want to be looked at before, so it is a command
and nothing that a page starts on a box that races. Knows where recordings and the configuration lie; knows no network.
"""

from __future__ import annotations

import shlex
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from dnb_edge.web.box import WebSettings
from dnb_edge.web.endpoint import Access, Endpoint
from dnb_edge.web.setup_models import TeachAnswer
from dnb_edge.web.setup_save import CONFIG

_SUFFIX = ".mcap"
_FIRST = "Record a drive of about a minute first, with the camera standing still: save, then let the car drive."
_HOW = (
    "Teaching takes a quarter of an hour of a computer with the extra `train` installed, better another one than this box. "
    "It shows its labels on a contact sheet, asks which are wrong, and says before and after. A clip of the same drive "
    "teaches more than a recording. The model is used once detector.model names it in the configuration; saving here keeps "
    "that line."
)


class Teacher:
    """The handler."""

    def __init__(self, settings: WebSettings) -> None:
        self._settings = settings

    def endpoints(self, base: str) -> tuple[Endpoint, ...]:
        """What there is to ask about teaching."""
        return (
            Endpoint(
                method="GET",
                path=f"{base}/teach",
                access=Access.CHANGE,
                handler=self.how,
                summary="How to teach the detector one's own car",
                answer=TeachAnswer,
            ),
        )

    async def how(self, request: Request) -> Response:
        """GET /api/v1/setup/teach."""
        del request
        return JSONResponse((await run_in_threadpool(self._how)).model_dump(mode="json"))

    def _how(self) -> TeachAnswer:
        newest = _newest(self._settings.runs)
        if newest is None:
            return TeachAnswer(recording=None, text=_FIRST, commands=[])
        config, taught = self._settings.setup / CONFIG, self._settings.setup / "taught"
        model = f"detector.model={taught / 'my-car.onnx'}"
        teach = ["dnb-edge", "teach", str(newest), "--config", str(config), "--out", str(taught)]
        check = ["dnb-edge", "run", "--config", str(config), "--set", model]
        return TeachAnswer(recording=newest.stem, text=_HOW, commands=[shlex.join(teach), shlex.join(check)])


def _newest(runs: Path) -> Path | None:
    """The newest finished recording; None where there is none."""
    if not runs.is_dir():
        return None
    found = [(path.stat().st_mtime_ns, path) for path in runs.iterdir() if path.suffix == _SUFFIX and path.is_file()]
    return max(found)[1] if found else None
