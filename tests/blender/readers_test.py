"""The readers of the Blender add-on in plain Python. V3D_TAKES: the folder of tests/python/make_takes."""
import contextlib
import ctypes
import os
import pathlib
import random
import sys
import tempfile
import types
import unittest
import zlib
from unittest import mock

import numpy as np

sys.path[:0] = [os.environ["V3D_PYTHON"]]
package = types.ModuleType("v3d_import")  # the add-on itself needs Blender
package.__path__ = [os.path.join(os.environ["V3D_ADDONS"], "v3d_import")]
sys.modules["v3d_import"] = package

import v3d  # noqa: E402
from v3d_import import decoder, rig, surfaces  # noqa: E402
from v3d_import.decoder import DecoderError  # noqa: E402

TAKE = pathlib.Path(os.environ["V3D_TAKES"]) / "take"


class Readers(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def check(self, path, order):
        shown = surfaces.Surfaces(str(path))
        self.addCleanup(shown.close)
        meshes = v3d.Take(TAKE).meshes()
        for pulse in order:
            surface = shown.at(shown.index_at(pulse)).surface
            mesh = meshes.read(pulse)
            np.testing.assert_array_equal(surface.vertices, mesh.vertices)
            np.testing.assert_array_equal(surface.triangles, mesh.triangles)
            np.testing.assert_array_equal(surface.colours, mesh.colours)

    def test_give_the_meshes_of_the_module_in_any_order(self):
        self.check(TAKE / "mesh.v3d", (2, 0, 1, 2, 1))

    def test_give_the_meshes_of_a_file_without_index_and_with_foreign_bytes(self):
        whole = (TAKE / "mesh.v3d").read_bytes()
        index = whole.rindex(b"V3DI")
        second = whole.index(b"V3DR", whole.index(b"V3DR") + 4)
        path = self.folder / "mesh.v3d"
        path.write_bytes(whole[:index])
        self.check(path, (0, 1, 2))
        path.write_bytes(whole[:second] + b"V3DR and no record" + whole[second:index - 5] + b"tail")
        shown = surfaces.Surfaces(str(path))
        self.addCleanup(shown.close)
        self.assertEqual(shown.pulses, [0, 1], "the last record lost bytes")

    def test_keep_a_damaged_record_of_a_file_without_index(self):
        data = bytearray((TAKE / "mesh.v3d").read_bytes())
        del data[data.rindex(b"V3DI"):]
        second = data.index(b"V3DR", data.index(b"V3DR") + 4)
        data[second + 200] ^= 1
        path = self.folder / "mesh.v3d"
        path.write_bytes(data)
        with contextlib.closing(surfaces.Surfaces(str(path))) as shown:
            self.assertEqual(shown.pulses, [0, 1, 2])
            shown.at(0)
            for index in (1, 2):  # pulse 2 needs the frame of pulse 1
                with self.assertRaisesRegex(DecoderError, "pulse 1 is damaged"):
                    shown.at(index)

    def test_reject_a_record_with_the_frame_of_another_pulse(self):
        whole = (TAKE / "mesh.v3d").read_bytes()
        data = bytearray(whole[:whole.rindex(b"V3DI")])
        last = data.rindex(b"V3DR")
        data[last + 8:last + 16] = (3).to_bytes(8, "little")  # the frame is that of pulse 2
        data[last + 20:last + 24] = zlib.crc32(data[last:last + 20]).to_bytes(4, "little")
        path = self.folder / "mesh.v3d"
        path.write_bytes(data)
        with contextlib.closing(surfaces.Surfaces(str(path))) as shown:
            self.assertEqual(shown.pulses, [0, 1, 3])
            shown.at(1)
            with self.assertRaisesRegex(DecoderError, "pulse 3 is damaged"):
                shown.at(2)

    def test_give_the_tracked_surfaces_of_the_module(self):
        shown = surfaces.Surfaces(str(TAKE / "motion.v3d"))
        segments = v3d.Take(TAKE).motion().segments
        for pulse in (2, 0, 1):
            segment = [s for s in segments if pulse in s.pulses][-1]
            surface = shown.at(shown.index_at(pulse)).surface
            np.testing.assert_array_equal(surface.vertices, segment.read(pulse).vertices)
            np.testing.assert_array_equal(surface.colours, segment.read(pulse).colours)
            np.testing.assert_array_equal(surface.triangles, segment.template.triangles)

    def test_give_the_cameras_of_the_module(self):
        cameras = v3d.Take(TAKE).cameras
        for camera in rig.load_calib(str(TAKE / "calib.toml")):
            expected = cameras[camera.name]
            np.testing.assert_allclose(camera.cam_from_world[:3, :3], expected.rotation, atol=1e-12)
            np.testing.assert_array_equal(camera.cam_from_world[:3, 3], expected.translation)
            self.assertEqual((camera.width, camera.height), expected.size)
            self.assertEqual(camera.focal, (expected.matrix[0, 0], expected.matrix[1, 1]))
            self.assertEqual(camera.centre, (expected.matrix[0, 2], expected.matrix[1, 2]))

    def test_reject_or_read_damaged_files(self):
        path = self.folder / "file"
        for name in ("mesh.v3d", "motion.v3d"):
            generator = random.Random(name)
            whole = (TAKE / name).read_bytes()
            failed = 0
            for n in range(150):
                data = bytearray(whole)
                for _ in range(1 + n % 3):
                    data[generator.randrange(len(data))] = generator.randrange(256)
                if n % 3 == 0:
                    del data[generator.randrange(len(data)):]
                path.write_bytes(data)
                try:
                    with contextlib.closing(surfaces.Surfaces(str(path))) as shown:
                        for index in range(len(shown.pulses)):
                            shown.at(index)
                except DecoderError as error:
                    self.assertNotIn("\n", str(error))
                    failed += 1
            self.assertGreater(failed, 100, name)

    def test_give_the_cameras_of_a_calibration_with_matrices_of_rotation(self):
        camera, = v3d.load_calib(self.calib("[[1, 0, 0], [0, 0, -1], [0, 1, 0]]"))
        ours, = rig.load_calib(self.calib("[[1, 0, 0], [0, 0, -1], [0, 1, 0]]"))
        np.testing.assert_allclose(ours.cam_from_world[:3, :3], camera.rotation, atol=1e-12)
        for rotation in ("[[1, 0, 0], [0, 0, 1], [0, 1, 0]]", "[[2, 0, 0], [0, 1, 0], [0, 0, 1]]", "[0, 0]", "7"):
            with self.assertRaisesRegex(DecoderError, "right: rotation: expected"):
                rig.load_calib(self.calib(rotation))

    def calib(self, rotation="[0, 0, 0]", size="[64, 48]", distortions="[]"):
        path = self.folder / "calib.toml"
        path.write_text(f"[right]\nname = 'right'\nsize = {size}\nmatrix = [[50, 0, 32], [0, 50, 24], [0, 0, 1]]\n"
                        f"distortions = {distortions}\nrotation = {rotation}\ntranslation = [0, 0, 1]\nfisheye = false\n")
        return str(path)

    def test_give_the_cameras_of_a_calibration_whose_sizes_have_a_decimal_point(self):
        path = self.calib(size="[1024.0, 768.0]")  # as Pose2Sim writes them
        camera, = v3d.load_calib(path)
        ours, = rig.load_calib(path)
        self.assertEqual((ours.width, ours.height), camera.size)
        self.assertIs(type(ours.width), int)
        for size in ("[1024.5, 768.0]", "[0, 768]", "[inf, 768]", "['64', 48]", "[true, 48]"):
            with self.assertRaisesRegex(DecoderError, r"right: size: expected whole numbers from 1 to 16384 pixels, found \("):
                rig.load_calib(self.calib(size=size))

    def test_tell_distorted_lenses_from_others(self):
        for distortions, expected in (("[]", False), ("[0, 0, 0, 0]", False), ("[0.1, 0, 0, 0, 0]", True)):
            camera, = rig.load_calib(self.calib(distortions=distortions))
            self.assertIs(camera.distorted, expected)
        for distortions in ("0.5", "[0.1]", "['a', 0, 0, 0]", "[nan, 0, 0, 0]", "[[0, 0, 0, 0]]"):
            with self.assertRaisesRegex(DecoderError, "right: distortions: expected"):
                rig.load_calib(self.calib(distortions=distortions))

    def test_reject_damaged_calibrations(self):
        path = self.folder / "calib.toml"
        whole = (TAKE / "calib.toml").read_bytes()
        generator = random.Random(3)
        failed = 0
        for _ in range(200):
            data = bytearray(whole)
            data[generator.randrange(len(data))] = generator.randrange(256)
            path.write_bytes(data)
            try:
                rig.load_calib(str(path))
            except DecoderError as error:
                self.assertNotIn("\n", str(error))
                failed += 1
        self.assertGreater(failed, 20)


class Photographs(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        (self.folder / "sparse/0").mkdir(parents=True)

    def write(self, camera="PINHOLE 320 240 200 200 160 120", name="cam01.png", pose="1 0 0 0 0 0 0"):
        (self.folder / "sparse/0/cameras.txt").write_text(f"# text\n1 {camera}\n")
        (self.folder / "sparse/0/images.txt").write_text(f"# text\n1 {pose} 1 {name}\n1 2 -1\n")

    def test_have_the_pixels_of_the_studio(self):
        self.write()
        camera, = rig.Photographs(str(self.folder)).cameras()
        self.assertEqual((camera.name, camera.centre), ("cam01", (159.5, 119.5)))
        np.testing.assert_array_equal(camera.cam_from_world, np.eye(4))

    def test_that_are_malformed_are_named(self):
        for change in ({"camera": "OPENCV 320 240 1 1 1 1"}, {"camera": "PINHOLE 320 240"}, {"camera": "PINHOLE 0 240 1 1 1 1"},
                       {"camera": "PINHOLE 320 240 nan 1 1 1"}, {"name": "../cam01.png"}, {"pose": "0 0 0 0 0 0 0"},
                       {"pose": "1 0 0 0 inf 0 0"}, {"pose": "x"}):
            self.write(**change)
            with self.assertRaisesRegex(DecoderError, r"sparse/0/\w+.txt: [^\n]+$", msg=str(change)):
                rig.Photographs(str(self.folder)).cameras()


class Memory(unittest.TestCase):
    def test_that_is_exhausted_is_not_reported_as_damage(self):
        frames = decoder.FrameDecoder()
        whole = frames._library
        self.addCleanup(setattr, frames, "_library", whole)
        frames._library = types.SimpleNamespace(v3d_decoder_decode=lambda *_: decoder.OUT_OF_MEMORY)
        with self.assertRaisesRegex(DecoderError, "^memory is exhausted$"):
            frames.decode(b"")


class Lengths(unittest.TestCase):
    """Lengths of a library that are impossible are rejected before their data is read."""

    def surface(self, **fields):
        kept = self.kept = [(ctypes.c_float * 9)(), (ctypes.c_uint32 * 3)(0, 1, 2)]
        of = decoder._Surface(vertices=3, positions=ctypes.cast(kept[0], ctypes.POINTER(ctypes.c_float)), triangles=1,
                              indices=ctypes.cast(kept[1], ctypes.POINTER(ctypes.c_uint32)))
        for name, value in fields.items():
            setattr(of, name, value)
        return of

    def test_beyond_the_limits_of_the_format(self):
        self.assertEqual(decoder._positions(self.surface()).shape, (3, 3))
        with self.assertRaisesRegex(DecoderError, "more than the 4194304"):
            decoder._positions(self.surface(vertices=10**12))
        with self.assertRaisesRegex(DecoderError, "more than the 8388608"):
            decoder._triangles(self.surface(triangles=10**12))

    def test_of_data_that_is_not_there(self):
        with self.assertRaisesRegex(DecoderError, "no data of 3 vertices"):
            decoder._positions(self.surface(positions=ctypes.POINTER(ctypes.c_float)()))

    def test_smaller_than_an_index(self):
        with self.assertRaisesRegex(DecoderError, "a triangle has vertex 2, but there are 2"):
            decoder._triangles(self.surface(vertices=2))

    def test_of_a_pulse_outside_of_its_segment(self):
        motion = decoder.MotionDecoder((TAKE / "motion.v3d").read_bytes())
        for index in (-1, 2, 10**6):
            with self.assertRaisesRegex(DecoderError, "no pulse at"):
                motion.vertices(0, index)


class Marks(unittest.TestCase):
    """Of surfaces, by which the add-on decides whether a mesh in Blender keeps its triangles."""

    def of(self, name, triangles):
        """Of the pulses of a file whose surfaces have these triangles."""
        vertices = np.zeros((4, 3), np.float32)
        segment = types.SimpleNamespace(pulses=np.array([0, 1]))
        motion = types.SimpleNamespace(segments=[segment], triangles=lambda _: triangles, vertices=lambda *_: (vertices, None))
        frames = types.SimpleNamespace(decode=lambda _: decoder.OK, surface=lambda: decoder.Surface(vertices, triangles, None))
        with mock.patch.multiple(surfaces, MotionDecoder=lambda _: motion, FrameDecoder=lambda: frames), \
                contextlib.closing(surfaces.Surfaces(str(TAKE / name))) as shown:
            return [shown.at(index).topology for index in range(2)]

    def test_differ_between_files_with_other_triangles(self):
        for name in ("mesh.v3d", "motion.v3d"):
            before = self.of(name, np.array([[0, 1, 2], [0, 2, 3]], np.uint32))
            after = self.of(name, np.array([[0, 1, 3], [1, 2, 3]], np.uint32))
            self.assertNotEqual(before[0], after[0], name)
            self.assertNotEqual(before[1], after[1], name)
            self.assertEqual(before, self.of(name, np.array([[0, 1, 2], [0, 2, 3]], np.uint32)))
        self.assertEqual(before[0], before[1], "a segment has one mark")


class Drawable(unittest.TestCase):
    def test_triangles_have_three_vertices_and_occur_once(self):
        triangles = np.array([[0, 1, 2], [2, 1, 1], [2, 1, 0], [1, 2, 3]], np.uint32)
        np.testing.assert_array_equal(surfaces.drawable(triangles), [[0, 1, 2], [1, 2, 3]])
        self.assertEqual(surfaces.drawable(np.zeros((0, 3), np.uint32)).shape, (0, 3))


if __name__ == "__main__":
    unittest.main()
