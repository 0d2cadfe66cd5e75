"""Cameras, frames and the ledger of the module v3d. V3D_TAKES: the folder of make_takes."""
import os
import pathlib
import shutil
import sys
import tempfile
import threading
import time
import tomllib
import unittest

import numpy as np
import v3d
from numpy.typing import NDArray

TAKES = pathlib.Path(os.environ.get("V3D_TAKES", "."))
TAKE = TAKES / "take"


def rodrigues(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation: NDArray[np.float64] = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return rotation


def bilinear(image: NDArray[np.uint8], pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y = np.floor(pixels).astype(int).T
    fx, fy = (pixels - np.floor(pixels)).T[:, :, None]
    rows = image.astype(float)
    top = rows[y, x] * (1 - fx) + rows[y, x + 1] * fx
    bottom = rows[y + 1, x] * (1 - fx) + rows[y + 1, x + 1] * fx
    result: NDArray[np.float64] = top * (1 - fy) + bottom * fy
    return result


class Cameras(unittest.TestCase):
    def test_have_the_values_of_the_calibration_file(self) -> None:
        tables = [table for name, table in tomllib.loads((TAKE / "calib.toml").read_text()).items() if name[:4] == "cam_"]
        cameras = v3d.Take(TAKE).cameras
        self.assertEqual(list(cameras), [table["name"] for table in tables])
        for table in tables:
            camera = cameras[table["name"]]
            self.assertEqual(list(camera.size), table["size"])
            np.testing.assert_array_equal(camera.matrix, table["matrix"])
            np.testing.assert_array_equal(camera.distortion[:5], table["distortions"])
            np.testing.assert_array_equal(camera.translation, table["translation"])
            np.testing.assert_allclose(camera.rotation, rodrigues(np.array(table["rotation"])), atol=1e-12)
            np.testing.assert_allclose(camera.rotation @ camera.centre + camera.translation, 0, atol=1e-12)

    def test_project_with_the_model_of_opencv(self) -> None:
        points = np.random.default_rng(1).uniform([-1, -1, 0], [1, 1, 2], (100, 3))
        for camera in v3d.load_calib(TAKE / "calib.toml"):
            x, y, z = (points @ camera.rotation.T + camera.translation).T
            x, y = x / z, y / z
            k1, k2, p1, p2, k3 = camera.distortion[:5]
            r2 = x * x + y * y
            radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
            distorted = np.stack([x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                                  y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y, np.ones_like(x)])
            np.testing.assert_allclose(camera.project(points), (camera.matrix @ distorted)[:2].T, atol=1e-9)

    def test_see_a_point_along_the_ray_of_its_pixel_and_none_behind_them(self) -> None:
        camera = v3d.load_calib(TAKE / "calib.toml")[0]
        pixels = np.random.default_rng(2).uniform(0, 239, (50, 2))
        np.testing.assert_allclose(camera.project(camera.centre + 2.5 * camera.rays(pixels)), pixels, atol=1e-7)
        self.assertTrue(np.isnan(camera.project([camera.centre - camera.rotation[2]])).all())


class Frames(unittest.TestCase):
    def setUp(self) -> None:
        self.take = v3d.Take(TAKE)

    def frame(self, camera: str = "cam02", pulse: int = 1) -> v3d.Frame:
        frame = self.take.frames(camera, masks=True).read(pulse)
        assert frame is not None
        return frame

    def test_of_a_range_of_pulses_come_in_order(self) -> None:
        self.assertEqual([frame.pulse for frame in self.take.frames("cam01")], [0, 1, 2])
        self.assertEqual([frame.pulse for frame in self.take.frames("cam01", 1, 2)], [1])
        self.assertEqual(self.take.frames("cam01", 1).pulses.tolist(), [1, 2])
        self.assertIsNone(self.take.frames("cam01").read(3))

    def test_keep_the_recorded_samples_when_they_are_demosaiced(self) -> None:
        frame = self.frame()
        self.assertEqual(frame.pixel_format, "BayerRG8")
        rgb = frame.rgb()
        self.assertEqual((frame.raw.shape, rgb.shape), ((240, 320), (240, 320, 3)))
        for row, column, channel in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
            np.testing.assert_array_equal(rgb[row::2, column::2, channel], frame.raw[row::2, column::2])

    def test_have_the_colour_response_of_the_calibration_on_request(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            copy = pathlib.Path(folder) / "take"
            shutil.copytree(TAKE, copy)
            calib = (copy / "calib.toml").read_text()
            response = "name = 'cam02'\ncolour_black = [4.0, 0.0, 0.0]\ncolour_matrix = [[2, 0, 0], [0, 1, 0], [0, 0, 1]]"
            (copy / "calib.toml").write_text(calib.replace("name = 'cam02'", response))
            frame = v3d.Take(copy).frames("cam02").read(1)
        assert frame is not None
        expected = frame.rgb().astype(int)
        expected[:, :, 0] = np.clip(2 * (expected[:, :, 0] - 4), 0, 255)
        np.testing.assert_array_equal(frame.rgb(corrected=True), expected)

    def test_show_undistorted_what_the_lens_saw_along_the_same_rays(self) -> None:
        frame = self.frame()
        pinhole = frame.camera.pinhole()
        rgb, straight = frame.rgb(), frame.undistorted()
        self.assertEqual(straight.shape[1::-1], pinhole.size)
        pixels = np.random.default_rng(3).integers([20, 20], [pinhole.size[0] - 20, pinhole.size[1] - 20], (500, 2))
        seen = frame.camera.project(pinhole.centre + 3 * pinhole.rays(pixels))
        np.testing.assert_allclose(straight[pixels[:, 1], pixels[:, 0]], bilinear(rgb, seen), atol=0.51)
        mask, straight_mask = frame.mask, frame.undistorted_mask()
        assert mask is not None and straight_mask is not None
        self.assertGreater(mask.sum(), 1000)
        columns, rows = np.floor(seen + 0.5).astype(int).T
        np.testing.assert_array_equal(straight_mask[pixels[:, 1], pixels[:, 0]], mask[rows, columns])

    def test_have_no_mask_unless_it_was_asked_for(self) -> None:
        frame = self.take.frames("cam02").read(1)
        assert frame is not None
        self.assertIsNone(frame.mask)
        self.assertIsNone(frame.undistorted_mask())
        np.testing.assert_array_equal(frame.raw, self.frame().raw)

    def test_stay_in_memory_as_long_as_an_array_of_them(self) -> None:
        raw = self.frame().raw
        expected = self.frame().raw.tobytes()
        others = [self.frame("cam03", pulse) for pulse in (0, 1, 2)]
        self.assertEqual(raw.tobytes(), expected)
        self.assertFalse(raw.flags.writeable)
        self.assertEqual(len(others), 3)

    def test_are_decoded_while_other_threads_run(self) -> None:
        """With this interval, another thread runs only where a call releases Python's lock."""
        frame = self.frame()
        turns = [0]
        done = threading.Event()

        def take_turns() -> None:
            while not done.is_set():
                turns[0] += 1
                time.sleep(0)

        interval = sys.getswitchinterval()
        other = threading.Thread(target=take_turns)
        other.start()
        sys.setswitchinterval(1000)
        try:
            until = time.monotonic() + 60
            while time.monotonic() < until:
                before = turns[0]
                frame.undistorted()
                if turns[0] > before:
                    return
            self.fail("no other thread ran in a minute of calls")
        finally:
            sys.setswitchinterval(interval)
            done.set()
            other.join()


class Ledgers(unittest.TestCase):
    def test_state_missing_duplicate_and_suspect_pulses_of_each_camera(self) -> None:
        ledger = v3d.Take(TAKES / "faults").ledger
        self.assertFalse(ledger.complete)
        self.assertIn("incomplete", ledger.verdict)
        self.assertEqual(ledger.commanded, 5)
        self.assertEqual(ledger.states("cam02").tolist(), [0, v3d.PulseState.MISSING, 0, 0, 0])
        self.assertEqual(ledger.states("cam03").tolist(), [0, 0, v3d.PulseState.DUPLICATE, 0, 0])
        self.assertEqual(ledger.states("cam01").tolist(), [0, 0, 0, v3d.PulseState.SUSPECT, 0])
        self.assertEqual(ledger.cameras["cam02"].missing.tolist(), [1])
        self.assertEqual(ledger.cameras["cam02"].written, 4)

    def test_of_a_whole_take_have_no_fault(self) -> None:
        ledger = v3d.Take(TAKE).ledger
        self.assertTrue(ledger.complete)
        self.assertFalse(any(ledger.states(name).any() for name in ledger.cameras))


if __name__ == "__main__":
    unittest.main()
