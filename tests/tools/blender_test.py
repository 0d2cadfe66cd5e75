"""Checks exported meshes in Blender. blender_test passes the file names; the first is a PLY, the reference."""
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
    else:
        # The default, "NORMALS", fails with Debian's numpy 1.24: Blender 3.4 uses np.bool, which numpy has removed.
        bpy.ops.import_scene.gltf(filepath=path, import_shading="SMOOTH")
    meshes = [thing for thing in bpy.context.scene.objects if thing.type == "MESH"]
    assert len(meshes) == 1, f"{path}: {len(meshes)} meshes"
    return meshes[0]


def can_read_draco():
    from io_scene_gltf2.io.com.gltf2_io_draco_compression_extension import dll_exists
    return dll_exists(quiet=True)


def check(path, vertices, triangles):
    thing = imported(path)
    mesh = thing.data
    assert len(mesh.vertices) == vertices, f"{path}: {len(mesh.vertices)} vertices, not {vertices}"
    assert len(mesh.polygons) == triangles, f"{path}: {len(mesh.polygons)} faces, not {triangles}"
    bpy.context.view_layer.update()
    heights = [(thing.matrix_world @ vertex.co).z for vertex in mesh.vertices]
    assert -0.2 < min(heights) < 0.3 and 1.2 < max(heights) < 3, f"{path}: from {min(heights)} to {max(heights)} m up"
    assert len(mesh.color_attributes) >= 1, f"{path}: no colours"
    colours = {tuple(round(channel, 3) for channel in item.color) for item in mesh.color_attributes[0].data}
    assert len(colours) > 50, f"{path}: {len(colours)} colours"
    print(f"{path}: {vertices} vertices, {triangles} triangles, {len(colours)} colours")


files = sys.argv[sys.argv.index("--") + 1:]
counts = ply_counts(files[0])
for file in files:
    if file == "draco.glb" and not can_read_draco():
        print(f"{file}: skipped, this Blender has no libextern_draco")
        continue
    check(file, *counts)
