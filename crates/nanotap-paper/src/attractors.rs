//! The census for the verdicts on Figs. 6–17: every case of the paper with one to five modes.

use super::PaperError;
use super::check::digits;
use super::runs::{Counted, Runs};
use super::section::{Section, Table};
use nanotap::model::cantilever::Cantilever;
use nanotap::model::parameter::Parameter;

/// Largest number of modes of the census.
const MAX_MODES: usize = 5;

/// The coexisting motions that the paper states for one case, by the name of the statement.
struct Coexistence {
    id: &'static str,
    omega: f64,
    alpha1: f64,
    /// Stable motions as (period, number).
    periodic: &'static [(usize, usize)],
    /// Whether one of them is not periodic.
    nonperiodic: bool,
}

const CLAIMS: [Coexistence; 4] = [
    Coexistence {
        id: "attractors-slow",
        omega: 2.6,
        alpha1: 0.1,
        periodic: &[(1, 2), (2, 1), (3, 1)],
        nonperiodic: false,
    },
    Coexistence {
        id: "attractors-fast",
        omega: 20.0,
        alpha1: 0.1,
        periodic: &[(1, 2), (11, 1), (28, 1), (21, 2)],
        nonperiodic: true,
    },
    Coexistence {
        id: "attractors-bare-fast",
        omega: 20.0,
        alpha1: 0.0,
        periodic: &[(1, 2), (2, 1), (4, 2)],
        nonperiodic: false,
    },
    Coexistence {
        id: "attractors-bare-slow",
        omega: 2.6,
        alpha1: 0.0,
        periodic: &[(1, 2), (2, 1), (4, 2)],
        nonperiodic: false,
    },
];

impl Coexistence {
    /// Whether a census found all of them.
    fn holds(&self, counted: &Counted) -> bool {
        self.periodic
            .iter()
            .all(|(period, count)| counted.stable(*period).len() >= *count)
            && (!self.nonperiodic || !counted.chaos().is_empty())
    }
}

/// Every attractor in the cases of Figs. 6–17.
pub(super) fn section(runs: &Runs<'_>, mut section: Section) -> Result<Section, PaperError> {
    let mut table = Table::new(
        "Attractors found from pseudo-random initial states in a box that fits the case",
        [
            "Ω",
            "α₁",
            "N",
            "motion",
            "starts",
            "W min",
            "W max",
            "amplitude",
            "largest |μ|, or λ₁ per period",
        ],
    );
    for claim in &CLAIMS {
        let mut kinds = Vec::new();
        let mut agreeing = Vec::new();
        let mut evidence = String::new();
        let mut again = String::new();
        for modes in 1..=runs.either(MAX_MODES, 3) {
            let case = Cantilever::paper()
                .with_modes(modes)
                .with(Parameter::Omega, claim.omega)
                .with(Parameter::Alpha1, claim.alpha1);
            let counted = runs.count(&case)?;
            rows(&mut table, &counted)?;
            kinds.push(format!("N = {modes}: {}", counted.kinds().join(", ")));
            if claim.holds(&counted) {
                agreeing.push(modes.to_string());
            }
            if modes == case.modes && modes == Cantilever::paper().modes {
                evidence = format!("N = 3, {}; {}", counted.summary(), counted.missed());
                again = counted.rerun();
            }
        }
        let mut here = kinds.join("; ");
        if !agreeing.is_empty() {
            here = format!("agrees with N = {}; {here}", agreeing.join(", "));
        }
        section = section.check(claim.id, agreeing.len(), here, evidence, again);
    }
    Ok(section
        .text(
            "Each initial state is followed until Newton finds a stable orbit to which the motion converges, \
             or until its Lyapunov exponents are known. The classification does not depend on a tolerance for repetition. \
             Orbits that differ only by a shift of whole drive periods count once.",
        )
        .table(table))
}

fn rows(table: &mut Table, counted: &Counted) -> Result<(), PaperError> {
    let case = &counted.case;
    let head = || {
        [
            case.omega.to_string(),
            case.alpha1.to_string(),
            case.modes.to_string(),
        ]
        .into_iter()
    };
    for (orbit, fraction) in counted.all_stable() {
        let o = counted.look(orbit)?.observables;
        table.row(head().chain([
            format!("period {}", orbit.period),
            format!("{} of {}", fraction.count, fraction.total),
            format!("{:.5}", o.tip_min),
            format!("{:.5}", o.tip_max),
            format!("{:.5}", o.amplitude),
            format!("|μ| = {}", digits(orbit.spectral_radius(), 5)),
        ]));
    }
    for chaos in counted.chaos() {
        let (exponent, error) = chaos.spectrum.largest();
        let o = counted.watch(chaos.state)?;
        table.row(head().chain([
            format!("chaos, lifetime above {:.0} periods", chaos.lifetime.low),
            format!("{} of {}", chaos.fraction.count, chaos.fraction.total),
            format!("{:.3}", o.tip_min),
            format!("{:.3}", o.tip_max),
            format!("{:.3}", o.amplitude),
            format!("λ₁ = {exponent:.3} ± {error:.3}"),
        ]));
    }
    Ok(())
}
