"""Reads pages of `supple view` by the description in scenes/viewer/README.md, independently of the page's own script."""
import base64
import json
import re
import struct
import zlib

import numpy as np


def _values(data, at, count, width, stride):
    planes = np.frombuffer(data, np.uint8, count * width, at).reshape(width, count).astype(np.int64)
    folded = sum(plane << (8 * k) for k, plane in enumerate(planes))
    difference = np.where(folded % 2 == 1, -(folded + 1) // 2, folded // 2)
    out = np.zeros(count, np.int64)
    for first in range(min(stride, count)):
        out[first::stride] = np.cumsum(difference[first::stride])
    return out, at + count * width


def _width(count):
    return 1 if 2 * count <= 0x100 else 2 if 2 * count <= 0x10000 else 3 if 2 * count <= 0x1000000 else 4


def _grid(entry, nodes):
    return np.array(entry["origin"]) + entry["step"] * nodes.reshape(-1, 3)


def _mesh(entry, data, at, before):
    if entry.get("kept"):
        return before, at
    n = entry["vertices"]
    mesh = {"step": entry.get("step", 0.0)}
    nodes, at = _values(data, at, 3 * n, 2, 3)
    mesh["position"] = _grid(entry, nodes)
    mesh["normal"], at = _values(data, at, 2 * n, 2, 2)
    mesh["pressure"] = np.zeros(n)
    if "pressure" in entry:
        shares, at = _values(data, at, n, 2, 1)
        mesh["pressure"] = shares / 255 * entry["pressure"]
    if "triangles" in entry:
        corners, at = _values(data, at, 3 * entry["triangles"], _width(n), 1)
        mesh["triangle"] = corners.reshape(-1, 3)
    else:
        mesh["triangle"] = before["triangle"] if before else np.zeros((0, 3), np.int64)
    return mesh, at


def read_frame(compressed, before=None):
    data = zlib.decompress(compressed)
    length = struct.unpack_from("<I", data)[0]
    frame = json.loads(data[4:4 + length])
    at = 4 + length
    meshes = []
    for i, entry in enumerate(frame["meshes"]):
        mesh, at = _mesh(entry, data, at, before["meshes"][i] if before else None)
        meshes.append(mesh)
    frame["meshes"] = meshes
    for kind in ("points", "particles"):
        entry, count = frame[kind], frame[kind]["count"]
        if count:
            nodes, at = _values(data, at, 3 * count, 2, 3)
            entry["position"] = _grid(entry, nodes)
        if count and kind == "points":
            shares, at = _values(data, at, count, 2, 1)
            entry["pressures"] = shares / 255 * entry["pressure"]
    assert at == len(data), "bytes after the end of the frame"
    return frame


def read_frames(data, before=None):
    frames, at = [], 0
    while at < len(data):
        length = struct.unpack_from("<I", data, at)[0]
        frames.append(read_frame(data[at + 4:at + 4 + length], frames[-1] if frames else before))
        at += 4 + length
    return frames


def read_page(text):
    """(head, frames) of a page."""
    head = json.loads(re.search(r'id="head">(.*?)</script>', text).group(1))
    frames = base64.b64decode(re.search(r'id="frames">(.*?)</script>', text).group(1))
    return head, read_frames(frames)
