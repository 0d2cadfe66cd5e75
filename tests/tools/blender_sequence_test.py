"""Plays animated GLB files in Blender and compares each pulse with the USD file of the same surfaces.

blender_test passes pairs of file names: GLB, USD. Where this Blender imports USD, it compares that, too.
"""
import os
import sys

import bpy
from mathutils import Vector

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from usda import Usda  # noqa: E402

SHOWN = 0.5  # scale of a surface that is shown: 1, otherwise 0


def start(stage):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = round(stage.metadata["timeCodesPerSecond"])


def shown_vertices():
    """The vertices of the surfaces that are shown at the current frame, world."""
    graph = bpy.context.evaluated_depsgraph_get()
    vertices = []
    for thing in bpy.context.scene.objects:
        evaluated = thing.evaluated_get(graph)
        if thing.type == "MESH" and evaluated.matrix_world.to_scale()[0] > SHOWN:
            vertices += [evaluated.matrix_world @ vertex.co for vertex in evaluated.to_mesh().vertices]
            evaluated.to_mesh_clear()
    return vertices


def bounds(vertices):
    return [Vector(side(vertex[axis] for vertex in vertices) for axis in range(3)) for side in (min, max)]


def compare(path, stage, frame_of):
    for time in stage.times():
        bpy.context.scene.frame_set(frame_of(time))
        vertices, expected = shown_vertices(), stage.at("points", time)
        assert len(vertices) == len(expected), f"{path}, pulse {time}: {len(vertices)} vertices, not {len(expected)}"
        for corner, wanted in zip(bounds(vertices), bounds(expected)):
            assert (corner - wanted).length < 1e-4, f"{path}, pulse {time}: {corner}, not {wanted}"
    print(f"{path}: {len(stage.times())} pulses")


def check_glb(path, stage):
    start(stage)
    bpy.ops.import_scene.gltf(filepath=path, import_shading="SMOOTH")
    meshes = [thing.data for thing in bpy.context.scene.objects if thing.type == "MESH"]
    assert all(mesh.color_attributes for mesh in meshes), f"{path}: no colours"
    first = stage.times()[0]
    compare(path, stage, lambda time: time - first)
    return any(mesh.shape_keys for mesh in meshes)


def check_usda(path, stage):
    if not bpy.app.build_options.usd:
        print(f"{path}: skipped, this Blender was built without USD")
        return
    start(stage)
    bpy.ops.wm.usd_import(filepath=path)
    compare(path, stage, lambda time: time)


files = sys.argv[sys.argv.index("--") + 1:]
morphing = []
for glb, usda in zip(files[::2], files[1::2]):
    read = Usda(usda)
    sides = [bounds(read.at("points", time)) for time in read.times()]
    assert any((low - sides[0][0]).length > 1e-3 for low, _ in sides), f"{usda}: the surface does not move"
    morphing.append(check_glb(glb, read))
    check_usda(usda, read)
assert morphing == [False, True], morphing
