"""NumPy's files .npy and .npz, without pickle and without taking what their headers promise.

An array is read only when its header tells numbers, and no more of them than there may be, so that neither a
hostile header nor a zip bomb makes memory disappear. The layout of .npy is NumPy's NEP 1.
"""

from __future__ import annotations

import struct
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from recon.readers.files import shown
from twin.errors import InputError

MAX_BYTES = 256 * 2**20  # chosen by us: a depth image of 8 bytes a pixel has 256 MiB at 8192x4096
_GARBLED = (
    ValueError, SyntaxError, TypeError, EOFError, OverflowError, MemoryError, RecursionError, struct.error, tokenize.TokenError,
    UnicodeDecodeError, zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError,
)  # fmt: skip


def read_npy(path: Path, most: int = MAX_BYTES) -> NDArray[Any]:
    """The array of a .npy of at most `most` bytes. InputError: objects (pickle), other or cut files."""
    try:
        with path.open("rb") as stream:
            return _array(stream, shown(path), most)
    except OSError as error:
        raise InputError(
            f"{shown(path)} can't be read ({error.strerror})", "copy the recording again"
        ) from None


def read_npz(path: Path, key: str, most: int = MAX_BYTES) -> NDArray[Any]:
    """The array `key` of a .npz of at most `most` bytes. Raises InputError as `read_npy`, and without one."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            if f"{key}.npy" not in names:
                raise InputError(
                    f"{shown(path)} has no array {key!r}; it holds {', '.join(names[:8]) or 'nothing'}",
                    f"save it as numpy.savez({key}=array)",
                )
            with archive.open(f"{key}.npy") as stream:
                return _array(stream, f"{shown(path)}:{key}", most)
    except InputError:
        raise
    except (OSError, *_GARBLED) as error:
        raise InputError(
            f"{shown(path)} is no readable .npz archive ({error})", "copy the recording again"
        ) from None


def _array(stream: IO[bytes], name: str, most: int) -> NDArray[Any]:
    """The array that begins here."""
    try:
        version = npy.read_magic(stream)
        read = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(version)
        if read is None:
            raise ValueError(f"version {version}")
        shape, column_major, dtype = read(stream)
        if dtype.kind not in "biuf" or dtype.itemsize > 8:
            why = "holds pickled objects, which can run code" if dtype.hasobject else f"holds {dtype}"
            raise InputError(f"{name} {why}", "save numbers with numpy.save")
        count = 1
        for side in shape:  # in Python's integers, which don't overflow
            count *= side
        if not 0 < count * dtype.itemsize <= most:
            raise InputError(
                f"{name} is of shape {shape}, {count * dtype.itemsize} bytes"[:200],
                f"expected at most {most} bytes, and some",
            )
        data = stream.read(count * dtype.itemsize)
    except InputError:
        raise
    except _GARBLED as error:
        told = " ".join(str(error).split())[:100]
        raise InputError(f"{name} is no NumPy array ({told})", "save it with numpy.save") from None
    if len(data) != count * dtype.itemsize:
        raise InputError(
            f"{name} is truncated: {len(data)} of {count * dtype.itemsize} bytes of its array",
            "copy the recording again",
        )
    flat = np.frombuffer(data, dtype)
    return flat.reshape(shape, order="F" if column_major else "C")
