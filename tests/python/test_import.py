"""What the package says where it cannot work."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import supple._supple


class Import(unittest.TestCase):
    @unittest.skipUnless(supple._supple._numpy_versions == "1", "this pybind11 knows NumPy 2")
    def test_refuses_a_numpy_that_it_would_misread(self):
        with tempfile.TemporaryDirectory() as folder:
            numpy = pathlib.Path(folder) / "numpy"
            numpy.mkdir()
            (numpy / "__init__.py").write_text("__version__ = '2.1.3'\n")
            path = os.pathsep.join([folder, os.environ["PYTHONPATH"]])
            done = subprocess.run([sys.executable, "-B", "-c", "import supple"], capture_output=True, text=True,
                                  env=os.environ | {"PYTHONPATH": path})
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("ImportError: supple was built with pybind11 ", done.stderr)
        self.assertIn("found NumPy 2.1.3. Build it with pybind11 2.12", done.stderr)


if __name__ == "__main__":
    unittest.main()
