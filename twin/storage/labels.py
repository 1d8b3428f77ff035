"""Label images in a folder, read when asked for."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError

LABEL = re.compile(r"\d{6,}\.png")


class LabelFolder(Mapping[int, "NDArray[np.uint8]"]):
    """Label images of a folder by recording frame, read when asked for. Other file names are no labels."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        names = sorted(p.stem for p in folder.glob("*.png") if LABEL.fullmatch(p.name))
        self._frames = {int(n): n for n in names}

    def __getitem__(self, frame: int) -> NDArray[np.uint8]:
        import cv2

        path = self._folder / f"{self._frames[frame]}.png"
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if image is None or image.ndim != 2 or image.dtype != np.uint8:
            raise InputError(f"{path} is not a single-channel 8-bit PNG", "labels are written by twin.save")
        return np.asarray(image, dtype=np.uint8)

    def __iter__(self) -> Iterator[int]:
        return iter(self._frames)

    def __len__(self) -> int:
        return len(self._frames)
