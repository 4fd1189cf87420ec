"""What the compiled kernels are given: as their header has it, and nothing else gets through."""

from __future__ import annotations

import ctypes
import re
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from compiled_kernels import loaded, needs_kernels

from itmo_video.kernels import compiled, compiled_light, library
from itmo_video.kernels.dispatch import with_compiled_form

# The table's letters for a parameter of the header.
LETTERS = {
    "uint8_t *": "Bp", "int32_t *": "I", "int64_t *": "L", "uint16_t *": "HW", "float *": "F",
    "double *": "D", "int64_t ": "n", "float ": "f", "double ": "d",
}  # fmt: skip
PLANE = np.full((6, 8), 0.5, np.float32)


def prototypes() -> dict[str, list[str]]:
    """The header's functions: the letters that each of their arguments may have."""
    text = Path(library.__file__).with_name("loops.h").read_text()
    found = {}
    for name, arguments in re.findall(r"^void itmo_(\w+)\(([^)]*)\);", text, re.MULTILINE):
        kinds = [
            re.sub(r"const |restrict |\w+$", "", " ".join(a.split())) for a in arguments.split(",")
        ]
        found[name] = [LETTERS[kind.replace("*restrict", "*").lstrip()] for kind in kinds]
    return found


def test_the_table_is_that_of_the_header() -> None:
    header = prototypes()
    assert set(header) == set(library._ARGUMENTS)
    for name, letters in library._ARGUMENTS.items():
        assert len(letters) == len(header[name]), name
        for at, (letter, allowed) in enumerate(zip(letters, header[name], strict=True)):
            assert letter in allowed, f"{name}, argument {at + 1}"


def light(plane: np.ndarray[Any, Any], **other: Any) -> None:
    """Call `weighted_sum` with one argument of another kind."""
    arguments = {"ratio": None, "out": None, **other}
    compiled.weighted_sum(loaded, [PLANE, PLANE, plane], (0.2, 0.7, 0.1), **arguments)


CODES = np.full((6, 8), 100, np.uint8)
TO_LIGHT = compiled_light.CodesToLight(
    (None, None), (16, 219, 128, 224), (1.5, 1.8, -0.4, -0.2), None
)
OUT = [np.empty((6, 8), np.float32) for _ in range(3)]


def codes(
    rows: slice = slice(0, 6), out: Any = OUT, plane: Any = CODES, chroma: Any = CODES
) -> None:
    """Call `ycbcr_rows` with one argument of another kind."""
    compiled_light.ycbcr_rows(
        loaded, [plane, CODES, chroma], rows, TO_LIGHT, out,
    )  # fmt: skip


def halves(dtype: Any = np.float16, **other: Any) -> None:
    """Call `expand` with one argument of another kind."""
    arguments = {"gain": PLANE, "weight": PLANE, **other}
    out = np.empty((3, 6, 8), dtype)
    compiled.expand(loaded, [PLANE] * 3, base=1.0, strength=1.0, out=out, **arguments)


WRONG = {
    "float64 for float32": lambda: light(PLANE.astype(np.float64)),
    "integers for float32": lambda: light(PLANE.astype(np.int32)),
    "a ratio of float16": lambda: light(PLANE, ratio=PLANE.astype(np.float16)),
    "a smaller plane": lambda: light(PLANE[:3]),
    "a smaller ratio": lambda: light(PLANE, ratio=PLANE[:, :4].copy()),
    "a smaller target": lambda: light(PLANE, out=np.empty((5, 8), np.float32)),
    "gaps between lines": lambda: light(np.zeros((6, 16), np.float32)[:, ::2]),
    "a transposed plane": lambda: light(np.zeros((8, 6), np.float32).T),
    "rows beyond the picture": lambda: codes(slice(0, 7)),
    "rows before the picture": lambda: codes(slice(-1, 5)),
    "targets of another size": lambda: codes(out=[np.empty((5, 8), np.float32)] * 3),
    "targets of float64": lambda: codes(out=[np.empty((6, 8))] * 3),
    "codes of 64 bits": lambda: codes(plane=CODES.astype(np.int64)),
    "luma of 16 bits beside chroma of 8": lambda: codes(plane=CODES.astype(np.uint16)),
    "chroma of two sizes": lambda: codes(chroma=CODES[:, :4].copy()),
    "halves as float32": lambda: halves(np.float32),
    "a smaller gain": lambda: halves(gain=PLANE[:3]),
    "a smaller map": lambda: halves(weight=PLANE[:3]),
    "a map without columns": lambda: compiled.guided_coefficients(
        loaded, PLANE, PLANE[:, :4], 1, 1e-3, PLANE
    ),
    "places of float32": lambda: compiled.camera_model(
        loaded, PLANE[0], PLANE[0], cast(Any, PLANE[:2]), PLANE[0], (1.0,), 1e-6
    ),
    "bytes as int16": lambda: compiled.pack_literals(loaded, np.zeros((2, 8), np.int16)),
}


@needs_kernels
@pytest.mark.parametrize("call", WRONG.values(), ids=list(WRONG))
def test_what_does_not_fit_raises(call: Any) -> None:
    """A kernel that was given it would read or write other memory, or other numbers, unseen."""
    with pytest.raises((ValueError, TypeError, ctypes.ArgumentError)):
        call()


def test_a_kernel_takes_the_form_that_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    def by_loops(loaded: Any, a: int, b: int) -> tuple[Any, ...]:
        return loaded, a, b

    @with_compiled_form(by_loops)
    def kernel(a: int, b: int) -> tuple[Any, ...]:
        return "plain", a, b

    there = object()
    monkeypatch.setattr(library, "library", lambda: there)
    assert kernel(1, b=2) == (there, 1, 2)
    monkeypatch.setattr(library, "library", lambda: None)
    assert kernel(1, b=2) == ("plain", 1, 2)


@needs_kernels
def test_what_fits_passes() -> None:
    light(PLANE, ratio=PLANE, out=np.empty((6, 8), np.float32))
    codes()
    halves()
