#!/usr/bin/env python3
"""Surface meshes by supple, VTK's flying edges and OpenVDB's volumeToMesh, on the bodies of mesh_bench.

All get the same body on the same lattice. VTK and OpenVDB need the field on nodes first; they get it from the fast field
stage of `mesh_bench --grid` (single precision, vector loops, the same candidate search), whose time is added to theirs:
for VTK values wherever a support reaches, for OpenVDB only the 8^3 leaves that bounds do not exclude; and once more ("splatted") with the
usual method of these libraries, which adds each blob to the nodes in its support. Times are CPU times of one
thread, the least of several runs; programs alternate. Errors of all meshes come from mesh_bench, both
ways: from the mesh to the exact surface, and back.

    python3 tests/benchmarks/peers/surface_meshes.py --bench build/release/bin/mesh_bench --work DIR w2/128 w3/128

If DIR does not exist, it is created: a virtual environment with VTK from the package index, and the OpenVDB program,
compiled from surface_mesh_openvdb.cpp against the distribution's library.
"""
import argparse
import json
import math
import os
import pathlib
import resource
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent


def cpu():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def run_vtk(grid, out, repeats):
    """Runs inside the virtual environment; prints the least CPU time in ms."""
    import numpy
    import vtk
    from vtk.util import numpy_support
    vtk.vtkMultiThreader.SetGlobalMaximumNumberOfThreads(1)
    vtk.vtkSMPTools.SetBackend("Sequential")
    with open(grid, "rb") as file:
        header = numpy.fromfile(file, dtype=numpy.float64, count=5)
        nodes = int(header[0])
        values = numpy.fromfile(file, dtype=numpy.float32)
    image = vtk.vtkImageData()
    image.SetDimensions(nodes, nodes, nodes)
    image.SetOrigin(*header[1:4])
    image.SetSpacing(header[4], header[4], header[4])
    image.GetPointData().SetScalars(numpy_support.numpy_to_vtk(values))
    best = math.inf
    for _ in range(repeats):
        mesher = vtk.vtkFlyingEdges3D()
        mesher.SetInputData(image)
        mesher.SetValue(0, 0.0)
        mesher.ComputeNormalsOn()
        mesher.ComputeGradientsOff()
        mesher.ComputeScalarsOff()
        start = cpu()
        mesher.Update()
        best = min(best, cpu() - start)
        result = mesher.GetOutput()
    points = numpy_support.vtk_to_numpy(result.GetPoints().GetData()).astype(numpy.float64)
    triangles = numpy_support.vtk_to_numpy(result.GetPolys().GetConnectivityArray()).astype(numpy.uint32)
    with open(out, "wb") as file:
        numpy.array([len(points), len(triangles) // 3], dtype=numpy.int64).tofile(file)
        points.tofile(file)
        triangles.tofile(file)
    print(json.dumps({"cpu_ms": 1e3 * best}))


def call(*command):
    lines = subprocess.run([str(c) for c in command], check=True, capture_output=True, text=True).stdout.splitlines()
    return [json.loads(line) for line in lines if line.startswith("{")]


def prepare(work):
    work.mkdir(parents=True, exist_ok=True)
    python = work / "venv/bin/python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", work / "venv"], check=True)
        subprocess.run([python, "-m", "pip", "install", "-q", "vtk", "numpy"], check=True)
    program = work / "surface_mesh_openvdb"
    source = HERE / "surface_mesh_openvdb.cpp"
    if not program.exists() or program.stat().st_mtime < source.stat().st_mtime:
        subprocess.run([os.environ.get("CXX", "g++"), "-O3", "-std=c++20", "-march=x86-64-v3", source, "-o", program,
                        "-lopenvdb", "-ltbb"], check=True)
    return python, program


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bench", type=pathlib.Path)
    parser.add_argument("--work", type=pathlib.Path)
    parser.add_argument("--rounds", type=int, default=2, help="times the programs take turns")
    parser.add_argument("--vtk", nargs=2, metavar=("GRID", "OUT"), help=argparse.SUPPRESS)
    parser.add_argument("cases", nargs="*", help="body/cells, e.g. w3/128")
    arguments = parser.parse_args()
    if arguments.vtk:
        return run_vtk(*arguments.vtk, 5)
    python, openvdb = prepare(arguments.work)
    grid, mesh = arguments.work / "grid.raw", arguments.work / "mesh.bin"
    for case in arguments.cases:
        body, cells = case.split("/")
        rows = {}

        def keep(name, cpu_ms, errors):
            row = rows.setdefault(name, {"cpu_ms": math.inf})
            row["cpu_ms"] = min(row["cpu_ms"], cpu_ms)
            row.update(errors)

        for _ in range(arguments.rounds):
            for method in ("cubes", "refined", "refined_twice"):
                ours, = [r for r in call(arguments.bench, f"{case}/{method}", "--both") if r["name"].endswith("/" + method)]
                keep(f"ours, {method}", ours["cpu_ms_min"] + ours["index_cpu_ms"],
                     {k: ours[k] for k in ("items", "error", "rms_vertex_over_h", "rms_back_over_h", "largest_back_over_h")})
            field, = call(arguments.bench, "--grid", body, cells, grid)
            result, = call(python, __file__, "--vtk", grid, mesh)
            errors, = call(arguments.bench, "--errors", body, cells, mesh)
            keep("VTK", field["cpu_ms_touched"] + result["cpu_ms"], errors)
            keep("VTK, splatted", field["cpu_ms_splat"] + result["cpu_ms"], errors)
            result, = call(openvdb, grid, mesh)
            errors, = call(arguments.bench, "--errors", body, cells, mesh)
            keep("OpenVDB", field["cpu_ms_surface"] + result["cpu_ms"], errors)
            keep("OpenVDB, splatted", field["cpu_ms_splat"] + result["cpu_ms"], errors)
        print(f"{case:8s} {'':20s} {'cpu ms':>8s} {'triangles':>10s} {'centroid/h':>11s} {'vertex/h':>10s} "
              f"{'back/h':>8s} {'farthest':>9s}")
        for name, row in rows.items():
            print(f"{'':8s} {name:20s} {row['cpu_ms']:8.1f} {row['items']:10d} {row['error']:11.5f} "
                  f"{row['rms_vertex_over_h']:10.2g} {row['rms_back_over_h']:8.4f} {row['largest_back_over_h']:9.3g}")
        # Time of ours at the errors of the peer, both ways: error ~ cell^2 and time ~ cell^-2, so time ~ 1 / error.
        for name in ("VTK", "VTK, splatted", "OpenVDB", "OpenVDB, splatted"):
            peer = rows[name]
            for method in ("cubes", "refined", "refined_twice"):
                ours = rows[f"ours, {method}"]
                ratio = max(ours[k] / peer[k] for k in ("error", "rms_back_over_h"))
                print(f"{'':8s} at the errors of {name}, both ways: {method} needs {ours['cpu_ms'] * ratio:.1f} ms, "
                      f"{peer['cpu_ms'] / (ours['cpu_ms'] * ratio):.1f} times less")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
