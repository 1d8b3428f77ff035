"""Which two topics of a bag are the colour and the depth camera, by types, encodings, frames and names."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from recon.readers.encoded import picture_size, require_pixels
from recon.readers.ros import images as ros_images
from recon.readers.ros.images import COMPRESSED, RAW
from recon.readers.ros.topics import Bag, Topic, guarded, listed
from twin.errors import InputError, nearest_name

_NO_DEPTH = re.compile(
    r"infra|(^|[/_])ir\d?([/_]|$)|confidence|amplitude|fisheye|thermal|disparity|label|occupancy"
)
_TO_COLOR = re.compile(r"aligned|registered|depth_to_(rgb|color)")
_COLOR_NAME = re.compile(r"rgb|colou?r")
_TRANSPORT = re.compile(r"/(compressed|compressedDepth|zstd)$")
REALSENSE = re.compile(r"^/device_\d+/sensor_\d+/\w+_\d+(?=/)")  # what names a stream of RealSense's recorder
_FEW = 0.5  # chosen by us: a camera with fewer pictures than this part of the most is a preview
_NAME_THEM = "name the ones to use with --color-topic and --depth-topic"
_DEPTH_AS = "raw (16UC1, 32FC1) or as its topic compressedDepth (PNG)"


@dataclass(frozen=True, eq=False)
class Camera:
    """An image topic: what its pictures are, and the first one.

    kind: "colour", "grey", "depth", "jpeg depth" for depth that JPEG spoilt, or "" if unusable.
    """

    topic: Topic
    kind: str
    first: ros_images.Image
    size: tuple[int, int]

    @property
    def name(self) -> str:
        return self.topic.name

    @property
    def base(self) -> str:
        """The topic that a transport's suffix was put on."""
        return _TRANSPORT.sub("", self.name)

    @property
    def place(self) -> str:
        """What is common to a camera's topics."""
        stream = REALSENSE.match(self.name)
        return stream[0] if stream else self.base.rpartition("/")[0]

    @property
    def frame(self) -> str:
        """The frame that its transform is told for; RealSense's recorder writes a version in its place."""
        stream = REALSENSE.match(self.name)
        return (stream[0] if stream else self.first.frame).lstrip("/")

    def says(self) -> str:
        encoding = self.first.encoding.split(";")[0] or "no encoding"
        return f"{self.name} ({encoding}, {len(self.topic.times)})"


def chosen(bag: Bag, color_topic: str | None, depth_topic: str | None) -> tuple[Camera, Camera]:
    """The colour and the depth camera.

    Topics that the user named come first. Else a depth image that lies on a colour image is preferred, then
    what is named colour. Raises InputError listing the topics if there are none, several, or other ones.
    """
    images = bag.of_type(RAW, COMPRESSED)
    cameras = [look(bag, t) for t in images]
    color = (
        _named(bag, cameras, color_topic, "colour") if color_topic else _of_kind(cameras, "colour", "grey")
    )
    depth = _named(bag, cameras, depth_topic, "depth") if depth_topic else _of_kind(cameras, "depth")
    lossy = [c for c in (depth if depth_topic else cameras) if c.kind == "jpeg depth"]
    if lossy and (depth_topic or not depth):
        raise InputError(
            f"{bag.shown}: {lossy[0].name} is depth in JPEG ({lossy[0].first.encoding!r}): 8 bits, which hold no distances",
            f"record depth {_DEPTH_AS}",
        )
    for name, option, found in (("colour", "--color-topic", color), ("depth", "--depth-topic", depth)):
        if not found:
            there = ", ".join(c.says() for c in cameras)
            video = [t for t in bag.topics.values() if "packet" in t.type.lower()]
            there = (
                f"its images: {there}"
                if cameras
                else f"no images among its topics: {listed(bag.topics.values())}"
            )
            raise InputError(
                f"{bag.shown} has no {name} topic that can be read; {there}"
                + (f"; video packets aren't read: {listed(video)}" if video else ""),
                f"record {name} {_DEPTH_AS if name == 'depth' else 'raw, as JPEG or as PNG'}, or name the topic with {option}",
            )
    pairs = [(_score(c, d), c, d) for c in color for d in depth if c.name != d.name]
    best = [(c, d) for score, c, d in pairs if score == max(s for s, _, _ in pairs)]
    if len(best) != 1:
        for name, sides in (("colour", [c for c, _ in best]), ("depth", [d for _, d in best])):
            several = sorted({c.name: c.says() for c in sides}.values())
            if len(several) > 1:
                raise InputError(
                    f"{bag.shown} has {len(several)} {name} topics: {', '.join(several)}", _NAME_THEM
                )
        raise InputError(f"{bag.shown} has one image topic for both colour and depth", _NAME_THEM)
    return best[0]


def look(bag: Bag, topic: Topic) -> Camera:
    """What the pictures of a topic are, by its first one."""
    name = f"{bag.shown}: a message of {topic.name}"
    with guarded(name):
        first = ros_images.parsed(topic.read(0), topic.type, topic.encoding)
        size = (first.width, first.height) if topic.type == RAW else picture_size(_behind_header(first))
        require_pixels(name, *size)
    lower, encoding = topic.name.lower(), first.encoding
    kind = ""
    if encoding in ros_images.COLOR:
        kind = "colour"
    elif encoding in ros_images.GREY:
        kind = "grey"
    elif encoding in ros_images.DEPTH or ros_images.PACKED_DEPTH.match(encoding) or _is_16_bit_png(first):
        vague = encoding == "mono16" or not (encoding in ros_images.DEPTH or ";" in encoding)
        kind = "" if _NO_DEPTH.search(lower) or (vague and "depth" not in lower) else "depth"
    elif ros_images.JPEG_DEPTH.match(encoding) and ("depth" in lower or not encoding.startswith("mono16")):
        kind = "" if _NO_DEPTH.search(lower) else "jpeg depth"
    elif topic.type == COMPRESSED and "depth" not in encoding:
        kind = "grey" if encoding.startswith(("mono", "8uc1")) else "colour"
    return Camera(topic, kind, first, size)


def _behind_header(image: ros_images.Image) -> memoryview:
    return image.data[12:] if "compresseddepth" in image.encoding else image.data


def _is_16_bit_png(image: ros_images.Image) -> bool:
    """Whether compressed data are a PNG of one channel of 16 bits, which no colour is."""
    return bytes(image.data[:8]) == b"\x89PNG\r\n\x1a\n" and bytes(image.data[24:26]) == b"\x10\x00"


def _named(bag: Bag, cameras: list[Camera], name: str, kind: str) -> list[Camera]:
    found = [c for c in cameras if c.name == name or c.name == "/" + name]
    if found:
        return found
    topic = bag.topics.get(name)
    if topic is not None:
        what = f"has {len(topic.times)} messages of type {topic.type}"
        raise InputError(
            f"{bag.shown}: {name} {what}, no images",
            f"name one of: {', '.join(c.says() for c in cameras) or 'none'}",
        )
    near = nearest_name(name, [c.name for c in cameras])
    raise InputError(
        f"{bag.shown} has no {kind} topic {name!r}",
        (f"did you mean {near!r}? " if near else "")
        + f"image topics: {', '.join(c.says() for c in cameras) or 'none'}",
    )


def _of_kind(cameras: list[Camera], *kinds: str) -> list[Camera]:
    """The cameras of the first of these kinds that has any, each by its best topic."""
    for kind in kinds:
        found = [c for c in cameras if c.kind == kind]
        most = max((len(c.topic.times) for c in found), default=0)
        found = [c for c in found if len(c.topic.times) >= _FEW * most]
        if found:
            return [_best(found, place) for place in dict.fromkeys(c.place for c in found)]
    return []


def _best(cameras: Iterable[Camera], place: str) -> Camera:
    def order(camera: Camera) -> tuple[bool, bool, bool, str]:
        raw = camera.topic.type == RAW
        return not raw, camera.first.encoding.startswith("bayer"), "mono" in camera.name, camera.name

    return min((c for c in cameras if c.place == place), key=order)


def _score(color: Camera, depth: Camera) -> tuple[bool, ...]:
    """What speaks for a pair, the strongest first."""
    together = bool(color.frame) and color.frame == depth.frame
    return (
        together and color.size == depth.size,
        bool(_TO_COLOR.search(depth.name.lower())),
        together,
        bool(_COLOR_NAME.search(color.name.lower())),
        _device(color.name) == _device(depth.name),
    )


def _device(name: str) -> str:
    return name.lstrip("/").split("/")[0]


def lies_on(depth: Camera, color: Camera) -> bool:
    """Whether a depth picture is of the colour camera's place, by its frame or by its name.

    RealSense's driver names the topic so; other drivers' registered depth has the colour camera's frame.
    """
    if color.frame and color.frame == depth.frame:
        return True
    return bool(_TO_COLOR.search(depth.name.lower())) and color.size == depth.size
