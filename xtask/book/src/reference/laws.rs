//! The contact laws.

use std::fmt::Write as _;

use nanotap::model::contact::ContactLaw;
use nanotap_volterra::laws::all;

use super::{code, head, plain, row};

const INTRODUCTION: &str = "\
# The contact laws

`law` under `[sample]`, or `contact` under `[model]` for those with a closed form.

## Exact laws

Piecewise linear: between two switches the motion is in closed form.

";

const NONLINEAR: &str = "
## Nonlinear laws

The beam stays exact; the force in time is a polynomial that solves a Volterra equation, see
[nonlinear laws](../theory/nonlinear.md). A sum is written with `+`, as in
`\"hertz + exponential-damping\"`; two laws that describe the same part of the interaction are not
added. The keys of `[sample]` and `[tip]` that give the parameters are in [the case
file](case.md).
";

pub(super) fn page() -> String {
    let mut text = INTRODUCTION.to_owned();
    text += &head(&["name", "what it is"]);
    for law in ContactLaw::ALL {
        text += &row(&[code(law.name()), law.meaning().to_owned()]);
    }
    text += NONLINEAR;
    for law in all() {
        let entry = law.entry;
        let _ = write!(text, "\n### {}\n\n{}.\n\n", entry.name, plain(entry.words));
        let _ = write!(text, "```text\n{}\n```\n\n", entry.formula);
        let memory = if entry.conservative {
            "Conservative."
        } else {
            "Dissipates, or has a memory."
        };
        let _ = write!(text, "{memory} Source: {}.\n\n", plain(entry.source));
        text += &head(&["parameter", "what it is", "unit", "range", "without it"]);
        for parameter in entry.parameters {
            let default = parameter.default.map_or(String::new(), |value| {
                if value.is_infinite() {
                    "infinite".to_owned()
                } else if value != 0.0 && value.abs() < 1e-3 {
                    format!("{value:e}")
                } else {
                    value.to_string()
                }
            });
            text += &row(&[
                code(parameter.name),
                parameter.words.to_owned(),
                parameter.dimension.unit.to_owned(),
                parameter.range.words().to_owned(),
                default,
            ]);
        }
    }
    text
}
