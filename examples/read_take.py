#!/usr/bin/env python3
"""read_take.py TAKE: prints what a take holds, with the Python module v3d (docs/python.md).

It reads one frame of each camera with its silhouette, counts the vertices of a mesh that each silhouette contains, and
prints the longest way of a tracked point.
"""
import sys

import numpy as np
import v3d
from numpy.typing import NDArray


def print_ledger(take: v3d.Take) -> None:
    ledger = take.ledger
    print(ledger.verdict)
    for name in ledger.cameras:
        states = ledger.states(name)
        print(f"{name}: {np.count_nonzero(states == 0)} of {len(states)} pulses without fault")


def share_inside(camera: v3d.Camera, mask: NDArray[np.bool_], mesh: v3d.Mesh) -> float:
    """The share of vertices that the camera projects into the silhouette."""
    pixels = camera.project(mesh.vertices)
    columns, rows = np.floor(pixels[~np.isnan(pixels[:, 0])] + 0.5).astype(int).T
    inside = (columns >= 0) & (rows >= 0) & (columns < mask.shape[1]) & (rows < mask.shape[0])
    return float(np.mean(mask[rows[inside], columns[inside]]))


def print_silhouettes(take: v3d.Take, mesh: v3d.Mesh) -> None:
    for name in mesh.cameras:
        frame = take.frames(name, masks=True).read(mesh.pulse)
        if frame is None or frame.mask is None:
            print(f"{name}: no frame of pulse {mesh.pulse}")
            continue
        print(f"{name}: {frame.pixel_format} {frame.raw.shape}, mean colour {frame.rgb()[frame.mask].mean(axis=0).round()}, "
              f"{share_inside(frame.camera, frame.mask, mesh):.1%} of the vertices inside its silhouette")


def print_motion(take: v3d.Take) -> None:
    if not (take.path / "motion.v3d").exists():
        print("no tracked surfaces: v3dctl track makes them")
        return
    for segment in take.motion().segments:
        ways = np.linalg.norm(np.diff(segment.trajectories(), axis=0), axis=2).sum(axis=0)
        print(f"tracked pulses {segment.pulses[0]} to {segment.pulses[-1]}: {segment.vertex_count} vertices, "
              f"longest way {ways.max():.3f} m")


def main() -> None:
    take = v3d.Take(sys.argv[1])
    print_ledger(take)
    meshes = take.meshes()
    for mesh in meshes:
        print(f"pulse {mesh.pulse}: {len(mesh.vertices)} vertices, {len(mesh.triangles)} triangles")
    print_silhouettes(take, meshes.read(int(meshes.pulses[0])))
    print_motion(take)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: read_take.py TAKE")
    try:
        main()
    except v3d.InputError as error:
        print(f"read_take.py: {error}", file=sys.stderr)
        sys.exit(2)
