//! Descriptions and units of the entries of results: observables, and other entries of documents,
//! time series and datasets.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{Dimension, OBSERVABLES};
use crate::time_series::COLUMNS;

/// Description and unit of an entry.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Entry {
    /// Description of the entry in a few words.
    pub words: &'static str,
    /// Name of the unit; `1` for a pure number.
    pub unit: &'static str,
}

/// Descriptions of entries by name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Glossary {
    /// Entries in the model's units.
    pub model: BTreeMap<String, Entry>,
    /// Entries under `physical`, in SI.
    pub physical: BTreeMap<String, Entry>,
}

/// Name, description and unit of the entries other than observables.
const OTHER_ENTRIES: &[(&str, &str, &str)] = &[
    ("strobe", "state at drive phase 0", STATE),
    ("start", "state where the recording starts", STATE),
    ("state", "state at drive phase 0", STATE),
    ("states", "modal amplitudes and their rates", STATE),
    ("residual", "largest entry of P^n(x) - x", STATE),
    ("error", "estimated distance from the true orbit", STATE),
    (
        "events",
        "time of the switch, from the end of the transient",
        Dimension::Time.model_unit(),
    ),
    ("event_kind", "which way", "1"),
    (
        "event_gap_rate",
        "rate of the gap just before",
        Dimension::Velocity.model_unit(),
    ),
    ("classification", "what the motion is", "1"),
    ("period", "minimal period", PERIODS),
    ("periods", "periods recorded", PERIODS),
    ("transient", "periods before the recording", PERIODS),
    (
        "thd",
        "part of the tip deflection's power outside the drive's frequency",
        "1",
    ),
    (
        "stable",
        "whether every multiplier is inside the unit circle",
        "1",
    ),
    ("share", "share of the initial states", "1"),
    ("share_low", "lower end of the share's 95 % interval", "1"),
    ("share_high", "upper end of the share's 95 % interval", "1"),
    ("spectral_radius", "largest modulus of a multiplier", "1"),
    (
        "decay_periods",
        "time in which a small disturbance falls to 1/e",
        PERIODS,
    ),
    ("multiplier", "largest modulus of a multiplier", "1"),
    (
        "multipliers",
        "Floquet multipliers, real and imaginary parts",
        "1",
    ),
    (
        "determinant_defect",
        "how far the product of the multipliers is from the trace formula, relative",
        "1",
    ),
    (
        "distance_to_orbit",
        "distance of the last state from the orbit",
        STATE,
    ),
    ("orbit_state", "state at drive phase 0", STATE),
    ("initial_state", "initial state", STATE),
    ("time", "time of a grazing, from the state", PERIODS),
    (
        "free_amplitude",
        "free amplitude A0",
        Dimension::Length.model_unit(),
    ),
    (
        "free_reach",
        "distance at which the free motion begins to touch",
        Dimension::Length.model_unit(),
    ),
    (
        "free_phase",
        "free phase lag",
        Dimension::Angle.model_unit(),
    ),
    (
        "periods_per_second",
        "speed of the propagation",
        "drive periods/s",
    ),
    (
        "evaluations_per_period",
        "evaluations of the gap",
        Dimension::PerPeriod.model_unit(),
    ),
    ("parameter", "the parameter", "1"),
    ("branch", "index of the branch", "1"),
    ("locus", "index of the curve in two parameters", "1"),
    ("event", "event that the curve follows", "1"),
    ("first", "first parameter along the curve", "1"),
    ("second", "second parameter along the curve", "1"),
    ("kind", "kind of the bifurcation", "1"),
    ("criticality", "supercritical or subcritical", "1"),
    ("uncertainty", "uncertainty of the parameter", "1"),
    ("reason", "why there is no motion", "1"),
    ("way", "direction in which the sample moves", "1"),
    ("direction", "direction of the line", "1"),
    ("part", "real or imaginary part", "1"),
    ("energy", "entry of the energy balance", "1"),
    ("condition", "what imaging meets at the point", "1"),
    ("kind_of_point", "condition of imaging", "1"),
    ("method", "integration method", "1"),
    ("switching", "how switches are located", "1"),
    (
        "apparent_period",
        "period with which the strobe points repeat",
        PERIODS,
    ),
    ("longest_apparent", "longest period that was tried", PERIODS),
    (
        "closure",
        "difference of strobe points one apparent period apart, relative to their size",
        "1",
    ),
];

const STATE: &str = "model units";
const PERIODS: &str = Dimension::Periods.model_unit();

/// Creates the glossary of all entries of results.
pub fn glossary() -> Glossary {
    let series = COLUMNS.map(|c| (c.name, c.words, c.dimension.model_unit()));
    let others = OTHER_ENTRIES.iter().copied().chain(series);
    let others = others.map(|(name, words, unit)| (name.to_owned(), Entry { words, unit }));
    let model = OBSERVABLES.iter().map(|o| {
        let entry = Entry {
            words: o.words,
            unit: o.dimension.model_unit(),
        };
        (o.name.to_owned(), entry)
    });
    let mut physical = BTreeMap::new();
    for o in OBSERVABLES {
        let unit = o.dimension.si_unit();
        let words = o.words;
        physical.insert(o.si_name.to_owned(), Entry { words, unit });
        if o.dimension == Dimension::Energy && o.is_number {
            let name = format!("{}_eV", o.si_name);
            physical.insert(name, Entry { words, unit: "eV" });
        }
    }
    for (name, words, unit) in [
        ("A_ratio", "amplitude over the free amplitude", "1"),
        ("frequency", "drive frequency", "Hz"),
    ] {
        physical.insert(name.to_owned(), Entry { words, unit });
    }
    Glossary {
        model: others.chain(model).collect(),
        physical,
    }
}
