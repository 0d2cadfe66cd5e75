"""Checks exported meshes in Blender. blender_test passes the file names; the first is a PLY, the reference.

atlas.glb has a texture of 256 texels, and more vertices, because a chart has vertices of its own.
"""
import re
import sys

import bpy


def ply_counts(path):
    with open(path, "rb") as file:
        head = file.read(4096).split(b"end_header")[0].decode()
    return tuple(int(re.search(rf"element {what} (\d+)", head)[1]) for what in ("vertex", "face"))


def imported(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if path.endswith(".ply"):
        bpy.ops.import_mesh.ply(filepath=path)
    elif path.endswith(".obj"):
        bpy.ops.wm.obj_import(filepath=path, forward_axis="Y", up_axis="Z")
    else:
        # The default, "NORMALS", fails with Debian's numpy 1.24: Blender 3.4 uses np.bool, which numpy has removed.
        bpy.ops.import_scene.gltf(filepath=path, import_shading="SMOOTH")
    meshes = [thing for thing in bpy.context.scene.objects if thing.type == "MESH"]
    assert len(meshes) == 1, f"{path}: {len(meshes)} meshes"
    return meshes[0]


def can_read_draco():
    from io_scene_gltf2.io.com.gltf2_io_draco_compression_extension import dll_exists
    return dll_exists(quiet=True)


def check_colours(path, mesh):
    assert len(mesh.color_attributes) >= 1, f"{path}: no colours"
    colours = {tuple(round(channel, 3) for channel in item.color) for item in mesh.color_attributes[0].data}
    assert len(colours) > 50, f"{path}: {len(colours)} colours"


def check_texture(path, mesh):
    """Texture coordinates lie in the image, and it has many colours where the corners of triangles are."""
    images = [node.image for node in mesh.materials[0].node_tree.nodes if node.type == "TEX_IMAGE"]
    assert [tuple(image.size) for image in images] == [(256, 256)], f"{path}: images {images}"
    pixels = images[0].pixels[:]
    corners = [item.uv for item in mesh.uv_layers[0].data]
    assert all(0 < u < 1 and 0 < v < 1 for u, v in corners), f"{path}: texture coordinates beyond the image"
    places = [4 * (int(256 * v) * 256 + int(256 * u)) for u, v in corners]
    colours = {tuple(round(channel, 3) for channel in pixels[at:at + 3]) for at in places}
    assert len(colours) > 50, f"{path}: {len(colours)} colours"


def check(path, vertices, triangles):
    thing = imported(path)
    mesh = thing.data
    has_texture = path == "atlas.glb"
    if has_texture:
        assert len(mesh.vertices) > vertices, f"{path}: {len(mesh.vertices)} vertices, not more than {vertices}"
    else:
        assert len(mesh.vertices) == vertices, f"{path}: {len(mesh.vertices)} vertices, not {vertices}"
    assert len(mesh.polygons) == triangles, f"{path}: {len(mesh.polygons)} faces, not {triangles}"
    bpy.context.view_layer.update()
    heights = [(thing.matrix_world @ vertex.co).z for vertex in mesh.vertices]
    assert -0.2 < min(heights) < 0.3 and 1.2 < max(heights) < 3, f"{path}: from {min(heights)} to {max(heights)} m up"
    (check_texture if has_texture else check_colours)(path, mesh)
    print(f"{path}: {len(mesh.vertices)} vertices, {triangles} triangles, {'texture' if has_texture else 'colours'}")


files = sys.argv[sys.argv.index("--") + 1:]
counts = ply_counts(files[0])
for file in files:
    if file == "draco.glb" and not can_read_draco():
        print(f"{file}: skipped, this Blender has no libextern_draco")
        continue
    check(file, *counts)
