"""Blender add-on: imports takes of the V3D studio (docs/blender.md)."""
import os

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from . import scene
from .decoder import DecoderError
from .rig import Photographs, load_calib, read_toml

bl_info = {
    "name": "V3D takes",
    "description": "Imports mesh.v3d and motion.v3d with the cameras of the rig and their photographs",
    "author": "V3D",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "File > Import > V3D take (.v3d)",
    "category": "Import-Export",
}
RATE_HZ = 25.0  # of a file outside of a take
LAST_FRAME = 1_048_574  # of Blender


class ImportV3D(bpy.types.Operator, ImportHelper):
    """Import a mesh file or motion file of the V3D studio"""
    bl_idname = "import_scene.v3d"
    bl_label = "Import V3D"
    bl_options = {"REGISTER", "UNDO"}
    filename_ext = ".v3d"
    filter_glob: StringProperty(default="*.v3d", options={"HIDDEN"})
    cameras: BoolProperty(name="Cameras", default=True, description="Cameras of calib.toml beside the file")
    photographs: StringProperty(name="Photographs", subtype="DIR_PATH",
                                description="Folder of v3dctl export --format colmap; empty: none")

    def execute(self, context):
        try:
            self._import(context)
        except DecoderError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}

    def _import(self, context):
        path = os.path.abspath(self.filepath)
        folder = os.path.dirname(path)
        surfaces = scene.surfaces_of(path, reopen=True)
        if surfaces.pulses[-1] > LAST_FRAME:
            raise DecoderError(f"{path}: pulse {surfaces.pulses[-1]} is later than Blender's last frame, {LAST_FRAME}")
        name, rate_hz = self._take(folder)
        photographs = Photographs(os.path.abspath(bpy.path.abspath(self.photographs))) if self.photographs else None
        cameras = self._cameras(folder, photographs)
        collection = bpy.data.collections.new(name)
        try:
            thing = scene.add_mesh(collection, name, path, surfaces.pulses[0])
        except DecoderError:
            bpy.data.collections.remove(collection)
            raise
        context.scene.collection.children.link(collection)
        self._set_timeline(context.scene, surfaces.pulses, rate_hz)
        if cameras:
            self._add_cameras(context.scene, collection, cameras, photographs)
        context.view_layer.objects.active = thing
        context.scene.frame_set(surfaces.pulses[0])

    def _take(self, folder):
        """Name and rate of the take around a file."""
        path = os.path.join(folder, "take.toml")
        if not os.path.exists(path):
            return os.path.basename(folder) or "V3D", RATE_HZ
        info = read_toml(path)
        rate_hz = info.get("rate_hz", RATE_HZ)
        if not isinstance(rate_hz, (int, float)) or not 0 < rate_hz <= 10000:
            raise DecoderError(f"{path}: rate_hz: expected a positive number of pulses per second")
        return str(info.get("name", "V3D")), rate_hz

    def _cameras(self, folder, photographs):
        if photographs:
            return photographs.cameras()
        path = os.path.join(folder, "calib.toml")
        return load_calib(path) if self.cameras and os.path.exists(path) else []

    def _set_timeline(self, target, pulses, rate_hz):
        target.frame_start, target.frame_end = pulses[0], pulses[-1]
        target.render.fps = max(1, round(rate_hz))
        target.render.fps_base = target.render.fps / rate_hz

    def _add_cameras(self, target, collection, cameras, photographs):
        size = scene.frame_size(cameras)
        target.render.resolution_x, target.render.resolution_y = size
        target.render.resolution_percentage = 100
        for camera in cameras:
            thing = scene.add_camera(collection, camera, size)
            if photographs:
                scene.add_photograph(thing, camera, photographs.folder, size)
            target.camera = target.camera or thing
        scene.on_update(target)
        if any(camera.distorted for camera in cameras):
            self.report({"WARNING"}, "Blender cannot show the distortion of the lenses; photographs of v3dctl export "
                                     "--format colmap have none")


def _menu_entry(menu, _context):
    menu.layout.operator(ImportV3D.bl_idname, text="V3D take (.v3d)")


def register():
    bpy.utils.register_class(ImportV3D)
    bpy.types.TOPBAR_MT_file_import.append(_menu_entry)
    bpy.app.handlers.frame_change_pre.append(scene.on_frame_change)
    bpy.app.handlers.depsgraph_update_post.append(scene.on_update)
    bpy.app.handlers.load_pre.append(scene.on_load)


def unregister():
    bpy.app.handlers.load_pre.remove(scene.on_load)
    bpy.app.handlers.depsgraph_update_post.remove(scene.on_update)
    bpy.app.handlers.frame_change_pre.remove(scene.on_frame_change)
    bpy.types.TOPBAR_MT_file_import.remove(_menu_entry)
    bpy.utils.unregister_class(ImportV3D)
    scene.close_files()
