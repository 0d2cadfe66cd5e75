"""Imports a take with the add-on in Blender and compares it with the module v3d. addon_test starts it."""
import os
import pathlib
import random
import shutil
import sys

import bpy
import numpy as np
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

sys.path.insert(0, os.environ["V3D_PYTHON"])
import v3d  # noqa: E402

TAKE = pathlib.Path(os.environ["V3D_TAKES"]) / "take"
MAX_M = 1e-5
MAX_PIXELS = 0.01


def import_take(path, **options):
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.import_scene.v3d(filepath=str(path), **options)
    return bpy.context.scene


def objects_of(scene, kind):
    return [thing for thing in scene.objects if thing.type == kind]


def values(collection, name, width, dtype=np.float32):
    array = np.empty(len(collection) * width, dtype)
    collection.foreach_get(name, array)
    return array.reshape(-1, width)


def srgb(linear):
    return 255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear**(1 / 2.4) - 0.055)


def check_surface(mesh, vertices, triangles, colours):
    first = {}  # of the triangles with the same vertices
    for triangle in triangles.tolist():
        first.setdefault(frozenset(triangle), triangle)
    once = list(first.values())
    assert len(once) > 0.99 * len(triangles), "Blender shows one of several triangles with the same vertices"
    assert len(mesh.vertices) == len(vertices) and len(mesh.polygons) == len(once)
    far = np.abs(values(mesh.vertices, "co", 3) - vertices).max()
    assert far < MAX_M, f"{far} m"
    np.testing.assert_array_equal(values(mesh.loops, "vertex_index", 1, np.int32).reshape(-1, 3), once)
    shown = srgb(values(mesh.color_attributes[0].data, "color", 4)[:, :3])
    assert np.abs(shown - colours).max() < 0.6, "colours"
    assert len(np.unique(colours, axis=0)) > 50
    return far


def check_meshes(scene, take):
    thing, = objects_of(scene, "MESH")
    for pulse in (0, 2, 1):
        scene.frame_set(pulse)
        mesh = take.meshes().read(pulse)
        far = check_surface(thing.data, mesh.vertices, mesh.triangles, mesh.colours)
        print(f"mesh.v3d, pulse {pulse}: {len(mesh.vertices)} vertices within {far:g} m")
    assert (scene.frame_start, scene.frame_end) == (0, 2)
    assert abs(scene.render.fps / scene.render.fps_base - take.rate_hz) < 1e-6
    scene.frame_set(50)
    check_surface(thing.data, *(lambda m: (m.vertices, m.triangles, m.colours))(take.meshes().read(2)))


def check_motion(scene, take):
    thing, = objects_of(scene, "MESH")
    segments = take.motion().segments
    for pulse in (1, 0, 2):
        scene.frame_set(pulse)
        segment = [s for s in segments if pulse in s.pulses][-1]  # the later one shows a pulse that two share
        tracked = segment.read(pulse)
        far = check_surface(thing.data, tracked.vertices, segment.template.triangles, tracked.colours)
        print(f"motion.v3d, pulse {pulse}: {segment.vertex_count} vertices within {far:g} m")


def pixel_in_blender(scene, thing, point, size):
    """The pixel of an image of `size`, which is in the middle of the picture."""
    x, y, _ = world_to_camera_view(scene, thing, Vector(point))
    width, height = scene.render.resolution_x, scene.render.resolution_y
    return np.array([x * width - 0.5 - (width - size[0]) / 2, (1 - y) * height - 0.5 - (height - size[1]) / 2])


def without_distortion(camera, points):
    """Pixels of a camera without its distortion."""
    pixels = camera.matrix @ (camera.rotation @ np.array(points).T + camera.translation[:, None])
    return (pixels[:2] / pixels[2]).T


def largest(differences):
    """The largest one. NaN, which no comparison finds, is a failure."""
    differences = np.asarray(differences)
    assert np.isfinite(differences).all(), f"no number among {differences.size} differences"
    return np.abs(differences).max()


def check_largest():
    assert largest([[0.5, -2], [1, 0]]) == 2
    for invalid in (np.nan, np.inf):
        try:
            largest([0.5, invalid])
        except AssertionError:
            continue
        raise AssertionError(f"{invalid} is accepted")


def check_cameras(scene, take, camera_of, project):
    points = np.random.default_rng(1).uniform([-0.5, -0.5, 0], [0.5, 0.5, 2], (20, 3))
    things = objects_of(scene, "CAMERA")
    assert sorted(thing.name for thing in things) == sorted(take.cameras)
    differences = []
    for thing in things:
        scene.camera = thing
        bpy.context.view_layer.update()
        camera = camera_of(take.cameras[thing.name])
        for point, pixel in zip(points, project(camera, points)):
            differences.append(pixel_in_blender(scene, thing, point, camera.size) - pixel)
    worst = largest(differences)
    print(f"{len(things)} cameras: points within {worst:.4f} pixels")
    assert worst < MAX_PIXELS, f"{worst} pixels"
    assert max(camera.size[1] for camera in map(camera_of, take.cameras.values())) == scene.render.resolution_y


def check_photographs(scene, take):
    for pulse in (0, 2):
        scene.frame_set(pulse)
        for thing in objects_of(scene, "CAMERA"):
            background, = thing.data.background_images
            frame = take.frames(thing.name).read(pulse)
            expected = frame.undistorted(corrected=True)
            height, width = expected.shape[:2]
            assert tuple(background.image.size) == (width, height), thing.name
            pixels = np.array(background.image.pixels[:]).reshape(height, width, 4)[::-1, :, :3]
            np.testing.assert_allclose(255 * pixels, expected, atol=0.6)
            # With FIT, the image is as large as the picture allows.
            fit = min(scene.render.resolution_x / width, scene.render.resolution_y / height)
            assert abs(background.scale * fit - 1) < 1e-6 and background.show_background_image


def message_of(path, **options):
    bpy.ops.wm.read_homefile(use_empty=True)
    try:
        bpy.ops.import_scene.v3d(filepath=str(path), **options)
    except RuntimeError as error:
        lines = [line for line in str(error).strip().splitlines() if "Warning" not in line]
        assert len(lines) == 1 and "Traceback" not in lines[0], lines
        assert not bpy.data.objects and not bpy.data.collections, "left objects behind"
        return lines[0]
    return ""


def check_errors(work):
    assert "No such file" in message_of(work / "nothing.v3d")
    assert "neither mesh.v3d nor motion.v3d" in message_of(TAKE / "cam01.lcmlog")
    assert "holds no export" in message_of(TAKE / "mesh.v3d", photographs=str(work / "empty"))
    broken = work / "broken"
    shutil.copytree(TAKE, broken)
    (broken / "calib.toml").write_text("[cam_0]\nsize = 3\n")
    assert "cam_0: size: expected [width, height]" in message_of(broken / "mesh.v3d")
    generator = random.Random(7)
    for name in ("mesh.v3d", "motion.v3d"):
        shutil.copy(TAKE / "calib.toml", broken)
        whole = (TAKE / name).read_bytes()
        failed = 0
        for n in range(20):
            data = bytearray(whole)
            data[generator.randrange(len(data))] ^= 1 << generator.randrange(8)
            if n % 2:
                del data[generator.randrange(len(data)):]
            (broken / name).write_bytes(data)
            if message_of(broken / name):
                failed += 1
                continue
            for pulse in range(3):
                bpy.context.scene.frame_set(pulse)
            failed += any("v3d_error" in thing for thing in bpy.data.objects)
        print(f"{failed} of 20 damaged {name} reported")
        assert failed > 0


def check_saved_file(work, take):
    """A saved scene reads its take again."""
    bpy.ops.wm.save_as_mainfile(filepath=str(work / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(work / "saved.blend"))
    check_meshes(bpy.context.scene, take)


def main():
    check_largest()
    bpy.ops.preferences.addon_enable(module="v3d_import")
    work = pathlib.Path.cwd()
    (work / "empty").mkdir()
    take = v3d.Take(TAKE)
    assert "_menu_entry" in [draw.__name__ for draw in bpy.types.TOPBAR_MT_file_import._dyn_ui_initialize()]
    scene = import_take(TAKE / "mesh.v3d")
    check_meshes(scene, take)
    check_cameras(scene, take, lambda camera: camera, without_distortion)
    check_saved_file(work, take)
    check_motion(import_take(TAKE / "motion.v3d", cameras=False), take)
    assert not objects_of(bpy.context.scene, "CAMERA")
    scene = import_take(TAKE / "mesh.v3d", photographs=str(work / "colmap"))
    check_cameras(scene, take, lambda camera: camera.pinhole(), lambda camera, points: camera.project(points))
    check_photographs(scene, take)
    check_errors(work)
    bpy.ops.preferences.addon_disable(module="v3d_import")
    assert not bpy.app.handlers.frame_change_pre, "left its handler behind"


main()
