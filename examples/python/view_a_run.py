"""A run from the library, its page for a browser, and its glTF file."""
import pathlib
import sys
import tempfile

import supple

folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
scene = supple.library("two_balls", {"duration": "0.5 s"})
result = supple.run(scene, folder, simulate_only=True, overwrite=True)
page = supple.view(scene, folder, cells=32)
model = supple.write_gltf(scene, folder)
for file in (page, model):
    print(f"{file} ({file.stat().st_size / 1e6:.2f} MB)")
    assert file.stat().st_size > 1e4
