"""Plots of curves on two logarithmic axes, as SVG."""
import math
from xml.sax.saxutils import escape

WIDTH, HEIGHT = 680, 420
LEFT, RIGHT, TOP, BOTTOM = 70, 230, 36, 50
COLOURS = ("#1b6ca8", "#c8553d", "#4c956c", "#8e5ea2", "#b08900", "#d17ba5", "#222222", "#7f8c8d")


def ticks(low, high):
    """1, 2 and 5 of each power of ten between, without the 2s and 5s where that would be too many."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    digits = (1, 2, 5) if len(powers) <= 4 else (1,)
    return [digit * 10.0**power for power in powers for digit in digits if low <= digit * 10.0**power <= high]


def name_of(value):
    for unit, suffix in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if value >= unit:
            return f"{value / unit:g}{suffix}"
    return f"{value:g}"


def log_plot(title, x_label, y_label, curves):
    """`curves`: name to a list of (x, y); points that are not above 0 are left out."""
    curves = {name: [(x, y) for x, y in points if x > 0 and y > 0] for name, points in curves.items()}
    xs = [x for points in curves.values() for x, _ in points]
    ys = [y for points in curves.values() for _, y in points]
    if not xs:
        xs = ys = [1, 10]
    x_range, y_range = ((min(v) / 1.2, max(v) * 1.2) for v in (xs, ys))

    def place(value, span, begin, end):
        return begin + (end - begin) * math.log(value / span[0]) / math.log(span[1] / span[0])

    def at(x, y):
        return place(x, x_range, LEFT, WIDTH - RIGHT), place(y, y_range, HEIGHT - BOTTOM, TOP)

    svg = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
           f'font-size="12"><rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
           f'<text x="{LEFT}" y="20" font-size="14">{escape(title)}</text>']
    for x in ticks(*x_range):
        u = at(x, y_range[0])[0]
        svg.append(f'<path d="M{u:.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#ddd"/>'
                   f'<text x="{u:.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{name_of(x)}</text>')
    for y in ticks(*y_range):
        v = at(x_range[0], y)[1]
        svg.append(f'<path d="M{LEFT} {v:.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>'
                   f'<text x="{LEFT - 6}" y="{v + 4:.1f}" text-anchor="end">{name_of(y)}</text>')
    svg.append(f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 12}" text-anchor="middle">{escape(x_label)}</text>'
               f'<text transform="translate(16 {(TOP + HEIGHT - BOTTOM) / 2}) rotate(-90)" text-anchor="middle">'
               f'{escape(y_label)}</text>')
    for k, (name, points) in enumerate(curves.items()):
        colour = COLOURS[k % len(COLOURS)]
        places = [at(x, y) for x, y in points]
        svg.append('<polyline fill="none" stroke-width="2" stroke="{}" points="{}"/>'.format(
            colour, " ".join(f"{u:.1f},{v:.1f}" for u, v in places)))
        svg += [f'<circle cx="{u:.1f}" cy="{v:.1f}" r="3" fill="{colour}"/>' for u, v in places]
        row = TOP + 16 + 20 * k
        svg.append(f'<rect x="{WIDTH - RIGHT + 14}" y="{row - 9}" width="12" height="4" fill="{colour}"/>'
                   f'<text x="{WIDTH - RIGHT + 32}" y="{row - 3}" font-size="11">{escape(name)}</text>')
    return "\n".join(svg + ["</svg>", ""])
