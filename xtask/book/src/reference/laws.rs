//! The contact laws.

use std::fmt::Write as _;

use nanotap::case::physical::Kind;
use nanotap::model::contact::ContactLaw;
use nanotap_volterra::laws::all;

use super::{code, head, plain, row};

const INTRODUCTION: &str = "\
# The contact laws

`law` under `[sample]`, or `contact` under `[model]` for those with a closed form.

## Exact laws

Piecewise-linear laws: between two switches the motion has a closed form.

";

const NONLINEAR: &str = "
## Nonlinear laws

The motion of the beam under a given force is exact; the force as a function of time is a polynomial
that solves a Volterra equation, see [nonlinear laws](../theory/nonlinear.md). Write a sum with `+`, as
in `\"hertz + exponential-damping\"`; two laws for the same part of the interaction cannot be added. The
keys of `[sample]` and `[tip]` that set the parameters are listed in [the case file](case.md).
";

pub(super) fn page() -> String {
    let mut text = INTRODUCTION.to_owned();
    text += &head(&["name", "meaning"]);
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
        text += &head(&["parameter", "meaning", "unit", "range", "default"]);
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
                unit(parameter.kind),
                parameter.range.words().to_owned(),
                default,
            ]);
        }
    }
    text
}

/// The SI unit with raised powers; empty for a pure number.
fn unit(kind: Kind) -> String {
    match kind {
        Kind::Number => String::new(),
        kind => kind.si_unit().replace("^2", "²").replace("^6", "⁶"),
    }
}
