"""Opens the files of a run with USD, VTK, OpenEXR and Blender and compares them with each other and with the tables of the run.

    check_handover.py FOLDER NAME      after: supple run SCENE with output {mesh: [usd, obj, ply], particles: [csv, vtk],
                                       contacts: [csv, vtk], meshing: {motion: true}}
Needs usd-core, vtk, OpenEXR, numpy and, where present, bpy (Blender). Prints one line per check; exit code 1 if one fails.
"""
import csv
import pathlib
import re
import sys
import xml.etree.ElementTree as xml

import numpy as np

failures = 0


def check(what, holds, detail=""):
    global failures
    failures += not holds
    print(f"{'ok  ' if holds else 'FAIL'} {what}{': ' + detail if detail else ''}")


def read_ply(path):
    """Positions, triangles and columns of a binary PLY file of supple."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + 11
    header = data[:end].decode().split("\n")
    vertices = int(next(line for line in header if line.startswith("element vertex")).split()[2])
    faces = int(next(line for line in header if line.startswith("element face")).split()[2])
    kinds = {"double": "<f8", "float": "<f4"}
    properties = [line.split() for line in header if line.split()[:2] in (["property", kind] for kind in kinds)]
    table = np.frombuffer(data, np.dtype([(name, kinds[kind]) for _, kind, name in properties]), vertices, end)
    triangles = np.frombuffer(data, np.dtype([("n", "u1"), ("v", "<i4", 3)]), faces, end + table.nbytes)["v"]
    # In single precision, as the other formats have them.
    columns = {name: table[name].astype(np.float32) for name in table.dtype.names}
    return np.stack([columns[axis] for axis in "xyz"], axis=1), triangles, columns


def frames_of(folder, pattern):
    found = {}
    for path in sorted(folder.glob(pattern)):
        found[int(re.search(r"\.(\d{4})\.[a-z]+$", path.name).group(1))] = path
    return found


def identifier(name):
    return re.sub(r"[^A-Za-z0-9_]", "_", name)


def meshes(folder, name):
    """{object: {frame: (positions, triangles, columns)}} from the PLY files."""
    objects = {}
    for path in sorted((folder / "meshes").glob(f"{name}.*.ply")):
        thing, frame = re.match(rf"{re.escape(name)}\.(.+)\.(\d{{4}})\.ply$", path.name).groups()
        objects.setdefault(thing, {})[int(frame)] = read_ply(path)
    return objects


def check_usd(folder, name, objects):
    from pxr import Usd, UsdGeom, UsdShade

    stage = Usd.Stage.Open(str(folder / f"{name}.usda"))
    check("USD opens", bool(stage))
    check("USD axis and unit", UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0)
    cameras = [p for p in stage.Traverse() if p.IsA(UsdGeom.Camera)]
    check("USD camera", len(cameras) == 1)
    for thing, frames in objects.items():
        prim = stage.GetPrimAtPath(f"/scene/{identifier(thing)}")
        mesh = UsdGeom.Mesh(prim)
        same = moved = bounded = True
        counts = set()
        for frame, (positions, triangles, columns) in frames.items():
            points = np.array(mesh.GetPointsAttr().Get(frame))
            indices = np.array(mesh.GetFaceVertexIndicesAttr().Get(frame)).reshape(-1, 3)
            sides = np.array(mesh.GetFaceVertexCountsAttr().Get(frame))
            same &= np.array_equal(points, positions) and np.array_equal(indices, triangles) and np.all(sides == 3)
            extent = np.array(mesh.GetExtentAttr().Get(frame))
            bounded &= np.array_equal(extent, [positions.min(0), positions.max(0)])
            velocity = np.array(mesh.GetVelocitiesAttr().Get(frame))
            moved &= np.array_equal(velocity, np.stack([columns[f"velocity_{k}"] for k in "xyz"], 1))
            for column in set(columns) - {"x", "y", "z", "nx", "ny", "nz", "velocity_x", "velocity_y", "velocity_z"}:
                value = UsdGeom.PrimvarsAPI(prim).GetPrimvar(column).Get(frame)
                same &= np.array_equal(np.array(value), columns[column])
            counts.add(len(points))
        check(f"USD mesh {thing}: points, triangles and columns of {len(frames)} frames are those of the PLY files", same,
              f"{min(counts)} to {max(counts)} vertices")
        check(f"USD mesh {thing}: extents", bounded)
        check(f"USD mesh {thing}: velocities", moved)
        material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
        check(f"USD mesh {thing}: material", bool(material) and bool(material.ComputeSurfaceSource()[0]))
    first, last = (limit(frame for frames in objects.values() for frame in frames) for limit in (min, max))
    check("USD time codes are frames", (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (first, last), f"{first} to {last}")


def check_obj(folder, name, objects):
    import vtk

    worst = 0.0  # over the size of the mesh; VTK reads decimals with an error of a unit in the last place
    for thing, frames in objects.items():
        for frame, (positions, triangles, _) in frames.items():
            reader = vtk.vtkOBJReader()
            reader.SetFileName(str(folder / "meshes" / f"{name}.{thing}.{frame:04d}.obj"))
            reader.Update()
            mesh = reader.GetOutput()
            if mesh.GetNumberOfPoints() != len(positions) or mesh.GetNumberOfCells() != len(triangles):
                worst = np.inf
                continue
            bounds = np.array(mesh.GetBounds()).reshape(3, 2).T
            worst = max(worst, np.abs(bounds - [positions.min(0), positions.max(0)]).max() / np.abs(positions).max())
    check("OBJ in VTK: counts and bounds of every frame", worst <= 2 * np.finfo(np.float32).eps, f"bounds differ by {worst:.1g}")


def vtk_table(path):
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy

    reader = vtk.vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    data = reader.GetOutput()
    points = vtk_to_numpy(data.GetPoints().GetData()) if data.GetNumberOfPoints() else np.zeros((0, 3))
    arrays = {}
    for i in range(data.GetPointData().GetNumberOfArrays()):
        array = data.GetPointData().GetArray(i)
        values = vtk_to_numpy(array).reshape(array.GetNumberOfTuples(), array.GetNumberOfComponents())
        for k in range(values.shape[1]):
            arrays[array.GetComponentName(k) or array.GetName()] = values[:, k]
    return points, arrays, data.GetNumberOfVerts(), data.GetNumberOfLines()


def check_vtk(folder, name, part, of=None):
    """Tables of a folder; `of` names the second kind that lies in it."""
    files = frames_of(folder / part, f"{name}.{of + '.' if of else ''}[0-9]*.vtp")
    part = of or part
    same, rows, lines = True, 0, 0
    for frame, path in files.items():
        points, arrays, verts, line_count = vtk_table(path)
        with open(path.with_suffix(".csv"), newline="") as file:
            table = list(csv.DictReader(file))
        same &= len(table) == len(points) == verts
        for k, axis in enumerate(("x_m", "y_m", "z_m")):
            same &= np.array_equal(points[:, k], [float(row[axis]) for row in table])
        for column, values in arrays.items():
            same &= np.array_equal(values, [float(row[column]) for row in table])
        rows, lines = rows + len(table), lines + line_count
    check(f"VTK {part}: every bit of {len(files)} frames is that of the CSV files", same, f"{rows} points, {lines} lines")
    entries = xml.parse(folder / f"{name}_{part}.pvd").getroot().findall(".//DataSet")
    there = all((folder / entry.get("file")).exists() for entry in entries)
    times = [float(entry.get("timestep")) for entry in entries]
    check(f"VTK {part}: list of {len(entries)} times", there and len(entries) == len(files) and times == sorted(times))


def check_exr(folder, name):
    import OpenEXR
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy

    files = frames_of(folder / "frames", f"{name}.*.exr")
    alike, layers = 1.0, True
    for frame, path in files.items():
        file = OpenEXR.File(str(path))
        pixels = {key: channel.pixels for key, channel in file.channels().items()}
        reader = vtk.vtkPNGReader()
        reader.SetFileName(str(path.with_suffix(".png")))
        reader.Update()
        shape = pixels["id"].shape
        srgb = vtk_to_numpy(reader.GetOutput().GetPointData().GetScalars()).reshape(*shape, 3)[::-1] / 255.0
        # What is covered whole, developed as pictures are: exposure, tone curve, sRGB. Pixels of several surfaces differ,
        # whose colours pictures mix after the curve.
        light = pixels["RGBA"].astype(float)
        whole = light[..., 3] == 1
        x = light[whole, :3] * file.header()["exposure"]
        shown = np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0, 1)
        shown = np.where(shown <= 0.0031308, 12.92 * shown, 1.055 * shown ** (1 / 2.4) - 0.055)
        alike = min(alike, np.mean(np.abs(shown - srgb[whole]).max(-1) < 1.5 / 255))
        known = len(file.header()["objects"].split(", "))
        there = pixels["id"] > 0
        normal = np.sqrt(sum(pixels[f"N.{axis}"].astype(float) ** 2 for axis in "XYZ"))
        layers &= pixels["id"].max() <= known and np.array_equal(np.isfinite(pixels["Z"]), there)
        layers &= np.abs(normal[there] - 1).max() < 2e-3 and all(f"velocity.{axis}" in pixels for axis in "XYZ")
    check(f"OpenEXR: light of {len(files)} frames, developed, is what the PNG files show", alike > 0.95 and len(files) > 0,
          f"within a step of 8 bits in {100 * alike:.1f} % of the pixels at least")
    check("OpenEXR: depth, normals, numbers and velocities", layers)


def check_blender(folder, name, objects):
    try:
        import bpy
    except ImportError:
        print("skip Blender: no bpy here")
        return
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=str(folder / f"{name}.usda"))
    for thing, frames in objects.items():
        item = bpy.data.objects.get(identifier(thing))
        check(f"Blender has {thing}", item is not None and item.type == "MESH")
        if item is None:
            continue
        same, counts = True, set()
        for frame, (positions, triangles, _) in frames.items():
            bpy.context.scene.frame_set(frame)
            mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
            world = np.array([item.matrix_world @ vertex.co for vertex in mesh.vertices])
            counts.add(len(world))
            same &= len(world) == len(positions) and len(mesh.polygons) == len(triangles)
            if same:
                same &= np.abs(world - positions).max() <= 1e-6 * np.abs(positions).max()
        check(f"Blender {thing}: vertices and faces of {len(frames)} frames", same, f"{min(counts)} to {max(counts)} vertices")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    thing, frames = next(iter(objects.items()))
    frame, (positions, triangles, _) = next(iter(frames.items()))
    for reader, suffix in ((bpy.ops.wm.ply_import, "ply"), (bpy.ops.wm.obj_import, "obj")):
        reader(filepath=str(folder / "meshes" / f"{name}.{thing}.{frame:04d}.{suffix}"))
        mesh = bpy.context.selected_objects[0].data
        check(f"Blender reads {suffix.upper()}", len(mesh.vertices) == len(positions) and len(mesh.polygons) == len(triangles))


def main():
    folder, name = pathlib.Path(sys.argv[1]), sys.argv[2]
    objects = meshes(folder, name)
    check("there are meshes", bool(objects))
    check_usd(folder, name, objects)
    check_obj(folder, name, objects)
    check_vtk(folder, name, "particles")
    check_vtk(folder, name, "contacts")
    check_vtk(folder, name, "contacts", "pairs")
    if list((folder / "frames").glob("*.exr")):
        check_exr(folder, name)
    check_blender(folder, name, objects)
    sys.exit(1 if failures else 0)


main()
