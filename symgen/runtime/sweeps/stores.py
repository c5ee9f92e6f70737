"""Stores of the results of a sweep: in memory, or in a Zarr group that is written chunk by chunk."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import warnings
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.atomic import write_text
from symgen.errors import ModelError, OutputError, ResultError
from symgen.runtime.digest import digest
from symgen.runtime.sweeps.layout import SweepLayout

if TYPE_CHECKING:
    import xarray

Array = NDArray[Any]
#: The array that marks finished runs; its chunks are written last.
DONE = "done"
#: The array with a digest of the results of each chunk, the same for all of its runs.
DIGEST = "digest"
#: Ending of the folders of a store.
ENDING = ".zarr"


class MemoryStore:
    """Results of a sweep in memory."""

    def __init__(self, layout: SweepLayout, count: int, chunk: int, attributes: Mapping[str, str]) -> None:
        self.layout, self.count, self.chunk, self.attributes = layout, count, chunk, attributes
        self.arrays = {entry.name: entry.empty(count) for entry in layout.entries}

    def is_done(self, first: int) -> bool:
        """Return false: nothing is there before it is computed."""
        return False

    def write(self, first: int, arrays: Mapping[str, Array]) -> None:
        """Write the chunk that begins with a run."""
        for name, values in arrays.items():
            self.arrays[name][first : first + len(values)] = values

    def dataset(self) -> xarray.Dataset:
        """Return the results of all runs."""
        from symgen.runtime.sweeps.dataset import SweepDataset

        entries = self.layout.entries
        variables = {e.name: (("run", *e.dims), self.arrays[e.name], dict(e.attributes)) for e in entries}
        coordinates: dict[str, Any] = {e.name: variables.pop(e.name) for e in entries if e.coordinate}
        if self.layout.axes:
            coordinates["axis"] = list(self.layout.axes)
        return SweepDataset(variables, coordinates, self.attributes)


class Zarr:
    """Results of a sweep in a Zarr group, which xarray reads: also while others write to it.

    Every chunk of every array is a file. A chunk counts once its part of the array ``done`` is written, which
    is last; files appear whole. Several processes may write chunks of one store.
    """

    def __init__(self, path: Path) -> None:
        described = path / ".zattrs"
        try:
            about = json.loads(described.read_bytes())["sweep"]
            self.identity, self.chunk = str(about["identity"]), int(about["chunk"])
        except (OSError, KeyError, ValueError, TypeError):
            if not (path / DONE).is_dir():
                raise ResultError(f"{path} is not the store of a sweep") from None
            raise ResultError(
                f"{described} is damaged: it names the sweep that the results in {path} are of\n"
                "  Restore the file from a copy, or remove the store, so that the sweep is computed again."
            ) from None
        self.path, self.names = path, tuple[str, ...]()
        self.group: Any = None  # until descriptions are restored

    @classmethod
    def created(cls, path: Path, layout: SweepLayout, sweep: Any, chunk: int) -> Zarr:
        """Create an empty store, which appears complete; another process may be faster."""
        aside = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.absolute().parent))
        try:
            aside.chmod(0o755)
            cls._described(aside, layout, sweep, chunk)
            with suppress(FileExistsError):
                _renamed(aside, path)
        except OSError as error:
            raise OutputError.of(path, error) from None
        finally:
            shutil.rmtree(aside, ignore_errors=True)
        return cls(path)

    def restored(self, layout: SweepLayout, sweep: Any) -> None:
        """Restore damaged descriptions and names of axes, with a warning each, and open the store."""
        import zarr

        self.names = tuple(entry.name for entry in layout.entries)
        with tempfile.TemporaryDirectory() as folder:
            self._described(Path(folder), layout, sweep, self.chunk)
            for intact in sorted(Path(folder).rglob(".z*")):
                file = self.path / intact.relative_to(folder)
                if not _agrees(file, json.loads(intact.read_bytes())):
                    warnings.warn(f"{file} is damaged: it is restored", stacklevel=2)
                    file.parent.mkdir(exist_ok=True)
                    write_text(file, intact.read_text(encoding="utf-8"))
        self.group = zarr.open_group(self.path, mode="r+", zarr_format=2)
        if layout.axes and self._axes() != layout.axes:
            warnings.warn(f"{self.path / 'axis'} is damaged: it is restored", stacklevel=2)
            self.group["axis"][:] = np.array(layout.axes, dtype=object)

    def _axes(self) -> tuple[str, ...]:
        """Return the names of axes in the store; none if they cannot be read."""
        try:
            return tuple(map(str, self.group["axis"][:]))
        except Exception:  # of zarr, its codecs and the file system alike
            return ()

    @staticmethod
    def _described(path: Path, layout: SweepLayout, sweep: Any, chunk: int) -> None:
        """Write the descriptions of all arrays to a folder."""
        import zarr
        from numcodecs import Zstd

        group = zarr.open_group(path, mode="w", zarr_format=2)
        coordinates = " ".join(e.name for e in layout.entries if e.coordinate and " " not in e.name)
        group.attrs.update({**sweep.attributes, "sweep": {"identity": sweep.identity, "chunk": chunk}})
        for entry in layout.entries:
            shape = (sweep.design.count, *entry.sizes)
            group.create_array(
                entry.name,
                shape=shape,
                chunks=(chunk, *entry.sizes),
                dtype=str if entry.text else "<f8",
                fill_value=None if entry.text else np.nan,
                compressors=Zstd(level=1, checksum=True),  # Blosc orders its blocks by its threads
                attributes={**entry.attributes, "_ARRAY_DIMENSIONS": ["run", *entry.dims]},
            )
        group.create_array(
            DIGEST,
            shape=(sweep.design.count,),
            chunks=(chunk,),
            dtype="<u8",
            fill_value=0,
            compressors=Zstd(level=1, checksum=True),
            attributes={
                "long_name": "digest of the results of the chunk of the run",
                "_ARRAY_DIMENSIONS": ["run"],
            },
        )
        about = {"long_name": "1 where the run is finished", "coordinates": coordinates}
        group.create_array(
            DONE,
            shape=(sweep.design.count,),
            chunks=(chunk,),
            dtype="u1",
            fill_value=None,
            compressors=Zstd(level=1, checksum=True),
            attributes={**about, "_ARRAY_DIMENSIONS": ["run"]},
        )
        if layout.axes:
            axes = group.create_array(
                "axis", shape=(len(layout.axes),), dtype=str, attributes={"_ARRAY_DIMENSIONS": ["axis"]}
            )
            axes[:] = np.array(layout.axes, dtype=object)

    def is_done(self, first: int) -> bool:
        """Return whether the chunk that begins with a run is there and intact; warn of a damaged one."""
        done, damage = self._state(first)
        if damage:
            warnings.warn(f"{damage}: it is computed again", stacklevel=2)
            number = first // self.chunk
            for name in (*self.names, DIGEST, DONE):
                for file in (self.path / name).glob(f"{number}*"):
                    if file.name.partition(".")[0] == str(number):
                        file.unlink(missing_ok=True)
        return done

    def warn_of_damage(self, first: int) -> None:
        """Warn of a damaged chunk that another process has written."""
        if damage := self._state(first)[1]:
            warnings.warn(f"{damage}: continue its part of the sweep", stacklevel=2)

    def _state(self, first: int) -> tuple[bool, str]:
        """Return whether the chunk that begins with a run is there and intact, and its damage in words."""
        span = slice(first, first + self.chunk)
        try:
            if not self.group[DONE][first]:
                return False, ""
            stored = {name: self.group[name][span] for name in self.names}
            if np.all(self.group[DIGEST][span] == _digest(stored)):
                return True, ""
            cause = "its digest differs"
        except Exception as error:  # of zarr, its codecs and the file system alike
            cause = str(error).partition("\n")[0] or type(error).__name__
        last = min(span.stop, self.group[DONE].shape[0]) - 1
        runs = f"chunk {first // self.chunk} of {self.path}, runs {first} to {last}"
        return False, f"{runs}, is damaged ({cause})"

    def write(self, first: int, arrays: Mapping[str, Array]) -> None:
        """Write the chunk that begins with a run."""
        count = 0
        try:
            for name, values in arrays.items():
                count = len(values)
                self.group[name][first : first + count] = values
            self.group[DIGEST][first : first + count] = _digest(arrays)
            self.group[DONE][first : first + count] = 1
        except OSError as error:
            raise OutputError.of(self.path, error) from None

    def dataset(self) -> xarray.Dataset:
        """Return the results of all runs, read when they are used."""
        return opened(self.path)


def _agrees(file: Path, intact: dict[str, Any]) -> bool:
    """Return whether a description agrees with an intact one, by whichever version of Zarr it was written."""
    try:
        there = json.loads(file.read_bytes())
        if "shape" in intact:
            return _read_as(there) == _read_as(intact)
        return all(there[key] == value for key, value in intact.items())
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False


def _read_as(array: dict[str, Any]) -> list[Any]:
    """Return the part of the description of an array by which its chunks are read."""
    codecs = [codec["id"] for codec in (array["compressor"], *(array.get("filters") or ()))]
    missing = array["fill_value"] if array["dtype"] == "<f8" else None
    exact = [array[key] for key in ("zarr_format", "shape", "chunks", "dtype", "order")]
    return [*exact, codecs, missing, array.get("dimension_separator", ".")]


def _digest(arrays: Mapping[str, Array]) -> int:
    """Return 64 bits of the digest of the results of a chunk."""
    return int(digest(arrays)[:16], 16)


def _renamed(source: Path, target: Path) -> None:
    """Rename a folder; raise FileExistsError where the target is there."""
    if target.exists():
        raise FileExistsError(target)
    try:
        source.rename(target)
    except OSError:
        if target.exists():
            raise FileExistsError(target) from None
        raise


def opened(path: str | os.PathLike[str]) -> xarray.Dataset:
    """Return the results in a Zarr store, read when they are used."""
    import xarray

    needed("a sweep in a file", "zarr")
    return xarray.open_zarr(path, consolidated=False, chunks=None)


def needed(use: str, *packages: str, extra: str = "sweep") -> None:
    """Raise ModelError with the use and the remedy unless packages of an extra are installed."""
    from importlib.util import find_spec

    missing: Iterable[str] = [name for name in packages if find_spec(name) is None]
    if missing:
        raise ModelError(f"{use} needs {' and '.join(missing)}: pip install 'symgen[{extra}]'")
