"""Types of the compiled module."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, final
from typing_extensions import disjoint_base

import numpy as np
import numpy.typing as npt

__all__ = [
    "BusyError",
    "DeviceError",
    "Frame",
    "InputError",
    "InternalError",
    "LanesweepError",
    "LimitState",
    "MissingFile",
    "RunStopped",
    "SystemRefusal",
    "UsageError",
    "VerificationError",
    "__version__",
    "described",
    "frame_of_columns",
    "frame_of_stream",
    "lists",
    "main",
    "profile",
    "register",
    "run",
    "simulate",
]
__version__: str

class LanesweepError(Exception):
    """An error of lanesweep.

    Attributes
    ----------
    problem : str
        Where and what.
    help : str or None
        What to do.
    exit_code : int
        The exit code of the program for it.
    """

    problem: str
    help: str | None
    exit_code: int

class UsageError(LanesweepError, ValueError): ...
class InputError(LanesweepError, ValueError): ...
class SystemRefusal(LanesweepError, OSError): ...
class MissingFile(SystemRefusal, FileNotFoundError): ...
class DeviceError(LanesweepError): ...
class VerificationError(LanesweepError): ...
class BusyError(LanesweepError): ...
class RunStopped(LanesweepError): ...
class InternalError(LanesweepError): ...

@final
class Frame:
    def __len__(self) -> int: ...
    @property
    def columns(self) -> list[str]: ...
    @property
    def units(self) -> dict[str, str]: ...
    @property
    def descriptions(self) -> dict[str, str]: ...
    def __arrow_c_stream__(self, requested_schema: Any | None = None) -> Any: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    def __getitem__(self, name: str, /) -> npt.NDArray[Any]: ...
    def __reduce__(self) -> tuple[Any, tuple[bytes]]: ...
    def to_numpy(self) -> dict[str, npt.NDArray[Any]]: ...
    def to_pandas(self) -> Any: ...
    def to_polars(self) -> Any: ...
    def _repr_html_(self) -> str: ...

@disjoint_base
class LimitState:
    def __new__(
        cls,
        density: Any,
        *,
        model: str,
        criterion: str,
        thw: str | None,
        profile: str,
        backend: str,
        device: str | None,
    ) -> LimitState: ...
    @property
    def parameters(self) -> list[str]: ...
    @property
    def points(self) -> list[list[float]]: ...
    @property
    def kernel_deviations(self) -> list[float]: ...
    @property
    def valid_share(self) -> float: ...
    def from_standard_normal(self, u: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]: ...
    def is_valid(self, points: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]: ...
    def log_density(self, points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]: ...
    def _draw(self, count: int, seed: int) -> npt.NDArray[np.float64]: ...
    def _estimate(
        self, points: npt.NDArray[np.float64], log_density: npt.NDArray[np.float64] | None, level: float
    ) -> str: ...
    def __call__(self, points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]: ...

def run(
    function: str,
    call: str,
    arguments: dict[str, bool | list[str | Path]],
    on_progress: Callable[[str, int, int | None], None] | None = None,
    on_message: Callable[[str, str], None] | None = None,
) -> tuple[int, str, str, list[tuple[str, Frame]]]: ...
def main(words: Sequence[str]) -> int: ...
def described(function: str) -> dict[str, Any]: ...
def lists() -> dict[str, Any]: ...
def profile(name: str) -> dict[str, Any]: ...
def frame_of_columns(columns: dict[str, Any]) -> Frame: ...
def frame_of_stream(bytes: bytes) -> Frame: ...
def simulate(
    cases: Any,
    *,
    category: str | None,
    models: list[str],
    thw: list[str],
    profile: str,
    dt: float | None,
    backend: str,
    device: str | None,
    reference: bool,
    accept_implausible: bool,
    on_message: Callable[[str, str], None] | None = None,
) -> tuple[Frame, list[str]]: ...
def register(
    name: str,
    fingerprint: str,
    driver: Any,
    may_accelerate: bool,
    attention: str,
    compiled: tuple[int, list[float], int, bool] | None,
) -> None: ...
