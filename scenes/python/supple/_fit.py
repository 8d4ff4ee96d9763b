"""Objects from data by the command line tool, which links CGAL; the package does not."""
import json
import pathlib

from supple import _tool


def fit(data, out, *, error=0.01, particles=200, primitives=2000, pieces="refuse", iso=None, window=None, label=None, material=None, kind="solid", thickness=None, picture=None, overwrite=False, threads=0):
    """Makes an object for scenes from a mesh, points or a volume, as `supple fit` does. Returns its report, a dict with distances, numbers and warnings.

    data        file of a mesh (PLY, OBJ, OFF, STL) or of points (XYZ, PLY) [m], or of a volume (NIfTI, NRRD, MetaImage, OpenVDB)
    out         file of the object, .yaml; scenes in its folder include it: objects: [{name: a, include: OUT}]. The report is also beside it, as .json
    error       largest distance between the surfaces, either way, over the diagonal of the data's box
    particles   number of particles
    primitives  largest number of primitives of the skeleton
    pieces      of data in several pieces: "refuse", "largest", or the number of one counted from the largest
    iso         of a volume: values above lie inside
    window      of a volume: values between two, a pair, lie inside
    label       of a volume: voxels of this number lie inside
    material    name of a shipped material ("jelly", "rubber" ...), or a file of scenes with the key 'material'
    kind        "solid", or "shell": a layer about a surface, which may be open
    thickness   of a shell [m]; None: a third of the distance between particles
    picture     file of a picture (.png) of data and fit side by side, with their distances as colours
    overwrite   whether an earlier object is replaced
    threads     number of threads, 0 for all; does not change the result

    Raises Error for data that cannot be fitted.
    """
    words = ["fit", data, "--out", out, "--error", repr(float(error)), "--particles", int(particles), "--primitives", int(primitives), "--pieces", str(pieces), "--kind", kind, "--threads", int(threads), "--quiet"]
    # Each one word, as values may begin with a minus sign.
    if iso is not None:
        words.append(f"--iso={float(iso)!r}")
    if window is not None:
        words.append("--window=" + ":".join(repr(float(value)) for value in window))
    if label is not None:
        words.append(f"--label={int(label)}")
    if material is not None:
        words += ["--material", material]
    if thickness is not None:
        words += ["--thickness", repr(float(thickness))]
    if picture is not None:
        words += ["--picture", picture]
    _tool.call(*words, *(["--overwrite"] if overwrite else []))
    return json.loads(pathlib.Path(out).with_suffix(".json").read_text(encoding="utf-8"))
