"""Cameras of a rig: calib.toml, and the cameras of `v3dctl export --format colmap` with their photographs. Without Blender.

Camera frame: x right, y down, z forward. Pixels: the centre of the first one is (0, 0).
"""
import math
import os
import re
import tomllib
from typing import NamedTuple

import numpy as np

from .decoder import DecoderError, one_line

MAX_SIDE = 16384
MAX_FILE = 64 << 20
DISTORTIONS = (0, 4, 5, 8, 12, 14)  # numbers of coefficients of OpenCV's lens models


class Camera(NamedTuple):
    name: str
    width: int  # pixels
    height: int
    focal: tuple  # fx, fy, pixels
    centre: tuple  # cx, cy, pixels
    cam_from_world: np.ndarray  # 4 x 4, metres
    distorted: bool  # Blender cannot show its lens: distortion or skew


def _read(path):
    try:
        with open(path, "rb") as file:
            data = file.read(MAX_FILE + 1)
        if len(data) > MAX_FILE:
            raise DecoderError(f"{path}: is larger than {MAX_FILE >> 20} MB")
        return data.decode()
    except OSError as error:
        raise DecoderError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise DecoderError(f"{path}: is no text") from None


def read_toml(path):
    try:
        return tomllib.loads(_read(path))
    except tomllib.TOMLDecodeError as error:
        raise DecoderError(f"{path}: {one_line(error)}") from None


def _numbers(value, shape, what):
    """An array of finite numbers."""
    try:
        array = np.array(value, float)
    except (TypeError, ValueError):
        raise DecoderError(f"{what}: expected numbers") from None
    if array.shape != shape or not np.isfinite(array).all():
        raise DecoderError(f"{what}: expected {' x '.join(map(str, shape))} finite numbers")
    return array


def _whole(number):
    """A whole number as int; Pose2Sim writes 1024.0."""
    return int(number) if isinstance(number, float) and number.is_integer() else number


def _distortions(value, what):
    if not isinstance(value, list) or len(value) not in DISTORTIONS:
        raise DecoderError(f"{what}: expected 0, 4, 5, 8, 12 or 14 numbers")
    return _numbers(value, (len(value),), what)


def _checked(camera, where):
    size = camera.width, camera.height
    if not all(type(side) is int and 0 < side <= MAX_SIDE for side in size):
        raise DecoderError(f"{where}: size: expected whole numbers from 1 to {MAX_SIDE} pixels, found {one_line(size)}")
    if min(camera.focal) <= 0:
        raise DecoderError(f"{where}: expected positive focal lengths")
    if not isinstance(camera.name, str) or not re.fullmatch(r"[^/\\\0]+", camera.name) or camera.name in (".", ".."):
        raise DecoderError(f"{where}: expected a name that can be a file name")
    return camera


def _pose(rotation, translation):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, translation
    return pose


def _rodrigues(vector):
    angle = math.hypot(*vector)
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def _rotation(value, what):
    """A rotation vector, or the rows of the matrix."""
    if not isinstance(value, list) or not value or not isinstance(value[0], list):
        return _rodrigues(_numbers(value, (3,), what))
    matrix = _numbers(value, (3, 3), what)
    if not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-3) or np.linalg.det(matrix) < 0:
        raise DecoderError(f"{what}: expected a rotation")
    return matrix


def load_calib(path):
    """The cameras of calib.toml: each table cam*, and each other table with a matrix."""
    cameras = []
    for key, table in read_toml(path).items():
        if not isinstance(table, dict) or not (key.startswith("cam") and key != "cameras" or "matrix" in table):
            continue
        where = f"{path}: {key}"
        size = table.get("size")
        if not isinstance(size, list) or len(size) != 2:
            raise DecoderError(f"{where}: size: expected [width, height]")
        matrix = _numbers(table.get("matrix"), (3, 3), f"{where}: matrix")
        if table.get("fisheye") is True:
            raise DecoderError(f"{where}: fisheye: expected false, because fisheye lenses are not supported")
        rotation = _rotation(table.get("rotation"), f"{where}: rotation")
        translation = _numbers(table.get("translation"), (3,), f"{where}: translation")
        distortions = _distortions(table.get("distortions", []), f"{where}: distortions")
        distorted = bool(matrix[0, 1] != 0 or distortions.any())
        cameras.append(_checked(Camera(table.get("name"), *map(_whole, size), (matrix[0, 0], matrix[1, 1]),
                                       (matrix[0, 2], matrix[1, 2]), _pose(rotation, translation), distorted), where))
    return cameras


def _quaternion(w, x, y, z):
    n = w * w + x * x + y * y + z * z
    if n == 0:
        raise ValueError
    s = 2 / n
    return np.array([[1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
                     [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
                     [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)]])


def _colmap_cameras(folder):
    """The cameras of one pulse."""
    model = os.path.join(folder, "sparse", "0")
    path = os.path.join(model, "cameras.txt")
    try:
        lenses = {}
        for line in _read(path).splitlines():
            words = line.split()
            if line[:1] != "#" and words:
                if words[1] != "PINHOLE":
                    raise DecoderError(f"{path}: expected cameras of the model PINHOLE, not {words[1]}")
                lenses[words[0]] = (int(words[2]), int(words[3]), *map(float, words[4:8]))
        path = os.path.join(model, "images.txt")
        lines = [line for line in _read(path).splitlines() if line[:1] != "#"]
        cameras = []
        for line in lines[::2]:
            words = line.split()
            width, height, fx, fy, cx, cy = lenses[words[8]]
            pose = _pose(_quaternion(*map(float, words[1:5])), [float(word) for word in words[5:8]])
            if not (np.isfinite(pose).all() and all(map(math.isfinite, (fx, fy, cx, cy)))):
                raise ValueError
            cameras.append(_checked(Camera(words[9].removesuffix(".png"), width, height, (fx, fy), (cx - 0.5, cy - 0.5),
                                           pose, False), path))
        return cameras
    except (ValueError, IndexError, KeyError):
        raise DecoderError(f"{path}: is no text file of `v3dctl export --format colmap`") from None


class Photographs:
    """Undistorted photographs: the folder of `v3dctl export --format colmap`, of one pulse or of several."""

    def __init__(self, folder):
        self.folder = folder
        if os.path.isdir(os.path.join(folder, "sparse")):
            self._folders = {None: folder}
        else:
            try:
                names = [name for name in os.listdir(folder) if re.fullmatch(r"\d{1,12}", name)]
            except OSError as error:
                raise DecoderError(f"{folder}: {error.strerror}") from None
            self._folders = {int(name): os.path.join(folder, name) for name in sorted(names)}
        if not self._folders:
            raise DecoderError(f"{folder}: holds no export of `v3dctl export --format colmap`")

    def cameras(self):
        """All cameras, each as in the first pulse that has it."""
        cameras = {}
        for folder in self._folders.values():
            for camera in _colmap_cameras(folder):
                cameras.setdefault(camera.name, camera)
        return list(cameras.values())

    def path(self, camera, pulse):
        """The photograph of a camera at a pulse; None without one. An export of one pulse shows it at all pulses."""
        folder = self._folders.get(None) or self._folders.get(pulse)
        path = os.path.join(folder, "images", camera + ".png") if folder else None
        return path if path and os.path.isfile(path) else None
