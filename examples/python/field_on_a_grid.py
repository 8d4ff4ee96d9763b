"""The field of a body on a grid of points, and the volume inside it by the mesh and by counting."""
import numpy as np

import supple

drop = supple.Field({
    "particles": {"arrange": "line", "count": 3, "spacing": 0.25, "mass": 1},
    "skeleton": [{"shape": "point", "kernel": {"type": "wyvill", "radius": 0.4}}],
})
axis = np.linspace(-0.75, 0.75, 60)
points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3) + drop.position.mean(axis=0)
values, gradients = drop.evaluate(points)
counted = np.count_nonzero(values > 0) * (axis[1] - axis[0]) ** 3
meshed = drop.mesh(cells=96).inspect().volume
print(f"volume {meshed:.5f} m^3 by the mesh, {counted:.5f} m^3 by points")
assert abs(counted / meshed - 1) < 0.02
