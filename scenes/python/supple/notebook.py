"""Jupyter: progress of runs, pictures inline, and the viewer as a widget.

    from supple import notebook

    result = notebook.run(supple.library("two_balls"), "out/two_balls")   # a bar, then the viewer
    notebook.picture(simulation)                                           # the current state
    notebook.Viewer(scene, "out/two_balls")                                # of an earlier run
"""
import html
import struct
import sys
import zlib

import supple

__all__ = ["Picture", "Viewer", "picture", "run"]


def _png(pixels):
    """8-bit sRGB, shape (height, width, 3), as a PNG file."""
    height, width, _ = pixels.shape

    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
            + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


class Picture:
    """Pixels that a notebook shows.

    pixels  8-bit sRGB, shape (height, width, 3), as Simulation.picture gives them
    """

    def __init__(self, pixels):
        self.pixels = pixels

    def _repr_png_(self):
        return _png(self.pixels)

    def __repr__(self):
        return f"<supple.notebook.Picture, {self.pixels.shape[1]} x {self.pixels.shape[0]} pixels>"


def picture(simulation, *, camera="", size=(640, 360), threads=0):
    """The current state as a Picture; the arguments are those of Simulation.picture."""
    return Picture(simulation.picture(camera=camera, size=size, threads=threads))


class Viewer:
    """The page of `supple view` for a run, which a notebook shows.

    scene, folder  of the run
    height         [pixel]
    options        further arguments of supple.view, such as frames or cells
    """

    def __init__(self, scene, folder, *, height=560, **options):
        self.page = supple.view(scene, folder, **options)
        self.height = height

    def _repr_html_(self):
        page = html.escape(self.page.read_text(encoding="utf-8"), quote=True)
        return f'<iframe srcdoc="{page}" width="100%" height="{self.height}" style="border: 1px solid #d5d9de"></iframe>'

    def __repr__(self):
        return f"<supple.notebook.Viewer of {self.page}>"


class _Bar:
    """Progress in a notebook as a line of HTML that is replaced, elsewhere on standard error."""

    def __init__(self):
        self._handle = None
        try:
            from IPython import get_ipython
            from IPython.display import HTML, display
            if get_ipython() is not None:
                self._html = HTML
                self._handle = display(HTML(""), display_id=True)
        except ImportError:
            pass

    def __call__(self, now):
        share = now.frame / max(now.frame_count, 1)
        left = f", {now.left_s:.0f} s left" if now.left_s >= 0 else ""
        text = f"{now.stage}: frame {now.frame} of {now.frame_count}{left}"
        if self._handle is not None:
            self._handle.update(self._html(f'<progress value="{share:.3f}" style="width: 20em"></progress> {html.escape(text)}'))
        else:
            print(f"\r{text}   ", end="", file=sys.stderr)

    def close(self):
        if self._handle is None:
            print(file=sys.stderr)


class _Run:
    """A finished run: its result, and its viewer where a notebook shows it."""

    def __init__(self, result, viewer):
        self.result = result
        self.viewer = viewer

    def _repr_html_(self):
        return self.viewer._repr_html_() if self.viewer else f"<pre>{html.escape(repr(self.result))}</pre>"

    def __repr__(self):
        return repr(self.result)


def run(scene, folder, *, view=True, height=560, **options):
    """supple.run with a bar of its progress. The answer has `result` (a RunResult) and `viewer`, which the notebook shows.

    view     false: no viewer
    height   of the viewer [pixel]
    options  further arguments of supple.run, such as overwrite or simulate_only
    """
    bar = _Bar()
    try:
        result = supple.run(scene, folder, progress=bar, **options)
        viewer = Viewer(scene, folder, height=height, progress=bar) if view and result.frames > 0 else None
    finally:
        bar.close()
    return _Run(result, viewer)
