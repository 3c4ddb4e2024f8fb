#!/usr/bin/env python3
"""Writes a furnished room of about so many triangles: make_room.py TRIANGLES FILE.glb (4,000 to 2,000,000).

The same room, light and furniture at every size. As a scene grows, it gets both more objects and finer ones: their
number and the triangles of each grow as the square root of TRIANGLES; 600 objects at 100,000. The same bytes on every
run. README.md beside this file says what is in it.
"""

import math
import pathlib
import random
import sys

from make_scenes import Gltf, area, box, cross, flipped, is_closed, sub, to_float32, triangles, volume

WIDTH, HEIGHT, DEPTH = 8.0, 2.8, 6.0  # x, y, z
PANEL = (5000, 4600, 4000)            # cd/m²
WINDOW = (1200, 1400, 1600)
OBJECTS = 600                         # at so many triangles:
TRIANGLES = 100_000

# ---- Shapes: faces, fronts outward; round ones with the normal at each point. ----


def grid(origin, across, up, columns, rows, without=()):
    """Rectangles between the columns (along x or z: `across`) and rows; `without`: the cells that are left out."""
    faces = {}
    for i in range(len(columns) - 1):
        for j in range(len(rows) - 1):
            corners = [(columns[i], rows[j]), (columns[i + 1], rows[j]), (columns[i + 1], rows[j + 1]),
                       (columns[i], rows[j + 1])]
            faces[i, j] = tuple(tuple(o + a * u + b * v for o, a, b in zip(origin, across, up)) for u, v in corners)
    return [face for cell, face in faces.items() if cell not in without], [faces[cell] for cell in without]


def revolved(profile, sides):
    """A closed body around the y axis; profile: (radius, height) from the axis to the axis, upwards or outwards."""
    def ring(radius, height):
        if radius == 0:
            return [(0.0, height, 0.0)] * sides
        return [(radius * math.sin(2 * math.pi * k / sides), height, radius * math.cos(2 * math.pi * k / sides))
                for k in range(sides)]

    rings = [[to_float32(point) for point in ring(*place)] for place in profile]
    faces = []
    for low, high in zip(rings, rings[1:]):
        for k in range(sides):
            corners = [low[k - 1], low[k], high[k], high[k - 1]]
            faces.append(tuple(dict.fromkeys(corners)))
    return faces


def smooth(faces):
    """Normals of a body without creases, by area of the faces around each point."""
    sums = {}
    for face in faces:
        for a, b, c in triangles(face):
            normal = cross(sub(b, a), sub(c, a))
            for corner in (a, b, c):
                sums[corner] = tuple(x + y for x, y in zip(sums.get(corner, (0, 0, 0)), normal))
    return {point: tuple(x / math.hypot(*normal) for x in normal) for point, normal in sums.items()}


def ball(radius, steps):
    """Stands on y = 0."""
    return [(radius * math.sin(math.pi * k / steps) if 0 < k < steps else 0,
             radius * (1 - math.cos(math.pi * k / steps))) for k in range(steps + 1)]


def vase(radius, steps):
    """A belly, a neck and a lip, closed at the top."""
    def at(t):
        return radius * (0.45 + 0.55 * math.sin(math.pi * min(1, 1.25 * t)) ** 2 * (1 - 0.3 * t) + 0.25 * t ** 4)

    last = steps - 2
    return [(0, 0)] + [(at(k / last), 3 * radius * k / last) for k in range(last + 1)] + [(0, 3 * radius)]


def cushion(radius, steps):
    """Flat and full: a superellipse of the fourth degree."""
    def root(x):
        return math.copysign(math.sqrt(abs(x)), x)

    return [(radius * root(math.sin(math.pi * k / steps)) if 0 < k < steps else 0,
             0.3 * radius * (1 - root(math.cos(math.pi * k / steps)))) for k in range(steps + 1)]


def lamp(radius, steps):
    """A foot, a stem and a shade; it does not shine."""
    def at(t):
        foot = 0.7 * max(0, 1 - (t / 0.15) ** 2)
        shade = 1 - 0.5 * (t - 0.55) / 0.45 if t > 0.55 else max(0, 1 - (0.55 - t) / 0.05)
        return radius * max(0.12, foot, shade)

    last = steps - 2
    return [(0, 0)] + [(at(k / last), 3.5 * radius * k / last) for k in range(last + 1)] + [(0, 3.5 * radius)]


ROUND = (vase, ball, cushion, lamp)

# ---- Furniture: boxes, as (low, high), around a middle on the floor ----


def table():
    legs = [box((x - 0.03, 0, z - 0.03), (x + 0.03, 0.71, z + 0.03)) for x in (-0.8, 0.8) for z in (-0.35, 0.35)]
    return sum(legs, box((-0.9, 0.71, -0.45), (0.9, 0.75, 0.45)))


def chair():
    legs = [box((x - 0.02, 0, z - 0.02), (x + 0.02, 0.43, z + 0.02)) for x in (-0.18, 0.18) for z in (-0.18, 0.18)]
    back = box((-0.2, 0.46, 0.17), (0.2, 0.9, 0.2))
    return sum(legs, box((-0.2, 0.43, -0.2), (0.2, 0.46, 0.2)) + back)


BOARDS = 6
BOARD_GAP = 0.36
SHELF_WIDTH, SHELF_DEPTH, SHELF_HEIGHT = 1.2, 0.26, 2.2


def shelf():
    half = SHELF_WIDTH / 2
    sides = box((-half - 0.02, 0, 0), (-half, SHELF_HEIGHT, SHELF_DEPTH)) + box((half, 0, 0),
                                                                             (half + 0.02, SHELF_HEIGHT, SHELF_DEPTH))
    return sum((box((-half, y, 0.01), (half, y + 0.02, SHELF_DEPTH)) for y in board_heights()), sides)


def board_heights():
    return [0.08 + BOARD_GAP * k for k in range(BOARDS)]


def sofa():
    return (box((-0.9, 0.12, -0.4), (0.9, 0.42, 0.3)) + box((-0.9, 0.12, 0.3), (0.9, 0.85, 0.5)) +
            box((-1.05, 0, -0.4), (-0.9, 0.6, 0.5)) + box((0.9, 0, -0.4), (1.05, 0.6, 0.5)))


TABLES = [(2.0, 1.9), (4.4, 3.2), (6.2, 4.6)]  # x, z
SHELVES = [(0.9 + 1.3 * k, 0.02) for k in range(5)]
SOFA = (1.5, 5.3)


def spread(places):
    """In an order of which every beginning lies evenly among all: that of van der Corput."""
    def reversed_bits(k):
        return int(f"{k:016b}"[::-1], 2)

    return [places[k] for k in sorted(range(len(places)), key=reversed_bits)]


def places_for_round_things():
    """(x, y, z, largest radius) on the tables, the floor and the shelves' tops, none in another's way."""
    places = []
    for x, z in TABLES:
        places += [(x + 0.14 * i, 0.75, z + 0.14 * j, 0.06) for i in range(-6, 7) for j in range(-3, 4)]
    for x, z in SHELVES:
        top = board_heights()[-1] + 0.02
        places += [(x - 0.52 + 0.13 * i, top, z + 0.13, 0.055) for i in range(9)]
    places += [(SOFA[0] - 0.7 + 0.35 * i, 0.42, SOFA[1] - 0.15, 0.16) for i in range(5)]

    def is_free(x, z):
        near_table = any(abs(x - a) < 1.3 and abs(z - b) < 0.95 for a, b in TABLES)
        return not near_table and not (abs(x - SOFA[0]) < 1.3 and abs(z - SOFA[1]) < 0.75) and z > 0.5

    floor = [(0.2 + 0.22 * i, 0.3 + 0.22 * j) for i in range(35) for j in range(26)]
    return places + [(x, 0, z, 0.1) for x, z in floor if is_free(x, z)]


# ---- The room ----


def shell(gltf, materials):
    """Walls, floor and ceiling, whose rectangles meet corner to corner; the panels and the window are among them."""
    x = [0, 2, 2.6, 5.4, 6, WIDTH]
    y = [0, 0.9, 2.1, HEIGHT]
    z = [0, 1.4, 2.0, 4.0, 4.6, DEPTH]
    floor, _ = grid((0, 0, 0), (0, 0, 1), (1, 0, 0), z, x)
    ceiling, panels = grid((0, HEIGHT, 0), (1, 0, 0), (0, 0, 1), x, z, [(1, 1), (1, 3), (3, 1), (3, 3)])
    back, _ = grid((0, 0, 0), (1, 0, 0), (0, 1, 0), x, y)
    front, _ = grid((0, 0, DEPTH), (0, 1, 0), (1, 0, 0), y, x)
    left, _ = grid((0, 0, 0), (0, 1, 0), (0, 0, 1), y, z)
    right, window = grid((WIDTH, 0, 0), (0, 0, 1), (0, 1, 0), z, y, [(2, 1)])
    faces = floor + ceiling + panels + back + front + left + right + window
    assert is_closed(faces) and math.isclose(volume(faces), -WIDTH * HEIGHT * DEPTH)
    assert math.isclose(area(panels), 4 * 0.36) and math.isclose(area(window), 2.4)
    gltf.mesh("room", [(materials["plaster"], ceiling + back + front + left + right), (materials["oak"], floor)])
    gltf.mesh("panels", [(gltf.material("panel", (0.8, 0.8, 0.8), PANEL), panels)])
    gltf.mesh("window", [(gltf.material("window", (0.2, 0.2, 0.2), WINDOW), window)])


def turned(degrees):
    half = math.radians(degrees) / 2
    return [0, round(math.sin(half), 6), 0, round(math.cos(half), 6)]


def furnish(gltf, materials):
    for k, (x, z) in enumerate(TABLES):
        gltf.mesh(f"table {k}", [(materials["oak"], table())], translation=[x, 0, z])
        for i, (dx, dz, turn) in enumerate([(-0.45, 0.6, 4), (0.45, 0.62, -7), (-0.5, -0.6, 176), (0.4, -0.63, 190)]):
            gltf.mesh(f"chair {k}.{i}", [(materials["walnut"], chair())], translation=[x + dx, 0, z + dz],
                      rotation=turned(turn))
    for k, (x, z) in enumerate(SHELVES):
        gltf.mesh(f"shelf {k}", [(materials["walnut"], shelf())], translation=[x, 0, z])
    gltf.mesh("sofa", [(materials["cloth"], sofa())], translation=[SOFA[0], 0, SOFA[1]])


def books(gltf, colours, count, dice):
    """In as many places as there are, side by side on the boards, evenly over all boards."""
    boards = [(x, y + 0.02, z) for x, z in SHELVES for y in board_heights()[:-1]]
    left = count
    for k, (x, y, z) in enumerate(spread(boards)):
        here = round(left / (len(boards) - k))
        left -= here
        pitch = SHELF_WIDTH / max(here, 20)
        for i in range(here):
            high, deep = dice.uniform(0.18, 0.3), dice.uniform(0.14, 0.2)
            wide = pitch * dice.uniform(0.75, 0.96)
            gltf.mesh(f"book {k}.{i}", [(dice.choice(colours), box((0, 0, 0), (wide, high, deep)))],
                      translation=[x - SHELF_WIDTH / 2 + i * pitch, y, z + 0.01])


def round_things(gltf, colours, count, budget, dice):
    """With `budget` triangles together, most of them on the largest."""
    places = spread(places_for_round_things())[:count]
    kinds = [(cushion if place[3] > 0.15 else dice.choice(ROUND), place[3] * dice.uniform(0.6, 1)) for place in places]
    whole = sum(size for _, size in kinds)
    used = 0
    planned = 0.0
    for k, ((x, y, z, _), (kind, size)) in enumerate(zip(places, kinds)):
        planned += budget * size / whole
        # 2·n sides of n steps are 4·n² − 4·n triangles, for at both ends they meet.
        steps = max(3, round(0.5 + math.sqrt(0.25 + max(0, planned - used) / 4)))
        faces = revolved(kind(size, steps), 2 * steps)
        used += 4 * steps * (steps - 1)
        normals = smooth(faces)
        gltf.mesh(f"{kind.__name__} {k}", [(dice.choice(colours), faces)], normal=normals.__getitem__,
                  translation=[round(x, 3), round(y, 3), round(z, 3)])
    return used


def furnished_room(target):
    dice = random.Random(1)
    gltf = Gltf()
    materials = {"plaster": gltf.material("plaster", (0.75, 0.74, 0.7)), "oak": gltf.material("oak", (0.5, 0.36, 0.22)),
                 "walnut": gltf.material("walnut", (0.3, 0.2, 0.13)), "cloth": gltf.material("cloth", (0.3, 0.36, 0.42))}
    colours = [gltf.material(f"colour {k}", tuple(round(dice.uniform(0.1, 0.75), 2) for _ in range(3)))
               for k in range(12)]
    shell(gltf, materials)
    furnish(gltf, materials)
    objects = OBJECTS * math.sqrt(target / TRIANGLES) - len(gltf.json["nodes"])
    book_count = round(0.55 * objects)
    books(gltf, colours, book_count, dice)
    round_things(gltf, colours, round(objects) - book_count, target - count_triangles(gltf), dice)
    return gltf


def count_triangles(gltf):
    return sum(gltf.json["accessors"][primitive["indices"]]["count"] // 3 for mesh in gltf.json["meshes"]
               for primitive in mesh["primitives"])


def main():
    if len(sys.argv) != 3 or not sys.argv[1].isdigit() or not 4_000 <= int(sys.argv[1]) <= 2_000_000:
        sys.exit(__doc__)
    gltf = furnished_room(int(sys.argv[1]))
    pathlib.Path(sys.argv[2]).write_bytes(gltf.glb())
    print(f"{count_triangles(gltf)} triangles in {len(gltf.json['nodes'])} objects")


if __name__ == "__main__":
    main()
