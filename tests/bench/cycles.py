"""Bakes a scene with Blender's Cycles, as a lightmap, for comparison; runs inside Blender (3.4 of Debian 12):

    blender --background --factory-startup --python-exit-code 1 --python cycles.py --
            SCENE.glb BAKED.glb [--samples 64] [--texels 65536] [--threads 2] [--environment 1,1,1]

BAKED.glb is the map as triangles with _IRRADIANCE in lx, for `radbake check`; beside it, BAKED.json says what it cost.
Times are of the bake alone: neither Blender's start nor reading, unwrapping and writing counts.

All faces are joined to one mesh with pure Lambert materials: base colour and emission factors, no textures, as radbake
uses them. A single-sided surface is black on its back; a double-sided one is baked a second time, turned around. No
denoiser, no clamping, no light threshold, paths as long as they are. Radiance in W/(m²·sr) stands for cd/m², so the
diffuse light that Cycles bakes without the surface's colour, which is E/π, times π is in lx. A spot, and a light with a
`range`, are refused: Blender's differ from those of KHR_lights_punctual. Windows get no light portals, which the scenes
have not.
"""
import argparse
import array
import dataclasses
import json
import math
import pathlib
import resource
import struct
import sys
import time

import bpy
from mathutils import Matrix, Quaternion, Vector

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import lightmap  # noqa: E402, beside this file

BLACK = 1e-4  # the least reflectance: Cycles bakes light divided by it
BOUNCES = 1024
UNUSED = -1.0  # marks the texels that the bake has left

# ---- The scene ----


class Gltf:
    """What the light sees of a .glb: triangles in world space, materials, lights."""

    def __init__(self, path):
        data = pathlib.Path(path).read_bytes()
        length = struct.unpack_from("<I", data, 12)[0]
        self.json = json.loads(data[20:20 + length])
        self.binary = data[28 + length:]
        self.faces, self.material, self.lights = [], [], []
        scene = self.json["scenes"][self.json.get("scene", 0)]
        for node in scene["nodes"]:
            self.visit(self.json["nodes"][node], Matrix.Identity(4))

    def visit(self, node, above):
        if "matrix" in node:
            m = node["matrix"]
            own = Matrix([m[row::4] for row in range(4)])
        else:
            x, y, z, w = node.get("rotation", (0, 0, 0, 1))
            own = Matrix.LocRotScale(Vector(node.get("translation", (0, 0, 0))), Quaternion((w, x, y, z)),
                                     Vector(node.get("scale", (1, 1, 1))))
        world = above @ own
        if "mesh" in node:
            for primitive in self.json["meshes"][node["mesh"]]["primitives"]:
                self.add(primitive, world)
        light = node.get("extensions", {}).get("KHR_lights_punctual")
        if light:
            self.lights.append((self.json["extensions"]["KHR_lights_punctual"]["lights"][light["light"]], world))
        for child in node.get("children", []):
            self.visit(self.json["nodes"][child], world)

    def add(self, primitive, world):
        if primitive.get("mode", 4) != 4:
            sys.exit("cycles: a primitive that is not of triangles")
        points = [tuple(world @ Vector(point)) for point in self.accessor(primitive["attributes"]["POSITION"])]
        order = [k for k, in self.accessor(primitive["indices"])] if "indices" in primitive else range(len(points))
        mirrored = world.determinant() < 0
        for k in range(0, len(order), 3):
            face = tuple(points[i] for i in order[k:k + 3])
            if lightmap.dot(lightmap.normal(face), lightmap.normal(face)) > 0:
                self.faces.append(face[::-1] if mirrored else face)
                self.material.append(primitive["material"])

    def accessor(self, number):
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        kind = {5121: "B", 5123: "H", 5125: "I", 5126: "f"}[accessor["componentType"]]
        each = struct.Struct("<" + {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]] * kind)
        begin = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        stride = view.get("byteStride", each.size)
        return [each.unpack_from(self.binary, begin + k * stride) for k in range(accessor["count"])]


def lambert(source, image):
    """A material of Blender that reflects and emits as the glTF one does, with `image` as where to bake to."""
    material = bpy.data.materials.new("lambert")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    colour = source.get("pbrMetallicRoughness", {}).get("baseColorFactor", (1, 1, 1, 1))[:3]
    strength = source.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1)
    emission = [strength * channel for channel in source.get("emissiveFactor", (0, 0, 0))]
    shader = nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = [max(BLACK, channel) for channel in colour] + [1]
    shader.inputs["Roughness"].default_value = 0
    if any(emission):
        both, lamp = nodes.new("ShaderNodeAddShader"), nodes.new("ShaderNodeEmission")
        lamp.inputs["Color"].default_value = [*emission, 1]
        links.new(shader.outputs[0], both.inputs[0])
        links.new(lamp.outputs[0], both.inputs[1])
        shader = both
    if not source.get("doubleSided"):
        front, geometry = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeNewGeometry")
        links.new(geometry.outputs["Backfacing"], front.inputs[0])
        links.new(shader.outputs[0], front.inputs[1])
        shader = front
    links.new(shader.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = image
    nodes.active = texture
    return material


def add_light(light, world):
    if light["type"] == "spot" or "range" in light:
        sys.exit(f"cycles: no {light['type']} light of Blender's is like this one of KHR_lights_punctual")
    intensity = light.get("intensity", 1)
    if light["type"] == "directional":
        lamp = bpy.data.lights.new("sun", "SUN")
        lamp.angle = 0
        lamp.energy = intensity  # W/m² where it falls upright
    else:
        lamp = bpy.data.lights.new("point", "POINT")
        lamp.shadow_soft_size = 0
        lamp.energy = 4 * math.pi * intensity  # W, all around
    lamp.color = light.get("color", (1, 1, 1))
    lamp.cycles.max_bounces = BOUNCES
    holder = bpy.data.objects.new("light", lamp)
    holder.matrix_world = Matrix.LocRotScale(world.to_translation(), world.to_quaternion(), None)
    bpy.context.collection.objects.link(holder)


def add_mesh(gltf, charts, size, image):
    mesh = bpy.data.meshes.new("scene")
    mesh.from_pydata([point for face in gltf.faces for point in face], [],
                     [(k, k + 1, k + 2) for k in range(0, 3 * len(gltf.faces), 3)])
    for source in gltf.json["materials"]:
        mesh.materials.append(lambert(source, image))
    mesh.polygons.foreach_set("material_index", gltf.material)
    places = [0.0] * (6 * len(gltf.faces))
    for chart in charts:
        for f, corners in chart.places.items():
            for k, corner in enumerate(corners):
                for axis in (0, 1):
                    places[6 * f + 2 * k + axis] = (chart.origin[axis] + corner[axis]) / size[axis]
    mesh.uv_layers.new(name="lightmap").data.foreach_set("uv", places)
    thing = bpy.data.objects.new("scene", mesh)
    bpy.context.collection.objects.link(thing)
    thing.select_set(True)
    bpy.context.view_layer.objects.active = thing
    return mesh


def turn_around(mesh, double, is_double):
    """So that the next bake is of the backs of double-sided faces; what else is baked goes to an image of one texel."""
    for f in double:
        mesh.polygons[f].flip()
    elsewhere = bpy.data.images.new("elsewhere", 1, 1)
    for material, keeps in zip(mesh.materials, is_double):
        if not keeps:
            material.node_tree.nodes.active.image = elsewhere


def set_up(samples, threads, environment):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode, scene.render.threads = "FIXED", threads
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = samples
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.light_sampling_threshold = 0
    cycles.max_bounces = cycles.diffuse_bounces = BOUNCES
    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    scene.world.cycles.max_bounces = BOUNCES
    sky = scene.world.node_tree.nodes["Background"].inputs
    sky["Color"].default_value, sky["Strength"].default_value = [*environment, 1], 1

# ---- The bake ----


def bake(image):
    """The texels (r, g, b, a) of the diffuse light, and what it took in (processor, wall) seconds."""
    image.pixels.foreach_set(array.array("f", [UNUSED]) * len(image.pixels))
    before, start = resource.getrusage(resource.RUSAGE_SELF), time.monotonic()
    bpy.ops.object.bake(type="DIFFUSE", pass_filter={"DIRECT", "INDIRECT"}, margin=0, use_clear=False)
    after, end = resource.getrusage(resource.RUSAGE_SELF), time.monotonic()
    texels = array.array("f", [0]) * len(image.pixels)
    image.pixels.foreach_get(texels)
    return texels, (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, end - start)


def write(path, triangles):
    points, irradiance = array.array("f"), array.array("f")
    for triangle in triangles:
        for point, value in triangle:
            points.extend(point)
            irradiance.extend(math.pi * channel for channel in value)
    count = len(points) // 3
    low, high = ([choose(points[axis::3]) for axis in range(3)] for choose in (min, max))
    data = points.tobytes() + irradiance.tobytes()
    gltf = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "_IRRADIANCE": 1}}]}],
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteOffset": k * 12 * count, "byteLength": 12 * count} for k in (0, 1)],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3", "min": low, "max": high},
                      {"bufferView": 1, "componentType": 5126, "count": count, "type": "VEC3"}]}
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    path.write_bytes(struct.pack("<III", 0x46546C67, 2, 28 + len(text) + len(data)) +
                     struct.pack("<II", len(text), 0x4E4F534A) + text +
                     struct.pack("<II", len(data), 0x004E4942) + data)


def main():
    arguments = argparse.ArgumentParser(prog="cycles.py", description=__doc__,
                                        formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("scene", type=pathlib.Path)
    arguments.add_argument("baked", type=pathlib.Path)
    arguments.add_argument("--samples", type=int, default=64)
    arguments.add_argument("--texels", type=int, default=65536)
    arguments.add_argument("--threads", type=int, default=2)
    arguments.add_argument("--environment", default="0,0,0", help="radiance of a uniform sky")
    given = arguments.parse_args(sys.argv[sys.argv.index("--") + 1:])

    bpy.ops.wm.read_factory_settings(use_empty=True)
    gltf = Gltf(given.scene)
    start = time.process_time()
    charts, size = lightmap.unwrap(gltf.faces, given.texels)
    unwrap_seconds = time.process_time() - start
    image = bpy.data.images.new("lightmap", *size, alpha=True, float_buffer=True, is_data=True)
    mesh = add_mesh(gltf, charts, size, image)
    set_up(given.samples, given.threads, [float(channel) for channel in given.environment.split(",")])
    for light, world in gltf.lights:
        add_light(light, world)

    def side(faces, wanted):
        texels, seconds = bake(image)

        def texel(x, y):
            k = 4 * (y * size[0] + x)
            return None if texels[k] == UNUSED else tuple(texels[k:k + 3])
        used = sum(value != UNUSED for value in texels[::4])
        return used, seconds, lightmap.triangles(faces, wanted, texel)

    sides = [side(gltf.faces, charts)]
    is_double = [bool(source.get("doubleSided")) for source in gltf.json["materials"]]
    double = {f for f, material in enumerate(gltf.material) if is_double[material]}
    if double:
        turn_around(mesh, double, is_double)
        backs = [dataclasses.replace(chart, places={f: chart.places[f] for f in chart.places if f in double})
                 for chart in charts]
        used, seconds, found = side(gltf.faces, backs)
        sides.append((used, seconds, (triangle[::-1] for triangle in found)))
    write(given.baked, (triangle for _, _, found in sides for triangle in found))
    given.baked.with_suffix(".json").write_text(json.dumps({
        "version": bpy.app.version_string, "samples": given.samples, "texels": sum(used for used, _, _ in sides),
        "charts": len(charts), "size": size, "seconds": sum(seconds[0] for _, seconds, _ in sides),
        "wall_seconds": sum(seconds[1] for _, seconds, _ in sides), "unwrap_seconds": unwrap_seconds}))


main()
