"""Differences of pictures. Python's standard library only."""
import math
import struct
import zlib


def read_png(path):
    """(width, height, channels, bytes of all rows) of a PNG of 8 bits without interlace."""
    data = path.read_bytes()
    at, header, packed = 8, None, b""
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        header = struct.unpack(">IIBBBBB", body) if kind == b"IHDR" else header
        packed += body if kind == b"IDAT" else b""
        at += 12 + size
    width, height, depth, colour, _, _, interlace = header
    channels = {0: 1, 2: 3, 6: 4}.get(colour)
    if depth != 8 or interlace or not channels:
        raise ValueError(f"{path}: expected a PNG of 8 bits without palette and interlace")
    return width, height, channels, unfiltered(zlib.decompress(packed), height, width * channels, channels)


def unfiltered(rows, height, length, step):
    """Undoes the filters of rows (PNG specification, 9.2)."""
    out, before = bytearray(), bytearray(length)
    for y in range(height):
        kind, line = rows[y * (length + 1)], bytearray(rows[y * (length + 1) + 1:(y + 1) * (length + 1)])
        for i in range(length if kind else 0):
            left, up, corner = line[i - step] if i >= step else 0, before[i], before[i - step] if i >= step else 0
            line[i] = (line[i] + (left, up, (left + up) // 2, paeth(left, up, corner))[kind - 1]) & 255
        out += line
        before = line
    return bytes(out)


def paeth(left, up, corner):
    guess = left + up - corner
    return min((abs(guess - left), 0, left), (abs(guess - up), 1, up), (abs(guess - corner), 2, corner))[2]


def rms(one, other):
    """Root mean square of the differences of two pictures, over the full range."""
    a, b = read_png(one), read_png(other)
    if a[:3] != b[:3]:
        raise ValueError(f"{one} and {other} differ in size")
    return math.sqrt(sum((x - y) ** 2 for x, y in zip(a[3], b[3])) / len(a[3])) / 255.0
