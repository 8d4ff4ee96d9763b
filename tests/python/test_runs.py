import json
import pathlib
import signal
import tempfile
import threading
import unittest

import supple
from support import two_drops


class Runs(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name) / "run"

    def test_leave_what_the_tool_leaves(self):
        scene = two_drops({"duration": 0.25})
        seen = []
        result = supple.run(scene, self.folder, progress=lambda now: seen.append((now.stage, now.frame)))
        self.assertEqual((result.outcome, result.exit_code, result.frames, result.film), ("done", 0, 3, None))
        self.assertEqual(json.loads(result.report.read_text())["state_hash"], result.state_hash)
        self.assertEqual([p.name for p in sorted((self.folder / "frames").iterdir())], [f"two_drops.000{n}.png" for n in (1, 2, 3)])
        self.assertIn(("simulate", 2), seen)
        self.assertIn("done", supple.info(self.folder))
        simulation = supple.Simulation(scene)
        simulation.load(self.folder / "states/two_drops.0003.state")
        self.assertEqual(simulation.state_hash, result.state_hash)

        drawn = supple.render(scene, self.folder, frames=[2], overwrite=True)
        self.assertEqual((drawn.outcome, drawn.report.name), ("done", "render.json"))
        exported = supple.export(two_drops({"duration": 0.25, "output.mesh": "[ply]"}), self.folder, frames="1-2")
        self.assertEqual((exported.outcome, len(list((self.folder / "meshes").glob("*.ply")))), ("done", 4))
        with self.assertRaisesRegex(supple.Error, "earlier result"):
            supple.run(scene, self.folder)

    def test_end_where_progress_raises_and_go_on_from_there(self):
        scene = two_drops()

        def stop(now):
            if now.frame > 3:
                raise LookupError(now.frame)

        with self.assertRaises(LookupError):
            supple.run(scene, self.folder, simulate_only=True, threads=1, progress=stop)
        self.assertEqual(json.loads((self.folder / "result.json").read_text())["outcome"], "interrupted")
        resumed = supple.run(scene, self.folder, simulate_only=True, threads=1, resume=True)
        simulation = supple.Simulation(scene)
        simulation.advance_to(scene.frame_count)
        self.assertEqual((resumed.outcome, resumed.state_hash), ("done", simulation.state_hash))

    def test_end_by_an_interrupt(self):
        scene = two_drops({"time_step": {"substeps": 4096}, "duration": 1000})
        timer = threading.Timer(0.2, lambda: signal.raise_signal(signal.SIGINT))
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            supple.run(scene, self.folder, simulate_only=True, threads=1)
        self.assertEqual(json.loads((self.folder / "result.json").read_text())["outcome"], "interrupted")

    def test_say_how_they_ended(self):
        result = supple.run(two_drops({f"objects.{name}.contact.modulus": 1e14 for name in ("left", "right")}), self.folder, simulate_only=True)
        self.assertEqual((result.outcome, result.exit_code), ("limit", 6))
        self.assertIn("time_step", result.reason)

    def test_are_compared(self):
        other = self.folder.parent / "other"
        for folder, colour in (self.folder, [1, 0, 0]), (other, [0, 0, 1]):
            supple.run(two_drops({"duration": 0.125, "objects.left.colour": colour}), folder)
        here = self.folder.parent / "both"
        both = supple.compare(self.folder, other, here, film=False)
        self.assertEqual([f.frame for f in both.frames], [1, 2])
        self.assertTrue(all(f.largest > 50 and 0 < f.psnr < 60 for f in both.frames))
        self.assertEqual((both.only_first, both.only_second, both.film), (0, 0, None))
        self.assertTrue((here / "compare.csv").exists())

    def test_refuse_wrong_frames(self):
        for frames, words in ("5-1", "expected"), ([99], "expected a frame from 1 to 9"), ([0, -1], "expected a frame from 1 to 9"):
            with self.assertRaises(supple.Error) as caught:
                supple.run(two_drops(), self.folder, frames=frames)
            self.assertEqual(caught.exception.kind, "usage")
            self.assertIn(words, str(caught.exception))


if __name__ == "__main__":
    unittest.main()
