"""The checks of what a race sees: set-up, camera, picture and detector; a table.

Knows which facts go to which rule, and what each check is for people who read the list.
"""

from __future__ import annotations

from typing import Any

from dnb_edge.doctor import camera_rules, gather, picture_rules, setup_facts, setup_rules, usb_rules
from dnb_edge.doctor.check import Check, Group

RACE_CHECKS: tuple[Check[Any], ...] = (
    Check(
        name="set-up",
        group=Group.SETUP,
        looks_at="whether a track is set up: a configuration at its place, or one saved on the pages",
        amiss="fails where there is neither",
        remedy="go through Set up on the pages",
        gather=setup_facts.find_set_up,
        judge=setup_rules.judge_set_up,
    ),
    Check(
        name="config",
        group=Group.SETUP,
        looks_at="the configuration, as `dnb-edge config check` does",
        amiss="fails at the first key that is wrong, and names its line",
        remedy="mend that line",
        gather=setup_facts.config_fault,
        judge=setup_rules.judge_config,
    ),
    Check(
        name="track",
        group=Group.SETUP,
        looks_at="the twin or the track's file: whether they make a route",
        amiss="fails where they do not",
        remedy="make the track again, under Set up or with `dnb-edge track build`",
        gather=setup_facts.find_track,
        judge=setup_rules.judge_track,
    ),
    Check(
        name="calibration",
        group=Group.SETUP,
        looks_at="the calibration: of this camera, this size and this track, and how good",
        amiss=(
            f"fails where it does not fit or is over the configuration's limit, warns over {1e3 * setup_rules.ERROR_WARN_M:g} "
            "mm of mean error"
        ),
        remedy="calibrate again",
        gather=setup_facts.find_calibration,
        judge=setup_rules.judge_calibration,
    ),
    Check(
        name="calibration-age",
        group=Group.SETUP,
        looks_at="how old the calibration is",
        amiss=f"warns after {setup_rules.OLD_DAYS:g} days",
        remedy="`dnb-edge calibrate check`",
        gather=setup_facts.find_calibration,
        judge=setup_rules.judge_age,
    ),
    Check(
        name="camera",
        group=Group.CAMERA,
        looks_at="whether the camera is plugged in and is one",
        amiss="fails where it is not",
        remedy="plug it in, or name another one in `capture.source`",
        gather=gather.camera_there,
        judge=camera_rules.judge_there,
    ),
    Check(
        name="camera-name",
        group=Group.CAMERA,
        looks_at="whether the configuration names it by a name that stays",
        amiss="warns of `/dev/video0` and its like, which may be another camera after the next start",
        remedy="name it by `/dev/v4l/by-id`",
        gather=gather.camera,
        judge=camera_rules.judge_name,
    ),
    Check(
        name="camera-access",
        group=Group.CAMERA,
        looks_at="whether the service, and you, may use it",
        amiss="fails where the service is not in its group",
        remedy="add the user to the group",
        gather=gather.camera_access,
        judge=lambda access: camera_rules.judge_access(access, what="camera"),
    ),
    Check(
        name="camera-in-use",
        group=Group.CAMERA,
        looks_at="which programs have it open",
        amiss="fails where another one than dnb-edge has, and names it",
        remedy="close that program",
        gather=gather.camera_use,
        judge=camera_rules.judge_use,
    ),
    Check(
        name="formats",
        group=Group.CAMERA,
        looks_at="whether it offers the size and rate that are asked for",
        amiss="fails where it does not, warns where it has them uncompressed only",
        remedy="ask for what it has",
        gather=gather.camera_wanted,
        judge=camera_rules.judge_formats,
    ),
    Check(
        name="usb-speed",
        group=Group.CAMERA,
        looks_at="how fast its USB line is",
        amiss=f"fails below {usb_rules.HIGH_SPEED_MBPS:g} Mbit/s",
        remedy="another port, another cable, no hub",
        gather=gather.usb,
        judge=usb_rules.judge_usb_speed,
    ),
    Check(
        name="frames",
        group=Group.CAMERA,
        looks_at="whether pictures come: of the running service, else by opening the camera for two seconds",
        amiss="fails where none come",
        remedy="unplug the camera and plug it in again",
        gather=gather.frames,
        judge=camera_rules.judge_frames,
    ),
    Check(
        name="rate",
        group=Group.CAMERA,
        looks_at="how many frames a second the camera really makes, by the kernel's stamps",
        amiss=(
            f"warns below {100 * camera_rules.SLOWEST_SHARE:g} % of `capture.fps`, fails below "
            f"{100 * camera_rules.USELESS_SHARE:g} %"
        ),
        remedy="more light and a fixed exposure",
        gather=gather.rate,
        judge=camera_rules.judge_rate,
    ),
    Check(
        name="gaps",
        group=Group.CAMERA,
        looks_at="numbers that are missing among the frames, and why",
        amiss=f"warns from {100 * camera_rules.LOST_WARN:g} % on, fails from {100 * camera_rules.LOST_FAIL:g} % on",
        remedy="by the reason: another cable, fewer programs, a smaller picture",
        gather=gather.losses,
        judge=camera_rules.judge_losses,
    ),
    Check(
        name="usb-bandwidth",
        group=Group.CAMERA,
        looks_at="what the pictures take of the bus, hubs, other cameras and disks on it",
        amiss=f"fails over {100 * usb_rules.BUS_WARN:g} % of what a camera can be given, warns of a hub or a rival",
        remedy="MJPG, another port",
        gather=gather.bus,
        judge=usb_rules.judge_bus,
    ),
    Check(
        name="controls",
        group=Group.CAMERA,
        looks_at="whether the camera took exposure, gain, focus and the rest as asked",
        amiss="warns where it took another value",
        remedy="ask for what it takes",
        gather=gather.controls,
        judge=camera_rules.judge_controls,
    ),
    Check(
        name="stamps",
        group=Group.CAMERA,
        looks_at="whether the kernel stamps each frame, on the clock that laps are timed by",
        amiss="warns where frames are timed by their arrival, fails where stamps are of another clock",
        remedy="a UVC camera",
        gather=gather.stamps,
        judge=camera_rules.judge_stamps,
    ),
    Check(
        name="exposure",
        group=Group.CAMERA,
        looks_at="the exposure against a frame's time, and how far a car goes in it (`--speed`)",
        amiss=(
            f"warns where it is automatic and over {1e3 * camera_rules.BLUR_WARN_M:g} mm, fails over "
            f"{1e3 * camera_rules.BLUR_FAIL_M:g} mm and over a frame's time"
        ),
        remedy="`capture.exposure_us` and more light",
        gather=gather.blur,
        judge=camera_rules.judge_exposure,
    ),
    Check(
        name="picture",
        group=Group.PICTURE,
        looks_at="whether the picture shows anything",
        amiss="fails where it is black, overexposed, covered or frozen",
        remedy="lens cap, light, exposure",
        gather=setup_facts.picture_fault,
        judge=picture_rules.judge_shows,
    ),
    Check(
        name="sharpness",
        group=Group.PICTURE,
        looks_at="how wide the sharpest edges of the picture are",
        amiss=(
            f"warns over {picture_rules.SOFT_PX:g} px, fails over {picture_rules.BLURRED_PX:g} px (of a "
            "picture 1280 px wide)"
        ),
        remedy="focus, wipe the lens",
        gather=gather.sharpness,
        judge=picture_rules.judge_sharpness,
    ),
    Check(
        name="flicker",
        group=Group.PICTURE,
        looks_at="whether the brightness beats with lamps on 50 or 60 Hz",
        amiss=(
            f"warns from an amplitude of {100 * picture_rules.FLICKER_WARN:g} % on, fails from "
            f"{100 * picture_rules.FLICKER_FAIL:g} % on"
        ),
        remedy="`capture.power_line_hz`, an exposure of whole flickers, other lamps",
        gather=gather.beats,
        judge=picture_rules.judge_flicker,
    ),
    Check(
        name="camera-moved",
        group=Group.PICTURE,
        looks_at="whether the camera still stands where it was calibrated",
        amiss="fails where it has moved by 0.2 % of the track's span, warns where nobody can tell",
        remedy="put it back, or calibrate again",
        gather=setup_facts.find_place,
        judge=picture_rules.judge_place,
    ),
    Check(
        name="model",
        group=Group.DETECTOR,
        looks_at="the detector's model and its checksum",
        amiss="fails where it is damaged or missing",
        remedy="install it again",
        gather=setup_facts.find_model,
        judge=setup_rules.judge_model,
    ),
    Check(
        name="detector-speed",
        group=Group.DETECTOR,
        looks_at="how long the detector takes against a frame's time; of a running race, which frames it was too slow for",
        amiss=(
            f"warns from {100 * setup_rules.BUSY_SHARE:g} % of a frame's time on, fails where it is slower than the camera; of "
            f"a running race from {100 * setup_rules.LOST_WARN:g} % and {100 * setup_rules.LOST_FAIL:g} % of the frames on"
        ),
        remedy="two threads, a lower rate, fewer programs",
        gather=setup_facts.find_pace,
        judge=setup_rules.judge_pace,
    ),
)
