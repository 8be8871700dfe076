"""Chromium without a window, told what to do over a pipe (Chrome DevTools Protocol): nothing has to be installed beside it."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import select
import shutil
import subprocess
import time
from base64 import b64decode
from collections.abc import Iterator
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
_FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--no-first-run", "--disable-extensions", "--mute-audio", "--disable-dev-shm-usage", "--remote-debugging-pipe",
)  # fmt: skip


def installed() -> str | None:
    """The path of a browser, None where there is none."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Browser:
    """A tab.

    Attributes:
        said: what the console or an exception said. fetched: addresses that were asked for.
    """

    def __init__(self, folder: Path) -> None:
        path = installed()
        assert path is not None
        there, ours = os.pipe()
        back, theirs = os.pipe()
        high = [fcntl.fcntl(fd, fcntl.F_DUPFD, 10) for fd in (there, theirs)]
        for fd in (there, theirs):
            os.close(fd)

        def pipes() -> None:
            os.dup2(high[0], 3)
            os.dup2(high[1], 4)

        command = [path, *_FLAGS, f"--user-data-dir={folder}", "about:blank"]
        quiet = subprocess.DEVNULL
        self._process = subprocess.Popen(command, pass_fds=(3, 4), preexec_fn=pipes, stdout=quiet, stderr=quiet, stdin=quiet)
        for fd in high:
            os.close(fd)
        self._ours, self._back, self._read, self._id = ours, back, b"", 0
        self.said: list[str] = []
        self.fetched: list[str] = []
        self._session = ""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call("Network.emulateNetworkConditions", offline=True, latency=0, downloadThroughput=0, uploadThroughput=0)

    def call(self, method: str, seconds: float = 120.0, **parameters: Any) -> dict[str, Any]:
        """What the browser answers."""
        self._id += 1
        message = {"id": self._id, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._ours, json.dumps(message).encode() + b"\0")
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for told in self._messages(end - time.monotonic()):
                if told.get("id") == self._id:
                    assert "error" not in told, (method, told["error"])
                    result: dict[str, Any] = told["result"]
                    return result
                self._note(told)
        raise TimeoutError(f"no answer to {method} in {seconds:g} s")

    def open(self, page: Path, width: int, scheme: str) -> None:
        """Load a page at a width [px], in "light" or "dark", and wait until all of its figures are drawn."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=False)
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.call("Page.navigate", url=page.as_uri())
        self.wait("document.readyState === 'complete' && typeof waiting !== 'undefined' && waiting.size === 0")

    def wait(self, expression: str, seconds: float = 120.0) -> None:
        """Until an expression is true."""
        end = time.monotonic() + seconds
        while not self.ask(expression):
            assert time.monotonic() < end, f"{expression} is not true after {seconds:g} s; {self.said}"
            time.sleep(0.1)

    def ask(self, expression: str) -> Any:
        """The value of an expression, in plain types."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def picture(self) -> bytes:
        """What is seen, as PNG."""
        return b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def close(self) -> None:
        """End it."""
        self._session = ""
        with contextlib.suppress(AssertionError, OSError, TimeoutError):
            self.call("Browser.close", seconds=5.0)
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for fd in (self._ours, self._back):
            os.close(fd)

    def _messages(self, seconds: float) -> Iterator[dict[str, Any]]:
        if select.select([self._back], [], [], max(0.0, min(seconds, 1.0)))[0]:
            piece = os.read(self._back, 1 << 20)
            if not piece:
                raise OSError("the browser has ended")
            *whole, self._read = (self._read + piece).split(b"\0")
            yield from map(json.loads, whole)

    def _note(self, told: dict[str, Any]) -> None:
        method, what = told.get("method"), told.get("params", {})
        if method == "Runtime.consoleAPICalled" and what["type"] in ("error", "warning", "assert"):
            self.said.append(" ".join(str(x.get("value", x.get("description", ""))) for x in what["args"]))
        elif method == "Runtime.exceptionThrown":
            self.said.append(json.dumps(what["exceptionDetails"])[:500])
        elif method == "Log.entryAdded" and what["entry"]["level"] == "error":
            self.said.append(what["entry"]["text"])
        elif method == "Network.requestWillBeSent" and not what["request"]["url"].startswith(
            ("file:", "data:", "blob:", "about:")
        ):
            self.fetched.append(what["request"]["url"])
