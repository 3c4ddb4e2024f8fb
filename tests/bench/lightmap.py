"""A lightmap of a scene: its charts, where their texels are, and the map as triangles, as a viewer interpolates it.

A face is a triangle of three points (x, y, z). Charts are made of faces that share edges and turn by little; each is
projected along the normal of its largest face and fills a rectangle of whole texels, so its lines keep their places
however it is scaled.
"""
import dataclasses
import math

CREASE = 0.9  # cosine of the angle at which a chart ends
SMALLEST = 2  # texels a side of a chart: of two rows and columns a triangle covers two centres at least
GAP = 1       # texels between charts
LONGEST = 8   # edges along which a chart may lie


def sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a):
    length = math.sqrt(dot(a, a))
    return (a[0] / length, a[1] / length, a[2] / length)


def normal(face):
    """As long as twice the area."""
    return cross(sub(face[1], face[0]), sub(face[2], face[0]))


@dataclasses.dataclass
class Chart:
    """`places`: of each of its faces, by number, the corners in texels from (0, 0) to `size`."""
    places: dict
    extent: tuple         # metres along u and v
    area: float           # of its projection, square metres
    size: tuple = (0, 0)  # texels along u and v
    origin: tuple = (0, 0)

    def scale(self, texels_per_metre):
        size = tuple(max(SMALLEST, math.ceil(length * texels_per_metre)) for length in self.extent)
        factor = [new / (old or length) for new, old, length in zip(size, self.size, self.extent)]
        self.places = {face: [(u * factor[0], v * factor[1]) for u, v in corners]
                       for face, corners in self.places.items()}
        self.size = size


def connected(faces, normals):
    """Lists of faces: each begins with the largest that is left and takes in what joins it without a crease."""
    at_edge = {}
    for f, face in enumerate(faces):
        for k in range(3):
            at_edge.setdefault((face[k], face[(k + 1) % 3]), f)
    left = dict.fromkeys(sorted(range(len(faces)), key=lambda f: -dot(normals[f], normals[f])))
    while left:
        first = next(iter(left))
        along = unit(normals[first])
        del left[first]
        chart = [first]
        for f in chart:
            for k in range(3):
                other = at_edge.get((faces[f][(k + 1) % 3], faces[f][k]))
                if other in left and dot(unit(normals[other]), along) > CREASE:
                    del left[other]
                    chart.append(other)
        yield chart


def outline(faces, numbers):
    """The vectors along the edges of these faces that no other of them shares, the longest first."""
    edges = {(faces[f][k], faces[f][(k + 1) % 3]) for f in numbers for k in range(3)}
    return sorted((sub(b, a) for a, b in edges if (b, a) not in edges), key=lambda edge: -dot(edge, edge))


def project(faces, numbers, along):
    """Along a unit vector, into the smallest rectangle that lies along one of the longest edges around: the smallest of
    all lies along one (Freeman and Shapira 1975), and charts have few long ones.
    """
    def lie(edge):
        u_axis = unit(cross(cross(along, edge), along))
        v_axis = cross(along, u_axis)
        flat = {f: [(dot(point, u_axis), dot(point, v_axis)) for point in faces[f]] for f in numbers}
        low, high = (tuple(choose(corner[axis] for corners in flat.values() for corner in corners) for axis in (0, 1))
                     for choose in (min, max))
        return flat, low, (high[0] - low[0], high[1] - low[1])

    flat, low, extent = min((lie(edge) for edge in outline(faces, numbers)[:LONGEST]), key=lambda at: math.prod(at[2]))
    places = {f: [(u - low[0], v - low[1]) for u, v in corners] for f, corners in flat.items()}
    return Chart(places, extent, sum(area(corners) for corners in places.values()))


def area(corners):
    """Of a triangle in the plane; positive if it turns to the left."""
    (ax, ay), (bx, by), (cx, cy) = corners
    return ((bx - ax) * (cy - ay) - (cx - ax) * (by - ay)) / 2


def unwrap(faces, texels):
    """Charts of faces that have an area, of about so many texels together, and the (width, height) of their map."""
    normals = [normal(face) for face in faces]
    charts = [project(faces, numbers, unit(normals[numbers[0]])) for numbers in connected(faces, normals)]

    def covered(texels_per_metre):
        return sum(chart.area / (chart.extent[0] * chart.extent[1]) *
                   math.prod(max(SMALLEST, math.ceil(length * texels_per_metre)) for length in chart.extent)
                   for chart in charts)

    low = high = math.sqrt(texels / sum(chart.area for chart in charts))
    while low > 1e-3 * high and covered(low) > texels:
        low /= 2
    for _ in range(30):
        middle = (low + high) / 2
        low, high = (middle, high) if covered(middle) <= texels else (low, middle)
    for chart in charts:
        chart.scale(low)
    return charts, pack(charts)


def pack(charts):
    """On shelves, the highest first; how wide and high they are together."""
    charts = sorted(charts, key=lambda chart: (-chart.size[1], -chart.size[0]))
    width = max([math.ceil(math.sqrt(sum((chart.size[0] + GAP) * (chart.size[1] + GAP) for chart in charts)))] +
                [chart.size[0] + 2 * GAP for chart in charts])
    x = y = GAP
    shelf = 0
    for chart in charts:
        if x + chart.size[0] + GAP > width:
            x, y, shelf = GAP, y + shelf + GAP, 0
        chart.origin = (x, y)
        x += chart.size[0] + GAP
        shelf = max(shelf, chart.size[1])
    return width, y + shelf + GAP


def filled(values, width, height):
    """Texels without a value take the mean of their neighbours that have one, again and again; None if none has."""
    left = [k for k, value in enumerate(values) if value is None]
    if len(left) == len(values):
        return None
    values = list(values)
    while left:
        found = {}
        for k in left:
            x, y = k % width, k // width
            around = [values[j * width + i] for j in range(max(0, y - 1), min(height, y + 2))
                      for i in range(max(0, x - 1), min(width, x + 2)) if values[j * width + i] is not None]
            if around:
                found[k] = tuple(sum(channel) / len(around) for channel in zip(*around))
        for k, value in found.items():
            values[k] = value
        left = [k for k in left if k not in found]
    return values


def clip(polygon, triangle):
    """Sutherland and Hodgman 1974: the part of a convex polygon in the plane that is inside a triangle, turned left."""
    for k in range(3):
        (ax, ay), (bx, by) = triangle[k], triangle[(k + 1) % 3]
        sides = [(bx - ax) * (y - ay) - (x - ax) * (by - ay) for x, y in polygon]
        if min(sides) >= 0:
            continue
        kept = []
        for i, (point, side) in enumerate(zip(polygon, sides)):
            before, side_before = polygon[i - 1], sides[i - 1]
            if (side < 0) != (side_before < 0):
                t = side_before / (side_before - side)
                kept.append((before[0] + t * (point[0] - before[0]), before[1] + t * (point[1] - before[1])))
            if side >= 0:
                kept.append(point)
        if len(kept) < 3:
            return []
        polygon = kept
    return polygon


def triangles(faces, charts, texel):
    """Yields ((point, value), …), three a triangle: each chart's texel centres and the triangles between them, cut to
    its faces. `texel(x, y)`: the value (r, g, b) of a texel of the map, or None; beyond the outermost centres it stays.
    A chart without any value is left out.
    """
    for chart in charts:
        width, height = chart.size
        values = filled([texel(chart.origin[0] + i, chart.origin[1] + j) for j in range(height) for i in range(width)],
                        width, height)
        if values is None:
            continue
        # Lines of the grid: the chart's edge, the centres, the chart's edge.
        lines = [[0, *(i + 0.5 for i in range(count)), count] for count in chart.size]

        def value(i, j):
            return values[min(max(j - 1, 0), height - 1) * width + min(max(i - 1, 0), width - 1)]

        for f, corners in chart.places.items():
            yield from cut(faces[f], corners, lines, value)


def cut(face, corners, lines, value):
    """The triangles of the grid of `lines` that lie in one face."""
    first = [max(0, math.floor(min(c[axis] for c in corners) - 0.5)) for axis in (0, 1)]
    last = [min(len(lines[axis]) - 2, math.floor(max(c[axis] for c in corners) + 0.5)) for axis in (0, 1)]
    (ax, ay), (bx, by), (cx, cy) = corners
    twice = 2 * area(corners)
    sides = sub(face[1], face[0]), sub(face[2], face[0])

    def in_space(u, v):
        s = ((u - ax) * (cy - ay) - (cx - ax) * (v - ay)) / twice
        t = ((bx - ax) * (v - ay) - (u - ax) * (by - ay)) / twice
        return tuple(face[0][axis] + s * sides[0][axis] + t * sides[1][axis] for axis in range(3))

    for j in range(first[1], last[1] + 1):
        for i in range(first[0], last[0] + 1):
            square = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            for half in ((0, 1, 2), (0, 2, 3)):
                nodes = [square[k] for k in half]
                own = [(lines[0][a], lines[1][b]) for a, b in nodes]
                known = [value(a, b) for a, b in nodes]
                polygon = clip(own, corners)
                if len(polygon) < 3:
                    continue
                points = [(in_space(*point), known[own.index(point)] if point in own else between(own, known, point))
                          for point in polygon]
                for k in range(1, len(points) - 1):
                    yield points[0], points[k], points[k + 1]


def between(corners, values, point):
    """Linear over a triangle in the plane."""
    whole = area(corners)
    weights = [area([point, corners[1], corners[2]]) / whole, area([corners[0], point, corners[2]]) / whole]
    weights.append(1 - sum(weights))
    return tuple(sum(w * value[channel] for w, value in zip(weights, values)) for channel in range(3))
