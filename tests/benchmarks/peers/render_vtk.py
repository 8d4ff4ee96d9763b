"""The ball of render_bench drawn by VTK: Phong shading without shadows, 4 samples, PNG included.

    pip install vtk numpy; python3 render_vtk.py

Prints the least CPU milliseconds per frame, as render_bench does.
"""
import json
import os
import tempfile
import time

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray


def ball(n):
    """12 n^2 triangles of a unit ball: the faces of a cube at equal angles."""
    points, triangles = [], []
    t = np.tan(0.25 * np.pi * (2.0 * np.arange(n + 1) / n - 1.0))
    for face in range(6):
        axis, side = face // 2, 1.0 if face % 2 == 0 else -1.0
        v, u = np.meshgrid(t, t, indexing="ij")
        p = np.zeros((n + 1, n + 1, 3))
        p[..., axis], p[..., (axis + 1) % 3], p[..., (axis + 2) % 3] = side, u * side, v
        base = len(points) * (n + 1) ** 2
        points.append((p / np.linalg.norm(p, axis=2, keepdims=True)).reshape(-1, 3))
        a = base + (np.arange(n)[:, None] * (n + 1) + np.arange(n)[None, :]).reshape(-1)
        triangles += [np.stack([a, a + 1, a + n + 2], 1), np.stack([a, a + n + 2, a + n + 1], 1)]
    return np.concatenate(points), np.concatenate(triangles)


def main():
    start = time.process_time()
    unit, triangles = ball(129)
    cells = vtk.vtkCellArray()
    connectivity = np.hstack([np.full((len(triangles), 1), 3), triangles]).astype(np.int64)
    cells.SetCells(len(triangles), numpy_to_vtkIdTypeArray(connectivity.ravel(), deep=True))
    data = vtk.vtkPolyData()
    data.SetPolys(cells)
    data.GetPointData().SetNormals(numpy_to_vtk(unit.astype(np.float32), deep=True))

    def place(when):
        wave = 1.0 + 0.05 * np.sin(8.0 * unit[:, :1] + when) * np.sin(6.0 * unit[:, 2:])
        points = vtk.vtkPoints()
        points.SetData(numpy_to_vtk((np.array([0, 0, 1.1]) + wave * unit).astype(np.float32), deep=True))
        data.SetPoints(points)

    place(0.0)
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(0.85, 0.45, 0.2)
    actor.GetProperty().SetInterpolationToPhong()
    plane = vtk.vtkPlaneSource()
    plane.SetOrigin(-20, -20, 0)
    plane.SetPoint1(20, -20, 0)
    plane.SetPoint2(-20, 20, 0)
    ground = vtk.vtkActor()
    ground.SetMapper(vtk.vtkPolyDataMapper())
    ground.GetMapper().SetInputConnection(plane.GetOutputPort())
    renderer = vtk.vtkRenderer()
    renderer.AddActor(actor)
    renderer.AddActor(ground)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(4)
    window.SetSize(1280, 720)
    window.AddRenderer(renderer)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(0.5, -6, 2.6)
    camera.SetFocalPoint(0, 0, 0.9)
    camera.SetViewUp(0, 0, 1)
    camera.SetViewAngle(35)
    path = os.path.join(tempfile.mkdtemp(), "frame.png")

    def draw():
        window.Render()
        grab = vtk.vtkWindowToImageFilter()
        grab.SetInput(window)
        grab.ReadFrontBufferOff()
        writer = vtk.vtkPNGWriter()
        writer.SetFileName(path)
        writer.SetInputConnection(grab.GetOutputPort())
        writer.Write()

    draw()
    first = time.process_time() - start
    least = 1e9
    for frame in range(1, 9):
        place(0.2 * frame)  # as in render_bench, the new vertices are not part of the time
        data.Modified()
        begin = time.process_time()
        draw()
        least = min(least, time.process_time() - begin)
    print(json.dumps({"name": "vtk/phong/frame", "version": vtk.vtkVersion().GetVTKVersion(), "window": window.GetClassName(),
                      "triangles": len(triangles), "min_cpu_ms": round(1e3 * least, 1), "first_frame_cpu_ms": round(1e3 * first, 1)}))


main()
