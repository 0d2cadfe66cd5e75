"""Blender's objects of a take: one mesh that follows the timeline, and the cameras with their photographs.

Frame N of the timeline shows pulse N.
"""
import bpy
import numpy as np
from mathutils import Matrix

from .decoder import DecoderError
from .rig import Photographs
from .surfaces import Surfaces, drawable

# Properties of our objects.
FILE, PHOTOGRAPHS, CAMERA, ASPECT = "v3d_file", "v3d_photographs", "v3d_camera", "v3d_pixel_aspect"
ERROR, TOPOLOGY, FACES = "v3d_error", "v3d_topology", "v3d_faces"
COLOURS = "Colour"
SENSOR_MM = 36.0
_open_files = {}  # path: Surfaces
_open_photographs = {}  # folder: Photographs


def _linear_table():
    """Linear light of the 256 values of sRGB."""
    value = np.arange(256) / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055)**2.4).astype(np.float32)


_LINEAR = _linear_table()


def surfaces_of(path, reopen=False):
    """The surfaces of a file, which stays open."""
    if reopen and path in _open_files:
        _open_files.pop(path).close()
    if path not in _open_files:
        _open_files[path] = Surfaces(path)
    return _open_files[path]


def close_files():
    for surfaces in _open_files.values():
        surfaces.close()
    _open_files.clear()
    _open_photographs.clear()


def _build(mesh, surface):
    """Replaces the geometry of a mesh."""
    mesh.clear_geometry()
    triangles = drawable(surface.triangles)
    count = mesh[FACES] = len(triangles)
    mesh.vertices.add(len(surface.vertices))
    mesh.loops.add(3 * count)
    mesh.polygons.add(count)
    if count:
        mesh.loops.foreach_set("vertex_index", triangles.astype(np.int32).ravel())
        mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
        if bpy.app.version < (4, 0):
            mesh.polygons.foreach_set("loop_total", np.full(count, 3, np.int32))
        mesh.polygons.foreach_set("use_smooth", np.ones(count, bool))


def _set_colours(mesh, colours):
    if colours is None or not len(colours):
        return
    if COLOURS not in mesh.color_attributes:
        mesh.color_attributes.new(COLOURS, "BYTE_COLOR", "POINT")
    linear = np.ones((len(colours), 4), np.float32)
    linear[:, :3] = _LINEAR[colours]
    mesh.color_attributes[COLOURS].data.foreach_set("color", linear.ravel())


def show(thing, frame):
    """Sets the mesh of an object to the surface of a frame of the timeline."""
    surfaces = surfaces_of(bpy.path.abspath(thing[FILE]))
    shown = surfaces.at(surfaces.index_at(frame))
    surface, mesh, topology = shown.surface, thing.data, repr(shown.topology)
    same = (mesh.get(TOPOLOGY) == topology and len(mesh.vertices) == len(surface.vertices) and
            len(mesh.polygons) == mesh.get(FACES))
    if not same:
        _build(mesh, surface)
    if len(surface.vertices):
        mesh.vertices.foreach_set("co", surface.vertices.ravel())
    _set_colours(mesh, surface.colours)
    mesh.update(calc_edges=not same)
    mesh[TOPOLOGY] = topology


def _show_photograph(thing, frame):
    folder = bpy.path.abspath(thing[PHOTOGRAPHS])
    if folder not in _open_photographs:
        _open_photographs[folder] = Photographs(folder)
    path = _open_photographs[folder].path(thing.get(CAMERA, ""), frame)
    for background in thing.data.background_images:
        background.show_background_image = path is not None
        if path is None:
            continue
        if background.image is None:
            background.image = bpy.data.images.load(path)
        elif bpy.path.abspath(background.image.filepath) != path:
            background.image.filepath = path
            background.image.reload()


@bpy.app.handlers.persistent
def on_frame_change(scene, _depsgraph=None):
    """Shows the pulse of the frame. An error stays in the property v3d_error of the object, which keeps its last pulse."""
    for thing in scene.objects:
        act = show if FILE in thing and thing.type == "MESH" else None
        act = _show_photograph if PHOTOGRAPHS in thing and thing.type == "CAMERA" else act
        if act is None:
            continue
        try:
            act(thing, scene.frame_current)
            if ERROR in thing:
                del thing[ERROR]
        except (DecoderError, RuntimeError) as error:
            text = " ".join(str(error).split())
            if thing.get(ERROR) != text:
                print(f"v3d: {text}")
            thing[ERROR] = text


@bpy.app.handlers.persistent
def on_update(scene, _depsgraph=None):
    """Sets the shape of the pixels to that of the scene's camera. Blender has one for all cameras."""
    aspect = scene.camera.get(ASPECT) if scene.camera else None
    if not isinstance(aspect, float) or not aspect > 0:
        return
    x, y = max(1, 1 / aspect), max(1, aspect)
    render = scene.render
    if abs(render.pixel_aspect_x - x) > 1e-6 or abs(render.pixel_aspect_y - y) > 1e-6:
        render.pixel_aspect_x, render.pixel_aspect_y = x, y


@bpy.app.handlers.persistent
def on_load(_file=None):
    close_files()


def _material():
    """Shows vertex colours without light, because they contain that of the studio."""
    material = bpy.data.materials.new("V3D colours")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    attribute, emission = nodes.new("ShaderNodeAttribute"), nodes.new("ShaderNodeEmission")
    attribute.attribute_name = COLOURS
    links.new(attribute.outputs["Color"], emission.inputs["Color"])
    links.new(emission.outputs["Emission"], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def add_mesh(collection, name, path, frame):
    """Adds the object of a file. Raises DecoderError, and then adds nothing."""
    thing = bpy.data.objects.new(name, bpy.data.meshes.new(name))
    thing[FILE] = path
    try:
        show(thing, frame)
    except DecoderError:
        bpy.data.meshes.remove(thing.data)  # with its object
        raise
    thing.data.materials.append(_material())
    collection.objects.link(thing)
    return thing


def frame_size(cameras):
    """Width and height of a picture that holds the image of every camera, pixels."""
    return max(camera.width for camera in cameras), max(camera.height for camera in cameras)


def add_camera(collection, camera, size):
    """Adds a camera. Its image is in the middle of a picture of `size` pixels."""
    aspect = camera.focal[0] / camera.focal[1]
    data = bpy.data.cameras.new(camera.name)
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = max(SENSOR_MM, 2 * size[0] / camera.focal[0])  # keeps the lens above Blender's least, 1 mm
    data.lens = camera.focal[0] * data.sensor_width / size[0]
    data.shift_x = ((camera.width - 1) / 2 - camera.centre[0]) / size[0]
    data.shift_y = aspect * (camera.centre[1] - (camera.height - 1) / 2) / size[0]
    thing = bpy.data.objects.new(camera.name, data)
    pose = np.linalg.inv(camera.cam_from_world)
    pose[:3, 1:3] *= -1  # Blender's cameras: y up, z backward
    thing.matrix_world = Matrix(pose.tolist())
    thing[CAMERA], thing[ASPECT] = camera.name, aspect
    collection.objects.link(thing)
    return thing


def add_photograph(thing, camera, folder, size):
    """Shows the photographs of a folder behind a camera."""
    thing[PHOTOGRAPHS] = folder
    thing.data.show_background_images = True
    background = thing.data.background_images.new()
    background.alpha = 1.0
    background.frame_method = "FIT"
    background.scale = max(camera.width / size[0], camera.height / size[1])
