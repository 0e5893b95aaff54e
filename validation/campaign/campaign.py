"""Represent the measured pose deviations of a platform, one row per measurement."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.model.robot import Robot
from forcefit.results.display import Figures, html_table, short_repr
from forcefit.results.text import in_unit

if TYPE_CHECKING:
    import pandas
    import xarray

# Names of the six components of a pose deviation, with rotations first.
READING = ("rx", "ry", "rz", "tx", "ty", "tz")
LOAD = ("mx", "my", "mz", "fx", "fy", "fz")


@dataclass(frozen=True, eq=False)
class Campaign:
    """Measured pose deviations of a platform, in the order of the file.

    A campaign of R measurements has R rows, and its robot has n frames.  The nominal
    robot must be able to reach every commanded configuration.

    Attributes:
        name: name of the campaign's folder.
        robot: the declared robot.
        ids: R unique labels.
        coordinates: (R, n) [rad or m] joint coordinates of the nominal robot.
        transforms: (R, n, 4, 4) poses of the frames in the base frame, without
            imperfections.
        mismatch: (R,) [rad, m] closure error of the nominal loops, due to rounded
            numbers in robot files.
        commanded: how the file specifies commands, ``"joints"`` or ``"pose"``.
        loads: (R, 6) [N m, N] loads on the platform at the reference point, base axes.
        measured: (R, 6) [rad, m] measured deviations rx ry rz tx ty tz at the reference
            point, base axes, NaN if not measured.
        sigma: (R, 6) [rad, m] standard deviations of the readings, NaN if unknown.  The
            standard deviation of a measured component is always known.
        covariates: mapping from the name of each covariate, without ``cov.``, to (R,)
            values.
        reference_point: (3,) [m] measured point, platform axes.
        registration: ``"known"``, or ``"unknown"`` if the pose of the measuring device
            is unknown.
        configuration: (R,) index of the commanded configuration, from 0.
        repeat: (R,) index of the combination of configuration and load, from 0. Rows
            with the same index are repeated measurements.
        session: (R,) name of the session of each row.  None without sessions.
        motion_units: unit (``rad`` or ``m``) of each covariate that is a measured
            motion, by name.
        points: mapping from the name of each additional measured point to its position
            (3,) [m], platform axes.
        per_session: names of additional effects that may differ between sessions.
        partial: (R,) values of each covariate that was recorded only in some sessions,
            by name; NaN in the other sessions.
        point: (R,) name of the measured point, ``""`` for the reference point.  None if
            only the reference point was measured.  If a row of the file contains
            several points, the campaign contains a row for each of them.
        common: (R, 6, k) [rad, m] additional noise that is common to the readings in
            one row of the file. This noise is ``common`` times k standard normal
            variables, which are the same for all readings in the row. None if there is
            no such noise.
    """

    name: str
    robot: Robot
    ids: tuple[str, ...]
    coordinates: NDArray
    transforms: NDArray
    mismatch: NDArray
    commanded: str
    loads: NDArray
    measured: NDArray
    sigma: NDArray
    covariates: dict[str, NDArray]
    reference_point: NDArray
    registration: str
    configuration: NDArray
    repeat: NDArray
    session: NDArray | None = None
    motion_units: Mapping[str, str] = field(default_factory=dict)
    points: Mapping[str, NDArray] = field(default_factory=dict)
    point: NDArray | None = None
    partial: Mapping[str, NDArray] = field(default_factory=dict)
    per_session: tuple[str, ...] = ()
    common: NDArray | None = None

    __repr__, _repr_html_, summary = short_repr, html_table, short_repr

    def _figures(self) -> Figures:
        """Return the number of rows, the noise and other figures for display."""
        cells, sizes = self.cells, []
        for unit, part in (("urad", slice(3)), ("um", slice(3, 6))):
            sigma = self.sigma[:, part][cells[:, part]]
            if sigma.size:
                sizes.append(in_unit(np.sqrt(np.mean(sigma**2)), unit, 3))
        return {
            "robot": self.robot.name,
            "rows": f"{len(self)}, of {len(set(self.configuration.tolist()))} "
            f"configurations; {len(self) - len(set(self.repeat.tolist()))} repeats",
            "commanded": self.commanded,
            "cells": f"{int(cells.sum())} of {cells.size} measured",
            "sigma": ", ".join(sizes) or "none",
            "loaded": f"{int(self.loads.any(axis=1).sum())} rows",
            "covariates": ", ".join(self.covariates) or "none",
            **({"in some sessions": ", ".join(self.partial)} if self.partial else {}),
            "registration": self.registration,
            **({"points": ", ".join(self.points)} if self.points else {}),
            **({"sessions": ", ".join(self.sessions)} if self.sessions else {}),
        }

    def __post_init__(self) -> None:
        R, n = len(self.ids), len(self.robot.frames)
        shapes = {
            "coordinates": (R, n), "transforms": (R, n, 4, 4), "mismatch": (R,),
            "loads": (R, 6), "measured": (R, 6), "sigma": (R, 6),
            "reference_point": (3,), "configuration": (R,), "repeat": (R,),
        }  # fmt: skip
        for name, shape in shapes.items():
            object.__setattr__(self, name, _locked(self, name, shape))
        for name in ("session", "point"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _locked(self, name, (R,)))
        if self.common is not None:
            shape = (R, 6, np.shape(self.common)[-1])
            object.__setattr__(self, "common", _locked(self, "common", shape))
        covariates = {k: _column(v, R, k) for k, v in self.covariates.items()}
        object.__setattr__(self, "covariates", covariates)

    def to_xarray(self) -> "xarray.Dataset":
        """Convert to an xarray data set with the dimension ``row``."""
        from forcefit.validation.campaign.tables import campaign_dataset

        return campaign_dataset(self)

    def to_pandas(self) -> "pandas.DataFrame":
        """Convert to a pandas table with one row per measurement."""
        from forcefit.assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "row")

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def cells(self) -> NDArray:
        """Mask (R, 6), True where a component was measured."""
        return np.isfinite(self.measured)

    @property
    def not_measured(self) -> list[str]:
        """Names of the components that were never measured."""
        seen = zip(READING, self.cells.T, strict=True)
        return [name for name, cells in seen if not cells.any()]

    @property
    def sessions(self) -> tuple[str, ...]:
        """Names of the sessions in order of first use.  Empty without sessions."""
        return (
            () if self.session is None else tuple(dict.fromkeys(self.session.tolist()))
        )

    @property
    def targets(self) -> NDArray:
        """Position (R, 3) [m] of the measured point of each row, platform axes."""
        if self.point is None:
            return np.broadcast_to(self.reference_point, (len(self), 3))
        places = {**self.points, "": self.reference_point}
        return np.array([places[name] for name in self.point])

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels (R,) of the rows in the file.

        All points measured in a row have the same label.
        """
        if self.point is None:
            return self.ids
        pairs = zip(self.ids, self.point.tolist(), strict=True)
        return tuple(i.removesuffix(f":{name}") if name else i for i, name in pairs)

    @property
    def measured_at_once(self) -> NDArray:
        """Index (R,) of the row in the file for each row of the campaign.

        All points measured in a row of the file have the same index.
        """
        number = dict[str, int]()
        rows = [number.setdefault(label, len(number)) for label in self.labels]
        return np.array(rows, dtype=int)

    def in_session(self, session: str | None) -> NDArray:
        """Return a mask (R,) of the rows of a session.  None selects all rows."""
        every = np.ones(len(self), dtype=bool)
        return every if session is None else np.asarray(self.session == session)

    def take(self, rows: ArrayLike | slice) -> "Campaign":
        """Select rows without renumbering ``configuration`` and ``repeat``.

        Args:
            rows: row indices, a mask (R,), or a slice.

        Returns:
            A campaign that contains the selected rows in the given order.
        """
        chosen = np.arange(len(self))[rows if isinstance(rows, slice) else _index(rows)]
        names = (
            "coordinates", "transforms", "mismatch", "loads", "measured", "sigma",
            "configuration", "repeat",
        )  # fmt: skip
        return replace(
            self,
            ids=tuple(self.ids[i] for i in chosen),
            covariates={k: v[chosen] for k, v in self.covariates.items()},
            partial={k: v[chosen] for k, v in self.partial.items()},
            session=None if self.session is None else self.session[chosen],
            point=None if self.point is None else self.point[chosen],
            common=None if self.common is None else self.common[chosen],
            **{name: getattr(self, name)[chosen] for name in names},
        )


def number_rows(*columns: ArrayLike, step: float = 1e-9) -> NDArray:
    """Number rows from 0. Equal rows have the same number.

    Args:
        columns: (R,) or (R, k) arrays to compare.  NaN is equal to NaN.
        step: values that differ by less than this are treated as equal.

    Returns:
        (R,) number of each row, in order of first occurrence.
    """
    table = np.column_stack([np.asarray(c, dtype=float) for c in columns])
    table = np.round(table / step)
    _, first, number = np.unique(
        np.nan_to_num(table, nan=np.inf), axis=0, return_index=True, return_inverse=True
    )
    rank = np.empty(len(first), dtype=int)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[number.reshape(-1)]


def _index(rows: ArrayLike) -> NDArray:
    """Return the index array of selected rows.

    An empty list selects no row.
    """
    index = np.asarray(rows)
    return index.astype(int) if index.size == 0 else index


def _locked(campaign: Campaign, name: str, shape: tuple[int, ...]) -> NDArray:
    """Check the shape of a campaign's array and return a read-only copy."""
    array = np.array(getattr(campaign, name))
    if array.shape != shape:
        whose = f"campaign '{campaign.name}': {name}"
        raise ValueError(f"{whose} has shape {array.shape}, expected {shape}")
    array.setflags(write=False)
    return array


def _column(values: ArrayLike, rows: int, name: str) -> NDArray:
    """Check the length and values of a covariate and return a read-only copy."""
    array = np.array(values, dtype=float)
    if array.shape != (rows,) or not np.isfinite(array).all():
        raise ValueError(f"covariate '{name}': expected {rows} finite numbers")
    array.setflags(write=False)
    return array
