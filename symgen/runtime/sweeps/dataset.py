"""Results of a sweep as a dataset, which notebooks show with its figures and extremes."""

from __future__ import annotations

import xarray

from symgen.display import display


class SweepDataset(xarray.Dataset):
    """A dataset over ``run``, which notebooks show with its figures and the extremes of its outputs."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        own: str = super()._repr_html_()
        whole = self.sizes.get("run", 0) > 1 and "title" in self.attrs and "error" in self
        return display("sweep_html", self) + own if whole else own
