"""Takes of the V3D studio: frames, cameras, ledger, meshes and tracked surfaces as numpy arrays.

    import v3d

    take = v3d.Take("takes/kendo-07")
    for frame in take.frames("cam01", 0, 25, masks=True):
        print(frame.pulse, frame.rgb().shape, frame.mask.sum())
    for mesh in take.meshes():
        print(mesh.pulse, mesh.vertices.shape)

Lengths are metres, pixels those of OpenCV: the centre of the first one is (0, 0). The world is right-handed with z up.
Bad input raises InputError with one line. Other errors of the disk raise RuntimeError. Threads may share all objects.
"""
import enum as _enum

from ._v3d import (Camera, CameraLedger, Frame, FrameIterator, Frames, InputError, Ledger, Mesh, Meshes, MeshIterator,
                   Motion, Segment, SegmentIterator, Take, Template, TrackedPulse, __version__, load_calib)


class PulseState(_enum.IntFlag):
    """State of a pulse in one camera, see Ledger.states(). 0: exactly one frame, with a certain number."""

    MISSING = 1
    DUPLICATE = 2
    SUSPECT = 4


__all__ = [
    "Camera", "CameraLedger", "Frame", "FrameIterator", "Frames", "InputError", "Ledger", "Mesh", "MeshIterator",
    "Meshes", "Motion", "PulseState", "Segment", "SegmentIterator", "Take", "Template", "TrackedPulse", "__version__",
    "load_calib"
]
for _name in __all__:
    if getattr(globals()[_name], "__module__", None) == "v3d._v3d":
        globals()[_name].__module__ = "v3d"
del _name
