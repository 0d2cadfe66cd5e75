"""What the module v3d does with bad input. V3D_TAKES: the folder of make_takes."""
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy as np
import v3d

TAKES = pathlib.Path(os.environ.get("V3D_TAKES", "."))
TAKE = TAKES / "take"


class Errors(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.copy = pathlib.Path(self.folder.name) / "take"
        shutil.copytree(TAKE, self.copy)

    def message(self, call, *arguments, **options):
        with self.assertRaises(v3d.InputError) as caught:
            call(*arguments, **options)
        self.assertNotIn("\n", str(caught.exception))
        return str(caught.exception)

    def test_are_value_errors_with_the_line_of_the_programs(self):
        self.assertTrue(issubclass(v3d.InputError, ValueError))
        self.assertEqual(self.message(v3d.Take, "nowhere"), "nowhere: no such folder; expected a take folder with take.toml")
        (self.copy / "mesh.v3d").unlink()
        (self.copy / "motion.v3d").unlink()
        self.assertIn("run v3dctl reconstruct", self.message(v3d.Take(self.copy).meshes))

    def test_name_what_is_missing(self):
        take = v3d.Take(TAKE)
        self.assertIn("no calibration of cam99", self.message(take.frames, "cam99"))
        self.assertIn("mesh.v3d: no mesh of pulse 7; it has pulses 0 to 2", self.message(take.meshes().read, 7))
        self.assertIn("has no pulse 9", self.message(take.motion().segments[0].read, 9))
        self.assertIn("no camera cam99", self.message(take.ledger.states, "cam99"))

    def test_of_objects_that_only_new_made_are_type_errors(self):
        classes = [value for value in vars(v3d).values() if type(value) is type(v3d.Take)]
        self.assertIn(v3d.Motion, classes)
        use = "import sys, v3d; made = getattr(v3d, sys.argv[1]); made.__new__(made)"
        for made in classes:
            # In a process of its own: the use of such an object would end this one.
            process = subprocess.run([sys.executable, "-c", use, made.__name__], capture_output=True, text=True)
            self.assertEqual(process.returncode, 1, made)
            self.assertIn("TypeError", process.stderr)

    def test_of_arrays_of_another_shape_name_the_shape(self):
        camera = v3d.Take(TAKE).cameras["cam01"]
        self.assertIn("rows of 2", self.message(camera.project, np.zeros((4, 2))))
        self.assertIn("1 dimensions", self.message(camera.rays, np.zeros(4)))
        self.assertEqual(camera.project(np.zeros((0, 3))).shape, (0, 2))

    def test_of_names_that_are_no_text_are_readable(self):
        path = os.fsdecode(os.fsencode(self.folder.name) + b"/\xff")
        self.assertIn("\udcff", self.message(v3d.Take, path))

    def test_name_a_frame_of_another_size_than_the_calibration(self):
        calib = self.copy / "calib.toml"
        calib.write_text(calib.read_text().replace("size = [320, 240]", "size = [640, 480]", 1))
        frame = v3d.Take(self.copy).frames("cam01").read(0)
        self.assertIn("the frame is 320x240, but the calibration is for 640x480", self.message(frame.undistorted))
        self.assertEqual(frame.rgb().shape, (240, 320, 3))

    def test_of_frames_without_background_name_it(self):
        shutil.rmtree(self.copy / "background")
        take = v3d.Take(self.copy)
        self.assertIsNotNone(take.frames("cam01").read(0))
        self.assertIn("no background model", self.message(take.frames("cam01", masks=True).read, 0))


class DamagedFiles(unittest.TestCase):
    """Each read of a damaged file gives a result or an InputError."""

    def damaged(self, name, read):
        generator = random.Random(name)
        with tempfile.TemporaryDirectory() as folder:
            copy = pathlib.Path(folder) / "take"
            shutil.copytree(TAKE, copy)
            whole = (copy / name).read_bytes()
            failed = 0
            for n in range(60):
                data = bytearray(whole)
                for _ in range(1 + n % 4):
                    data[generator.randrange(len(data))] = generator.randrange(256)
                if n % 3 == 0:
                    del data[generator.randrange(len(data)):]
                (copy / name).write_bytes(data)
                try:
                    read(copy)
                except v3d.InputError as error:
                    self.assertNotIn("\n", str(error))
                    failed += 1
            self.assertGreater(failed, 0)

    def test_of_meshes_end_no_program(self):
        self.damaged("mesh.v3d", lambda take: [mesh.vertices.sum() for mesh in v3d.Take(take).meshes()])

    def test_of_motion_end_no_program(self):
        self.damaged("motion.v3d",
                     lambda take: [segment.trajectories() for segment in v3d.Take(take).motion().segments])

    def test_of_calibration_end_no_program(self):
        self.damaged("calib.toml", lambda take: [c.project([[0, 0, 1]]) for c in v3d.Take(take).cameras.values()])

    def test_of_the_ledger_end_no_program(self):
        self.damaged("ledger.toml", lambda take: v3d.Take(take).ledger.states("cam01"))

    def test_of_logs_lose_frames_and_end_no_program(self):
        whole = (TAKE / "cam01.lcmlog").read_bytes()
        generator = random.Random(4)
        with tempfile.TemporaryDirectory() as folder:
            copy = pathlib.Path(folder) / "take"
            shutil.copytree(TAKE, copy)
            fewer = 0
            for n in range(30):
                data = bytearray(whole)
                for _ in range(3):
                    data[generator.randrange(len(data))] = generator.randrange(256)
                (copy / "cam01.lcmlog").write_bytes(data[:generator.randrange(len(data))])
                try:
                    frames = [frame.undistorted() for frame in v3d.Take(copy).frames("cam01", masks=n % 2 == 0)]
                except v3d.InputError:
                    frames = []
                fewer += len(frames) < 3
            self.assertEqual(fewer, 30)


if __name__ == "__main__":
    unittest.main()
