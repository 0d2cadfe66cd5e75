"""Meshes and tracked surfaces of the module v3d, and its types. V3D_TAKES: the folder of make_takes."""
import ast
import concurrent.futures
import os
import pathlib
import re
import unittest

import numpy as np
import v3d
from numpy.typing import NDArray

TAKES = pathlib.Path(os.environ.get("V3D_TAKES", "."))
TAKE = TAKES / "take"


def read_ply(path: pathlib.Path) -> tuple[NDArray[np.float32], NDArray[np.uint8], NDArray[np.int32]]:
    """Positions, colours and triangles of a PLY of v3dctl."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    vertices, faces = (int(re.findall(rf"element {what} (\d+)", head.decode())[0]) for what in ("vertex", "face"))
    rows = np.frombuffer(body, [("position", "<f4", 3), ("colour", "u1", 3)], vertices)
    triangles = np.frombuffer(body, [("count", "u1"), ("index", "<i4", 3)], faces, rows.nbytes)
    return rows["position"], rows["colour"], triangles["index"]


class Meshes(unittest.TestCase):
    def test_are_those_of_the_export(self) -> None:
        meshes = v3d.Take(TAKE).meshes()
        self.assertEqual(meshes.pulses.tolist(), [0, 1, 2])
        self.assertEqual(len(meshes), 3)
        for mesh in meshes:
            positions, colours, triangles = read_ply(TAKES / f"ply/{mesh.pulse:06}.ply")
            np.testing.assert_array_equal(mesh.vertices, positions)
            np.testing.assert_array_equal(mesh.triangles, triangles)
            assert mesh.colours is not None
            np.testing.assert_array_equal(mesh.colours, colours)
            self.assertEqual(mesh.cameras, [f"cam{n:02}" for n in range(1, 7)])

    def test_can_be_read_in_any_order_and_in_ranges(self) -> None:
        meshes = v3d.Take(TAKE).meshes(1, 2)
        self.assertEqual([mesh.pulse for mesh in meshes], [1])
        for pulse in (2, 0, 1, 0):
            np.testing.assert_array_equal(meshes.read(pulse).vertices, read_ply(TAKES / f"ply/{pulse:06}.ply")[0])

    def test_stay_in_memory_as_long_as_an_array_of_them(self) -> None:
        meshes = v3d.Take(TAKE).meshes()
        vertices, triangles = meshes.read(0).vertices, meshes.read(0).triangles
        others = [meshes.read(pulse) for pulse in (1, 2)]
        del meshes
        positions, _, indices = read_ply(TAKES / "ply/000000.ply")
        np.testing.assert_array_equal(vertices, positions)
        np.testing.assert_array_equal(triangles, indices)
        self.assertFalse(vertices.flags.writeable)
        self.assertEqual(len(others), 2)

    def test_of_one_reader_may_be_read_by_several_threads(self) -> None:
        meshes = v3d.Take(TAKE).meshes()
        expected = {pulse: meshes.read(pulse).vertices for pulse in (0, 1, 2)}
        with concurrent.futures.ThreadPoolExecutor(4) as threads:
            for mesh in threads.map(meshes.read, [0, 1, 2, 1] * 10):
                np.testing.assert_array_equal(mesh.vertices, expected[mesh.pulse])


class Motion(unittest.TestCase):
    def test_has_the_template_at_its_key_pulse(self) -> None:
        segments = v3d.Take(TAKE).motion().segments
        self.assertGreater(len(segments), 0)
        for segment in segments:
            np.testing.assert_array_equal(segment.read(segment.key_pulse).vertices, segment.template.vertices)
            self.assertEqual(segment.template.vertices.shape, (segment.vertex_count, 3))
            self.assertEqual(segment.template.triangles.shape, (segment.triangle_count, 3))
            self.assertLess(segment.template.triangles.max(), segment.vertex_count)

    def test_has_the_positions_of_all_pulses_as_trajectories(self) -> None:
        for segment in v3d.Motion(TAKE / "motion.v3d").segments:
            trajectories = segment.trajectories()
            self.assertEqual(trajectories.shape, (len(segment.pulses), segment.vertex_count, 3))
            for positions, tracked in zip(trajectories, segment):
                np.testing.assert_array_equal(positions, tracked.vertices)
                assert tracked.colours is not None and tracked.confidences is not None
                self.assertEqual(tracked.colours.shape, tracked.vertices.shape)
                self.assertEqual(tracked.confidences.shape, (segment.vertex_count,))

    def test_is_near_the_meshes(self) -> None:
        take = v3d.Take(TAKE)
        for segment in take.motion().segments:
            for tracked in segment:
                vertices = take.meshes().read(tracked.pulse).vertices
                sample = tracked.vertices[::25]
                far = np.linalg.norm(sample[:, None] - vertices[None], axis=2).min(axis=1)
                self.assertLess(np.median(far), 0.02)


class Types(unittest.TestCase):
    def test_name_the_members_of_all_classes(self) -> None:
        stub = ast.parse((pathlib.Path(v3d.__file__).parent / "_v3d.pyi").read_text())
        classes = {node.name: node for node in stub.body if isinstance(node, ast.ClassDef) and node.name != "InputError"}
        self.assertEqual(set(classes), {name for name in v3d.__all__ if isinstance(getattr(v3d, name), type)} -
                         {"InputError", "PulseState"})
        for name, node in classes.items():
            stated = {item.name for item in node.body if isinstance(item, ast.FunctionDef) and item.name[:2] != "__"}
            self.assertEqual(stated, {member for member in vars(getattr(v3d, name)) if member[0] != "_"}, name)

    def test_that_cannot_be_made_alone_have_no_constructor(self) -> None:
        with self.assertRaises(TypeError):
            v3d.Frame()


if __name__ == "__main__":
    unittest.main()
