"""The table of a study as columns: Parquet, data frame, dataset."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from copose.errors import InputError
from copose.results import whole_file
from copose.results.arrays import package
from copose.studies.points.hashes import RECORD_FORMAT
from copose.studies.points.points import Axis
from copose.studies.study import StudyFolder
from copose.studies.table import StudyTable, by_arm

if TYPE_CHECKING:
    import pandas
    import xarray


@overload
def read_study(folder: str | Path, form: Literal["dataframe"] = ...) -> pandas.DataFrame: ...
@overload
def read_study(folder: str | Path, form: Literal["xarray"]) -> xarray.Dataset: ...
def read_study(
    folder: str | Path, form: Literal["dataframe", "xarray"] = "dataframe"
) -> pandas.DataFrame | xarray.Dataset:
    """The table of a study.

    Args:
        folder: of the study, with its ``study.jsonl``.
        form: a data frame with a row a point, or a dataset over the grid, of a sample over points.

    Raises:
        InputError: the folder is none of a study, or pandas, or xarray, is not installed.
    """
    if form not in ("dataframe", "xarray"):
        raise InputError(f"{form!r} is neither 'dataframe' nor 'xarray'", key="form")
    place = StudyFolder(Path(folder))
    table = StudyTable.of(place.study(), place)
    return study_frame(table) if form == "dataframe" else study_dataset(table)


def study_frame(table: StudyTable) -> pandas.DataFrame:
    """A row a point, a column a key.

    Raises:
        InputError: pandas is not installed.
    """
    frame: pandas.DataFrame = package("pandas", "study").DataFrame(
        list(rows(table)), columns=list(_kinds(table))
    )
    return frame.set_index("point")


def study_dataset(table: StudyTable) -> xarray.Dataset:
    """Objective, recorded numbers and status over the grid and the seeds, of a sample over points.

    Raises:
        InputError: xarray is not installed.
    """
    points = table.study.points
    columns = {**table.numbers, "status": np.array(table.statuses), "seconds": table.seconds}
    coordinates: dict[str, Any]
    if points.sampled:
        dimensions: tuple[str, ...] = ("point",)
        sizes: tuple[int, ...] = (len(table),)
        coordinates = {"point": np.arange(len(table))}
        coordinates |= {k: ("point", _plain(table.column(k))) for k in table.study.file.keys}
        coordinates["seed"] = ("point", [points.seed(i) for i in range(len(table))])
    else:
        dimensions = (*(axis.label for axis in points.axes), "seed")
        sizes = (*points.shape, len(points.seeds))
        coordinates = {axis.label: _ticks(axis) for axis in points.axes}
        coordinates["seed"] = list(points.seeds)
    variables = {name: (dimensions, column.reshape(sizes)) for name, column in columns.items()}
    return package("xarray", "study").Dataset(variables, coordinates)


def write_parquet(table: StudyTable, file: Path, rows_at_once: int = 10_000) -> None:
    """Write a table as Parquet, the format of the record in its metadata.

    Raises:
        InputError: pyarrow is not installed, or the file cannot be written.
    """
    arrow, parquet = package("pyarrow", "study"), package("pyarrow.parquet", "study")
    kinds = {
        "number": arrow.float64(),
        "whole": arrow.int64(),
        "text": arrow.string(),
        "vector": arrow.list_(arrow.float64()),
    }
    fields = [arrow.field(name, kinds[kind]) for name, kind in _kinds(table).items()]
    schema = arrow.schema(fields, {"copose": f"study, format {RECORD_FORMAT}"})
    with whole_file(file) as content, parquet.ParquetWriter(content, schema) as writer:
        block = list[dict[str, Any]]()
        for row in rows(table):
            block.append(row)
            if len(block) == rows_at_once:
                writer.write_table(arrow.Table.from_pylist(block, schema))
                block = []
        writer.write_table(arrow.Table.from_pylist(block, schema))


def rows(table: StudyTable) -> Iterator[dict[str, Any]]:
    """A row for each point, by the names of the columns; None where there is nothing."""
    kinds, study = _kinds(table), table.study
    for point in range(len(table)):
        row: dict[str, Any] = dict.fromkeys(kinds)
        row |= {"point": point, "seed": study.points.seed(point), "status": table.statuses[point]}
        for key, value in table.values(point).items():
            row[key] = _text(value) if kinds[key] == "text" else value
        line = table.line(point)
        if line is not None:
            row |= {key: line[key] for key in ("reason", "objective", "seconds", "hash")}
            row["missing"] = ", ".join(line["missing"])
            row |= {name: _float(value) for name, value in line["record"].items()}
            row |= {f"joints.{arm}": q for arm, q in by_arm(line["joints"] or {})}
        yield {name: row[name] for name in kinds}


def _kinds(table: StudyTable) -> dict[str, str]:
    """The kind of every column by its name, in order."""
    study = table.study
    kinds = {"point": "whole"}
    for axis in study.points.axes:
        kinds |= {key: "number" if axis.numeric(key) else "text" for key in axis.keys}
    kinds |= {"seed": "whole", "status": "text", "reason": "text", "objective": "number"}
    kinds |= dict.fromkeys(study.file.record, "number")
    kinds |= {f"joints.{arm}": "vector" for arm in table.arms}
    return kinds | {"missing": "text", "seconds": "number", "hash": "text"}


def _float(value: Any) -> float | None:
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else None


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, default=str)


def _ticks(axis: Axis) -> list[Any]:
    """The values of an axis of a grid; of several keys the rows as texts."""
    rows_of_axis = axis.rows or ()
    return _plain([row[0] if len(axis.keys) == 1 else list(row) for row in rows_of_axis])


def _plain(values: list[Any]) -> list[Any]:
    """Numbers as they are, all else as texts."""
    numbers = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values)
    return values if numbers else [_text(value) for value in values]
