"""Fits from Python: tables of any kind, and their results."""

import pickle
import struct
from pathlib import Path

import nanotap
import numpy as np
import pytest

LEVER = """
[model]
modes = 2
[cantilever]
k = "42 N/m"
f0 = "330 kHz"
Q = 400
[sample]
stiffness = "30 N/m"
loss_tangent = 0.1
[drive]
frequency_ratio = 1.001
free_amplitude = "20 nm"
[gap]
tip = "15 nm"
"""
FREE = ["sample.stiffness", "gap.offset"]


@pytest.fixture(scope="module")
def curve() -> dict[str, np.ndarray]:
    """Amplitude and phase over the distance, without noise."""
    case = nanotap.Case.from_toml(LEVER)
    ds = nanotap.approach(case, from_="18 nm", to="4 nm", points=8, branches=False).sel(
        way="approach"
    )
    return {
        "distance (nm)": 1e9 * ds.zc.values,
        "amplitude (nm)": 1e9 * ds.physical_A.values,
        "phase (deg)": ds.phase.values,
    }


def test_exact_data_give_the_exact_values(curve: dict[str, np.ndarray]) -> None:
    case = nanotap.Case.from_toml(LEVER.replace("30 N/m", "24 N/m"))
    found = nanotap.fit(case, data=curve, free=FREE)
    assert found.fits
    assert found.best["sample.stiffness"] == pytest.approx(30, rel=1e-5)
    assert abs(found.best["gap.offset"]) < 1e-12
    assert set(found.errors) == set(FREE)
    assert found.best_case() is not None
    again = pickle.loads(pickle.dumps(found))
    assert again.best == found.best


def test_frames_datasets_and_files_are_tables(
    curve: dict[str, np.ndarray], tmp_path: object
) -> None:
    pandas = pytest.importorskip("pandas")
    xarray = pytest.importorskip("xarray")
    case = nanotap.Case.from_toml(LEVER)
    frame = pandas.DataFrame(curve)
    path = f"{tmp_path}/curve.csv"
    frame.to_csv(path, index=False)
    names = {"distance": "nm", "amplitude": "nm", "phase": "deg"}
    columns = {
        name: ("distance", curve[f"{name} ({unit})"], {"units": unit})
        for name, unit in names.items()
    }
    distance = columns.pop("distance")
    dataset = xarray.Dataset(columns, {"distance": distance})
    values = [
        nanotap.fit(case, data=data, free=FREE, profile=False).best
        for data in (curve, frame, path, dataset)
    ]
    for other in values[1:]:
        assert other["sample.stiffness"] == pytest.approx(
            values[0]["sample.stiffness"], rel=1e-9
        )


def test_a_force_volume_is_a_dataset(
    curve: dict[str, np.ndarray], tmp_path: Path
) -> None:
    pandas = pytest.importorskip("pandas")
    soft = nanotap.Case.from_toml(LEVER.replace("30 N/m", "24 N/m"))
    frames = [
        pandas.DataFrame({**curve, "x (um)": x, "y (um)": y})
        for x, y in [(0, 0), (1, 0), (1, 1)]
    ]
    volume = pandas.concat(frames)
    ds = nanotap.fit_map(soft, volume, ["x", "y"], FREE, progress=False)
    assert dict(ds.sizes) == {"y": 2, "x": 2}
    assert ds.x.attrs["units"] == "um"
    stiffness = ds["sample.stiffness"]
    assert stiffness.attrs["units"] == "N/m"
    assert stiffness.values == pytest.approx(
        np.array([[30, 30], [np.nan, 30]]), rel=1e-5, nan_ok=True
    )
    assert ds.result.values.tolist() == [["fits", "fits"], ["", "fits"]]
    path = tmp_path / "map.zarr"
    nanotap.fit_map(soft, volume, "x,y", FREE, out=path, chunk="1/2", progress=False)
    again = nanotap.fit_map(soft, volume, "x,y", FREE, out=path, progress=False)
    assert again.drop_attrs().identical(ds.drop_attrs())
    with pytest.raises(ValueError, match="fit_map"):
        nanotap.fit(soft, data=volume, free=FREE, pixels=["x", "y"])


def test_a_map_in_an_instruments_file_is_a_dataset(
    cell_map: tuple[Path, np.ndarray],
) -> None:
    path, moduli = cell_map
    ds = nanotap.fit_map(path, tip_radius="5 um", progress=False)
    assert ds.x.values == pytest.approx([1e-6, 3e-6])
    modulus = ds["sample.modulus"]
    assert modulus.attrs["units"] == "Pa"
    # Three standard errors of a fit.
    off = np.abs(modulus - moduli) / ds["sample.modulus_error"]
    assert float(off.max()) < 3
    assert modulus.isnull().values.tolist() == [[False, False], [False, True]]
    assert ds.result.values.tolist() == [["fits", "fits"], ["fits", ""]]
    with pytest.raises(TypeError, match="pixels"):
        nanotap.fit_map(nanotap.Case.from_toml(LEVER), {"zc (nm)": [1.0]})


def test_a_computed_force_curve_is_a_table() -> None:
    def case(modulus: str, amplitude: str = "0 nm") -> nanotap.Case:
        text = LEVER.replace('"20 nm"', f'"{amplitude}"').replace(
            'stiffness = "30 N/m"\nloss_tangent = 0.1',
            f'law = "dmt"\nmodulus = "{modulus}"\nhamaker = "5e-20 J"\n'
            '[tip]\nradius = "10 nm"',
        )
        return nanotap.Case.from_toml(text)

    ramp = {"to": "-5 nm", "speed": "1 um/s", "points": 60}
    curve = nanotap.force_curve(case("500 MPa"), **ramp)
    found = nanotap.fit(case("50 MPa"), data=curve, free=["sample.modulus"])
    # The static branch has the compliance of all modes, the motion that of three: 0.4 % at this
    # stiffness (docs/cases/fit.md).
    assert found.best["sample.modulus"] == pytest.approx(500e6, rel=5e-3)
    driven = nanotap.force_curve(case("500 MPa", "5 nm"), **ramp)
    with pytest.raises(ValueError, match="driven"):
        nanotap.fit(case("50 MPa"), data=driven, free=["sample.modulus"])


GEL = Path(__file__).parents[1] / "docs" / "cases" / "gel.csv"


def test_a_force_curve_needs_no_case() -> None:
    # Computed with 5 kPa, a sphere of 5 um, 0.05 N/m and the contact point at 12 um.
    found = nanotap.fit(GEL, tip_radius="5 um")
    [curve] = found.force_curves
    assert curve.modulus.value == pytest.approx(5e3, rel=0.02)
    assert curve.contact_point.value == pytest.approx(12e-6, abs=10e-9)
    assert (curve.segment, curve.spring_constant_from) == ("approach", "header")
    assert any("Hertz" in note for note in found.preparation)
    # The same from a data frame, whose attributes are the header.
    pytest.importorskip("pandas")
    again = nanotap.fit(nanotap.read(GEL), tip_radius=5e-6)
    assert again.best == found.best
    both = nanotap.fit(GEL, tip_radius="5 um", segment="both", poisson=0.3)
    ratio = both.force_curves[0].modulus.value / curve.modulus.value
    assert both.force_curves[0].segment == "approach and retract"
    assert ratio == pytest.approx((1 - 0.3**2) / (1 - 0.5**2), rel=0.02)
    with pytest.raises(ValueError, match="tip_radius"):
        nanotap.fit(GEL)
    with pytest.raises(ValueError, match="spring_constant"):
        nanotap.fit({"z (nm)": [1, 2], "deflection (nm)": [1, 2]}, tip_radius=1e-6)
    with pytest.raises(ValueError, match="range"):
        nanotap.fit(GEL, tip_radius="5 um", range={"depth": ("1 nm", "2 nm")})


def test_what_is_no_table_is_refused(curve: dict[str, np.ndarray]) -> None:
    case = nanotap.Case.from_toml(LEVER)
    with pytest.raises(TypeError, match="data"):
        nanotap.fit(case, free=FREE)
    with pytest.raises(ValueError, match="amplitudo"):
        wrong = {**curve, "amplitudo (nm)": curve["amplitude (nm)"]}
        nanotap.fit(case, data=wrong, free=FREE)
    with pytest.raises(ValueError, match=r"sample\.stifness"):
        nanotap.fit(case, data=curve, free="sample.stifness")


def test_laws_are_compared(curve: dict[str, np.ndarray]) -> None:
    case = nanotap.Case.from_toml(LEVER.replace("30 N/m", "24 N/m"))
    laws = ["spring-damper", "kelvin-voigt"]
    found = nanotap.fit(case, data=curve, free=FREE, laws=laws, profile=False)
    assert found.law == "spring-damper"
    table = found.compared()
    assert list(table.index) == laws and table.above_best["spring-damper"] == 0
    assert table.weight.sum() == pytest.approx(1)
    assert nanotap.fit(case, data=curve, free=FREE, profile=False).compared().empty


def test_each_curve_has_its_case(curve: dict[str, np.ndarray]) -> None:
    case = nanotap.Case.from_toml(LEVER)
    shifted = {**curve, "distance (nm)": curve["distance (nm)"] + 0.2}
    found = nanotap.fit(
        case,
        data={"one": curve, "two": shifted},
        free="sample.stiffness",
        per_curve=["cantilever.Q", "gap.offset"],
        profile=False,
    )
    assert found.best["gap.offset of two"] == pytest.approx(-2e-10, rel=1e-3)
    best = found.best_case("two")
    assert best.physical is not None
    assert best.physical.Q == pytest.approx(found.best["cantilever.Q of two"])
    with pytest.raises(KeyError):
        found.best_case("three")


def write_wave(path: Path, channels: dict[str, np.ndarray], note: str) -> None:
    """A binary wave of version 5 (WaveMetrics, technical note 3): 64 bytes of sizes, 320 bytes about
    the wave, the numbers, the note, and the labels of the columns.
    """
    data = np.array(list(channels.values()), dtype="<f8")
    columns, rows = data.shape
    labels = b"".join(name.encode().ljust(32, b"\0") for name in ["", *channels])
    wave = struct.pack("<3Iihh6xh32s8x", 0, 0, 0, rows * columns, 4, 0, 1, b"curve")
    wave += struct.pack("<4i8d", rows, columns, 0, 0, 1, 1, 1, 1, 0, 0, 0, 0)
    wave = wave.ljust(320, b"\0")

    def sizes(checksum: int) -> bytes:
        of_labels = (0, len(labels), 0, 0)
        return struct.pack(
            "<2h4i4i4i3i",
            5,
            checksum,
            320 + data.nbytes,
            0,
            len(note),
            0,
            *(0,) * 4,
            *of_labels,
            *(0,) * 3,
        )

    words = np.frombuffer(sizes(0) + wave, "<i2").astype(np.int64).sum()
    checksum = (int(-words) + 2**15) % 2**16 - 2**15
    path.write_bytes(sizes(checksum) + wave + data.tobytes() + note.encode() + labels)


def test_instruments_files_are_read(
    curve: dict[str, np.ndarray], tmp_path: Path
) -> None:
    path = tmp_path / "curve.ibw"
    channels = {
        "ZSnsr": 1e-9 * curve["distance (nm)"],
        "Amp": 1e-9 * curve["amplitude (nm)"],
        "Phase": curve["phase (deg)"],
    }
    write_wave(path, channels, "AmpInvOLS: 5.8e-08\rImagingMode: AC Mode")
    read = nanotap.read(path)
    assert read.attrs == {"AmpInvOLS": 5.8e-8, "ImagingMode": "AC Mode"}
    np.testing.assert_allclose(read["Amp (nm)"], curve["amplitude (nm)"], rtol=1e-12)
    found = nanotap.fit(
        nanotap.Case.from_toml(LEVER), data=read, free=FREE, profile=False
    )
    assert found.best["sample.stiffness"] == pytest.approx(30, rel=1e-5)
    text = tmp_path / "curve.csv"
    read.to_csv(text, index=False)
    np.testing.assert_allclose(nanotap.read(text)["Phase (deg)"], read["Phase (deg)"])
    path = tmp_path / "curve.jpk-force"
    path.write_bytes(b"PK")
    with pytest.raises(ValueError, match="not a force curve of JPK"):
        nanotap.read(path)
    path = tmp_path / "curve.nhf"
    path.write_bytes(b"")
    with pytest.raises(ValueError, match="package NSFopen"):
        nanotap.read(path)
    with pytest.raises(FileNotFoundError):
        nanotap.read(tmp_path / "none.ibw")
