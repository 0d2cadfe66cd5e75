"""Compares joints and surfaces in Blender with skeleton.json and the tracked surface.

skeleton_blender_test passes for each take: the number of its tracked segments, skeleton.json, the BVH and the glTF file, and the
tracked surface as USD.
"""
import base64
import json
import math
import os
import statistics
import sys

import bpy
import io_anim_bvh.import_bvh
from mathutils import Matrix, Quaternion, Vector

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from usda import Usda  # noqa: E402

MAX_M = 0.001
MAX_SKIN_M = 0.005  # weights are bytes in skeleton.json
MAX_MEDIAN_M = 0.02  # between the surface that the skeleton moves and the tracked one
SHOWN = 0.5  # scale of an armature that is shown: 1, otherwise 0


def start(truth):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = round(truth["rate_hz"])


def show(frame):
    bpy.context.scene.frame_set(frame)
    bpy.context.view_layer.update()


def largest_error(armature, names, pulse, to_world):
    heads = [to_world(armature.matrix_world @ armature.pose.bones[name].matrix.translation) for name in names]
    return max(math.dist(head, position) for head, position in zip(heads, pulse["positions"]))


def check_bvh(path, truth):
    start(truth)
    # Blender 3.4 opens the file with mode "rU", which Python 3.11 no longer has.
    io_anim_bvh.import_bvh.open = lambda path, mode: open(path)
    bpy.ops.import_anim.bvh(filepath=path, rotate_mode="NATIVE")
    armature = next(thing for thing in bpy.context.scene.objects if thing.type == "ARMATURE")
    names = [joint["name"] for joint in truth["joints"]]
    far = 0
    for n, pulse in enumerate(truth["pulses"]):
        show(1 + n)
        # y up, z forward and x to the left become Blender's z up: the world is (-y, x, z) of it.
        far = max(far, largest_error(armature, names, pulse, lambda p: (-p.y, p.x, p.z)))
    print(f"{path}: {len(truth['pulses'])} pulses, joints within {1000 * far:.3f} mm")
    assert far < MAX_M, f"{path}: {1000 * far:.2f} mm"


def frames_of(pulse):
    """world_from_joint of all joints."""
    return [Matrix.Translation(position) @ Quaternion(rotation).to_matrix().to_4x4()
            for position, rotation in zip(pulse["positions"], pulse["rotations"])]


def skinned(weights, rest, pulse, positions):
    """The surface at rest after linear blend skinning by skeleton.json."""
    motions = [to @ at.inverted() for at, to in zip(frames_of(rest), frames_of(pulse))]
    moved = []
    for (joints, shares), position in zip(weights, positions):
        sum_ = Vector((0, 0, 0))
        for joint, share in zip(joints, shares):
            if share > 0:
                sum_ += share / 255 * (motions[joint] @ Vector(position))
        moved.append(sum_)
    return moved


def weights_of(skin):
    """Of each vertex, the numbers of four joints and their weights in units of 1/255."""
    data = base64.b64decode(skin["weights"])
    return [(data[n:n + 4], data[n + 4:n + 8]) for n in range(0, len(data), 8)]


def shown_surface(thing):
    """The vertices of a surface as its modifiers move it, world."""
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    vertices = [evaluated.matrix_world @ vertex.co for vertex in evaluated.to_mesh().vertices]
    evaluated.to_mesh_clear()
    return vertices


def distances(a, b):
    assert len(a) == len(b), f"{len(a)} vertices, not {len(b)}"
    return [math.dist(p, q) for p, q in zip(a, b)]


def check_segment(path, truth, skin, surface, armature, others, stage):
    """One tracked surface: the armature's joints, and the surface that they move, at each pulse of its skin."""
    names = [joint["name"] for joint in truth["joints"]]
    pulses = {pulse["pulse"]: pulse for pulse in truth["pulses"]}
    first = truth["skins"][0]["pulses"][0]
    at, joints_far = {}, 0
    for number in skin["pulses"]:
        show(number - first)
        shown = [thing.name for thing in [armature, *others] if thing.matrix_world.to_scale()[0] > SHOWN]
        assert shown == [armature.name], f"{path}, pulse {number}: {shown} are shown, not {armature.name}"
        joints_far = max(joints_far, largest_error(armature, names, pulses[number], tuple))
        at[number] = shown_surface(surface)
    assert joints_far < MAX_M, f"{path}: joints {1000 * joints_far:.2f} mm"
    # At rest the skeleton moves nothing.
    rest = min(at, key=lambda number: max(distances(at[number], stage.at("points", number))))
    still = max(distances(at[rest], stage.at("points", rest)))
    assert still < MAX_M, f"{path}: at no pulse the surface is the tracked one: {1000 * still:.2f} mm at best"
    weights = weights_of(skin)
    skin_far, medians = 0, []
    for number, vertices in at.items():
        expected = skinned(weights, pulses[rest], pulses[number], stage.at("points", rest))
        skin_far = max(skin_far, max(distances(vertices, expected)))
        medians.append(statistics.median(distances(vertices, stage.at("points", number))))
    print(f"{path}: pulses {skin['pulses'][0]} to {skin['pulses'][-1]}, joints within {1000 * joints_far:.3f} mm, surface within "
          f"{1000 * skin_far:.2f} mm of the skin, median at most {1000 * max(medians):.1f} mm from the tracked one")
    assert skin_far < MAX_SKIN_M, f"{path}: {1000 * skin_far:.2f} mm"
    assert max(medians) < MAX_MEDIAN_M, f"{path}: median {1000 * max(medians):.1f} mm"
    moved = max(distances(at[skin["pulses"][0]], at[skin["pulses"][-1]]))
    assert moved > MAX_MEDIAN_M, f"{path}: the surface does not move"


def check_glb(path, truth, stage, segments):
    start(truth)
    bpy.ops.import_scene.gltf(filepath=path, import_shading="SMOOTH", bone_heuristic="BLENDER")
    surfaces = [thing for thing in bpy.context.scene.objects if thing.type == "MESH" and thing.vertex_groups]
    surfaces.sort(key=lambda thing: thing.name)
    assert len(surfaces) == len(truth["skins"]) == segments, f"{path}: {len(surfaces)} surfaces, {len(truth['skins'])} skins"
    armatures = [next(one.object for one in thing.modifiers if one.type == "ARMATURE") for thing in surfaces]
    for skin, surface, armature in zip(truth["skins"], surfaces, armatures):
        others = [thing for thing in armatures if thing != armature]
        check_segment(path, truth, skin, surface, armature, others, stage)
        assert len(surface.data.color_attributes) >= 1, f"{path}: no colours"


files = sys.argv[sys.argv.index("--") + 1:]
for segments, truth_file, bvh, glb, usda in zip(*[iter(files)] * 5):
    with open(truth_file) as file:
        read = json.load(file)
    check_bvh(bvh, read)
    check_glb(glb, read, Usda(usda), int(segments))
