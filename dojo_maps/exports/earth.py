"""Between the map's metres and degrees on the earth."""

from typing import Any

import numpy as np
import pyproj

from dojo_maps.errors import ExportError
from dojo_maps.geometry.polylines import Floats


class Earth:
    """A network's projection, both ways."""

    def __init__(self, proj: str, net_offset: tuple[float, float]) -> None:
        """Take a PROJ string, and the offset of the map's coordinates, metres.

        Raises:
            ExportError: the projection is unknown.
        """
        self._name, self._offset = proj, net_offset
        try:
            # Without a datum shift, because SUMO applies none on the way in.
            self._convert = pyproj.Proj(proj)
        except pyproj.exceptions.CRSError as error:
            raise ExportError(
                f"the network's projection {proj[:200]!r} is not one that PROJ knows: {error}; "
                "correct projParameter in its <location>"
            ) from error

    def degrees(self, positions: Any) -> tuple[Floats, Floats]:
        """Turn positions on the map into places on the earth.

        Args:
            positions: (n, 2 or more), metres, map frame; only x and y count.

        Returns:
            Longitudes (n,) and latitudes (n,), degrees.

        Raises:
            ExportError: they do not fit the projection.
        """
        try:
            x, y = positions[:, 0] - self._offset[0], positions[:, 1] - self._offset[1]
            longitudes, latitudes = self._convert(x, y, inverse=True)
        except pyproj.exceptions.ProjError as error:
            raise ExportError(f"{self._does_not_fit()}: {error}") from error
        if not (np.abs(longitudes) <= 180.0).all() or not (np.abs(latitudes) <= 90.0).all():
            raise ExportError(self._does_not_fit())
        return longitudes, latitudes

    def positions(self, longitudes: Any, latitudes: Any) -> Floats:
        """Turn places on the earth into positions on the map.

        Args:
            longitudes: (n,), degrees.
            latitudes: (n,), degrees.

        Returns:
            (n, 2), metres, map frame.

        Raises:
            ExportError: they do not fit the projection.
        """
        try:
            x, y = self._convert(longitudes, latitudes, errcheck=True)
        except pyproj.exceptions.ProjError as error:
            raise ExportError(f"a place lies outside the projection {self._name[:200]!r}: {error}") from error
        return np.column_stack([x, y]) + self._offset

    def _does_not_fit(self) -> str:
        return (
            f"the network's coordinates lie outside its projection {self._name[:200]!r}; "
            "correct projParameter and netOffset in its <location>"
        )
