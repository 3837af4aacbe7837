"""What mypy in strict mode accepts and refuses of a user's program; `cargo xtask python` checks
it."""

import nanotap

case = nanotap.Case(modes=3, alpha1=0.1, omega=20.0)
lever = nanotap.Case.from_file("lever.toml", **{"gap.tip": "12 nm"})
nearer = lever.with_({"gap.tip": "11 nm"})
stiffer = lever.with_(**{"cantilever.k": "3 N/m"})
ds = nanotap.sweep(case, over={"omega": nanotap.range(2.4, 3.4, 400)}, periods=50)
frame = nanotap.read("curve.ibw")
curves = nanotap.read("map.jpk-qi-data", curve="all")
frame["Amp (nm)"].mean()
curves.to_netcdf("map.nc")
# A misspelt option.
nanotap.attractors(case, startz=8)  # type: ignore[call-arg]
calibrated = nanotap.calibrate("lever.tnd", temperature=25, to="200 kHz")
nanotap.calibrate("lever.tnd", temperatures=25)  # type: ignore[call-arg]
