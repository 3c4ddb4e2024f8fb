#!/usr/bin/env python3
"""Writes the project's scenes: make_scenes.py [FOLDER] (default: the folder of this file).

Metres, cd/m², one material a primitive, counter-clockwise fronts. The same bytes on every run and machine.
README.md beside this file says what is known of each scene.
"""

import json
import math
import pathlib
import struct
import sys

# ---- Geometry: a face is a planar polygon of three or four points, counter-clockwise from its front. ----


def sub(a, b):
    return tuple(x - y for x, y in zip(a, b))


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def triangles(face):
    return [(face[0], face[i], face[i + 1]) for i in range(1, len(face) - 1)]


def area(faces):
    return sum(math.hypot(*cross(sub(b, a), sub(c, a))) / 2 for face in faces for a, b, c in triangles(face))


def volume(faces):
    """Of what a closed surface encloses: positive if its fronts look outward."""
    return sum(dot(a, cross(b, c)) / 6 for face in faces for a, b, c in triangles(face))


def is_closed(faces):
    """Every edge of every face belongs to exactly one neighbour, which runs along it the other way."""
    edges = [(face[i - 1], face[i]) for face in faces for i in range(len(face))]
    return len(set(edges)) == len(edges) and all((b, a) in set(edges) for a, b in edges)


def looks_at(face, point):
    a, b, c = triangles(face)[0]
    return dot(cross(sub(b, a), sub(c, a)), sub(point, a)) > 0


def flipped(faces):
    return [tuple(reversed(face)) for face in faces]


def box(low, high):
    """The six faces of a box, fronts outward."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    return hexahedron([(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)],
                      [(x0, y1, z0), (x1, y1, z0), (x1, y1, z1), (x0, y1, z1)])


def hexahedron(bottom, top):
    """Fronts outward. Both rings run counter-clockwise seen from below."""
    sides = [(bottom[i - 1], top[i - 1], top[i], bottom[i]) for i in range(4)]
    return [tuple(bottom), tuple(reversed(top))] + sides


# ---- glTF ----


def to_float32(values):
    return struct.unpack(f"<{len(values)}f", struct.pack(f"<{len(values)}f", *values))


class Gltf:
    def __init__(self):
        self.json = {
            "asset": {"version": "2.0", "generator": "radbake scenes/make_scenes.py"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "materials": [],
            "accessors": [],
            "bufferViews": [],
        }
        self.bytes = bytearray()

    def material(self, name, reflectance, radiance=(0, 0, 0), double_sided=False):
        """reflectance: linear RGB; radiance: L_e in cd/m²."""
        material = {
            "name": name,
            "pbrMetallicRoughness": {"baseColorFactor": [*reflectance, 1], "metallicFactor": 0, "roughnessFactor": 1},
        }
        strength = max(radiance)
        if strength > 0:
            material["emissiveFactor"] = [channel / strength for channel in radiance]
            material["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
            self.uses("KHR_materials_emissive_strength")
        if double_sided:
            material["doubleSided"] = True
        self.json["materials"].append(material)
        return len(self.json["materials"]) - 1

    def uses(self, extension):
        if extension not in self.json.setdefault("extensionsUsed", []):
            self.json["extensionsUsed"].append(extension)

    def light(self, name, kind, color, intensity, *, cones=None, **place):
        """A node with a light that shines along its -z; intensity: cd, of a directional one lx; cones: inner and
        outer angle of a spot."""
        self.uses("KHR_lights_punctual")
        light = {"name": name, "type": kind, "color": color, "intensity": intensity}
        if cones:
            light["spot"] = {"innerConeAngle": cones[0], "outerConeAngle": cones[1]}
        lights = self.json.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})["lights"]
        lights.append(light)
        self.node(name=name, extensions={"KHR_lights_punctual": {"light": len(lights) - 1}}, **place)

    def node(self, **properties):
        self.json["scenes"][0]["nodes"].append(len(self.json["nodes"]))
        self.json["nodes"].append(properties)

    def mesh(self, name, parts, normal=None, **place):
        """A node with a mesh; parts: [(material, faces)]. Without `normal` (a function of the position) faces are
        flat, and those of one material share the vertices where they meet."""
        primitives = [self.primitive(material, faces, normal) for material, faces in parts]
        self.json["meshes"].append({"name": name, "primitives": primitives})
        self.node(name=name, mesh=len(self.json["meshes"]) - 1, **place)

    def primitive(self, material, faces, normal):
        vertices = {}
        indices = []
        for face in faces:
            for corner in (corner for triangle in triangles(face) for corner in triangle):
                indices.append(vertices.setdefault(to_float32(corner), len(vertices)))
        attributes = {"POSITION": self.vectors(list(vertices), bounds=True)}
        if normal:
            attributes["NORMAL"] = self.vectors([to_float32(normal(vertex)) for vertex in vertices])
        letter, kind = ("H", 5123) if len(vertices) < 65536 else ("I", 5125)
        view = self.view(struct.pack(f"<{len(indices)}{letter}", *indices), 34963)
        accessor = self.accessor({"bufferView": view, "componentType": kind, "count": len(indices), "type": "SCALAR"})
        return {"attributes": attributes, "indices": accessor, "material": material}

    def vectors(self, vectors, bounds=False):
        view = self.view(b"".join(struct.pack("<3f", *vector) for vector in vectors), 34962)
        accessor = {"bufferView": view, "componentType": 5126, "count": len(vectors), "type": "VEC3"}
        if bounds:
            accessor["min"] = [min(axis) for axis in zip(*vectors)]
            accessor["max"] = [max(axis) for axis in zip(*vectors)]
        return self.accessor(accessor)

    def view(self, content, target):
        self.json["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(content), "target": target})
        self.bytes += content + b"\0" * (-len(content) % 4)
        return len(self.json["bufferViews"]) - 1

    def accessor(self, accessor):
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    def glb(self):
        text = json.dumps({**self.json, "buffers": [{"byteLength": len(self.bytes)}]}, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        chunks += struct.pack("<II", len(self.bytes), 0x004E4942) + self.bytes
        return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


# ---- The scenes ----

BLACK = (0, 0, 0)


def frame(outer, inner):
    """The four quadrilaterals between two rings of four points."""
    return [(outer[i - 1], outer[i], inner[i], inner[i - 1]) for i in range(4)]


def cornell_box():
    """https://www.graphics.cornell.edu/online/box/data.html, whose millimetres are kept as they are."""

    def metres(faces):
        return [tuple(tuple(x / 1000 for x in corner) for corner in face) for face in faces]

    floor = [((552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2))]
    light = [((343, 548.8, 227), (343, 548.8, 332), (213, 548.8, 332), (213, 548.8, 227))]
    ceiling = frame([(556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)], light[0])
    back = [((549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2))]
    right = [((0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2))]
    left = [((552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0))]

    def block(height, ring):
        bottom = [(x, 0, z) for x, z in ring]
        top = [(x, height, z) for x, z in ring]
        faces = flipped(hexahedron(bottom, top)[1:])
        centre = tuple(sum(axis) / 8 for axis in zip(*bottom, *top))
        assert not any(looks_at(face, centre) for face in faces)
        return metres(faces)

    assert all(looks_at(face, (278, 450, 100)) for face in floor + light + ceiling + back + right + left)

    gltf = Gltf()
    white = gltf.material("white", (0.725, 0.71, 0.68))
    red = gltf.material("red", (0.63, 0.065, 0.05))
    green = gltf.material("green", (0.14, 0.45, 0.091))
    lamp = gltf.material("light", (0.78, 0.78, 0.78), (17000, 12000, 4000))
    gltf.mesh("room", [(white, metres(floor + ceiling + back)), (red, metres(left)), (green, metres(right))])
    gltf.mesh("light", [(lamp, metres(light))])
    gltf.mesh("short block", [(white, block(165, [(130, 65), (82, 225), (240, 272), (290, 114)]))])
    gltf.mesh("tall block", [(white, block(330, [(423, 247), (265, 296), (314, 456), (472, 406)]))])
    # 25 mm of film behind 35 mm of focal length. A glTF camera looks along -z: half a turn makes it +z.
    gltf.json["cameras"] = [{"name": "camera", "type": "perspective",
                             "perspective": {"aspectRatio": 1, "yfov": round(2 * math.atan(12.5 / 35), 6), "znear": 0.01}}]
    gltf.node(name="camera", camera=0, translation=[0.278, 0.273, -0.8], rotation=[0, 1, 0, 0])
    return gltf


FURNACE = ("furnace", (0.5, 0.5, 0.5), (100, 100, 100))


def furnace_box():
    faces = flipped(box((0, 0, 0), (3, 2, 1)))
    assert is_closed(faces) and math.isclose(volume(faces), -6)
    gltf = Gltf()
    gltf.mesh("box", [(gltf.material(*FURNACE), faces)])
    return gltf


def tube():
    """A square tube of 200 × 1 × 1 m, lit by its end at x = 0."""
    faces = flipped(box((0, 0, 0), (200, 1, 1)))
    end = [face for face in faces if all(x == 0 for x, _, _ in face)]
    assert is_closed(faces) and len(end) == 1 and math.isclose(area(faces), 802)
    gltf = Gltf()
    gltf.mesh("tube", [(gltf.material("wall", (0.5, 0.5, 0.5)), [face for face in faces if face not in end]),
                       (gltf.material("end", (0.5, 0.5, 0.5), (100, 100, 100)), end)])
    return gltf


def furnace_sphere():
    """An icosahedron whose faces are divided in four, twice."""

    def unit(v):
        return tuple(x / math.sqrt(dot(v, v)) for x in v)

    golden = (1 + math.sqrt(5)) / 2
    corners = [unit(v) for a in (-1, 1) for b in (-golden, golden) for v in ((0, a, b), (a, b, 0), (b, 0, a))]
    edge = min(math.dist(corners[0], corner) for corner in corners[1:]) * 1.001
    faces = [(a, b, c) for a in corners for b in corners for c in corners
             if a < b and a < c and b != c and max(math.dist(a, b), math.dist(b, c), math.dist(c, a)) < edge
             and not looks_at((a, b, c), (0, 0, 0))]
    for _ in range(2):
        divided = []
        for a, b, c in faces:
            ab, bc, ca = (unit(tuple(x + y for x, y in zip(*ends))) for ends in ((a, b), (b, c), (c, a)))
            divided += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = divided
    faces = flipped(faces)
    assert len(faces) == 320 and is_closed(faces) and volume(faces) < 0
    gltf = Gltf()
    gltf.mesh("sphere", [(gltf.material(*FURNACE), faces)], normal=lambda p: tuple(-x for x in unit(p)))
    return gltf


LAMP = ("emitter", BLACK, (100, 100, 100))
RECEIVER = ("receiver", BLACK)
UNIT_FLOOR = [((-0.5, 0, -0.5), (-0.5, 0, 0.5), (0.5, 0, 0.5), (0.5, 0, -0.5))]
UNIT_CEILING = [((-0.5, 1, -0.5), (0.5, 1, -0.5), (0.5, 1, 0.5), (-0.5, 1, 0.5))]


def plates_parallel():
    assert looks_at(UNIT_FLOOR[0], (0, 1, 0)) and looks_at(UNIT_CEILING[0], (0, 0, 0))
    gltf = Gltf()
    gltf.mesh("emitter", [(gltf.material(*LAMP), UNIT_CEILING)])
    gltf.mesh("receiver", [(gltf.material(*RECEIVER), UNIT_FLOOR)])
    return gltf


def plates_perpendicular():
    wall = [((-0.5, 0, -0.5), (0.5, 0, -0.5), (0.5, 1, -0.5), (-0.5, 1, -0.5))]
    assert looks_at(wall[0], (0, 0, 0)) and looks_at(UNIT_FLOOR[0], (0, 1, 0))
    gltf = Gltf()
    gltf.mesh("emitter", [(gltf.material(*LAMP), wall)])
    gltf.mesh("receiver", [(gltf.material(*RECEIVER), UNIT_FLOOR)])
    return gltf


def plates_occluded():
    gltf = plates_parallel()
    half = 0.125
    blocker = [((-half, 0.5, -half), (-half, 0.5, half), (half, 0.5, half), (half, 0.5, -half))]
    gltf.mesh("blocker", [(gltf.material("blocker", BLACK, double_sided=True), blocker)])
    return gltf


def two_rooms():
    """Two rooms of 4 × 2.7 × 4 m, a wall 0.2 m thick between them, in it a doorway with a door 25° ajar."""
    depth, height, lintel = 4.0, 2.7, 2.0
    near, far = 2.6, 3.5  # the doorway, along z
    wall = (4.0, 4.2)     # the sides of the dividing wall, along x
    strips = [(0, near), (near, far), (far, depth)]

    def along_x(x0, x1):
        """Floor, ceiling and both long walls from x0 to x1."""
        faces = [((x0, 0, z0), (x0, 0, z1), (x1, 0, z1), (x1, 0, z0)) for z0, z1 in strips]
        faces += [((x0, height, z0), (x1, height, z0), (x1, height, z1), (x0, height, z1)) for z0, z1 in strips]
        faces += [((x0, 0, 0), (x1, 0, 0), (x1, height, 0), (x0, height, 0)),
                  ((x0, 0, depth), (x0, height, depth), (x1, height, depth), (x1, 0, depth))]
        return faces

    def facing_back(x, outline):
        """A face in the plane x whose front looks along -x; the outline is (z, y)."""
        return tuple((x, y, z) for z, y in outline)

    def end(x):
        return [facing_back(x, [(z0, 0), (z1, 0), (z1, height), (z0, height)]) for z0, z1 in strips]

    beside = [[(near, lintel), (far, lintel), (far, height), (near, height)],
              [(far, 0), (depth, 0), (depth, height), (far, lintel)],
              [(far, lintel), (depth, height), (far, height)]]
    plain = [[(0, 0), (near, 0), (near, lintel), (0, height)], [(near, lintel), (near, height), (0, height)]]
    panel = [(0.8, 1.2), (1.8, 1.2), (1.8, 2.0), (0.8, 2.0)]
    around = [[(0, 0), (near, 0), panel[1], panel[0]], [(near, 0), (near, lintel), panel[2], panel[1]],
              [(near, lintel), (near, height), panel[2]], [(near, height), (0, height), panel[3], panel[2]],
              [(0, height), (0, 0), panel[0], panel[3]]]

    a, b = wall
    light = [facing_back(a, panel)]
    first = along_x(0, a) + flipped(end(0)) + [facing_back(a, outline) for outline in beside + around]
    second = along_x(b, b + 4) + end(b + 4) + flipped([facing_back(b, outline) for outline in beside + plain])
    doorway = [((a, 0, near), (a, 0, far), (b, 0, far), (b, 0, near)),
               ((a, lintel, near), (b, lintel, near), (b, lintel, far), (a, lintel, far)),
               ((a, 0, near), (b, 0, near), (b, lintel, near), (a, lintel, near)),
               ((a, 0, far), (a, lintel, far), (b, lintel, far), (b, 0, far))]
    shell = light + first + second + doorway
    assert is_closed(shell)
    assert math.isclose(volume(shell), -(2 * 4 * depth * height + (b - a) * (far - near) * lintel))

    # The hinge is at the second room's side, the door turned into that room.
    angle = math.radians(25)

    def door_point(along, across, y):
        return (b + along * math.sin(angle) + across * math.cos(angle), y,
                near + 0.02 + along * math.cos(angle) - across * math.sin(angle))

    door_ring = [(0.01, -0.04), (0.01, 0), (0.88, 0), (0.88, -0.04)]
    door = hexahedron(*([door_point(*corner, y) for corner in door_ring] for y in (0.01, 1.99)))
    assert is_closed(door) and math.isclose(volume(door), 0.87 * 0.04 * 1.98)
    # Between the jambs, so it meets no wall; on the far side of the light's plane, as all of the second room.
    assert all(near < z < far and 0 < y < lintel and x > a for face in door for x, y, z in face)
    assert all(not looks_at(light[0], corner) for face in door + second + doorway for corner in face)

    gltf = Gltf()
    plaster = gltf.material("plaster", (0.7, 0.65, 0.6))
    lamp = gltf.material("light", (0.7, 0.65, 0.6), (2000, 2000, 2000))
    gltf.mesh("rooms", [(plaster, first + doorway + second)])
    gltf.mesh("light", [(lamp, light)])
    gltf.mesh("door", [(plaster, door)])
    assert math.isclose(area(shell + door), TWO_ROOMS_AREA, abs_tol=1e-4)
    return gltf


TWO_ROOMS_AREA = 151.6332  # m², as README.md states it


def three_lights():
    """A black floor of 4 × 4 m under a point light, a spot and a sun, each in a channel of its own."""
    gltf = Gltf()
    floor = [((-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2))]
    screen = [((-1.25, 0.5, -0.25), (-1.25, 0.5, 0.25), (-0.75, 0.5, 0.25), (-0.75, 0.5, -0.25))]
    assert looks_at(floor[0], (0, 1, 0))
    gltf.mesh("floor", [(gltf.material("floor", BLACK), floor)])
    gltf.mesh("screen", [(gltf.material("screen", BLACK, double_sided=True), screen)])
    gltf.light("bulb", "point", (1, 0, 0), 100, translation=[0, 1, 0])
    # Turned about x by -90°: -z becomes -y.
    gltf.light("spot", "spot", (0, 1, 0), 100, cones=(math.radians(20), math.radians(40)),
               translation=[0, 2, 1], rotation=[-math.sqrt(0.5), 0, 0, math.sqrt(0.5)])
    # -z becomes (1, -1, 0)/√2: about x by -90° first, then about z by 45°.
    half, eighth = math.sqrt(0.5), math.radians(22.5)
    gltf.light("sun", "directional", (0, 0, 1), 100,
               rotation=[-half * math.cos(eighth), -half * math.sin(eighth), half * math.sin(eighth), half * math.cos(eighth)])
    return gltf


def window_room():
    """A room of 4 × 2.7 × 3 m, in whose wall at x = 4 there is a square hole."""
    room = flipped(box((0, 0, 0), (4, 2.7, 3)))
    wall = [face for face in room if all(x == 4 for x, _, _ in face)]
    window = [(4, 0.9, 0.9), (4, 2.1, 0.9), (4, 2.1, 2.1), (4, 0.9, 2.1)]
    assert is_closed(room) and len(wall) == 1
    start = wall[0].index((4, 0, 0))
    ring = wall[0][start:] + wall[0][:start]
    hole = window if ring[1] == (4, 2.7, 0) else window[:1] + window[:0:-1]
    faces = [face for face in room if face not in wall] + frame(ring, hole)
    assert all(looks_at(face, (2, 1.35, 1.5)) for face in faces)
    assert math.isclose(area(faces), 2 * (4 * 2.7 + 4 * 3 + 2.7 * 3) - 1.2 * 1.2)
    gltf = Gltf()
    gltf.mesh("room", [(gltf.material("plaster", (0.5, 0.5, 0.5)), faces)])
    return gltf


SCENES = (cornell_box, furnace_box, furnace_sphere, plates_parallel, plates_perpendicular, plates_occluded, two_rooms,
          three_lights, window_room, tube)


def main():
    folder = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parent
    for scene in SCENES:
        (folder / (scene.__name__.replace("_", "-") + ".glb")).write_bytes(scene().glb())


if __name__ == "__main__":
    main()
