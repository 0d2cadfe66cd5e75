"""The C decoder (codec/v3d_decoder.h) by ctypes. Without Blender.

Arrays are copies, so no array refers to memory of the decoder. Each length of the library is checked before its data is
read: vertex and triangle counts against the limits of the formats, and indices against the number of vertices.
"""
import ctypes
import ctypes.util
import os
from typing import NamedTuple, Optional

import numpy as np

LIBRARY = "libv3d-decoder.so.2"
PACKAGE = "libv3d-decoder2"
OK, MALFORMED, NEEDS_REFERENCE, OUT_OF_MEMORY = range(4)
# Limits of docs/compact-frame.md, which are above those of docs/motion-format.md.
MAX_VERTICES = 4_194_304
MAX_TRIANGLES = 8_388_608
MAX_PULSES = 65_536


class DecoderError(Exception):
    """Bad input. The text is one line."""


class _Frame(ctypes.Structure):
    """v3d_frame"""
    _fields_ = [("pulse", ctypes.c_int64), ("exposure_ns", ctypes.c_int64), ("key_pulse", ctypes.c_int64),
                ("quality", ctypes.c_float), ("step_m", ctypes.c_double), ("origin_m", ctypes.c_double * 3),
                ("cameras", ctypes.c_size_t), ("camera_names", ctypes.POINTER(ctypes.c_char_p)),
                ("missing_cameras", ctypes.c_size_t), ("vertices", ctypes.c_size_t),
                ("positions", ctypes.POINTER(ctypes.c_float)), ("colours", ctypes.POINTER(ctypes.c_uint8)),
                ("triangles", ctypes.c_size_t), ("indices", ctypes.POINTER(ctypes.c_uint32)),
                ("live_passes", ctypes.c_size_t), ("labels", ctypes.POINTER(ctypes.c_uint8))]


class _Segment(ctypes.Structure):
    """v3d_motion_segment"""
    _fields_ = [("pulses", ctypes.c_size_t), ("pulse_numbers", ctypes.POINTER(ctypes.c_int64)),
                ("key", ctypes.c_size_t), ("vertices", ctypes.c_size_t), ("triangles", ctypes.c_size_t),
                ("step_m", ctypes.c_double)]


class _Surface(ctypes.Structure):
    """v3d_motion_surface"""
    _fields_ = [("vertices", ctypes.c_size_t), ("positions", ctypes.POINTER(ctypes.c_float)),
                ("colours", ctypes.POINTER(ctypes.c_uint8)), ("triangles", ctypes.c_size_t),
                ("indices", ctypes.POINTER(ctypes.c_uint32))]


class _Pulse(ctypes.Structure):
    """v3d_motion_pulse"""
    _fields_ = [("pulse", ctypes.c_int64), ("vertices", ctypes.c_size_t), ("positions", ctypes.POINTER(ctypes.c_float)),
                ("colours", ctypes.POINTER(ctypes.c_uint8)), ("confidences", ctypes.POINTER(ctypes.c_uint8))]


class Surface(NamedTuple):
    """The surface of a pulse."""
    vertices: np.ndarray  # float32 [vertices, 3], world, metres, z up
    triangles: np.ndarray  # uint32 [triangles, 3], counter-clockwise seen from outside
    colours: Optional[np.ndarray]  # uint8 [vertices, 3], sRGB


_FUNCTIONS = {
    "v3d_decoder_new": (ctypes.c_void_p, []),
    "v3d_decoder_free": (None, [ctypes.c_void_p]),
    "v3d_decoder_decode": (ctypes.c_int, [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t]),
    "v3d_decoder_frame": (ctypes.POINTER(_Frame), [ctypes.c_void_p]),
    "v3d_motion_open": (ctypes.c_int, [ctypes.POINTER(ctypes.c_void_p), ctypes.c_char_p, ctypes.c_size_t]),
    "v3d_motion_free": (None, [ctypes.c_void_p]),
    "v3d_motion_segments": (ctypes.c_size_t, [ctypes.c_void_p]),
    "v3d_motion_segment_at": (ctypes.POINTER(_Segment), [ctypes.c_void_p, ctypes.c_size_t]),
    "v3d_motion_surface_of": (ctypes.POINTER(_Surface), [ctypes.c_void_p, ctypes.c_size_t]),
    "v3d_motion_decode": (ctypes.POINTER(_Pulse), [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t]),
}
_library = None


def library():
    """The shared library: the file V3D_DECODER of the environment, or that of the package libv3d-decoder2."""
    global _library
    if _library is None:
        path = os.environ.get("V3D_DECODER", LIBRARY)
        try:
            loaded = ctypes.CDLL(path)
            for name, (result, arguments) in _FUNCTIONS.items():
                function = getattr(loaded, name)
                function.restype, function.argtypes = result, arguments
        except (OSError, AttributeError) as error:
            raise DecoderError(f"{path}: {one_line(error)}; install the package {PACKAGE}, version 2.2 or later") from None
        _library = loaded
    return _library


def one_line(error):
    return " ".join(str(error).split())


def _rows(pointer, count, limit, dtype, what):
    """A copy of `count` rows of three elements."""
    if count > limit:
        raise DecoderError(f"{count} {what}: more than the {limit} of the format")
    if count == 0:
        return np.zeros((0, 3), dtype)
    if not pointer:
        raise DecoderError(f"no data of {count} {what}")
    return np.ctypeslib.as_array(pointer, (count, 3)).astype(dtype, copy=True)


def _positions(of):
    return _rows(of.positions, of.vertices, MAX_VERTICES, np.float32, "vertices")


def _colours(of):
    return _rows(of.colours, of.vertices, MAX_VERTICES, np.uint8, "colours") if of.colours else None


def _triangles(of):
    triangles = _rows(of.indices, of.triangles, MAX_TRIANGLES, np.uint32, "triangles")
    if triangles.size and triangles.max() >= of.vertices:
        raise DecoderError(f"a triangle has vertex {triangles.max()}, but there are {of.vertices}")
    return triangles


class FrameDecoder:
    """Decodes a sequence of compact frames. One thread."""

    def __init__(self):
        self._handle = None
        self._library = library()
        self._handle = self._library.v3d_decoder_new()
        if not self._handle:
            raise DecoderError("memory is exhausted")

    def __del__(self):
        if self._handle:
            self._library.v3d_decoder_free(self._handle)

    def decode(self, data):
        """Decodes the next frame, bytes; returns OK, NEEDS_REFERENCE or another status of damage."""
        status = self._library.v3d_decoder_decode(self._handle, data, len(data))
        if status == OUT_OF_MEMORY:
            raise DecoderError("memory is exhausted")
        return status

    def surface(self):
        """The last decoded frame."""
        pointer = self._library.v3d_decoder_frame(self._handle)
        if not pointer:
            raise DecoderError("no frame was decoded")
        frame = pointer.contents
        return Surface(_positions(frame), _triangles(frame), _colours(frame))


class Segment(NamedTuple):
    """A run of pulses with the same triangles."""
    pulses: np.ndarray  # int64, increasing
    vertices: int
    triangles: int


class MotionDecoder:
    """A motion file in memory. One thread."""

    def __init__(self, data):
        self._handle = None
        self._library = library()
        handle = ctypes.c_void_p()
        status = self._library.v3d_motion_open(ctypes.byref(handle), data, len(data))
        if status == OUT_OF_MEMORY:
            raise DecoderError("memory is exhausted")
        if status != OK or not handle:
            raise DecoderError("is no motion file, or damaged: run v3dctl track again")
        self._handle = handle
        self.segments = [self._segment(n) for n in range(self._library.v3d_motion_segments(handle))]

    def __del__(self):
        if self._handle:
            self._library.v3d_motion_free(self._handle)

    def _segment(self, number):
        pointer = self._library.v3d_motion_segment_at(self._handle, number)
        if not pointer:
            raise DecoderError(f"no segment {number}")
        segment = pointer.contents
        if not 0 < segment.pulses <= MAX_PULSES or not segment.pulse_numbers:
            raise DecoderError(f"{segment.pulses} pulses in segment {number}; expected 1 to {MAX_PULSES}")
        pulses = np.ctypeslib.as_array(segment.pulse_numbers, (segment.pulses,)).copy()
        return Segment(pulses, segment.vertices, segment.triangles)

    def triangles(self, segment):
        pointer = self._library.v3d_motion_surface_of(self._handle, segment)
        if not pointer:
            raise DecoderError(f"the template of segment {segment} is damaged: run v3dctl track again")
        return _triangles(pointer.contents)

    def vertices(self, segment, index):
        """Positions and colours (or None) of a pulse, by its index in the segment."""
        if not 0 <= index < len(self.segments[segment].pulses):
            raise DecoderError(f"no pulse at {index} of segment {segment}")
        pointer = self._library.v3d_motion_decode(self._handle, segment, index)
        if not pointer:
            raise DecoderError(f"pulse {self.segments[segment].pulses[index]} is damaged: run v3dctl track again")
        pulse = pointer.contents
        if pulse.vertices != self.segments[segment].vertices:
            raise DecoderError(f"{pulse.vertices} vertices; the segment has {self.segments[segment].vertices}")
        return _positions(pulse), _colours(pulse)
