"""Run by CTest: lightmap_test.py."""
import math
import unittest

import lightmap


def grid_of(shape, count):
    """Two triangles for each cell of [0, 1]², whose corners `shape(s, t)` places in space."""
    faces = []
    for i in range(count):
        for j in range(count):
            a, b, c, d = (shape((i + di) / count, (j + dj) / count) for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)))
            faces += [(a, b, c), (a, c, d)]
    return faces


def area(triangle):
    return math.hypot(*lightmap.normal(triangle)) / 2


def texel_centres(chart):
    return [(i + 0.5, j + 0.5) for j in range(chart.size[1]) for i in range(chart.size[0])]


def covers(corners, point):
    return all(lightmap.area([corners[k], corners[(k + 1) % 3], point]) >= 0 for k in range(3))


TILTED = grid_of(lambda s, t: (1 + 2 * s, 3 * t, 0.5 * s), 2)
SMALL = [((0, 5, 0), (0.01, 5, 0), (0.003, 5.004, 0))]
CORNER = grid_of(lambda s, t: (s, 0, -t), 1) + grid_of(lambda s, t: (s, t, -1), 1)


class Charts(unittest.TestCase):
    def test_hold_every_face_once(self):
        faces = TILTED + SMALL + CORNER
        charts, _ = lightmap.unwrap(faces, 1000)
        self.assertEqual(sorted(f for chart in charts for f in chart.places), list(range(len(faces))))

    def test_end_at_a_crease_and_at_nothing_else(self):
        charts, _ = lightmap.unwrap(TILTED + CORNER, 1000)
        self.assertEqual(sorted(len(chart.places) for chart in charts), [2, 2, 8])

    def test_do_not_overlap_in_the_map(self):
        charts, (width, height) = lightmap.unwrap(TILTED + SMALL + CORNER, 1000)
        taken = set()
        for chart in charts:
            x, y = chart.origin
            texels = {(x + i, y + j) for i in range(chart.size[0]) for j in range(chart.size[1])}
            self.assertFalse(taken & texels)
            self.assertTrue(0 <= x and x + chart.size[0] <= width and 0 <= y and y + chart.size[1] <= height)
            taken |= texels

    def test_have_about_as_many_texels_as_were_asked_for(self):
        for wanted in (1000, 20000):
            charts, _ = lightmap.unwrap(TILTED + CORNER, wanted)
            self.assertAlmostEqual(sum(math.prod(chart.size) for chart in charts) / wanted, 1, delta=0.1)

    def test_cover_a_texel_centre_however_small_they_are(self):
        charts, _ = lightmap.unwrap(TILTED + SMALL, 1000)
        small = min(charts, key=lambda chart: chart.area)
        self.assertTrue(any(covers(corners, centre) for corners in small.places.values()
                            for centre in texel_centres(small)))


class Triangles(unittest.TestCase):
    def bake(self, faces, texels, value):
        """As triangles, what `value(point)` is at the texels whose centre a face covers; elsewhere there is none."""
        charts, _ = lightmap.unwrap(faces, texels)
        found = {}
        for chart in charts:
            for centre in texel_centres(chart):
                for f, corners in chart.places.items():
                    if covers(corners, centre):
                        whole = lightmap.area(corners)
                        weights = [lightmap.area([centre if k == n else corners[k] for k in range(3)]) / whole
                                   for n in range(3)]
                        point = [sum(w * p[axis] for w, p in zip(weights, faces[f])) for axis in range(3)]
                        place = tuple(int(o + c) for o, c in zip(chart.origin, centre))
                        found[place] = value(point)
        return list(lightmap.triangles(faces, charts, lambda x, y: found.get((x, y))))

    def test_cover_the_faces_once(self):
        faces = TILTED + SMALL + CORNER
        triangles = self.bake(faces, 1000, lambda point: (1, 1, 1))
        self.assertAlmostEqual(sum(area([point for point, _ in triangle]) for triangle in triangles),
                               sum(area(face) for face in faces), places=9)
        for triangle in triangles:
            self.assertEqual([value for _, value in triangle], [(1, 1, 1)] * 3)

    def test_turn_as_the_faces_do(self):
        for triangle in self.bake(TILTED, 100, lambda point: (1, 1, 1)):
            normal = lightmap.normal([point for point, _ in triangle])
            self.assertGreater(lightmap.dot(normal, lightmap.normal(TILTED[0])), -1e-12)

    def test_are_linear_between_texel_centres_and_constant_beyond_the_last(self):
        side = 50
        faces = grid_of(lambda s, t: (s, t, 0), 1)
        triangles = self.bake(faces, side * side, lambda point: (point[0], point[1], 0))
        for triangle in triangles:
            for point, value in triangle:
                for axis in (0, 1):
                    inside = min(max(point[axis], 0.5 / side), 1 - 0.5 / side)
                    self.assertAlmostEqual(value[axis], inside, places=9)

    def test_lack_a_chart_that_has_no_texel(self):
        charts, _ = lightmap.unwrap(CORNER, 100)
        x, y = charts[0].origin
        first = {(x + i, y + j) for i in range(charts[0].size[0]) for j in range(charts[0].size[1])}
        triangles = lightmap.triangles(CORNER, charts, lambda x, y: None if (x, y) in first else (1, 1, 1))
        self.assertAlmostEqual(sum(area([point for point, _ in triangle]) for triangle in triangles), 1, places=9)


if __name__ == "__main__":
    unittest.main()
