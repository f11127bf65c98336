from collections.abc import Callable
from typing import Any

import numpy as np

__version__: str

class NativeImage:
    width: int
    height: int
    notes: list[str]
    origin: tuple[float, float, float]
    color_range: tuple[float, float] | None
    view: tuple[list[float], list[float], list[float], float, float | None]
    def planes(self) -> dict[str, np.ndarray | tuple[np.ndarray, list[str]]]: ...
    def srgb(self) -> np.ndarray: ...
    def to_exr(self) -> bytes: ...
    def to_png(self) -> bytes: ...

class FrameList:
    numbers: list[int]
    notes: list[str]
    up: str
    def __init__(self, paths: list[str], *, follow_links: bool, mesh_points: bool, topology: str | None) -> None: ...
    def files(self, index: int) -> list[str]: ...
    def read(self, index: int, threads: int | None) -> dict[str, Any]: ...

def render(
    positions: np.ndarray,
    attributes: list[tuple[str, np.ndarray]],
    settings: str,
    *,
    base: str,
    frame: int,
    name: str,
    time: float | None,
    cell: tuple[list[float], list[list[float]], list[bool]] | None,
    threads: int | None,
) -> NativeImage: ...
def write_spf(
    path: str,
    positions: np.ndarray,
    attributes: list[tuple[str, np.ndarray]],
    *,
    radius: float | None,
    time: float | None,
) -> None: ...
def run_job(
    file: str | None,
    settings: str,
    *,
    base: str,
    mode: str,
    progress: Callable[[dict[str, Any]], object] | None,
    threads: int | None,
) -> dict[str, Any]: ...
def job_dir(file: str | None, settings: str, *, base: str) -> str: ...
def write_manifest(path: str, settings: str, *, base: str) -> None: ...
