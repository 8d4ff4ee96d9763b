#!/usr/bin/env python3
"""The page of scripts/evidence.sh when its programs fail, and what it computes. usage: evidence_test.py SCRATCH"""
import pathlib
import shutil
import struct
import subprocess
import sys
import unittest
import zlib

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCRATCH = pathlib.Path(sys.argv.pop(1)).resolve()
sys.path.insert(0, str(ROOT / "scripts"))
sys.dont_write_bytecode = True

import fit_curves  # noqa: E402
from evidence import pictures, plots  # noqa: E402

ROWS = """#!/bin/sh
case "$2" in
  core/integrators) exit 3 ;;
  core/laws) echo '{"name": "core/laws/cohesion", "particles": 100, "us": 10, "pairs_per_particle": 10}'
             echo '{"name": "core/laws/cohesion", "particles": 1000, "us": 200, "pairs_per_particle": 20}' ;;
  core/lists) echo 'core/lists: no row' ;;
esac
"""


def write_png(path, rows, filters, channels):
    """Rows of bytes with the filter of each: 0, or 2 (differences to the row above)."""
    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    data, above = b"", bytes(len(rows[0]))
    for row, kind in zip(rows, filters):
        data += bytes([kind]) + (row if kind == 0 else bytes((a - b) & 255 for a, b in zip(row, above)))
        above = row
    header = struct.pack(">IIBBBBB", len(rows[0]) // channels, len(rows), 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b""))


class Page(unittest.TestCase):
    def run_parts(self, *parts):
        folder = SCRATCH / self._testMethodName
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        tool = folder / "supple"
        tool.write_text(ROWS)
        tool.chmod(0o755)
        ended = subprocess.run([sys.executable, "-B", "-m", "evidence", "--supple", tool, "--peers", folder / "none", "--work", folder / "work", "--page", folder / "page.md", *parts],
                               cwd=ROOT / "scripts", capture_output=True, text=True)
        page = folder / "page.md"
        self.assertFalse(list(folder.glob(".*")), "hidden files are left")
        return ended.returncode, page.read_text() if page.exists() else None

    def test_failed_parts_are_lines_and_the_exit_code(self):
        code, page = self.run_parts("integrators", "peers")
        self.assertEqual(code, 1)
        self.assertIn("| Time integration | failed: supple bench core/integrators", page)
        self.assertIn("ended with 3", page)
        self.assertIn("Left out: MuJoCo did not install here.", page)

    def test_other_parts_are_measured(self):
        code, page = self.run_parts("particles")
        self.assertEqual(code, 0)
        self.assertIn("| `cohesion` | 1.30 | 1.30 | 1.00 | 1.00 |", page)  # log10(20), log10(20) / log10(20)
        self.assertTrue((SCRATCH / self._testMethodName / "images/evidence_particles.svg").exists())

    def test_unknown_parts_are_refused(self):
        code, page = self.run_parts("integrator")
        self.assertEqual((code, page), (2, None))


class Figures(unittest.TestCase):
    def test_exponent_of_a_power(self):
        self.assertAlmostEqual(plots.exponent([(x, 3.0 * x**1.5) for x in (2, 10, 100)]), 1.5)

    def test_points_that_are_not_positive_are_left_out(self):
        self.assertEqual(plots.log_log({"a": [(1, 0), (10, 1), (100, 2)]}, "x", "y").count("<circle"), 2)

    def test_curves_of_fits(self):
        rows = fit_curves.rows_of(['no row', '{"method": "fit", "asked": 0.01, "primitives": 300, "rms": 0.001, "largest": 0.008, "cpu_s": 9}',
                                   '{"method": "fit", "asked": 0.02, "primitives": 100, "rms": 0.002, "largest": 0.015, "cpu_s": 5}',
                                   '{"method": "spheres", "asked": 0.02, "primitives": 100, "rms": 0.01, "largest": 0.08, "cpu_s": 2}'])
        self.assertEqual(fit_curves.curves(rows, "primitives"), {"fit, largest": [(100, 1.5), (300, 0.8)], "fit, RMS": [(100, 0.2), (300, 0.1)], "spheres, largest": [(100, 8.0)], "spheres, RMS": [(100, 1.0)]})
        self.assertEqual(fit_curves.table(rows)[2:], ["| 2 % | 100 | 0.20 %, 1.50 %, 5.0 | 1.00 %, 8.00 %, 2.0 | - |", "| 1 % | 300 | 0.10 %, 0.80 %, 9.0 | - | - |"])

    def test_difference_of_pictures(self):
        SCRATCH.mkdir(parents=True, exist_ok=True)
        one, other = SCRATCH / "one.png", SCRATCH / "other.png"
        write_png(one, [bytes((10, 20, 30, 40, 50, 60)), bytes((1, 2, 3, 4, 5, 6))], (0, 2), 3)
        write_png(other, [bytes((10, 20, 30, 40, 50, 60)), bytes((1, 2, 3, 4, 5, 18))], (2, 0), 3)
        self.assertAlmostEqual(pictures.rms(one, other), 12.0 / 12.0**0.5 / 255.0)
        write_png(other, [bytes(8)], (0,), 4)
        self.assertRaises(ValueError, pictures.rms, one, other)


if __name__ == "__main__":
    unittest.main()
