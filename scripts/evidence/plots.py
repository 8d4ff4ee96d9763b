"""Plots on logarithmic axes as SVG. Python's standard library only."""
import html
import math

WIDTH, HEIGHT = 760, 460
LEFT, RIGHT, TOP, BOTTOM = 70, 200, 20, 50
COLOURS = ("#1b9e77", "#d95f02", "#7570b3", "#e7298a", "#66a61e", "#e6ab02", "#a6761d", "#386cb0", "#f0027f", "#bf5b17", "#444444", "#80b1d3")


class Axis:
    """A logarithmic axis over whole decades."""

    def __init__(self, values, begin, end):
        self.low, self.high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
        self.high = max(self.high, self.low + 1)
        self.begin, self.end = begin, end

    def at(self, value):
        return self.begin + (math.log10(value) - self.low) / (self.high - self.low) * (self.end - self.begin)

    def decades(self):
        return [10.0**k for k in range(self.low, self.high + 1)]


def log_log(series, x_label, y_label, asked=None):
    """SVG of curves, one colour each.

    series: {name: [(x, y), ...]}, each drawn in its order, without points that are not positive
    asked: {name: [x, ...]}, by points: a dashed line leads from the point to it
    @raise ValueError: no point is positive
    """
    asked = asked or {}
    series = {name: [point for point in curve if min(point) > 0.0] for name, curve in series.items()}
    points = [point for curve in series.values() for point in curve]
    x = Axis([a for a, _ in points] + [a for values in asked.values() for a in values], LEFT, WIDTH - RIGHT)
    y = Axis([b for _, b in points], HEIGHT - BOTTOM, TOP)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" font-family="sans-serif" font-size="12">',
           f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>']
    for value in x.decades():
        out.append(f'<path d="M{x.at(value):.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#ddd"/>'
                   f'<text x="{x.at(value):.1f}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">{value:g}</text>')
    for value in y.decades():
        out.append(f'<path d="M{LEFT} {y.at(value):.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>'
                   f'<text x="{LEFT - 8}" y="{y.at(value) + 4:.1f}" text-anchor="end">{value:g}</text>')
    for k, (name, curve) in enumerate(series.items()):
        colour = COLOURS[k % len(COLOURS)]
        places = [(x.at(a), y.at(b)) for a, b in curve]
        out.append(f'<polyline points="{" ".join(f"{a:.1f},{b:.1f}" for a, b in places)}" fill="none" stroke="{colour}"/>')
        out += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3.5" fill="{colour}"/>' for a, b in places]
        out += [f'<path d="M{a:.1f} {b:.1f}H{x.at(value):.1f}" stroke="{colour}" stroke-dasharray="2 3" stroke-width="0.7"/>'
                for (a, b), value in zip(places, asked.get(name, ()))]
        out.append(f'<text x="{WIDTH - RIGHT + 12}" y="{TOP + 16 + 18 * k}" fill="{colour}">{html.escape(name)}</text>')
    out.append(f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 10}" text-anchor="middle">{html.escape(x_label)}</text>')
    out.append(f'<text transform="translate(16 {(TOP + HEIGHT - BOTTOM) / 2}) rotate(-90)" text-anchor="middle">{html.escape(y_label)}</text></svg>')
    return "\n".join(out) + "\n"


def exponent(curve):
    """Slope of the line of least squares through log y over log x, of points that are positive; at least two different x."""
    points = [(math.log(a), math.log(b)) for a, b in curve if a > 0.0 and b > 0.0]
    mean_x, mean_y = (sum(values) / len(points) for values in zip(*points))
    return sum((a - mean_x) * (b - mean_y) for a, b in points) / sum((a - mean_x) ** 2 for a, _ in points)
