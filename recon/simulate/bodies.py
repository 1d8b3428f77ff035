"""Bodies as the kernels read them: arrays of each, kept while in use, and one atlas of all textures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.simulate.painters import SIZE, Image
from recon.simulate.surfaces import Surface
from recon.simulate.textures import mipmaps

F32 = NDArray[np.float32]
KEPT = 16  # bodies; a hand that closes is another body in each frame, and one that rests comes back


@dataclass(frozen=True)
class Body:
    """Surfaces that move together; `label` is the value they get in the label image."""

    surfaces: tuple[Surface, ...]
    label: int


class Prepared:
    """Concatenated arrays of one body."""

    def __init__(self, body: Body, starts: list[NDArray[np.int64]]):
        self.body = body  # kept so that its id stays its own
        counts = [len(s.vertices) for s in body.surfaces]
        base = np.concatenate([[0], np.cumsum(counts)[:-1]])
        self.vertices = np.concatenate([s.vertices for s in body.surfaces]).astype(np.float32)
        self.faces = np.concatenate([s.faces + b for s, b in zip(body.surfaces, base, strict=True)]).astype(
            np.uint32
        )
        self.corners = np.concatenate([s.with_normals() for s in body.surfaces]).astype(np.float32)
        self.surface = np.repeat(np.arange(len(body.surfaces)), [len(s.faces) for s in body.surfaces])
        self.to_texture = np.stack([s.T_texture_object for s in body.surfaces])
        self.tile = np.array([s.material.tile for s in body.surfaces], np.float32)
        self.gloss = np.array([s.material.gloss for s in body.surfaces], np.float32)
        self.tone = np.array([float(s.material.image.mean()) for s in body.surfaces], np.float32)
        self.starts = np.stack(starts)


class BodyCache:
    """The bodies of the last frames, prepared. Known by identity: reuse bodies and images between frames.

    At most KEPT bodies are held, or a frame's, with their textures: long recordings forget rare ones.
    """

    def __init__(self) -> None:
        self._bodies: dict[int, Prepared] = {}  # the longest unused first
        self._atlas = Atlas()

    def prepared(self, bodies: list[Body]) -> list[Prepared]:
        """Arrays of the bodies of one frame, in their order."""
        for body in bodies:
            held = self._bodies.pop(id(body), None)
            if held is None:
                held = Prepared(body, [self._atlas.starts(s.material.image) for s in body.surfaces])
            self._bodies[id(body)] = held
        for key in list(self._bodies)[: -max(KEPT, len(bodies))]:
            del self._bodies[key]
        self._atlas.keep({id(s.material.image) for p in self._bodies.values() for s in p.body.surfaces})
        return [self._bodies[id(body)] for body in bodies]

    @property
    def texels(self) -> F32:
        """All texture images and their mip levels in one flat array; `Prepared.starts` points into it."""
        return self._atlas.texels


class Atlas:
    """Texture images and their mip levels in one flat array of equal slots; slots of images not kept are
    reused. `texels` handed out stay as they are for frames still being rendered: new images go into a
    copy."""

    def __init__(self) -> None:
        sides = [SIZE]
        while sides[-1] > 4:
            sides.append(sides[-1] // 2)
        sizes = 3 * np.array(sides) ** 2
        self._levels = np.cumsum(sizes) - sizes
        self._slot = int(sizes.sum())
        self._held: dict[int, tuple[Image, int]] = {}  # the image is held so that its id stays its own
        self._free: list[int] = []
        self._texels: F32 = np.empty(0, np.float32)
        self._shared = False

    @property
    def texels(self) -> F32:
        """All slots, one after the other."""
        self._shared = True
        return self._texels

    def starts(self, image: Image) -> NDArray[np.int64]:
        """Where each mip level of `image` (SIZE, SIZE, 3) starts in `texels`; a new image is added."""
        if id(image) not in self._held:
            if not self._free:
                self._grow()
            slot = self._free.pop()
            start = slot * self._slot
            if self._shared:
                self._texels, self._shared = self._texels.copy(), False
            levels = np.concatenate([level.reshape(-1) for level in mipmaps(image)])
            self._texels[start : start + self._slot] = levels
            self._held[id(image)] = (image, slot)
        starts: NDArray[np.int64] = self._held[id(image)][1] * self._slot + self._levels
        return starts

    def keep(self, images: set[int]) -> None:
        """Give back the slots of all images whose id is not among `images`."""
        for key in self._held.keys() - images:
            self._free.append(self._held.pop(key)[1])

    def _grow(self) -> None:
        slots = len(self._texels) // self._slot
        more = max(8, slots)
        grown = np.empty((slots + more) * self._slot, np.float32)
        grown[: len(self._texels)] = self._texels
        self._texels = grown
        self._shared = False
        self._free.extend(range(slots, slots + more))
