"""Instruments' files as Datasets."""

import struct
from pathlib import Path

import nanotap
import numpy as np
import pytest
import xarray as xr

# As AFM Workshop writes a curve: the approach, then the retract.
CURVE = """Force-Distance Curve
Point:\t1
X, nm:\t{x}
Y, nm:\t250
Force Constant, nN/nm:\t0.5
Extend Z-Sense(nm),Extend Force(nN),Retract Z-Sense(nm),Retract Force(nN)
{rows}
"""


def curve(folder: Path, name: str, points: int, x: float = 0.0) -> Path:
    rows = [f"{100 + k},{0.5 * k},{200 - k},{-0.25 * k}" for k in range(points)]
    path = folder / name
    path.write_text(CURVE.format(x=x, rows="\n".join(rows)))
    return path


def test_a_curve_has_segments_units_and_what_the_file_says(tmp_path: Path) -> None:
    ds = nanotap.read(curve(tmp_path, "a.csv", 4), curve=0)
    assert list(ds["segment"].values) == ["approach"] * 4 + ["retract"] * 4
    assert ds.attrs["spring_constant"] == 0.5
    z = ds[ds.attrs["distance"]]
    assert z.attrs["units"] == "m"
    assert z.values == pytest.approx(
        1e-9 * np.array([100, 101, 102, 103, 200, 199, 198, 197])
    )
    approach = ds.where(ds["segment"] == "approach", drop=True)
    deflection = approach[ds.attrs["deflection"]]
    assert deflection.attrs["units"] in {"m", "N"}
    ds.to_netcdf(tmp_path / "curve.nc")
    again = xr.load_dataset(tmp_path / "curve.nc")
    xr.testing.assert_identical(again.drop_attrs(deep=False), ds.drop_attrs(deep=False))


def test_several_curves_lie_along_a_dimension(tmp_path: Path) -> None:
    ds = nanotap.read(curve(tmp_path, "a.csv", 3), curve="all")
    assert dict(ds.sizes) == {"curve": 1, "point": 6}
    with pytest.raises(ValueError, match="no curve 1"):
        nanotap.read(tmp_path / "a.csv", curve=[0, 1])


def test_an_image_has_axes(tmp_path: Path) -> None:
    head = (
        b"Gwyddion Simple Field 1.0\nXRes = 3\nYRes = 2\nXReal = 3e-6\nYReal = 2e-6\n"
    )
    head += b"ZUnits = m\nXYUnits = m\nTitle = height\n"
    head += b"\0" * (4 - len(head) % 4)
    path = tmp_path / "image.gsf"
    path.write_bytes(head + struct.pack("<6f", *range(6)))
    ds = nanotap.read(path, images=True)
    height = ds["height"]
    assert height.dims == ("y", "x")
    assert height.attrs["units"] == "m"
    assert ds["x"].values == pytest.approx([0.5e-6, 1.5e-6, 2.5e-6])
    # The first line of the file is the top one.
    assert ds["y"].values == pytest.approx([1.5e-6, 0.5e-6])
    np.testing.assert_array_equal(height.values, [[0, 1, 2], [3, 4, 5]])
    ds.to_netcdf(tmp_path / "image.nc")


def test_a_spectrum_has_frequencies(tmp_path: Path) -> None:
    path = tmp_path / "noise.tnd"
    path.write_text(
        "# thermal noise data\n# Channels: 'frequency' 'average'\n"
        "# Units: 'Hz' 'V^2/Hz'\n1.0 2.0\n2.0 3.0\n"
    )
    ds = nanotap.read(path, spectra=True)
    assert ds["frequency"].attrs["units"] == "Hz"
    np.testing.assert_array_equal(ds["average"], [2.0, 3.0])
