//! The constants that do not steer a computation.

/// Crates that do not compute: formats of files, layout, front ends, messages.
pub(super) const CRATES: [&str; 6] = [
    "afm-files",
    "nanotap-cli",
    "nanotap-error",
    "nanotap-explorer",
    "nanotap-figures",
    "nanotap-python",
];

/// Facts and numbers that follow from others: file below `crates/`, and names.
const FACTS: &[(&str, &[&str])] = &[
    ("afm-thermal/src/calibration.rs", &["BOLTZMANN"]),
    ("afm-thermal/src/estimate.rs", &["TWO_SIDED_95"]),
    ("afm-thermal/src/fluid.rs", &["CELSIUS"]),
    ("afm-thermal/src/lever.rs", &["ALPHA"]),
    ("afm-thermal/src/scatter.rs", &["MEDIAN"]),
    ("afm-thermal/src/spectrum.rs", &["QUARTER_PI"]),
    ("nanotap-arithmetic/src/eigenvalues.rs", &["GOLDEN"]),
    ("nanotap-case/src/key/keys.rs", &["AFTER_LAWS"]),
    (
        "nanotap-dynamics/src/census/confidence.rs",
        &["Z", "NONE_SEEN"],
    ),
    ("nanotap-fit/src/calibrate/source.rs", &["CELSIUS"]),
    ("nanotap-fit/src/fit/reporting.rs", &["STANDARD_ERRORS_95"]),
    ("nanotap-fit/src/fit/statistics.rs", &["Z"]),
    ("nanotap-flow/src/search/side_by_side.rs", &["ALL"]),
    ("nanotap-flow/src/search/walk.rs", &["RATE_OF_SIXTH"]),
    (
        "nanotap-flow/src/simd/functions.rs",
        &["ROUND", "LN2_HIGH", "LN2_LOW", "PIO2_1", "PIO2_2", "PIO2_3"],
    ),
    ("nanotap-model/src/contact/mod.rs", &["NUMBERS", "OWN_KEYS"]),
    ("nanotap-model/src/parameter.rs", &["PAPER", "COUNT"]),
    ("nanotap-motions/src/upset.rs", &["GOLDEN", "PLASTIC"]),
    ("nanotap-proof/src/interval.rs", &["HALF_PI", "LN_2"]),
    ("nanotap-quantity/src/lib.rs", &["JOULES_PER_ELECTRONVOLT"]),
    ("nanotap-quantity/src/units.rs", &["DEGREE"]),
    (
        "nanotap-scan/src/force_curve/statics.rs",
        &["BEAM_COMPLIANCE"],
    ),
    (
        "nanotap-surveys/src/basin.rs",
        &["UNSETTLED", "UNBOUNDED", "FAILED", "BEHIND"],
    ),
    ("nanotap-surveys/src/lever.rs", &["AIR"]),
    ("nanotap-surveys/src/noise/free_lever.rs", &["OPTICAL"]),
    ("nanotap-surveys/src/noise/mod.rs", &["BOLTZMANN"]),
    ("nanotap-volterra/src/laws/electric.rs", &["VACUUM"]),
    (
        "nanotap-volterra/src/laws/thin.rs",
        &["SPHERE_SERIES", "CONE_SERIES", "PUNCH_SERIES"],
    ),
];

/// Whether the constant `name` of this file, a path from the repository's root, does not steer a
/// computation.
pub(super) fn is_left_out(file: &str, name: &str) -> bool {
    let path = file.strip_prefix("crates/").unwrap_or(file);
    let is_fact = |(place, names): &(&str, &[&str])| *place == path && names.contains(&name);
    CRATES
        .iter()
        .any(|package| path.split('/').next() == Some(package))
        || path.contains("/figure/")
        || FACTS.iter().any(is_fact)
}
