"""Values to files and back, exactly: nested dataclasses, mappings, sequences and arrays, without pickle.

The structure goes to `data.json`, the arrays to `arrays.npz`. Dataclasses and named tuples are written with
their import name and read back through their constructor, so that they check themselves again; only classes
of this project's packages are ever imported. Equal values give equal bytes.
"""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError

T = TypeVar("T")

PACKAGES = ("twin", "recon", "robots")
_EPOCH = (1980, 1, 1, 0, 0, 0)  # zip archives carry clock times; a fixed one keeps equal values byte-equal
_KIND = "__kind__"


class Codec(Protocol[T]):
    """Stores the value of a stage in an existing, empty folder, exactly.

    `settle(value)` is what `load` would return after `save`: runs with or without a folder use equal bytes.
    """

    def save(self, value: T, folder: Path) -> None: ...
    def load(self, folder: Path) -> T: ...
    def settle(self, value: T) -> T: ...


class CodecError(InputError):
    """A value can't be written, or a stored value can't be read back."""


class OtherVersionError(CodecError):
    """A stored value is of a class that this version doesn't have, or that has other fields now."""


class TreeCodec:
    """Stores nested dataclasses, named tuples, dicts, tuples, lists, arrays, numbers, strings and None."""

    def save(self, value: Any, folder: Path) -> None:
        """Write `value` as data.json and arrays.npz into an existing folder."""
        tree, arrays = encode(value)
        _write_arrays(arrays, folder / "arrays.npz")
        (folder / "data.json").write_text(json.dumps(tree, allow_nan=False), encoding="utf-8")

    def load(self, folder: Path) -> Any:
        """Read what `save` wrote. CodecError: a damaged folder, OtherVersionError: a class is missing."""
        try:
            tree = json.loads((folder / "data.json").read_text(encoding="utf-8"))
            with np.load(folder / "arrays.npz", allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
            return decode(tree, arrays)
        except (OSError, EOFError, ValueError, KeyError, TypeError, AttributeError, zipfile.BadZipFile) as e:
            raise CodecError(f"{folder} holds no readable value ({e})", "delete the folder") from e

    def settle(self, value: Any) -> Any:
        """The value as `load` would give it back after `save`, without touching the disk."""
        return decode(*encode(value))


def encode(value: Any) -> tuple[Any, dict[str, NDArray[Any]]]:
    """Structure (JSON types only) and the named arrays it refers to. Arrays become C-ordered."""
    arrays: dict[str, NDArray[Any]] = {}
    return _encode(value, arrays, "value"), arrays


def decode(tree: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    """Inverse of `encode`."""
    if isinstance(tree, list):
        return [decode(t, arrays) for t in tree]
    if not isinstance(tree, dict):
        return tree
    kind, data = tree[_KIND], tree["data"]
    if kind == "array":
        return arrays[data]
    if kind == "float":
        return float(data)
    if kind == "tuple":
        return tuple(decode(t, arrays) for t in data)
    if kind == "dict":
        return {decode(k, arrays): decode(v, arrays) for k, v in data}
    if kind == "object":
        return _object(tree["class"], {k: decode(v, arrays) for k, v in data.items()})
    raise CodecError(f"unknown kind of value {kind!r}")


def _encode(value: Any, arrays: dict[str, NDArray[Any]], where: str) -> Any:
    if isinstance(value, np.ndarray):
        return _encode_array(value, arrays, where)
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else {_KIND: "float", "data": repr(value)}
    if is_dataclass(value) and not isinstance(value, type):
        names = [f.name for f in fields(value) if f.init]
    elif isinstance(value, tuple) and hasattr(value, "_fields"):
        names = list(value._fields)
    elif isinstance(value, (tuple, list)):
        items = [_encode(v, arrays, f"{where}[{k}]") for k, v in enumerate(value)]
        return items if isinstance(value, list) else {_KIND: "tuple", "data": items}
    elif isinstance(value, Mapping):
        pairs = [[_encode(k, arrays, where), _encode(v, arrays, f"{where}[{k!r}]")] for k, v in value.items()]
        return {_KIND: "dict", "data": pairs}
    else:
        raise CodecError(f"{where} is a {type(value).__name__}, which can't be stored")
    data = {name: _encode(getattr(value, name), arrays, f"{where}.{name}") for name in names}
    return {_KIND: "object", "class": _class_name(type(value), where), "data": data}


def _encode_array(value: NDArray[Any], arrays: dict[str, NDArray[Any]], where: str) -> Any:
    if value.dtype.hasobject:
        raise CodecError(f"{where} is an array of Python objects, which can't be stored")
    name = f"a{len(arrays)}"
    arrays[name] = np.array(value, order="C")
    return {_KIND: "array", "data": name}


def _class_name(cls: type, where: str) -> str:
    name = f"{cls.__module__}:{cls.__qualname__}"
    if cls.__module__.split(".")[0] not in PACKAGES or "<locals>" in name:
        raise CodecError(
            f"{where} is a {name}, which can't be stored", "use a class of twin, recon or robots"
        )
    return name


def _object(name: str, values: Mapping[str, Any]) -> Any:
    cls = _class(name)
    known = {f.name for f in fields(cls) if f.init} if is_dataclass(cls) else set(cls._fields)
    if known != values.keys():
        odd = ", ".join(sorted(known ^ values.keys()))
        raise OtherVersionError(f"the fields of {name} are others now ({odd})")
    return cls(**values)


def _class(name: str) -> Any:
    module, _, qualname = name.partition(":")
    if module.split(".")[0] not in PACKAGES or "." in qualname:
        raise CodecError(f"{name} is not a class that may be read from a file")
    try:
        cls = getattr(import_module(module), qualname)
    except (ModuleNotFoundError, AttributeError) as e:
        raise OtherVersionError(f"{name} is gone") from e
    if not (isinstance(cls, type) and (is_dataclass(cls) or hasattr(cls, "_fields"))):
        raise CodecError(f"{name} is not a data class")
    return cls


def _write_arrays(arrays: Mapping[str, NDArray[Any]], path: Path) -> None:
    """An .npz with masks and labels deflated (some fifty times smaller), the rest stored."""
    with zipfile.ZipFile(path, "w", allowZip64=True) as archive:
        for name, array in arrays.items():
            small = array.dtype.itemsize == 1 and array.size > 4096
            entry = zipfile.ZipInfo(f"{name}.npy", _EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED if small else zipfile.ZIP_STORED
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, array, allow_pickle=False)
            archive.writestr(entry, buffer.getbuffer(), compresslevel=1 if small else None)
