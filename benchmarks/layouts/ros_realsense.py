"""Write a recording as RealSense's recorder does: a ROS 1 .bag or a ROS 2 .db3, each with its own idea of a
camera's numbers.

Topics, texts and the depth unit behind a ROS 1 image are those of librealsense's ros_writer.cpp and
ros2_writer.cpp.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from benchmarks.layouts.ros import Ros, Style, ros1_bag, ros2_bag
from recon.recording import Intrinsics, Recording
from twin.geometry import Array


def write_realsense(
    recording: Recording,
    out: Path,
    T_color_depth: Array,
    unit: float = 0.001,
    container: str = "bag",
    in_images: bool = True,
) -> Path:
    """A file of RealSense's recorder: its depth camera beside the colour camera, its topics, and its times
    from zero on.

    container: "bag" (ROS 1) or "db3" (ROS 2, its cameras and transforms as text). unit: metres per count, in
    each depth image (in_images, "bag" alone) or as the sensor's option.
    """
    bag = container == "bag"
    scratch = out.with_suffix("")
    with ros1_bag(out) if bag else ros2_bag(scratch) as ros:
        prefix = {s: f"/device_0/sensor_{n}/{s}_0" for n, s in enumerate(("Depth", "Color"))}
        reference = np.eye(4)
        reference[:3, 3] = [0.002, 0.0, 0.001]  # the group's reference is the depth camera's neighbour
        stands = {"Depth": reference, "Color": T_color_depth @ reference}
        for stream, T in stands.items():
            _put_realsense_stream(ros, prefix[stream], recording.intrinsics, T)
        if not (bag and in_images):
            kind = "std_msgs/msg/Float32" if bag else "std_msgs/msg/String"
            value = np.float32(unit).item() if bag else f"{unit:.6f}"
            ros.put("/device_0/sensor_0/option/Depth_Units/value", kind, ros.make(kind, value), 1)
        for k, time in enumerate(recording.times):
            log = round((time - recording.times[0]) * 1e9) + 10**9
            stamp = round(time * 1e9) if bag else log
            frame = recording.frame(k)
            counts = np.rint(frame.depth.astype(np.float64) / unit).astype(np.uint16)
            for stream, pixels, encoding in (("Color", frame.color, "rgb8"), ("Depth", counts, "mono16")):
                name = "1" if bag and in_images else "" if bag else stream
                tail = struct.pack("<f", unit if stream == "Depth" else 0.0) if bag and in_images else b""
                message = ros.image(stamp, name, pixels, encoding, Style())
                ros.put(f"{prefix[stream]}/image/data", "sensor_msgs/msg/Image", message, log, tail)
    if bag:
        return out
    return (scratch / f"{scratch.name}.db3").rename(out)


def _put_realsense_stream(ros: Ros, prefix: str, k: Intrinsics, T_stream_reference: Array) -> None:
    if ros.ros1:
        info = ros.info(0, "", k, "Inverse Brown Conrady", (0.0,) * 5)
        ros.put(f"{prefix}/info/camera_info", "sensor_msgs/msg/CameraInfo", info, 1)
        transform = ros.transform(T_stream_reference)
        ros.put(f"{prefix}/tf/0", "geometry_msgs/msg/Transform", transform, 1)
        return
    text = (
        f"width={k.width};height={k.height};fx={k.fx:.9g};ppx={k.cx:.9g};fy={k.fy:.9g};ppy={k.cy:.9g};"
        "model=Inverse Brown Conrady;coeffs=0,0,0,0,0"
    )
    ros.put(f"{prefix}/camera_info", "std_msgs/msg/String", ros.make("std_msgs/msg/String", text), 1)
    columns = ",".join(f"{v:.6f}" for v in T_stream_reference[:3, :3].T.reshape(-1))
    moved = ",".join(f"{v:.6f}" for v in T_stream_reference[:3, 3])
    text = f"rotation={columns};translation={moved}"
    ros.put(f"{prefix}/tf/ref_0", "std_msgs/msg/String", ros.make("std_msgs/msg/String", text), 1)
