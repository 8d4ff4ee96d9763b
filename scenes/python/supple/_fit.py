"""Objects from data by the command line tool, which links CGAL; the package does not."""
import json
import pathlib

from supple import _tool


def fit(data, out, *, error=0.01, particles=200, primitives=2000, pieces="refuse", overwrite=False, threads=0):
    """Makes an object for scenes from a closed triangle mesh, as `supple fit` does. Returns its report, a dict with distances, numbers and warnings.

    data        file of the mesh: PLY, OBJ, OFF or STL [m]
    out         file of the object, .yaml; scenes in its folder include it: objects: [{name: a, include: OUT}]. The report is also beside it, as .json
    error       largest distance between the surfaces, either way, over the diagonal of the data's box
    particles   number of particles
    primitives  largest number of primitives of the skeleton
    pieces      of data in several pieces: "refuse" or "largest"
    overwrite   whether an earlier object is replaced
    threads     number of threads, 0 for all; does not change the result

    Raises Error for data that cannot be fitted.
    """
    words = ["fit", data, "--out", out, "--error", repr(float(error)), "--particles", int(particles), "--primitives", int(primitives), "--pieces", pieces, "--threads", int(threads), "--quiet"]
    _tool.call(*words, *(["--overwrite"] if overwrite else []))
    return json.loads(pathlib.Path(out).with_suffix(".json").read_text(encoding="utf-8"))
