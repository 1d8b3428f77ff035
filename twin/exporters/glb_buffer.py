"""The binary half of a .glb: accessors and images, the lists that refer to them, and the file itself."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

# glTF 2.0, 3.6.2: componentType of an accessor
_COMPONENT = {"float32": 5126, "uint32": 5125, "uint16": 5123, "uint8": 5121}
_SHAPE = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
# of bufferViews: what a graphics card is to expect
VERTICES, INDICES = 34962, 34963
_QUALITY = 90  # of JPEG, chosen by us: half of the bytes of 95, no difference at a texel's size


@dataclass
class GlbBuffer:
    """What a file refers to by number, in the order in which it came."""

    _data: bytearray = field(default_factory=bytearray)
    _lists: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    _textures: dict[int, tuple[NDArray[np.uint8], int]] = field(default_factory=dict)

    def add(self, kind: str, entry: dict[str, Any]) -> int:
        """Number of a new entry of `meshes`, `materials` or another list of the document."""
        entries = self._lists.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def accessor(
        self, values: NDArray[Any], target: int | None = None, bounds: bool = False, normalized: bool = False
    ) -> int:
        """Number of an accessor of values (n, k). bounds: with the least and largest, as positions need."""
        count, width = values.shape
        entry: dict[str, Any] = {
            "bufferView": self._view(np.ascontiguousarray(values).tobytes(), target),
            "componentType": _COMPONENT[values.dtype.name],
            "count": count,
            "type": _SHAPE[width],
        }
        if normalized:
            entry["normalized"] = True
        if bounds:
            entry |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self.add("accessors", entry)

    def texture(self, image: NDArray[np.uint8]) -> int:
        """Number of a texture of an RGB image (H, W, 3), as JPEG; the same array is stored once."""
        import cv2

        if id(image) not in self._textures:
            ok, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
            if not ok:
                raise OSError(f"an image of {image.shape} can't be encoded")
            source = self.add("images", {"bufferView": self._view(data.tobytes()), "mimeType": "image/jpeg"})
            # the array is kept, so that no other gets its id
            self._textures[id(image)] = (image, self.add("textures", {"source": source}))
        return self._textures[id(image)][1]

    def _view(self, data: bytes, target: int | None = None) -> int:
        self._data.extend(bytes(-len(self._data) % 4))
        entry = {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(data)}
        self._data.extend(data)
        return self.add("bufferViews", entry | ({} if target is None else {"target": target}))

    def file(self, document: Mapping[str, Any]) -> bytes:
        """The .glb of a document, with all that was added (glTF 2.0, chapter 4)."""
        self._data.extend(bytes(-len(self._data) % 4))
        whole = {**document, **self._lists}
        if self._data:
            whole["buffers"] = [{"byteLength": len(self._data)}]
        text = json.dumps(whole, allow_nan=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        if self._data:
            chunks += struct.pack("<I4s", len(self._data), b"BIN\0") + bytes(self._data)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
