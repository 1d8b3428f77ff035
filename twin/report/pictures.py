"""Pictures and films inside the page."""

from __future__ import annotations

import base64

from twin.report.frames import Image


def jpeg(image: Image) -> str:
    import cv2

    _, data = cv2.imencode(".jpg", image[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])
    return uri(data.tobytes(), "image/jpeg")


def uri(data: bytes, kind: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"
