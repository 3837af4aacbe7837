//! The reference levers with one mode, as case files.

use nanotap::case::Case;
use nanotap::study::orbit::{OrbitOptions, OrbitReport, orbit};

/// Modal stiffness over static stiffness, β₁⁴/12 for a clamped-free beam.
pub(crate) const MODAL: f64 = 12.362_363_368_400_15 / 12.0;
/// Joules in an electronvolt.
pub(crate) const EV: f64 = 1.602_176_634e-19;

/// The orbit of a case, by the default search.
pub(crate) fn found(case: &Case) -> OrbitReport {
    orbit(&case.model().unwrap(), &OrbitOptions::default()).unwrap()
}

/// A lever of one mode with the modal stiffness `k` N/m at resonance, driven at its tip.
pub(crate) fn lever(
    (k, q, frequency): (f64, f64, &str),
    (amplitude, gap): (f64, f64),
    sample: &[&str],
) -> Case {
    let mut words: Vec<String> = [
        "modes=1".to_owned(),
        format!("cantilever.k={} N/m", k / MODAL),
        format!("cantilever.f0={frequency}"),
        format!("cantilever.Q={q}"),
        "tip.radius=5 nm".to_owned(),
        "drive.actuation=tip".to_owned(),
        format!("drive.frequency={frequency}"),
        format!("drive.free_amplitude={amplitude} nm"),
        format!("gap.tip={gap} nm"),
    ]
    .into();
    words.extend(sample.iter().map(|&word| word.to_owned()));
    Case::parse(None, &words).unwrap()
}

/// The lever in air: 0.9 N/m, Q 200, 100 kHz.
pub(crate) fn air(amplitude: f64, gap: f64, sample: &[&str]) -> Case {
    lever((0.9, 200.0, "100 kHz"), (amplitude, gap), sample)
}

/// DMT contact with van der Waals attraction.
pub(crate) const DMT: [&str; 7] = [
    "sample.law=dmt",
    "sample.modulus=1 GPa",
    "sample.poisson=0.3",
    "tip.modulus=160 GPa",
    "tip.poisson=0.3",
    "sample.hamaker=3e-20 J",
    "sample.intermolecular_distance=0.169 nm",
];

/// Hertz's contact on a softer sample.
pub(crate) const HERTZ: [&str; 6] = [
    "sample.law=hertz",
    "sample.modulus=100 MPa",
    "sample.poisson=0.3",
    "tip.modulus=160 GPa",
    "tip.poisson=0.3",
    "sample.intermolecular_distance=0.169 nm",
];
