"""What the set-up's requests do to the draft: pictures kept, lanes and lines set, all put in place.

Knows the draft, its folder and the rooms that judge pictures and tracks; knows no request. All of it takes time: call it in a
thread.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from dnb_edge.errors import InputError, WorkError
from dnb_edge.live.messages import Picture
from dnb_edge.track.twin import load_twin
from dnb_edge.view.photograph import SEAM_M
from dnb_edge.web import setup_look, setup_save, setup_steps, setup_track, setup_upload
from dnb_edge.web.setup_draft import (
    Draft,
    DraftStore,
    EndsPx,
    LaneChoice,
    Lines,
    Pair,
    RouteChoice,
    ScaleChoice,
    StoredPicture,
)
from dnb_edge.web.setup_flicker import FlickerWatch
from dnb_edge.web.setup_keypoints import sigma_picture
from dnb_edge.web.setup_models import FlattenBody, LaneBody, LineBody, LinesBody


def keep_photo(store: DraftStore, data: bytes, *, from_camera: bool) -> Draft:
    """Keeps a picture of the camera's view; clicks move with it where it is the same view in another size."""
    upload = setup_upload.checked(data, what="the camera's picture", upright=True)
    fault = setup_look.fault_of(setup_upload.decoded(data, what="the camera's picture"))
    if fault is not None:
        raise InputError(f"the picture cannot be used, {fault}")

    def changed(draft: Draft) -> Draft:
        stored = store.keep("photo", upload, from_camera=from_camera)
        return draft.model_copy(update={"photo": stored, "pairs": _moved(draft.pairs, draft.photo, stored)})

    return store.change(changed)


def keep_twin(store: DraftStore, data: bytes) -> Draft:
    """Keeps a twin. All that was clicked on another one means nothing on it."""
    upload = setup_upload.checked(data, what="the twin")
    stored = store.keep("twin", upload)

    def changed(draft: Draft) -> Draft:
        if draft.twin is not None and draft.twin.sha256 == stored.sha256:
            return draft
        return _on_another_twin(draft, stored, pairs=_only_camera(draft.pairs))

    return store.change(changed)


def flatten(store: DraftStore, body: FlattenBody) -> Draft:
    """Makes a twin of the camera's picture, whose four corners are keypoints then."""
    photo = store.load().photo
    if photo is None:
        raise InputError("there is no picture to make a twin of: take the camera's picture first")
    picture = setup_upload.decoded(store.path(photo).read_bytes(), what="the camera's picture")
    upload, metres_per_px, corners = setup_track.flattened(picture, body.corners_px, body.width_m, body.height_m)
    stored = store.keep("twin", upload)
    pairs = tuple(
        Pair(name=str(k), camera_px=camera_px, twin_px=twin_px)
        for k, (camera_px, twin_px) in enumerate(zip(body.corners_px, corners, strict=True), start=1)
    )

    def changed(draft: Draft) -> Draft:
        return _on_another_twin(
            draft,
            stored,
            pairs=pairs,
            # Tape across the lane is no end of it.
            close_gap_px=round(SEAM_M / metres_per_px, 1),
            scale=ScaleChoice(metres_per_px=metres_per_px),
        )

    return store.change(changed)


def set_lane(store: DraftStore, body: LaneBody) -> Draft:
    """What the lane looks like: its shade, or the colour at a place on the twin."""
    if (body.at_px is None) == (body.shade is None):
        raise InputError("the lane: give a place on it, or its shade, one of the two")
    twin = store.load().twin
    if twin is None:
        raise InputError("the lane: give the twin first")
    lane = LaneChoice(shade=body.shade)
    if body.at_px is not None:
        lane = setup_track.lane_at(store.path(twin), body.at_px)
    return store.change(lambda draft: draft.model_copy(update={"lane": lane}))


def set_lines(store: DraftStore, body: LinesBody) -> Draft:
    """The start, finish and sector lines: by their ends, or across the lane at a place on the route. Twin px."""
    found = setup_steps.understood(store.load(), store.folder).track

    def ends(line: LineBody | None, name: str) -> EndsPx | None:
        if line is None:
            return None
        if (line.ends_px is None) == (line.at_px is None):
            raise InputError(f"the line {name!r}: give its ends, or a place on the route, one of the two")
        if line.at_px is None:
            return line.ends_px
        return setup_track.snapped(found, line.at_px, name=name, flipped=line.flipped)

    sectors = tuple(ends(line, f"sector {k}") for k, line in enumerate(body.sectors, start=1))
    lines = Lines(
        start_px=ends(body.start, "start"),
        finish_px=ends(body.finish, "finish"),
        sectors_px=tuple(line for line in sectors if line is not None),
    )
    return store.change(lambda draft: draft.model_copy(update={"lines": lines}))


def save(store: DraftStore, folder: Path, source: str | None) -> tuple[setup_save.Saved, Draft]:
    """Puts the draft in place in `folder`; `source`: the camera that the daemon has. Raises as `setup_save.save` does."""
    draft = store.load()
    known = setup_steps.understood(draft, store.folder)
    saved = setup_save.save(known, folder, store, source=source)
    return saved, store.saved(draft.revision)


def sigma(store: DraftStore) -> bytes:
    """How sure a position is, over twin and camera picture, as PNG."""
    draft = store.load()
    known = setup_steps.understood(draft, store.folder)
    if draft.twin is None or draft.photo is None:
        raise InputError("the sigma map: give the twin and take the picture first")
    photo = setup_upload.decoded(store.path(draft.photo).read_bytes(), what="the camera's picture")
    return sigma_picture(known.keypoints, known.metric_track, load_twin(store.path(draft.twin)), photo)


def looked(picture: Picture, flicker: FlickerWatch) -> tuple[setup_look.PictureLook, str | None]:
    """How sharp and how well exposed the camera's picture is, and what to say of lamps that flicker."""
    image = setup_upload.decoded(picture.jpeg, what="the camera's picture")
    return setup_look.look_at(image), flicker.look(picture, image)


def stored_bytes(store: DraftStore, stored: StoredPicture) -> bytes:
    """The kept picture's bytes. Raises `WorkError` where they cannot be read, or are not those that were kept."""
    try:
        data = store.path(stored).read_bytes()
    except OSError as error:
        raise WorkError(f"{stored.file}: cannot be read: {error.strerror or error}: give the picture anew") from error
    if hashlib.sha256(data).hexdigest() != stored.sha256:
        raise WorkError(f"{stored.file}: is damaged: give the picture anew")
    return data


def _on_another_twin(
    draft: Draft,
    twin: StoredPicture,
    *,
    pairs: tuple[Pair, ...],
    close_gap_px: float | None = None,
    scale: ScaleChoice | None = None,
) -> Draft:
    """The draft with `twin` instead of another one, and nothing of what was said about that one."""
    return draft.model_copy(
        update={
            "twin": twin,
            "lane": None,
            "route": RouteChoice(closed=draft.route.closed, close_gap_px=close_gap_px),
            "scale": scale,
            "lines": Lines(),
            "pairs": pairs,
        }
    )


def _only_camera(pairs: tuple[Pair, ...]) -> tuple[Pair, ...]:
    """The pairs without their twin's points, for another twin."""
    return tuple(Pair(name=pair.name, camera_px=pair.camera_px) for pair in pairs if pair.camera_px is not None)


def _moved(pairs: tuple[Pair, ...], old: StoredPicture | None, new: StoredPicture) -> tuple[Pair, ...]:
    """The pairs for a new picture: a smaller or larger one of one shape moves the clicks, another shape drops them."""
    if old is None or (old.width_px, old.height_px) == (new.width_px, new.height_px):
        return pairs
    across, down = new.width_px / old.width_px, new.height_px / old.height_px
    alike = abs(across - down) * max(new.width_px, new.height_px) < 2.0 * max(across, down)
    return tuple(
        Pair(
            name=pair.name,
            camera_px=None
            if pair.camera_px is None or not alike
            else (pair.camera_px[0] * across, pair.camera_px[1] * down),
            twin_px=pair.twin_px,
        )
        for pair in pairs
        if alike or pair.twin_px is not None
    )
