import pathlib
import re
import shutil
import signal
import subprocess
import tempfile
import unittest
import urllib.error
import urllib.request

import numpy as np

import supple
from browser import BROWSER, OPTIONS, Browser
from support import LIBRARY, TOOL, two_drops
from view_page import read_frames, read_page

TITLE = "Two drops </script><b> & \"quotes\""


def run_of(scene, folder):
    result = supple.run(scene, folder, simulate_only=True, overwrite=True, threads=1)
    assert result.outcome == "done", result.reason


def browse(page, *arguments, size="1000,640"):
    """Calls the browser without a window; its output as text."""
    with tempfile.TemporaryDirectory() as profile:
        done = subprocess.run([BROWSER, *OPTIONS, f"--user-data-dir={profile}", f"--window-size={size}", "--virtual-time-budget=30000",
                               *arguments, page], capture_output=True, text=True, timeout=100)
    return done.stdout


class ViewPage(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.scene = two_drops({"title": TITLE, "duration": 0.75})
        run_of(cls.scene, cls.folder)
        cls.page = supple.view(cls.scene, cls.folder, cells=40)
        cls.head, cls.frames = read_page(cls.page.read_text())

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def at(self, frame):
        simulation = supple.Simulation(self.scene)
        simulation.set_cells(40)
        simulation.advance_to(frame)
        return simulation

    def test_shows_the_meshes_of_each_frame_within_half_a_step(self):
        for shown in self.frames:
            simulation = self.at(shown["frame"])
            for look, drawn in zip(self.head["meshes"], shown["meshes"]):
                mesh = simulation.meshes()[look["name"]]
                np.testing.assert_array_equal(drawn["triangle"], mesh.triangle)
                np.testing.assert_allclose(drawn["position"], mesh.position, rtol=0, atol=0.5001 * drawn["step"])
                self.assertLess(drawn["step"], 1e-3 * np.ptp(mesh.position))

    def test_has_the_numbers_of_each_frame(self):
        touching = 0
        for shown in self.frames:
            simulation = self.at(shown["frame"])
            energies, motion, contacts = simulation.energies(), simulation.motion(), simulation.contacts()
            self.assertAlmostEqual(shown["time"], simulation.time, places=6)
            for name in ("kinetic", "interaction", "contact", "total"):
                self.assertAlmostEqual(shown["energy"][name], getattr(energies, name), delta=1e-6 * (1e-9 + abs(energies.total)))
            np.testing.assert_allclose(shown["momentum"], motion.momentum, rtol=1e-6, atol=1e-12)
            self.assertEqual([(p["a"], p["b"]) for p in shown["pairs"]], [(p.a, p.b) for p in contacts])
            for drawn, pair in zip(shown["pairs"], contacts):
                touching += 1
                np.testing.assert_allclose(drawn["force"], pair.force, rtol=1e-6, atol=1e-9)
                np.testing.assert_allclose(drawn["at"], pair.centre_of_pressure, rtol=1e-6, atol=1e-9)
                largest = max(mesh["pressure"].max() for mesh in shown["meshes"])
                self.assertLess(abs(largest / pair.largest_pressure - 1), 0.2)  # at vertices
        self.assertGreater(touching, 0)
        np.testing.assert_allclose(self.frames[-1]["particles"]["position"], self.at(self.frames[-1]["frame"]).particles.position,
                                   atol=self.frames[-1]["particles"]["step"])

    def test_leaves_out_meshes_that_stay(self):
        scene = supple.Scene({"duration": 1, "frame_rate": 8, "objects": [
            {"name": name, "particles": {"arrange": "single", "at": [x, 0, 0], "velocity": [v, 0, 0], "mass": 1},
             "skeleton": [{"shape": "point", "kernel": {"type": "wyvill", "radius": 0.3}}]} for name, x, v in (("rests", 0, 0), ("moves", 3, 1))]})
        with tempfile.TemporaryDirectory() as folder:
            run_of(scene, folder)
            page = supple.view(scene, folder, cells=40).read_text()
            head, frames = read_page(page)
            rests = [m["name"] for m in head["meshes"]].index("rests")
            for frame in frames[1:]:
                self.assertIs(frame["meshes"][rests], frames[0]["meshes"][rests])

    def test_names_nothing_outside_itself(self):
        text = self.page.read_text()
        self.assertEqual(self.head["title"], TITLE)
        self.assertIsNone(re.search(r'(?:src|href)\s*=\s*["\']?(?:https?:)?//', text))
        self.assertIsNone(re.search(r'(?:import\s*\(|fetch\s*\()\s*["\'`]https?:', text))

    def test_keeps_to_its_size(self):
        small = supple.view(self.scene, self.folder, self.folder / "small.html", size=8e5)
        self.assertLessEqual(small.stat().st_size, 8e5)
        with self.assertRaises(supple.Error) as refused:
            supple.view(self.scene, self.folder, self.folder / "none.html", size=1e5)
        self.assertEqual(refused.exception.kind, "limit")
        self.assertFalse((self.folder / "none.html").exists())

    def test_does_not_depend_on_threads(self):
        again = supple.view(self.scene, self.folder, self.folder / "again.html", cells=40, threads=3)
        self.assertEqual(again.read_bytes(), self.page.read_bytes())

    @unittest.skipUnless(BROWSER, "no browser (apt-get install chromium)")
    def test_plays_in_a_browser(self):
        """Pictures of two frames differ, and the page says which frame it shows."""
        pictures = []
        for frame in (2, 5):
            picture = self.folder / f"{frame}.png"
            browse(f"file://{self.page}#frame={frame}", f"--screenshot={picture}")
            pictures.append(picture.read_bytes())
        self.assertNotEqual(*pictures)
        text = browse(f"file://{self.page}#frame=5", "--dump-dom")
        self.assertIn('data-frame="5"', text)
        self.assertIn(f'data-ready="{len(self.frames)}"', text)
        self.assertNotIn("This page cannot be shown", text.split("<script>")[0])

    @unittest.skipUnless(BROWSER, "no browser (apt-get install chromium)")
    def test_is_scrubbed_by_mouse_and_keys(self):
        last = len(self.frames)
        with Browser(f"file://{self.page}") as page:
            page.wait(f"document.body && document.body.dataset.ready == '{last}'")

            def frame():
                return int(page.value("document.body.dataset.frame"))

            shown = [frame() for _ in page.drag("#scrub", [0.02, 0.3, 0.5, 0.7, 0.98])]
            self.assertEqual((shown[0], shown[-1]), (1, last))
            self.assertEqual(shown, sorted(set(shown)))
            end = page.picture()
            back = [frame() for _ in page.drag("#plots canvas", [0.99, 0.6, 0.02])]  # the first plot
            self.assertEqual((back[0], back[-1]), (last, 1))
            self.assertGreater(back[0], back[1])
            self.assertGreater(back[1], back[2])
            self.assertNotEqual(page.picture(), end)
            page.press("End")
            self.assertEqual(frame(), last)
            page.press("ArrowLeft")
            self.assertEqual(frame(), last - 1)
            for _ in page.drag("#scrub", [0.02]):  # leaves the focus on the slider
                pass
            page.press(" ")
            page.wait(f"document.body.dataset.frame == '{last}'")  # it plays

    @unittest.skipUnless(BROWSER, "no browser (apt-get install chromium)")
    def test_draws_a_frame_the_same_whatever_was_shown_before(self):
        last = len(self.frames)
        free = [not frame["pairs"] for frame in self.frames]
        self.assertTrue(free[0] and not all(free))
        with Browser(f"file://{self.page}") as page:
            page.wait(f"document.body && document.body.dataset.ready == '{last}'")
            page.press("Home")
            first = page.picture()
            for _ in range(free.index(False)):
                page.press("ArrowRight")
            self.assertFalse(page.picture() == first)
            page.press("Home")
            self.assertTrue(page.picture() == first)

    def page_of(self, scene):
        run_of(scene, self.folder / "other")
        return supple.view(scene, self.folder / "other", cells=24)

    @unittest.skipUnless(BROWSER, "no browser (apt-get install chromium)")
    def test_shows_all_of_the_film_beside_its_panel(self):
        """Balls at the sides of a wide picture are seen whole where the window is narrow."""
        scene = supple.Scene({"duration": 0.25, "frame_rate": 8, "camera": {"from": [0, -5, 0], "look_at": [0, 0, 0], "field_of_view_deg": 30},
                              "output": {"images": {"size": [1600, 600]}}, "objects": [
            {"name": name, "particles": {"arrange": "single", "at": [x, 0, 0], "mass": 1}, "colour": [1, 0, 0],
             "skeleton": [{"shape": "point", "kernel": {"type": "wyvill", "radius": 0.5}}]} for name, x in (("left", -3), ("right", 3))]})
        with Browser(f"file://{self.page_of(scene)}", 900, 640) as page:
            page.wait("document.body && document.body.dataset.ready == '3'")
            colour = page.pixels("#view", 114, 120)
        red = colour[:, :, 0] > colour[:, :, 1] + 60
        self.assertFalse(red[:, 0].any() or red[:, -1].any())
        self.assertTrue(red[:, :57].any() and red[:, 57:].any())

    @unittest.skipUnless(BROWSER, "no browser (apt-get install chromium)")
    def test_draws_shadows_at_any_size(self):
        pictures = []
        for size in (1e-3, 1.0, 100.0):
            scene = supple.Scene({"duration": 0.25, "frame_rate": 8, "camera": {"from": [0, -4 * size, 2 * size], "look_at": [0, 0, 0]},
                                  "ground": {"height": -size}, "objects": [
                {"name": "ball", "particles": {"arrange": "single", "mass": 1}, "skeleton": [{"shape": "point", "kernel": {"type": "wyvill", "radius": size}}]}]})
            with Browser(f"file://{self.page_of(scene)}") as page:
                page.wait("document.body && document.body.dataset.ready == '3'")
                pictures.append(page.pixels("#view", 134, 120))
        self.assertLess(abs(pictures[0] - pictures[1]).max(), 12)
        self.assertLess(abs(pictures[2] - pictures[1]).max(), 12)


class FollowedRun(unittest.TestCase):
    @unittest.skipUnless(TOOL, "the command line tool is not built")
    def test_is_served_while_it_goes_on(self):
        with tempfile.TemporaryDirectory() as folder:
            run = subprocess.Popen([TOOL, "run", LIBRARY / "contacts/two_balls.yaml", "--simulate-only", "--view", "--out", folder, "--progress", "none"],
                                   stdout=subprocess.PIPE, text=True)
            try:
                address = run.stdout.readline().split()[1]
                self.assertTrue(address.startswith("http://127.0.0.1:"))
                with urllib.request.urlopen(address) as answer:
                    self.assertIn('"follows":true', answer.read().decode())
                frames, ended = [], False
                while not ended:
                    wanted = frames[-1]["frame"] + 1 if frames else 1
                    with urllib.request.urlopen(f"{address}frames?from={wanted}") as answer:
                        data = answer.read()
                        ended = answer.headers["X-Run-Ended"] == "true" and not data
                    frames += read_frames(data, frames[-1] if frames else None)
                self.assertEqual([f["frame"] for f in frames], list(range(1, supple.library("two_balls").frame_count + 1)))
                for request, code in ((urllib.request.Request(address, headers={"Host": "elsewhere.example"}), 403), (f"{address}result.json", 404),
                                      (f"{address}frames?from=0", 400), (urllib.request.Request(address, data=b""), 405)):
                    with self.assertRaises(urllib.error.HTTPError) as refused:
                        urllib.request.urlopen(request)
                    self.assertEqual(refused.exception.code, code)
                    refused.exception.close()
            finally:
                run.send_signal(signal.SIGINT)
                run.stdout.read()
                run.stdout.close()
                self.assertEqual(run.wait(timeout=30), 0)


if __name__ == "__main__":
    unittest.main()
