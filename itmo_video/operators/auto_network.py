"""Running the network of `auto`: its weights, from auto.onnx, and its two forms.

The plain form is OpenCV's. The compiled one takes less than half the time, as OpenCV 5 multiplies
3 x 3 convolutions directly; ONNX Runtime takes 1.5 times as long as ours, and 78 MB.
"""

from __future__ import annotations

import ctypes
import functools
import threading
from collections.abc import Iterator
from importlib import resources
from typing import Any

import cv2
import numpy as np

from itmo_video.kernels import compiled_network
from itmo_video.kernels.dispatch import with_compiled_form
from itmo_video.model import Float32

_WEIGHTS = "auto.onnx"
# The numbers of fields in ONNX's messages (onnx.proto): ModelProto, GraphProto, TensorProto.
_GRAPH, _INITIALIZER, _DIMS, _RAW_DATA = 7, 5, 1, 9
_local = threading.local()


def _compiled_shares(loaded: ctypes.CDLL, features: Float32) -> Float32:
    return compiled_network.shares(loaded, features, _packed(loaded))


@with_compiled_form(_compiled_shares)
def network_shares(features: Float32) -> Float32:
    """The network's shares, float32 (30, h, w), of its features (17, h, w); a new array.

    h and w are multiples of 16.
    """
    if not hasattr(_local, "net"):  # a cv2.dnn.Net cannot be shared by threads
        _local.net = cv2.dnn.readNetFromONNX(np.frombuffer(_file(), np.uint8))
    _local.net.setInput(features[None])
    return np.array(_local.net.forward()[0], np.float32)  # a copy, as it reuses its buffer


@functools.lru_cache(maxsize=1)
def _packed(loaded: ctypes.CDLL) -> Float32:
    arrays = list(_initializers(_file()))
    return compiled_network.packed(loaded, zip(arrays[::2], arrays[1::2], strict=True))


def _file() -> bytes:
    return resources.files(__package__).joinpath(_WEIGHTS).read_bytes()


def _initializers(model: bytes) -> Iterator[Float32]:
    """The arrays in an ONNX file, in its order: a weight and a bias of each layer."""
    graph = next(value for number, value in _fields(model) if number == _GRAPH)
    for number, value in _fields(graph):
        if number == _INITIALIZER:
            fields = list(_fields(value))
            shape = [size for number, size in fields if number == _DIMS]
            data = next(raw for number, raw in fields if number == _RAW_DATA)
            yield np.frombuffer(data, "<f4").reshape(shape)


def _fields(message: bytes) -> Iterator[tuple[int, Any]]:
    """The numbers and values of a protobuf message's fields (protobuf.dev, Encoding)."""
    at = 0

    def varint() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = message[at]
            at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    while at < len(message):
        key = varint()
        if key & 7 == 0:
            yield key >> 3, varint()
        else:  # 2, bytes; of fixed size are none in these messages
            size = varint()
            yield key >> 3, message[at : at + size]
            at += size
