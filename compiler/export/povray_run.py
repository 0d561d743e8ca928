"""Running POV-Ray for a reference picture in linear light.

The command line and the file's meaning are POV-Ray 3.7's: 16-bit values, no gamma, no dithering, no
antialiasing. Time and memory are those of its process alone.

Example: ``draw("tree.pov", 640, 480).pixels`` is a (480, 640, 3) float32 array in [0, 1].
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..reading.diagnostics import PlsysError

SETTINGS = ("-A", "-D", "-V", "+FN16", "File_Gamma=1.0", "Dither=off")
POLL_SECONDS = 0.01
LAST_LINES = 6  # of POV-Ray's messages, shown when it fails


@dataclass
class Drawing:
    """``pixels`` (height, width, 3) float32, linear; ``seconds`` of wall time; ``rss`` the process's peak
    bytes."""

    pixels: np.ndarray
    seconds: float
    rss: int


def find_povray() -> str:
    """The program's path; PlsysError with what to do where there is none."""
    program = shutil.which("povray")
    if program is None:
        raise PlsysError(
            "POV-Ray isn't installed ('povray' is not on the PATH); on Debian: apt-get install povray"
        )
    return program


def draw(scene: str | Path, width: int, height: int) -> Drawing:
    """Renders a .pov file. PlsysError where POV-Ray is missing or refuses the scene."""
    program = find_povray()
    with tempfile.TemporaryDirectory() as folder:
        image, log = Path(folder) / "povray.png", Path(folder) / "log.txt"
        # By a name of its own: POV-Ray can't open paths that aren't ASCII.
        link = Path(folder) / "scene.pov"
        link.symlink_to(Path(scene).resolve())
        command = [
            program,
            f"+I{link}",
            f"+O{image}",
            f"+W{width}",
            f"+H{height}",
            *SETTINGS,
        ]
        started = time.perf_counter()
        with open(log, "wb") as messages:
            # A folder of its own: POV-Ray may leave state files where it runs.
            child = subprocess.Popen(
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=messages,
                stderr=messages,
                env=_environment(folder),
            )
            rss = _watch(child)
        seconds = time.perf_counter() - started
        if child.returncode != 0 or not image.exists():
            lines = [line for line in log.read_text(errors="replace").splitlines() if line.strip()]
            raise PlsysError("POV-Ray can't draw it:\n" + "\n".join(lines[-LAST_LINES:]), str(scene))
        return Drawing(read_linear16(image), seconds, rss)


def _watch(child: subprocess.Popen) -> int:
    """Waits for the process; its peak memory in bytes. Not from getrusage: that counts what this process had
    when it forked, too."""
    rss = 0
    while child.poll() is None:
        rss = max(rss, peak_rss(child.pid))
        time.sleep(POLL_SECONDS)
    return rss


def peak_rss(pid: int | str = "self") -> int:
    """The most memory a running process ever had resident, in bytes; 0 where the system doesn't tell."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0
    for line in status.splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) * 1024
    return 0


def _environment(folder: str) -> dict[str, str]:
    """POV-Ray reads its user's settings from HOME; a reference picture must not depend on them."""
    return {**os.environ, "HOME": folder}


def read_linear16(path: str | Path) -> np.ndarray:
    """The values of a 16-bit PNG as they stand, v/65535: (height, width, 3) float32."""
    import OpenImageIO as oiio

    source = oiio.ImageInput.open(str(path))
    if source is None:
        raise PlsysError(f"can't be read: {oiio.geterror().strip()}", str(path))
    try:
        pixels = source.read_image(oiio.FLOAT)
    finally:
        source.close()
    return np.ascontiguousarray(np.asarray(pixels)[:, :, :3], np.float32)
