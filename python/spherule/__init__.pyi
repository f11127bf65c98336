from collections.abc import Callable, Mapping
from collections.abc import Sequence as _SequenceType
from os import PathLike
from typing import Any, Literal, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

__version__: str

_Path: TypeAlias = str | PathLike[str]
_Settings: TypeAlias = Mapping[str, Any]

class Error(Exception):
    file: str | None
    place: str | None
    remedy: str | None

class InputError(Error): ...
class ArrayError(InputError, ValueError): ...
class SettingError(Error, ValueError): ...
class OutputError(Error): ...
class JobError(Error): ...
class InternalError(Error): ...

class Cell:
    vectors: np.ndarray
    origin: tuple[float, float, float]
    periodic: tuple[bool, bool, bool]
    def __init__(
        self,
        vectors: ArrayLike,
        origin: tuple[float, float, float] = ...,
        periodic: tuple[bool, bool, bool] = ...,
    ) -> None: ...

class Frame:
    positions: np.ndarray
    radius: float | np.ndarray | None
    attributes: dict[str, np.ndarray]
    time: float | None
    origin: tuple[float, float, float]
    number: int
    up: str
    name: str
    notes: list[str]
    cell: Cell | None
    def __init__(
        self,
        positions: np.ndarray,
        radius: float | np.ndarray | None = ...,
        attributes: dict[str, np.ndarray] = ...,
        time: float | None = ...,
        origin: tuple[float, float, float] = ...,
        number: int = ...,
        up: str = ...,
        name: str = ...,
        notes: list[str] = ...,
        cell: Cell | None = ...,
    ) -> None: ...
    def __len__(self) -> int: ...

class Sequence(_SequenceType[Frame]):
    numbers: list[int]
    notes: list[str]
    def __len__(self) -> int: ...
    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def frame(self, number: int) -> Frame: ...

class Image:
    width: int
    height: int
    planes: dict[str, np.ndarray]
    notes: list[str]
    origin: tuple[float, float, float]
    color_range: tuple[float, float] | None
    range: tuple[float, float] | None
    camera: dict[str, Any]
    @property
    def rgba(self) -> np.ndarray: ...
    @property
    def srgb(self) -> np.ndarray: ...
    def __array__(self, dtype: DTypeLike | None = ..., copy: bool | None = ...) -> np.ndarray: ...
    def __getitem__(self, name: str) -> np.ndarray: ...
    def to_exr(self) -> bytes: ...
    def to_png(self) -> bytes: ...
    def save(self, path: _Path) -> None: ...
    def _repr_png_(self) -> bytes: ...

class Job:
    def __init__(self, manifest: _Settings | _Path, *, settings: _Settings | None = ...) -> None: ...
    @property
    def dir(self) -> str: ...
    def run(
        self,
        *,
        progress: Callable[[dict[str, Any]], object] | None = ...,
        mode: Literal["resume", "force", "keep_done"] = ...,
        threads: int | None = ...,
    ) -> dict[str, Any]: ...
    def check(self) -> dict[str, Any]: ...
    def status(self) -> dict[str, Any]: ...
    def verify(self) -> list[dict[str, Any]]: ...

class Explorer:
    url: str
    @property
    def settings(self) -> dict[str, Any]: ...
    @property
    def camera(self) -> dict[str, Any] | None: ...
    @property
    def frame(self) -> int | None: ...
    def close(self) -> None: ...
    def __enter__(self) -> Explorer: ...
    def __exit__(self, *_: object) -> None: ...
    def _repr_html_(self) -> str: ...

def explore(
    data: ArrayLike | Frame | _Path,
    *,
    attributes: Mapping[str, ArrayLike] | None = ...,
    radius: ArrayLike | None = ...,
    settings: _Settings | None = ...,
    height: int = ...,
) -> Explorer: ...
def render(
    positions: ArrayLike | Frame,
    *,
    look: Literal["auto", "plain", "paper", "studio", "water", "whitted", "none"] | None = ...,
    radius: ArrayLike | Literal["auto", "vdw", "covalent"] | None = ...,
    attributes: Mapping[str, ArrayLike] | None = ...,
    camera: _Settings | None = ...,
    settings: _Settings | None = ...,
    time: float | None = ...,
    size: tuple[int, int] | None = ...,
    samples: int | None = ...,
    color: Any = ...,
    channels: list[str] | None = ...,
    up: Literal["x", "y", "z", "-x", "-y", "-z"] | None = ...,
    cell: Cell | ArrayLike | None = ...,
    frame: int = ...,
    name: str = ...,
    threads: int | None = ...,
) -> Image: ...
def sequence(
    path: _Path | list[_Path], *, follow_links: bool = ..., mesh_points: bool = ..., topology: _Path | None = ...
) -> Sequence: ...
def read(
    path: _Path | list[_Path], frame: int | None = ..., *, mesh_points: bool = ..., topology: _Path | None = ...
) -> Frame: ...
def write_spf(
    path: _Path,
    positions: ArrayLike,
    *,
    radius: ArrayLike | None = ...,
    attributes: Mapping[str, ArrayLike] | None = ...,
    time: float | None = ...,
) -> None: ...
def inspect(path: _Path) -> dict[str, Any]: ...
def command() -> str: ...
def movie(job: _Path, path: _Path, **options: Any) -> str: ...
def sheet(job: _Path, path: _Path, **options: Any) -> str: ...
