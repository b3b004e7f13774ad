"""Ultralytics itself, as a peer in its own process: exports a model with random weights and says what it finds in pictures.

    python ultralytics_peer.py yolo11n.yaml FOLDER '{"plain": {}, "nms": {"nms": true}}'

`FOLDER/pictures.npz` holds the pictures. For each variant (a name and the arguments of its export) it writes `NAME.onnx` and
`NAME.npz`, whose array N_M is what Ultralytics finds in picture N with the M-th of `SETTINGS`: rows of x1, y1, x2, y2,
confidence, class, or with OBB of u, v, width, height, angle, confidence, class. In its own process, since Ultralytics changes
OpenCV and torch when it is imported. No network: weights are random, with their outputs made to vary over the picture.
"""

from __future__ import annotations

import importlib.machinery
import json
import os
import sys
import types
from pathlib import Path

import numpy as np

SETTINGS = (
    {"conf": 0.25, "iou": 0.7},
    {"conf": 0.4, "iou": 0.3},
    {"conf": 0.25, "iou": 0.5, "classes": list(range(0, 80, 3))},
)
"""What Ultralytics is asked with."""


def _without_torchvision() -> None:
    """Puts a stand-in for torchvision's NMS in its place where the package is missing or does not fit torch's build."""
    import torch  # noqa: PLC0415

    try:
        import torchvision  # noqa: F401, PLC0415
    except (ImportError, RuntimeError):
        from ultralytics.utils.nms import TorchNMS  # noqa: PLC0415
    else:
        return

    class Nms(torch.autograd.Function):
        @staticmethod
        def forward(ctx, boxes, scores, iou):
            return TorchNMS.nms(boxes, scores, iou)

        @staticmethod
        def symbolic(g, boxes, scores, iou):
            def number(value, dtype=torch.int64):
                return g.op("Constant", value_t=torch.tensor(value, dtype=dtype))

            batch, classes = g.op("Unsqueeze", boxes, number([0])), g.op("Unsqueeze", scores, number([0, 1]))
            kept = g.op("NonMaxSuppression", batch, classes, number([2**31 - 1]), number([iou], torch.float32))
            return g.op("Squeeze", g.op("Gather", kept, number([2]), axis_i=1), number([1]))

    package, ops = types.ModuleType("torchvision"), types.ModuleType("torchvision.ops")
    package.__spec__ = importlib.machinery.ModuleSpec("torchvision", None)
    package.ops, ops.nms = ops, Nms.apply
    sys.modules |= {"torchvision": package, "torchvision.ops": ops}


def _lively(model, pictures) -> None:
    """Makes a network with random weights say different things of different places: a few per cent of its boxes are sure."""
    import cv2  # noqa: PLC0415
    import torch  # noqa: PLC0415

    shrunk = np.stack([cv2.resize(picture, (320, 320)) for picture in pictures])
    pictures = torch.from_numpy(shrunk[..., ::-1].copy()).permute(0, 3, 1, 2).float() / 255
    norms = [module for module in model.modules() if isinstance(module, torch.nn.BatchNorm2d)]
    for norm in norms:
        norm.momentum = None  # plain mean over the batches seen
        norm.reset_running_stats()
    head = model.model[-1]
    model.train()
    with torch.no_grad():
        model(pictures)
    model.eval()
    near, far = (0.5, 5.0) if head.reg_max == 1 else (-2.0, 4.0)
    branches = [
        (branch, rare, low, high)
        for name, rare, low, high in (("cv2", 0.0, near, far), ("cv3", 3.0, -9.0, 3.0), ("cv4", 0.0, -2.0, 2.0))
        for prefix in ("", "one2one_")
        for branch in getattr(head, prefix + name, None) or ()
    ]

    class Squash(torch.nn.Module):
        """Into a range that no two numbers leave equal, so that confidences do not tie."""

        def __init__(self, middle, deviation, low, high):
            super().__init__()
            self.middle, self.deviation, self.low, self.high = middle, deviation, low, high

        def forward(self, x):
            z = (x - self.middle) / self.deviation
            return self.low + (self.high - self.low) * 0.5 * (1.0 + z / (1.0 + z.abs()))

    for branch, rare, low, high in branches:
        outputs: list[torch.Tensor] = []
        hook = branch.register_forward_hook(lambda module, given, out, outputs=outputs: outputs.append(out))
        with torch.no_grad():
            model(pictures)
        hook.remove()
        middle, deviation = (
            value[None, :, None, None] for value in (outputs[0].mean((0, 2, 3)), outputs[0].std((0, 2, 3)))
        )
        branch.append(Squash(middle + rare * deviation, deviation, low, high))


def main() -> None:
    """Exports and asks."""
    yaml, folder, variants = sys.argv[1], Path(sys.argv[2]), json.loads(sys.argv[3])
    os.environ |= {"YOLO_CONFIG_DIR": str(folder), "YOLO_OFFLINE": "true", "YOLO_AUTOINSTALL": "false"}
    import torch  # noqa: PLC0415

    torch.set_num_threads(1)
    from ultralytics import YOLO, settings  # noqa: PLC0415

    settings.update({"sync": False})
    _without_torchvision()
    pictures = dict(np.load(folder / "pictures.npz"))
    for name, arguments in variants.items():
        torch.manual_seed(7)
        yolo = YOLO(yaml)
        _lively(yolo.model, pictures.values())
        made = yolo.export(format="onnx", opset=17, **{"simplify": False, "imgsz": 320, **arguments})
        exported = (folder / name).with_suffix(".onnx")
        Path(made).replace(exported)
        asked = YOLO(exported, task=yolo.task)
        found = {}
        for key, picture in pictures.items():
            for number, how in enumerate(SETTINGS):
                more = {"imgsz": arguments.get("imgsz", 320)} if arguments.get("dynamic") else {}
                (result,) = asked.predict(picture, device="cpu", verbose=False, save=False, **how, **more)
                boxes = result.boxes if result.obb is None else result.obb
                found[f"{key}_{number}"] = boxes.data.cpu().numpy()
        np.savez(exported.with_suffix(".npz"), **found)


if __name__ == "__main__":
    main()
