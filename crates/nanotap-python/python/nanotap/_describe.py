"""What the entries of results are called, and their units."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

    from ._case import Case

MODEL = {
    "strobe": ("state at drive phase 0", "model units"),
    "start": ("state where the recording starts", "model units"),
    "state": ("state at drive phase 0", "model units"),
    "events": ("time of the switch, from the end of the transient", "sqrt(mL4/EI)"),
    "event_kind": ("which way", "1"),
    "event_gap_rate": ("rate of the gap just before", "g0/sqrt(mL4/EI)"),
    "tau": ("time", "sqrt(mL4/EI)"),
    "tip": ("tip deflection W", "g0"),
    "tip_rate": ("rate of the tip deflection", "g0/sqrt(mL4/EI)"),
    "gap": ("gap between tip and sample", "g0"),
    "force": ("force of the sample on the tip", "g0 EI/L3"),
    "contact": ("1 in contact, else 0", "1"),
    "states": ("modal amplitudes and their rates", "model units"),
    "classification": ("what the motion is", "1"),
    "period": ("minimal period", "drive periods"),
    "periods": ("periods recorded", "drive periods"),
    "transient": ("periods before the recording", "drive periods"),
    "tip_max": ("greatest tip deflection W", "g0"),
    "tip_min": ("least tip deflection W", "g0"),
    "amplitude": ("half of peak to peak of the tip deflection", "g0"),
    "mean_deflection": ("time mean of the tip deflection", "g0"),
    "rms_deflection": ("root mean square of the tip deflection about its mean", "g0"),
    "gap_range": ("least and greatest gap", "g0"),
    "contact_fraction": ("part of the time in contact", "1"),
    "contact_time": ("time in contact a drive period", "sqrt(mL4/EI)"),
    "contacts_per_period": ("contacts begun", "1/drive period"),
    "peak_force": ("greatest force of the sample on the tip", "g0 EI/L3"),
    "mean_force": ("time mean of that force", "g0 EI/L3"),
    "impact_speed": ("greatest speed at which a contact begins", "g0/sqrt(mL4/EI)"),
    "energy_balance": (
        "energy over the recording; the residual as a part",
        "g0^2 EI/L3",
    ),
    "beam_clearance": ("least height of the beam above the sample", "g0"),
    "beam_clearance_xi": ("where that is, clamp 0 to tip 1", "L"),
    "beam_clearance_period": ("when that is", "drive periods"),
    "first_harmonic": (
        "amplitude of the tip deflection at the drive's frequency",
        "g0",
    ),
    "phase": ("phase lag of the tip deflection behind the drive", "degrees"),
    "thd": ("part of the tip deflection's power outside the drive's frequency", "1"),
    "residual": ("largest entry of P^n(x) - x", "model units"),
    "error": ("estimated distance from the true orbit", "model units"),
    "stable": ("whether every multiplier is inside the unit circle", "1"),
    "spectral_radius": ("largest modulus of a multiplier", "1"),
    "indentation": ("greatest depth of the tip in the sample", "g0"),
    "dissipation": ("energy that the sample takes a drive period", "g0^2 EI/L3"),
    "virial": ("virial of the tip-sample force", "g0^2 EI/L3"),
    "periods_per_second": ("speed of the propagation", "drive periods/s"),
    "evaluations_per_period": ("evaluations of the gap", "1/drive period"),
    "multiplier": ("largest modulus of a multiplier", "1"),
    "parameter": ("the parameter", "1"),
    "branch": ("index of the branch", "1"),
}
"""Long name and unit by the name of an entry, in the model's own units."""

PHYSICAL = {
    "tip_max": "m",
    "tip_min": "m",
    "amplitude": "m",
    "first_harmonic": "m",
    "mean_deflection": "m",
    "indentation": "m",
    "optical_amplitude": "m",
    "F_max": "N",
    "mean_force": "N",
    "contact_time": "s",
    "E_dis": "J",
    "E_dis_eV": "eV",
    "virial": "J",
    "virial_eV": "eV",
    "drive_power": "W",
    "sample_power": "W",
    "impact_speed": "m/s",
    "frequency": "Hz",
    "phase": "degrees",
    "optical_phase": "degrees",
}
"""SI units of what is said of a motion of a physical case."""


def describe(ds: "xr.Dataset") -> "xr.Dataset":
    """The same Dataset, every variable with `long_name` and `units` where they are known."""
    for name, variable in ds.variables.items():
        key = str(name)
        if key in MODEL:
            long_name, unit = MODEL[key]
            variable.attrs.setdefault("long_name", long_name)
            variable.attrs.setdefault("units", unit)
        elif key.startswith("physical_"):
            inner = key.removeprefix("physical_")
            variable.attrs.setdefault("long_name", MODEL.get(inner, (inner, ""))[0])
            variable.attrs.setdefault("units", PHYSICAL.get(inner, "1"))
    return ds


def case_attributes(case: "Case", title: str) -> dict[str, str]:
    """What a Dataset says of its origin."""
    from ._nanotap import __version__

    return {
        "title": title,
        "nanotap_version": __version__,
        "case": case._core.document_at_setpoint,
    }
