//! The observables.

use nanotap::observe::OBSERVABLES;

use super::{code, head, row};

const INTRODUCTION: &str = "\
# The observables

The observables of a motion, by the names that JSON, CSV headers, datasets, `--show` and Python use.
In a JSON document the entries of a motion are in the model's units, and those under `physical` in
SI, where some have names that experimenters use. Sweeps, branches and curves store the *recorded*
observables of every motion; the others are measured when a single motion is reported. The
[definitions](../theory/observables.md) are on a separate page.
";

pub(super) fn page() -> String {
    let mut text = INTRODUCTION.to_owned();
    text.push('\n');
    text += &head(&["name", "in SI", "meaning", "unit", "SI unit", "recorded"]);
    for observable in OBSERVABLES {
        let si_name = if observable.si_name == observable.name {
            String::new()
        } else {
            code(observable.si_name)
        };
        let recorded = nanotap::observe::ObservableSet::COMMON.contains(observable);
        text += &row(&[
            code(observable.name),
            si_name,
            observable.words.to_owned(),
            observable.dimension.model_unit().to_owned(),
            observable.dimension.si_unit().to_owned(),
            (if recorded { "yes" } else { "" }).to_owned(),
        ]);
    }
    text
}
