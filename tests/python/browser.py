"""A browser without a window, led by the DevTools protocol over a pipe."""
import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time

import numpy as np

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
OPTIONS = ["--headless=new", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars", "--disable-background-networking"]
SECONDS = 120  # for an answer, on a busy machine


class Browser:
    """One page: `with Browser(address) as page`."""

    def __init__(self, address, width=1000, height=640):
        self._profile = tempfile.mkdtemp()
        to_read, self._write = os.pipe()
        self._read, to_write = os.pipe()

        def give_pipes():  # the protocol is on descriptors 3 and 4
            ends = os.dup(to_read), os.dup(to_write)
            os.dup2(ends[0], 3)
            os.dup2(ends[1], 4)

        self._process = subprocess.Popen([BROWSER, *OPTIONS, f"--user-data-dir={self._profile}", f"--window-size={width},{height}", "--remote-debugging-pipe", "about:blank"],
                                         preexec_fn=give_pipes, pass_fds=(3, 4), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_read)
        os.close(to_write)
        self._answers, self._number, self._session = b"", 0, None
        try:
            target = self.call("Target.createTarget", url=address)["targetId"]
            self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
            self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        except BaseException:
            self.__exit__()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        os.close(self._write)  # ends it
        try:
            self._process.wait(20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._read)
        shutil.rmtree(self._profile, ignore_errors=True)

    def call(self, method, **parameters):
        """The result of a method of the protocol."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        end = time.monotonic() + SECONDS
        while True:
            while b"\0" in self._answers:
                text, self._answers = self._answers.split(b"\0", 1)
                answer = json.loads(text)
                if answer.get("id") == self._number:
                    assert "error" not in answer, answer
                    return answer["result"]
            ready, _, _ = select.select([self._read], [], [], max(0.0, end - time.monotonic()))
            data = os.read(self._read, 1 << 20) if ready else b""
            assert data, f"{method}: no answer of the browser"
            self._answers += data

    def value(self, expression):
        """Of an expression in the page."""
        return self.call("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def wait(self, expression):
        """Until an expression in the page is true."""
        end = time.monotonic() + SECONDS
        while not self.value(expression):
            assert time.monotonic() < end, f"never true: {expression}"
            time.sleep(0.1)

    def drag(self, selector, shares):
        """Presses the mouse on an element at a share of its width, moves to others and lets go; yields at each."""
        left, top, width, height = self.value(f"(() => {{ const b = document.querySelector({json.dumps(selector)}).getBoundingClientRect(); return [b.x, b.y, b.width, b.height]; }})()")
        kind = "mousePressed"
        for share in shares:
            at = {"x": left + share * width, "y": top + 0.5 * height, "button": "left", "buttons": 1}
            self.call("Input.dispatchMouseEvent", type=kind, clickCount=1, **at)
            kind = "mouseMoved"
            yield share
        self.call("Input.dispatchMouseEvent", type="mouseReleased", clickCount=1, **at)

    def press(self, key):
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, code=key)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key, code=key)

    def pixels(self, selector, width, height):
        """RGB values of a canvas that is drawn by WebGL, scaled down, shape (height, width, 3)."""
        rgba = self.value(f"""(() => {{
            const small = Object.assign(document.createElement("canvas"), {{ width: {width}, height: {height} }}).getContext("2d");
            small.drawImage(document.querySelector({json.dumps(selector)}), 0, 0, {width}, {height});
            return Array.from(small.getImageData(0, 0, {width}, {height}).data);
        }})()""")
        return np.array(rgba, np.float64).reshape(height, width, 4)[:, :, :3]

    def picture(self):
        """A PNG of the page."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
