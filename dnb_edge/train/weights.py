"""The trained network's weights as a file: what fine-tuning starts from, shipped beside the int8 model.

Knows names, shapes and NumPy's .npz; nothing of training. Weights are stored in float16: half the bytes, and far finer than
what int8 keeps of them. Nothing in the file is ever executed (a pickle could be).
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.train.network import CentreNet

SUFFIX = ".weights.npz"
"""Weights of NAME.onnx lie beside it in NAME.weights.npz."""
_LARGEST = float(np.finfo(np.float16).max)
_COUNTERS = "num_batches_tracked"


def weights_path(model: Path) -> Path:
    """Where the weights of the model in `model` (NAME.onnx) lie."""
    return model.with_suffix(SUFFIX)


def save_weights(path: Path, network: CentreNet) -> None:
    """Write the network's weights and running statistics to `path` as float16; the file appears only when whole.

    Raises ValueError for a value that float16 cannot hold.
    """
    arrays: dict[str, NDArray[np.float16]] = {}
    for name, value in network.state_dict().items():
        if name.endswith(_COUNTERS):
            continue
        array = value.detach().cpu().to(torch.float32).numpy()
        if not np.isfinite(array).all() or float(np.abs(array).max(initial=0.0)) > _LARGEST:
            raise ValueError(f"weights {name}: hold values that float16 cannot")
        arrays[name] = array.astype(np.float16)
    part = path.with_name(path.name + ".part")
    with part.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
    part.replace(path)


def load_weights(path: Path) -> CentreNet:
    """The network with the weights in `path`, in eval mode.

    Raises InputError, naming the file, where it is missing, no .npz file, or of another network.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays = {name: np.asarray(stored[name]) for name in stored.files}
    except OSError as fault:
        raise InputError(
            f"{path}: the weights cannot be read ({fault.strerror or fault}); they belong beside the model, install it again"
        ) from fault
    except (ValueError, EOFError, KeyError, zipfile.BadZipFile) as fault:
        raise InputError(f"{path}: not a file of weights ({fault}); install the model again") from fault
    network = CentreNet()
    state = network.state_dict()
    wanted = {name: tuple(value.shape) for name, value in state.items() if not name.endswith(_COUNTERS)}
    _check(path, wanted, arrays)
    for name in wanted:
        state[name] = torch.from_numpy(arrays[name].astype(np.float32))
    network.load_state_dict(state)
    network.eval()
    return network


def _check(path: Path, wanted: dict[str, tuple[int, ...]], arrays: dict[str, NDArray[np.generic]]) -> None:
    missing, foreign = sorted(wanted.keys() - arrays.keys()), sorted(arrays.keys() - wanted.keys())
    if missing or foreign:
        what = f"{missing[0]} is missing" if missing else f"{foreign[0]} is not known"
        raise InputError(f"{path}: weights of another network ({what}); use a model of this version of dnb-edge")
    for name, shape in wanted.items():
        array = arrays[name]
        if array.shape != shape:
            raise InputError(
                f"{path}: weights of another network ({name} is {array.shape}, not {shape}); "
                "use a model of this version of dnb-edge"
            )
        if array.dtype != np.float16 or not np.isfinite(array).all():
            raise InputError(f"{path}: damaged weights ({name} is not finite float16); install the model again")
