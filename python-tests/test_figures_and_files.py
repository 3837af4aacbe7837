"""Figures of every result, and the files that other programs read."""

import json
import struct

import matplotlib as mpl
import nanotap
import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from nanotap import export, plot

mpl.use("agg")


@pytest.fixture(scope="module")
def swept(regular):
    return nanotap.sweep(
        regular, over={"omega": nanotap.range(2.5, 3.1, 31)}, starts=2, periods=12
    )


@pytest.fixture(scope="module")
def mapped(regular):
    over = {"omega": nanotap.range(2.5, 3.1, 7), "alpha4": nanotap.range(15, 25, 5)}
    return nanotap.sweep(regular, over=over, periods=4)


def drawn(picture):
    png = picture._repr_png_()
    assert png.startswith(b"\x89PNG")
    return picture


def test_runs_and_orbits_are_drawn(regular):
    for run in (
        nanotap.simulate(regular),
        nanotap.simulate(regular, omega=2.6, periods=30),
        nanotap.simulate(regular, periods=3, transient=0),
        nanotap.simulate(regular, method="rk4", periods=5),
    ):
        drawn(plot.show(run))
    picture = drawn(nanotap.orbit(regular).plot())
    time, _, harmonics, multipliers = picture.axes
    # The extrema of the drawn deflection are those of the orbit.
    tip = next(line for line in time.lines if line.get_label() == "tip")
    orbit = nanotap.orbit(regular)
    assert tip.get_ydata().max() == pytest.approx(orbit.tip_max, abs=1e-4)
    assert harmonics.get_yscale() == "log"
    assert "drive periods" in time.get_xlabel() and "μ" in multipliers.get_xlabel()
    with pytest.raises(ValueError, match="no time series"):
        plot.run(nanotap.simulate(regular, series=0))


def test_attractors_are_drawn_in_the_order_of_their_colours(bistable):
    found = nanotap.attractors(bistable, starts=24, unstable=1)
    left, right = drawn(found.plot()).axes
    colours = {
        line.get_label().split(" (")[0]: to_hex(line.get_color()) for line in left.lines
    }
    assert colours == {one.name: plot.PERIODS[one.period - 1] for one in found}
    # Four strobe points of the period 4, one of the period 1.
    marks = sorted(len(line.get_xdata()) for line in right.lines[: len(found)])
    assert marks == [1, 4]


def test_sweeps_are_drawn_in_the_terminals_colours(swept, mapped, regular):
    axes = drawn(plot.show(swept)).axes[0]
    colours = {
        cloud.get_label(): to_hex(cloud.get_facecolor()[0])
        for cloud in axes.collections
    }
    periodic = swept.classification.values == "periodic"
    kinds = {
        f"period {period}" if orbit else str(word)
        for word, period, orbit in zip(
            swept.classification.values.ravel(),
            swept.period.values.ravel(),
            periodic.ravel(),
        )
    }
    assert set(colours) == kinds
    for word, colour in colours.items():
        known = plot.MOTIONS | {
            f"period {n + 1}": c for n, c in enumerate(plot.PERIODS)
        }
        assert colour == known[word]
    # A dot for each turn of each orbit.
    for period in np.unique(swept.period.values[periodic]):
        dots = next(
            c for c in axes.collections if c.get_label() == f"period {period:.0f}"
        )
        orbits = (swept.period.values == period) & periodic
        assert len(dots.get_offsets()) == orbits.sum() * min(period, 12)
    assert "Ω" in axes.get_xlabel()
    # The selection of the user is drawn.
    some = swept.isel(start=0, omega=slice(0, 9))
    low, high = drawn(plot.sweep(some)).axes[0].get_xlim()
    assert (low, high) == (some.omega[0], some.omega[-1])
    picture = drawn(plot.show(mapped))
    words = {text.get_text() for text in picture.axes[0].get_legend().get_texts()}
    for word, period in zip(
        mapped.classification.values.ravel(), mapped.period.values.ravel()
    ):
        assert (f"period {period}" if word == "periodic" else word) in words
    follow = nanotap.sweep(
        regular, over={"omega": nanotap.range(2.9, 3.0, 4)}, follow="both", periods=3
    )
    # Both directions are drawn in the same panels, each with its label.
    both = [
        {mark.get_label() for mark in (*axes.collections, *axes.lines)}
        for axes in drawn(plot.show(follow)).axes
    ]
    assert any({"following up", "following down"} <= words for words in both)


def test_basins_branches_and_the_rest_are_drawn(bistable, regular):
    basin = nanotap.basin(bistable, x="a1=-1:1:10", y="v1=-20:20:8", starts=24)
    axes = drawn(plot.show(basin)).axes[0]
    assert axes.get_xlim()[0] < -1 and "ȧ_{1}" in axes.get_ylabel()
    branch = nanotap.branch(
        regular, parameter="omega", from_=3.0, to=2.9, second={"alpha4": (18, 22)}
    )
    _, right = drawn(plot.show(branch)).axes
    assert "α" in right.get_ylabel() and len(right.lines) >= 1
    drawn(plot.branch(branch, show="spectral_radius"))
    with pytest.raises(ValueError, match="available: branch"):
        plot.branch(branch, show="colour")
    drawn(plot.show(nanotap.lyapunov(regular, periods=500, points=50)))
    drawn(plot.show(nanotap.modes(regular)))
    drawn(plot.show(nanotap.convergence(regular, largest=3)))
    with pytest.raises(TypeError, match="no figure for a dict"):
        plot.show({})


def test_figures_are_drawn_into_the_users_own_axes(swept, regular):
    picture, axes = mpl.figure.Figure(), None
    axes = picture.subplots()
    assert plot.sweep(swept, axes=axes) is picture
    assert axes.collections and axes.get_legend()
    four = mpl.figure.Figure().subplots(2, 2)
    nanotap.orbit(regular).plot(axes=four)
    assert all(one.lines for one in four.flat)
    with pytest.raises(ValueError, match="4 panels, not 1"):
        nanotap.orbit(regular).plot(axes=axes)


def test_curves_are_the_terminals(regular, tmp_path):
    """One description: matplotlib draws everything where the terminal's SVG has it."""
    store = tmp_path / "s.zarr"
    ds = nanotap.sweep(
        regular, over={"omega": nanotap.range(2.9, 3.0, 4)}, periods=3, out=store
    )
    svg = nanotap._nanotap.figure(store, "svg").decode()
    axes = plot.sweep(ds).axes[0]
    for cloud in axes.collections:
        assert f'aria-label="{cloud.get_label()}"' in svg
        assert f'stroke="{to_hex(cloud.get_facecolor()[0])}"' in svg


def test_the_approach_goes_both_ways(physical):
    ds = nanotap.approach(physical, points=8, branches=False)
    assert ds.physical_A.dims == ("way", "zc")
    assert ds.way.values.tolist() == ["approach", "retract"]
    length = physical.physical.length_unit
    np.testing.assert_allclose(ds.zc, ds.alpha5 * length, rtol=1e-12)
    np.testing.assert_array_equal(ds.physical_A, ds.first_harmonic)
    np.testing.assert_array_equal(ds.alpha5.dims, ds.zc.dims)
    # Far away it oscillates freely, with A₀ of the case.
    assert float(ds.physical_A[0, -1]) == pytest.approx(20e-9, rel=1e-6)
    picture = drawn(plot.show(ds))
    assert "nm" in picture.axes[0].get_ylabel()
    with_branches = nanotap.approach(physical, points=4)
    assert "branch_stable" in with_branches
    drawn(plot.show(with_branches))


def test_the_shift_is_drawn_against_the_amplitude(physical):
    """Constant least distance: the amplitude falls with the distance, and is the axis."""
    ds = nanotap.approach(
        physical, fm=True, closest="-1 nm", from_="19 nm", to="7 nm", points=4
    )
    held = json.loads(ds.attrs["modulation"])
    assert held["closest"] * physical.physical.length_unit == pytest.approx(-1e-9)
    assert (ds.physical_frequency_shift > 0).all()
    amplitude = ds.physical_A.sel(way="approach").values
    assert amplitude[-1] / amplitude[0] == pytest.approx(2.5, rel=1e-9)
    picture = drawn(plot.approach(ds))
    assert len(picture.axes) == 3
    assert "amplitude" in picture.axes[-1].get_xlabel()


def test_the_terminals_own_picture_is_to_be_had(regular, tmp_path):
    out = tmp_path / "s.zarr"
    nanotap.sweep(
        regular, over={"omega": nanotap.range(2.9, 3.0, 4)}, periods=3, out=out
    )
    assert b"<svg" in nanotap._nanotap.figure(out, "svg")
    assert nanotap._nanotap.figure(out, "png").startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="expected svg, png, pdf or json"):
        nanotap._nanotap.figure(out, "gif")


def test_tables_say_the_same_in_every_format(swept, tmp_path):
    frame = export.table(swept)
    assert frame.index.names == ["omega", "start"] and len(frame) == 62
    assert set(frame.classification) <= {
        "periodic",
        "chaotic",
        "quasi-periodic",
        "undecided",
    }
    assert frame.tip_max.loc[2.5, 0] == float(swept.tip_max[0, 0])
    export.csv(swept, tmp_path / "t.csv")
    export.parquet(swept, tmp_path / "t.parquet")
    from_csv = pd.read_csv(tmp_path / "t.csv", float_precision="round_trip")
    from_parquet = pd.read_parquet(tmp_path / "t.parquet")
    pd.testing.assert_frame_equal(from_csv, from_parquet, check_dtype=False)
    np.testing.assert_array_equal(from_parquet.tip_max, frame.tip_max)
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_tables_of_other_results(regular, bistable, tmp_path):
    orbit = nanotap.orbit(regular)
    frame = export.table(orbit)
    assert frame.index.name == "tau" and {"tip", "force", "a1", "v3"} <= set(
        frame.columns
    )
    export.csv(orbit, tmp_path / "orbit.csv")
    assert len(pd.read_csv(tmp_path / "orbit.csv")) == 201
    branch = nanotap.branch(regular, parameter="omega", from_=3.0, to=2.95)
    assert {"omega", "tip_max", "a1"} <= set(export.table(branch).columns)
    drawn(plot.show(branch))
    assert len(export.table(nanotap.attractors(bistable, starts=24))) == 2
    basin = nanotap.basin(bistable, x="a1=-1:1:5", y="v1=-4:4:4", starts=24)
    assert export.table(basin).attractor.shape == (20,)
    with pytest.raises(TypeError, match="dict cannot be converted to a table"):
        export.table({})


def test_orbits_are_kept_as_hdf5(regular, swept, tmp_path):
    h5py = pytest.importorskip("h5py")
    orbit = nanotap.orbit(regular)
    export.hdf5(orbit, tmp_path / "orbit.h5")
    with h5py.File(tmp_path / "orbit.h5") as file:
        np.testing.assert_array_equal(file["states"], orbit.states)
        np.testing.assert_array_equal(file["multipliers"], orbit.multipliers)
        np.testing.assert_array_equal(file["series/tip"], orbit.series.tip)
        assert file["series/tip"].attrs["units"] == "g0"
        assert file.attrs["period"] == 1 and file.attrs["stable"]
        assert json.loads(file.attrs["case"])["omega"] == 3
        np.testing.assert_array_equal(file["harmonics/order"][:2], [1, 2])
    export.hdf5(swept, tmp_path / "sweep.h5")
    with h5py.File(tmp_path / "sweep.h5") as file:
        np.testing.assert_array_equal(file["tip_max"], swept.tip_max)
        assert json.loads(file["tip_max"].attrs["dimensions"]) == ["omega", "start"]
    with pytest.raises(TypeError, match="expected an orbit or a Dataset"):
        export.hdf5({}, tmp_path / "x.h5")


def read_gsf(path):
    """A reader written from Gwyddion's description of the format, independent of the writer."""
    data = path.read_bytes()
    head, _, _ = data.partition(b"\0")
    lines = head.decode().splitlines()
    assert lines[0] == "Gwyddion Simple Field 1.0"
    fields = dict(line.split(" = ", 1) for line in lines[1:])
    start = len(head) + 4 - len(head) % 4
    columns, rows = int(fields["XRes"]), int(fields["YRes"])
    values = struct.unpack(f"<{columns * rows}f", data[start:])
    return fields, np.array(values).reshape(rows, columns)


def test_maps_are_fields_of_gwyddion(mapped, bistable, tmp_path):
    path = tmp_path / "map.gsf"
    export.gsf(mapped, path, variable="tip_max")
    fields, values = read_gsf(path)
    np.testing.assert_allclose(values[::-1], mapped.tip_max.isel(start=0), rtol=1e-6)
    assert float(fields["XReal"]) == pytest.approx(7 * 0.1)
    assert float(fields["YOffset"]) == pytest.approx(15 - 1.25)
    basin = nanotap.basin(bistable, x="a1=-1:1:6", y="v1=-4:4:5", starts=24)
    export.gsf(basin, path)
    np.testing.assert_array_equal(read_gsf(path)[1][::-1], basin.attractor)
    for arguments, words in (
        ({"variable": "nothing"}, "unknown `nothing`"),
        ({"variable": "strobe"}, "a map has two"),
        ({"start": 3}, "out of range; there are 1 starts"),
    ):
        with pytest.raises(ValueError, match=words):
            export.gsf(mapped, path, **arguments)
    log = nanotap.sweep(
        bistable,
        over={
            "omega": nanotap.range(19, 20, 2),
            "alpha4": nanotap.range(1, 100, 4, log=True),
        },
        periods=2,
    )
    with pytest.raises(ValueError, match="equal steps"):
        export.gsf(log, path)


def test_panels_are_chosen_and_drawn_into_given_axes(regular):
    import matplotlib.pyplot as plt

    orbit = nanotap.orbit(regular)
    picture, one = plt.subplots()
    assert nanotap.plot.orbit(orbit, ax=one, panels="b") is picture
    assert one.get_xlabel()
    assert len(nanotap.plot.orbit(orbit, panels="ac").axes) == 2
    with pytest.raises(ValueError, match="unknown panel 'z'"):
        nanotap.plot.orbit(orbit, panels="z")
    with pytest.raises(ValueError, match="4 panels, not 1"):
        nanotap.plot.orbit(orbit, ax=one)
    plt.close(picture)


def test_any_variable_is_drawn_over_one_parameter(regular):
    sweep = nanotap.sweep(
        regular, over={"omega": nanotap.range(2.9, 3.1, 5)}, starts=2, periods=4
    )
    label = nanotap.plot.sweep(sweep, show="peak_force").axes[0].get_ylabel()
    assert "force" in label
    many = nanotap.orbit(regular, omega=np.linspace(2.9, 3.1, 4))
    assert "phase" in nanotap.plot.show(many, show="phase").axes[0].get_ylabel()
    with pytest.raises(ValueError, match="`colour` is not a numeric variable"):
        nanotap.plot.orbits(many, show="colour")


def test_multipliers_are_two_numbers_in_every_format(regular, tmp_path):
    xarray = pytest.importorskip("xarray")
    branch = nanotap.branch(regular, parameter="omega", from_=2.95, to=3.05)
    radius = np.hypot(
        branch.multipliers.sel(part="re"), branch.multipliers.sel(part="im")
    )
    np.testing.assert_allclose(
        radius.max("multiplier"), branch.spectral_radius, rtol=1e-15
    )
    nanotap.export.netcdf(branch, tmp_path / "b.nc", engine="scipy")
    back = xarray.open_dataset(tmp_path / "b.nc", engine="scipy")
    np.testing.assert_array_equal(back.multipliers, branch.multipliers)
