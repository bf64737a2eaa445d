"""Elevations of the ground from a GeoTIFF file: one band of metres, in any projection that EPSG numbers.

The file is read by tifffile, an extra of the package (`terrain`), within bounds of size.
"""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
from pyproj.exceptions import ProjError

from dojo_maps.errors import SourceError, ToolMissingError
from dojo_maps.geometry.polylines import Floats
from dojo_maps.input_files import read_bytes

_MOST_BYTES = 1 << 28
_MOST_PIXELS = 25_000_000
"""Of the file, and of its band once unpacked: 5,000 x 5,000, a city at a metre."""
_LOWEST, _HIGHEST = -500.0, 9000.0
"""Metres; what lies beyond is a mark for ground that nobody has measured."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ElevationGrid:
    """Elevations on a raster.

    Attributes:
        name: of the file.
        values: (rows, columns), metres, from the north down; NaN where nobody has measured.
        crs: EPSG's number of the system that the raster lies in.
        corner: x and y of the middle of the first pixel, in that system.
        step: x and y from one pixel to the next; y runs down the rows, so it is usually negative.
    """

    name: str
    values: Floats
    crs: int
    corner: tuple[float, float]
    step: tuple[float, float]

    def at(self, lon: Floats, lat: Floats) -> Floats:
        """Give the elevations of places, between pixels in proportion.

        Args:
            lon: (n,), degrees, WGS 84.
            lat: (n,), degrees.

        Returns:
            (n,), metres; NaN outside of the raster and where a neighbouring pixel is unknown.
        """
        x, y = pyproj.Transformer.from_crs(4326, self.crs, always_xy=True).transform(lon, lat)
        column = (np.asarray(x) - self.corner[0]) / self.step[0]
        row = (np.asarray(y) - self.corner[1]) / self.step[1]
        rows, columns = self.values.shape
        inside = (column >= 0) & (column <= columns - 1) & (row >= 0) & (row <= rows - 1)
        column, row = np.where(inside, column, 0.0), np.where(inside, row, 0.0)
        left, top = (np.minimum(v.astype(int), n - 2) for v, n in ((column, columns), (row, rows)))
        right, down = column - left, row - top
        upper = self.values[top, left] * (1 - right) + self.values[top, left + 1] * right
        lower = self.values[top + 1, left] * (1 - right) + self.values[top + 1, left + 1] * right
        return np.where(inside, upper * (1 - down) + lower * down, np.nan)


def read_elevations(path: Path) -> ElevationGrid:
    """Read a GeoTIFF.

    Args:
        path: of the file.

    Returns:
        Its elevations; NaN where the file has none, or one that no ground on earth has.

    Raises:
        SourceError: it is no GeoTIFF of elevations, or larger than is read.
        ToolMissingError: tifffile is not installed.
    """
    try:
        import tifffile  # noqa: PLC0415 - an extra, and only who gives a file needs it
    except ImportError:
        raise ToolMissingError(
            "reading a GeoTIFF needs tifffile; install it with pip install traffic-dojo[terrain]"
        ) from None
    data = read_bytes(path, most=_MOST_BYTES)
    try:
        with tifffile.TiffFile(io.BytesIO(data)) as file:
            page = file.pages.first
            shape, tags, unknown = page.shape, page.geotiff_tags, page.nodata
            _check_band(path, shape, page.dtype)
            values = np.array(page.asarray(), dtype=float)
    except SourceError:
        raise
    except Exception as problem:
        what = " ".join(str(problem).split()) or type(problem).__name__
        raise SourceError(path, f"not a TIFF file that can be read ({what})") from problem
    if tags is None:
        raise SourceError(path, "a TIFF file without a place on the earth; expected a GeoTIFF")
    values[(values == unknown) | ~((values > _LOWEST) & (values < _HIGHEST))] = np.nan
    corner, step = _place(path, tags)
    return ElevationGrid(name=path.name, values=values, crs=_system(path, tags), corner=corner, step=step)


def _check_band(path: Path, shape: tuple[int, ...], kind: Any) -> None:
    if len(shape) != 2 or min(shape) < 2 or kind is None or np.dtype(kind).kind not in "iuf":
        raise SourceError(path, f"has the shape {shape}; expected one band of elevations in metres")
    if shape[0] * shape[1] > _MOST_PIXELS:
        raise SourceError(
            path, f"has {shape[1]} x {shape[0]} pixels, at most {_MOST_PIXELS} are read; cut out the place"
        )


def _place(path: Path, tags: dict[str, Any]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Give the middle of the first pixel and the step from one to the next."""
    try:
        scale, tie = tags["ModelPixelScale"], tags["ModelTiepoint"]
        step = (float(scale[0]), -float(scale[1]))
        half = 0.0 if tags.get("GTRasterTypeGeoKey", 1) == 2 else 0.5
        corner = tuple(float(tie[3 + k]) + (half - float(tie[k])) * step[k] for k in (0, 1))
    except (KeyError, IndexError, TypeError, ValueError):
        raise SourceError(
            path, "does not say where its pixels lie (ModelPixelScale and ModelTiepoint, north up)"
        ) from None
    if not (np.isfinite([*corner, *step]).all() and step[0] > 0 > step[1]):
        raise SourceError(path, f"has pixels of {step[0]:g} x {-step[1]:g}; expected numbers above 0")
    return (corner[0], corner[1]), step


def _system(path: Path, tags: dict[str, Any]) -> int:
    code = int(tags.get("ProjectedCSTypeGeoKey") or tags.get("GeographicTypeGeoKey") or 0)
    try:
        pyproj.CRS.from_epsg(code)
    except ProjError:
        raise SourceError(
            path, f"lies in the system EPSG:{code}, which is unknown; convert it to EPSG:4326"
        ) from None
    return code
