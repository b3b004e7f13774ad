"""Finding car-like things in a picture.

Knows pixels and search windows; knows nothing of metres, targets' identity or laps. Only `onnx.py` imports ONNX Runtime."""
