"""Images and cameras as ROS' sensor_msgs have them, and what they are here."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from nuno.camera.camera import Camera
from nuno.errors import MessageError
from nuno.robot.readings import ImageReading
from nuno.robot.wire import messages as ros

Fields = dict[str, Any]

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
RGB, BGR, GRAY, DEPTH, MILLIMETRES = "rgb8", "bgr8", "mono8", "32FC1", "16UC1"
"""Encodings that are understood; millimetres are those of depth cameras, 0 where nothing is."""
KINDS = {RGB: (np.uint8, 3), BGR: (np.uint8, 3), GRAY: (np.uint8, 1), DEPTH: (np.float32, 1),
         MILLIMETRES: (np.uint16, 1)}  # fmt: skip
LIGHT = (cv2.IMWRITE_PNG_COMPRESSION, 1)
"""PNG as fast as it gets: images are kept to the bit, which JPEG does not do."""


def image_fields(reading: ImageReading, frame: str) -> Fields:
    """Return a sensor_msgs/msg/Image: colour as rgb8, depth as 32FC1 [m]. On this wire bytes are text in base 64."""
    image = np.ascontiguousarray(reading.image)
    kind = RGB if image.ndim == 3 else DEPTH
    return {
        "header": ros.header_fields(reading.time, frame), "height": image.shape[0], "width": image.shape[1],
        "encoding": kind, "is_bigendian": 0, "step": image.strides[0], "data": base64.b64encode(image.data).decode(),
    }  # fmt: skip


def compressed_fields(reading: ImageReading, frame: str) -> Fields:
    """Return a sensor_msgs/msg/CompressedImage of colour, as image_transport has it in PNG."""
    _, data = cv2.imencode(".png", cv2.cvtColor(reading.image, cv2.COLOR_RGB2BGR), LIGHT)
    header = ros.header_fields(reading.time, frame)
    return {"header": header, "format": "rgb8; png compressed bgr8", "data": base64.b64encode(data.data).decode()}


def camera_info_fields(time: float, camera: Camera, frame: str) -> Fields:
    """Return a sensor_msgs/msg/CameraInfo."""
    matrix = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    distortion = np.zeros(5) if camera.distortion is None else camera.distortion
    return {
        "header": ros.header_fields(time, frame), "height": camera.height, "width": camera.width,
        "distortion_model": "plumb_bob" if len(distortion) <= 5 else "rational_polynomial",
        "d": distortion.tolist(), "k": matrix, "r": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        "p": [*matrix[:3], 0.0, *matrix[3:6], 0.0, *matrix[6:], 0.0], "binning_x": 0, "binning_y": 0,
        "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
    }  # fmt: skip


def read_image(message: Fields) -> tuple[float, np.ndarray]:
    """Return the time [s] and what a sensor_msgs/msg/Image shows: (h, w, 3) uint8 RGB, or depths (h, w) float32 [m].

    Raises:
        MessageError: a field that is missing or of another type, an encoding that is not understood, or a length that
            does not fit.
    """
    encoding = ros.field(message, "encoding", str)
    if encoding not in KINDS:
        raise MessageError(f"images must be encoded as one of {', '.join(KINDS)}, got {encoding!r}")
    kind, channels = KINDS[encoding]
    height, width, step = (ros.field(message, name, int) for name in ("height", "width", "step"))
    data = _bytes(message)
    row = width * channels * np.dtype(kind).itemsize
    if min(height, width) < 1 or step < row or len(data) != height * step:
        raise MessageError(f"an image of {width} x {height} px in rows of {step} bytes cannot have {len(data)} bytes")
    rows = np.frombuffer(data, np.uint8).reshape(height, step)[:, :row]
    own = np.dtype(kind)
    own = own.newbyteorder(">") if ros.field(message, "is_bigendian", (int, bool), default=0) else own.newbyteorder("<")
    values = np.ascontiguousarray(rows).view(own).reshape(height, width, channels)
    return ros.seconds(message, "header.stamp", 0.0), _as_here(values, encoding)


def read_compressed(message: Fields) -> tuple[float, np.ndarray]:
    """Return the time [s] and what a sensor_msgs/msg/CompressedImage shows, (h, w, 3) uint8 RGB.

    Raises:
        MessageError: a field that is missing or of another type, or data that is no JPEG or PNG.
    """
    image = cv2.imdecode(np.frombuffer(_bytes(message), np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise MessageError(f"a compressed image of the format {message.get('format')!r} cannot be read")
    return ros.seconds(message, "header.stamp", 0.0), cv2.cvtColor(image, cv2.COLOR_BGR2RGB)


def read_camera_info(message: Fields, camera: Camera) -> Camera:
    """Return a camera with the pixels that a sensor_msgs/msg/CameraInfo tells, where another is.

    Raises:
        MessageError: a field that is missing or of another type.
        InvalidInputError: numbers that make no camera.
    """
    k = ros.reals(message, "k", 9)
    distortion = ros.reals(message, "d")
    height, width = (ros.field(message, name, int) for name in ("height", "width"))
    return replace(
        camera, width=width, height=height, fx=float(k[0]), fy=float(k[4]), cx=float(k[2]), cy=float(k[5]),
        distortion=distortion if distortion.any() else None,
    )  # fmt: skip


def transform_fields(time: float, parent: str, child: str, place: np.ndarray, turn: np.ndarray) -> Fields:
    """Return a geometry_msgs/msg/TransformStamped of a position [m] and a quaternion (w, x, y, z)."""
    transform: Mapping[str, Any] = {
        "translation": ros.vector_fields(place), "rotation": ros.quaternion_fields(turn),
    }  # fmt: skip
    return {"header": ros.header_fields(time, parent), "child_frame_id": child, "transform": transform}


def _bytes(message: Fields) -> bytes:
    data = ros.field(message, "data", (str, list))
    try:
        return bytes(data) if isinstance(data, list) else base64.b64decode(data, validate=True)
    except (ValueError, TypeError, binascii.Error) as error:
        raise MessageError(f"'data' must be bytes in base 64, got {str(data)[:40]!r}: {error}") from error


def _as_here(values: np.ndarray, encoding: str) -> np.ndarray:
    if encoding == RGB:
        return values
    if encoding == BGR:
        return np.ascontiguousarray(values[..., ::-1])
    if encoding == GRAY:
        return np.repeat(values, 3, axis=2)
    if encoding == DEPTH:
        return values[..., 0].astype(np.float32)
    depth = values[..., 0] / np.float32(1000.0)
    return np.where(values[..., 0] == 0, np.float32(np.inf), depth).astype(np.float32)
