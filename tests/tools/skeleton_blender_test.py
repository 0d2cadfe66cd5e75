"""Compares joints in Blender with skeleton.json. skeleton_blender_test passes skeleton.json, the BVH and the glTF file."""
import json
import math
import sys

import bpy
import io_anim_bvh.import_bvh

MAX_M = 0.001

truth_file, bvh, glb = sys.argv[sys.argv.index("--") + 1:]
truth = json.load(open(truth_file))
names = [joint["name"] for joint in truth["joints"]]
bpy.context.scene.render.fps = round(truth["rate_hz"])


def largest_error(armature, frame, pulse, to_world):
    bpy.context.scene.frame_set(frame)
    bpy.context.view_layer.update()
    far = 0
    for name, position in zip(names, pulse["positions"]):
        head = armature.matrix_world @ armature.pose.bones[name].matrix.translation
        far = max(far, math.dist(to_world(head), position))
    return far


def check(what, armature, first_frame, to_world):
    far = max(largest_error(armature, first_frame + n, pulse, to_world) for n, pulse in enumerate(truth["pulses"]))
    print(f"{what}: {len(truth['pulses'])} pulses, joints within {1000 * far:.3f} mm")
    assert far < MAX_M, f"{what}: {1000 * far:.2f} mm"


def armatures():
    return [thing for thing in bpy.context.scene.objects if thing.type == "ARMATURE"]


bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.render.fps = round(truth["rate_hz"])
# Blender 3.4 opens the file with mode "rU", which Python 3.11 no longer has.
io_anim_bvh.import_bvh.open = lambda path, mode: open(path)
bpy.ops.import_anim.bvh(filepath=bvh, rotate_mode="NATIVE")
# y up, z forward and x to the left become Blender's z up: the world is (-y, x, z) of it.
check("BVH", armatures()[0], 1, lambda p: (-p.y, p.x, p.z))

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.render.fps = round(truth["rate_hz"])
bpy.ops.import_scene.gltf(filepath=glb, import_shading="SMOOTH", bone_heuristic="BLENDER")
assert len(armatures()) == 1, f"glTF: {len(armatures())} armatures"
check("glTF", armatures()[0], 0, lambda p: (p.x, p.y, p.z))
meshes = [thing for thing in bpy.context.scene.objects if thing.type == "MESH" and thing.vertex_groups]
assert len(meshes) == 1, f"glTF: {len(meshes)} surfaces with a skin"
assert len(meshes[0].data.color_attributes) >= 1, "glTF: no colours"
