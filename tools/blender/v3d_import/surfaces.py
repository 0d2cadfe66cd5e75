"""The surfaces of a take by pulse, from mesh.v3d or motion.v3d. Without Blender.

The layout of mesh.v3d is in docs/compact-frame.md, the motion file in docs/motion-format.md.
"""
import bisect
import os
import struct
import zlib
from typing import NamedTuple

import numpy as np

from .decoder import NEEDS_REFERENCE, OK, DecoderError, FrameDecoder, MotionDecoder, Surface

MESH_MAGIC = b"V3DM\r\n\x1a\n"
MOTION_MAGIC = b"V3DT\r\n\x1a\n"
HEADER = 16
RECORD = struct.Struct("<4sIqII")  # magic, payload bytes, pulse, CRC of the payload, CRC of the head
ENTRY = struct.Struct("<qQII")  # pulse, offset, payload bytes, CRC of the payload
FOOTER = struct.Struct("<QII8s")  # offset and bytes of the index, its CRC, magic
MAX_PAYLOAD = 268_435_456
MAX_INDEX = 64 << 20
MAX_MOTION = 1 << 30
CHUNK = 1 << 20
PULSE = struct.Struct("<q")
PULSE_AT, KEY_PULSE_AT = 24, 40  # in a compact frame


class Shown(NamedTuple):
    """A surface, and a mark that differs for surfaces with other triangles, also where the file has changed."""
    surface: Surface
    topology: object


def checksum(triangles):
    return zlib.crc32(triangles.tobytes())


class _Entry(NamedTuple):
    pulse: int
    offset: int  # of the compact frame in the file
    size: int
    crc: int


def drawable(triangles):
    """The triangles that Blender can show: each of three vertices, and the first of those with the same three."""
    ordered = np.sort(triangles, axis=1)
    whole = (ordered[:, 0] != ordered[:, 1]) & (ordered[:, 1] != ordered[:, 2])
    _, first = np.unique(ordered, axis=0, return_index=True)
    once = np.zeros(len(triangles), bool)
    once[first] = True
    return triangles[whole & once]


class MeshFile:
    """mesh.v3d: a mesh for each pulse."""

    def __init__(self, path):
        self._file = open(path, "rb")
        try:
            self._open()
        except BaseException:
            self._file.close()
            raise

    def _open(self):
        self._size = os.fstat(self._file.fileno()).st_size
        entries = self._indexed()
        self._entries = self._scanned() if entries is None else entries
        if not self._entries:
            raise DecoderError("holds no meshes")
        self.pulses = [entry.pulse for entry in self._entries]
        self._decoder = FrameDecoder()

    def close(self):
        self._file.close()

    def _read(self, offset, size):
        self._file.seek(offset)
        return self._file.read(size)

    def _indexed(self):
        """The entries of the index at the end; None without a valid one."""
        if self._size < HEADER + 8 + FOOTER.size:
            return None
        offset, size, crc, magic = FOOTER.unpack(self._read(self._size - FOOTER.size, FOOTER.size))
        if magic != b"V3DE\r\n\x1a\n" or not 8 <= size <= MAX_INDEX or offset + size != self._size - FOOTER.size:
            return None
        index = self._read(offset, size)
        if len(index) != size or zlib.crc32(index) != crc or index[:4] != b"V3DI":
            return None
        if struct.unpack_from("<I", index, 4)[0] * ENTRY.size != size - 8:
            return None
        entries = [_Entry(pulse, at + RECORD.size, length, check)
                   for pulse, at, length, check in ENTRY.iter_unpack(index[8:])]
        inside = all(entry.offset + entry.size <= offset and entry.size <= MAX_PAYLOAD for entry in entries)
        ascending = all(a.pulse < b.pulse for a, b in zip(entries, entries[1:]))
        return entries if inside and ascending else None

    def _record(self, at):
        """The entry of the record at an offset; None unless its head is right and its payload lies inside the file."""
        head = self._read(at, RECORD.size)
        if len(head) != RECORD.size:
            return None
        magic, size, pulse, crc, head_crc = RECORD.unpack(head)
        if magic != b"V3DR" or zlib.crc32(head[:-4]) != head_crc or size > MAX_PAYLOAD or pulse < 0:
            return None
        entry = _Entry(pulse, at + RECORD.size, size, crc)
        return entry if entry.offset + size <= self._size else None

    def _is_whole(self, entry):
        """Whether a record is no unfinished one, in whose place later records begin. A whole one may be damaged."""
        end = entry.offset + entry.size
        if end == self._size or self._record(end) or self._read(end, 4) == b"V3DI":
            return True
        if self._checksummed > 4 * self._size:  # only overlapping records need that
            return False
        self._checksummed += entry.size
        return zlib.crc32(self._read(entry.offset, entry.size)) == entry.crc

    def _next(self, at):
        """The offset of the next magic of a record; the end of the file if there is none."""
        while at < self._size:
            found = self._read(at, CHUNK).find(b"V3DR")
            if found >= 0:
                return at + found
            at += CHUNK - 3
        return self._size

    def _scanned(self):
        """The entries of a file without an index. Bytes that are no whole record are skipped."""
        self._checksummed = 0  # bytes of payloads
        entries, at = [], HEADER
        while at + RECORD.size <= self._size:
            entry = self._record(at)
            if entry is None or not self._is_whole(entry):
                at = self._next(at + 1)
                continue
            if not entries or entry.pulse > entries[-1].pulse:
                entries.append(entry)
            at = entry.offset + entry.size
        return entries

    def _frame(self, index):
        entry = self._entries[index]
        frame = self._read(entry.offset, entry.size)
        of_pulse = frame[PULSE_AT:PULSE_AT + PULSE.size] == PULSE.pack(entry.pulse)
        if len(frame) != entry.size or zlib.crc32(frame) != entry.crc or not of_pulse:
            raise DecoderError(f"pulse {entry.pulse} is damaged: reconstruct the take again")
        return frame

    def _decode(self, index, frame):
        status = self._decoder.decode(frame)
        if status == NEEDS_REFERENCE:
            key_pulse = PULSE.unpack_from(frame, KEY_PULSE_AT)[0]
            for before in range(bisect.bisect_left(self.pulses, key_pulse), index):
                if self._decoder.decode(self._frame(before)) != OK:
                    raise DecoderError(f"pulse {self.pulses[before]} is damaged: reconstruct the take again")
            status = self._decoder.decode(frame)
        if status != OK:
            raise DecoderError(f"pulse {self.pulses[index]} is damaged, or of another version: reconstruct the take again")

    def at(self, index):
        """The surface of the pulse self.pulses[index]."""
        self._decode(index, self._frame(index))
        surface = self._decoder.surface()
        return Shown(surface, ("mesh", index, checksum(surface.triangles)))


class MotionFile:
    """motion.v3d: tracked surfaces, whose triangles stay in a segment. The later segment shows a pulse that two share."""

    def __init__(self, path):
        with open(path, "rb") as file:
            data = file.read(MAX_MOTION + 1)
        if len(data) > MAX_MOTION:
            raise DecoderError("is larger than 1 GB")
        self._decoder = MotionDecoder(data)
        places = {}
        for number, segment in enumerate(self._decoder.segments):
            for index, pulse in enumerate(segment.pulses.tolist()):
                places[pulse] = (number, index)
        if not places:
            raise DecoderError("holds no pulses")
        self.pulses = sorted(places)
        self._places = [places[pulse] for pulse in self.pulses]
        self._segment = None  # the last one

    def close(self):
        pass

    def at(self, index):
        """The surface of the pulse self.pulses[index]."""
        segment, place = self._places[index]
        if self._segment != segment:
            self._triangles = self._decoder.triangles(segment)
            self._topology = ("segment", segment, checksum(self._triangles))
            self._segment = segment
        vertices, colours = self._decoder.vertices(segment, place)
        return Shown(Surface(vertices, self._triangles, colours), self._topology)


class Surfaces:
    """The surfaces of a file by pulse. Errors are DecoderError, one line with the path."""

    def __init__(self, path):
        self.path = path
        try:
            with open(path, "rb") as file:
                magic = file.read(8)
            if magic == MESH_MAGIC:
                self._file = MeshFile(path)
            elif magic == MOTION_MAGIC:
                self._file = MotionFile(path)
            else:
                raise DecoderError("is neither mesh.v3d nor motion.v3d")
        except OSError as error:
            raise DecoderError(f"{path}: {error.strerror}") from None
        except DecoderError as error:
            raise DecoderError(f"{path}: {error}") from None

    @property
    def pulses(self):
        return self._file.pulses

    def index_at(self, pulse):
        """The index of the last pulse that is not later; the first one before all."""
        return max(0, bisect.bisect_right(self.pulses, pulse) - 1)

    def at(self, index):
        """Shown of the pulse self.pulses[index]."""
        try:
            shown = self._file.at(index)
        except OSError as error:
            raise DecoderError(f"{self.path}: {error.strerror}") from None
        except DecoderError as error:
            raise DecoderError(f"{self.path}: {error}") from None
        if not np.isfinite(shown.surface.vertices).all():
            raise DecoderError(f"{self.path}: pulse {self.pulses[index]} has positions that are no numbers")
        return shown

    def close(self):
        self._file.close()
