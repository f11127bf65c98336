"""A headless Chromium, spoken to over its debugging pipe, with Python's standard library only."""

import base64
import json
import os
import shutil
import subprocess
import sys


class Browser:
    """One Chromium and one page in it."""

    def __init__(self, profile):
        name = next((n for n in ("chromium", "chromium-browser", "google-chrome") if shutil.which(n)), None)
        if name is None:
            sys.exit("no chromium: apt-get install chromium")
        (to_read, to), (here, to_write) = os.pipe(), os.pipe()

        def hand_over():
            # Chromium reads commands from 3 and writes answers to 4; first out of each other's way.
            read, write = os.dup(to_read), os.dup(to_write)
            read, write = os.dup2(read, 103), os.dup2(write, 104)
            os.dup2(read, 3)
            os.dup2(write, 4)

        self.process = subprocess.Popen(
            [name, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
             "--hide-scrollbars", "--no-first-run", "--disable-background-networking",
             "--disable-extensions", f"--user-data-dir={profile}", "--remote-debugging-pipe",
             "about:blank"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            preexec_fn=hand_over, close_fds=False)
        os.close(to_read)
        os.close(to_write)
        self.to, self.here = os.fdopen(to, "wb", 0), os.fdopen(here, "rb")
        self.buffer, self.events, self.sent = b"", [], 0
        self.patience = 20000  # milliseconds for a picture that should come
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        self.session = None
        self.session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(f"{domain}.enable")

    def ask(self, method, **params):
        """Sends a command and waits for its answer; what comes between is kept."""
        self.sent += 1
        message = {"id": self.sent, "method": method, "params": params}
        if getattr(self, "session", None):
            message["sessionId"] = self.session
        self.to.write(json.dumps(message).encode() + b"\0")
        while True:
            answer = self.receive()
            if answer.get("id") == self.sent:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            self.events.append(answer)

    def receive(self):
        while b"\0" not in self.buffer:
            piece = os.read(self.here.fileno(), 1 << 20)
            if not piece:
                raise RuntimeError("chromium has ended")
            self.buffer += piece
        message, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(message)

    def open(self, url, width, scheme, height=900):
        """Opens `url` and returns the events of its loading."""
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height,
                 deviceScaleFactor=1, mobile=width < 600)
        self.ask("Emulation.setEmulatedMedia",
                 features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.events = []
        self.ask("Page.navigate", url=url)
        while not any(e.get("method") == "Page.loadEventFired" for e in self.events):
            self.events.append(self.receive())
        # Whatever starts after loading shows before the second frame is painted.
        self.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))")
        return self.events

    def evaluate(self, expression):
        answer = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"])
        return answer["result"].get("value")

    def key(self, key, shift=False):
        """Presses a key, as a keyboard does."""
        text = {"text": key} if len(key) == 1 else {}
        for kind in ("keyDown", "keyUp"):
            self.ask("Input.dispatchKeyEvent", type=kind, key=key, modifiers=8 if shift else 0,
                     **(text if kind == "keyDown" else {}))

    def mouse(self, kind, x, y, **more):
        self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def pixels(self, box):
        """A picture of a part of the page, as bytes. Input is handled by the second frame after it."""
        self.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))")
        clip = {"x": box[0], "y": box[1], "width": box[2], "height": box[3], "scale": 1}
        return self.ask("Page.captureScreenshot", clip=clip, captureBeyondViewport=True)["data"]

    def shot(self, path, width, height, whole=True):
        """A picture of the page from its top, or of what is seen of it."""
        clip = {"x": 0, "y": 0, "width": width, "height": height, "scale": 1}
        image = self.ask("Page.captureScreenshot", **({"clip": clip, "captureBeyondViewport": True} if whole else {}))
        path.write_bytes(base64.b64decode(image["data"]))

    def close(self):
        self.session = None
        try:
            self.ask("Browser.close")
            self.process.wait(20)
        except (RuntimeError, OSError, subprocess.TimeoutExpired):
            self.process.kill()
            self.process.wait()
