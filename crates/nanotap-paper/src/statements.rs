//! The statements of the paper that are checked, under the sections of the report, in the order of
//! the paper; evidence for several sections comes last.
//!
//! A section: its name, the approximate time in seconds on two cores, the function that computes it,
//! and its heading. A statement: its name, whether it is about the print or the motion, what the
//! computation has to give so that it holds, and the statement with its place in the paper.

use super::check::About::{self, Motion, Print};
use super::expected::Expected::{
    self, Above, AtLeast, AtMost, Below, Contradicted, Digits, Holds, Near, Open,
};
use super::runs::Runs;
use super::section::Section;
use super::{
    PaperError, attractors, bare_tip, bifurcation_diagram, clearance, convergence_study, equations,
    fast_drive, frequencies, impact, slow_drive, time_step,
};

/// A statement of the paper.
pub(super) struct Statement {
    /// Identifier, such as `eq25` or `fig8-amplitude`; it begins with the name of its section.
    pub(super) id: &'static str,
    pub(super) about: About,
    /// What the computation has to give so that the statement holds.
    pub(super) expected: Expected,
    /// The statement, with its location.
    pub(super) paper: &'static str,
}

/// A section of the report: its statements, and the function that computes it.
pub(super) struct Topic {
    pub(super) id: &'static str,
    pub(super) title: &'static str,
    /// Approximate time in seconds on two cores.
    pub(super) weight: u32,
    pub(super) make: fn(&Runs<'_>, Section) -> Result<Section, PaperError>,
    pub(super) statements: &'static [Statement],
}

macro_rules! topics {
    ($($id:literal, $weight:literal s, $make:path: $title:literal {
        $($statement:literal $about:ident, $expected:expr => $paper:literal;)*
    })*) => {
        /// All sections, in the order of the report.
        pub(super) const TOPICS: &[Topic] = &[$(Topic {
            id: $id,
            title: $title,
            weight: $weight,
            make: $make,
            statements: &[$(Statement {
                id: $statement,
                about: $about,
                expected: $expected,
                paper: $paper,
            }),*],
        }),*];
    };
}

/// Difference visible in a figure of the paper's size, relative to the amplitude.
const VISIBLE: f64 = 0.05;

topics! {
"eq7", 1 s, equations::damping_units: "Eq. (7): the damping parameters" {
    "eq7" Print, Near(1.0, 1e-9) => "Eq. (7): α₃ = C√(L⁴/EI), α₆ = (C₁/L)√(L⁴/EI)";
}
"eq14", 6 s, equations::cosine_term: "Eq. (14): the drive's cosine term" {
    "eq14" Print, Contradicted => "Eq. (14): … − α₂ α₃ ∫φ_i cos Ωτ";
}
"eq23", 1 s, equations::bare_frequencies: "Eq. (23): frequencies of the bare beam" {
    "eq23" Print, Digits(&[(3.52, 2), (22.03, 2), (61.7, 1)]) => "Eq. (23): ω₀₁ = 3.52, ω₀₂ = 22.03, ω₀₃ = 61.7";
}
"eq25", 1 s, equations::contact_frequencies: "Eq. (25): frequencies in contact" {
    "eq25" Print, AtLeast(1) => "Eq. (25): ω₁ = 7.79, ω₂ = 20.33, ω₃ = 55.81";
    "eq25-modes" Print, Open => "section 3 studies N = 1 … 4 and does not say how many modes Eq. (25) has";
    "eq25-trend" Motion, Holds => "compared with Eq. (23), ω₁ increases dramatically while ω₂ and ω₃ reduce";
}
"alpha4", 1 s, equations::samples: "Section 4: contact stiffness of ten samples" {
    "alpha4-samples" Print, Holds =>
        "section 4: α₄ from 4.7×10⁻³ (1 MPa) to 233.5 (50 GPa); 18.7 for polystyrene (4 GPa), 23.4 for \
         graphite (5 GPa), tip of E₁ = 130 GPa, ν₁ = 0.27";
}
"scaling", 1 s, equations::scaling: "Section 3: amplitude-independent frequencies" {
    "scaling" Motion, Below(1e-12) =>
        "section 3: the eigenfrequency of this intermittent contact system is amplitude-independent";
}
"fig2e", 1 s, frequencies::mode_shapes: "Fig. 2e: the first three modes" {
    "fig2e" Motion, Digits(&[(0.0, 0), (1.0, 0), (2.0, 0)]) =>
        "Fig. 2e: the lowest three mode shapes of a cantilever";
}
"fig2f", 2 s, clearance::section: "Fig. 2f: contact of other parts of the beam" {
    "fig2f" Motion, AtMost(0) =>
        "section 2: driving frequency, amplitude and parameters were chosen and examined so that only the tip touches";
}
"fig3", 1 s, frequencies::maps: "Fig. 3: frequencies against tip mass and contact stiffness" {
    "fig3-influence" Motion, Above(1.0) =>
        "Fig. 3: α₁ and α₄ have larger influence on the first natural frequency";
}
"fig4", 2 s, convergence_study::section: "Fig. 4: number of modes needed at Ω = 4.1" {
    "fig4-steady-state" Motion, Contradicted => "Fig. 4: the tip motion is the steady-state motion";
    "fig4-one-mode" Motion, Above(VISIBLE) => "Fig. 4: N = 1 differs significantly from N = 2, 3, 4";
    "fig4-convergence" Motion, Below(VISIBLE) => "Fig. 4: for N = 3, 4 there is very little difference";
    "fig4-contact-time" Motion, Above(0.1) => "Fig. 4: the contact time is a significant portion of the cycle";
}
"fig5", 25 s, bifurcation_diagram::section: "Fig. 5: the bifurcation diagram" {
    "fig5-periods-1-2" Motion, Holds => "Fig. 5: period-1 and period-2 motions and their bifurcations";
    "fig5-window" Motion, AtLeast(1) =>
        "section 4: for 2.0 ≤ Ω ≤ 2.15 nonperiodic motions evolve from period 2";
    "fig5-further" Motion, Holds =>
        "section 4: if the driving frequency further increases, nonperiodic motions evolve from period-1 motions";
    "fig5-period-3" Motion, AtLeast(1) =>
        "section 4: other subharmonics like period 3 exist, which Fig. 5 does not show";
    "fig5-coexistence" Motion, AtLeast(1) => "section 4: several period-n motions coexist at one driving frequency";
}
"fig6", 6 s, slow_drive::fig6: "Fig. 6: two period-1 motions at Ω = 2.6, α₁ = 0.1" {
    "fig6" Motion, AtLeast(2) => "Fig. 6: two period-1 motions coexist at Ω = 2.6, α₁ = 0.1";
}
"fig7", 1 s, slow_drive::fig7: "Fig. 7: period 2 and period 3 at Ω = 2.6, α₁ = 0.1" {
    "fig7-period-2" Motion, AtLeast(1) => "Fig. 7a, b: a period-2 motion exists at Ω = 2.6, α₁ = 0.1";
    "fig7-period-3" Motion, AtLeast(1) => "Fig. 7c, d: a period-3 motion exists at Ω = 2.6, α₁ = 0.1";
}
"fig8", 20 s, fast_drive::fig8: "Fig. 8: a period-1 motion at Ω = 20, α₁ = 0.1" {
    "fig8" Motion, AtLeast(1) => "Fig. 8: a period-1 motion exists at Ω = 20, α₁ = 0.1";
    "fig8-amplitude" Motion, Digits(&[(0.145, 3)]) => "section 4: the amplitude in Fig. 8 is 0.145";
    "fig8-less-distorted" Motion, Below(0.5) =>
        "section 4: compared with Ω = 2.6, the period-1 motions at Ω = 20 are much less asymmetric and distorted";
}
"fig9", 1 s, fast_drive::fig9: "Fig. 9: another period-1 motion at Ω = 20, α₁ = 0.1" {
    "fig9" Motion, AtLeast(2) => "Fig. 9: another period-1 motion, very near that of Fig. 8, coexists";
    "fig9-amplitude" Motion, Contradicted => "section 4: the amplitude in Fig. 9 is 0.148";
}
"fig10", 1 s, fast_drive::fig10: "Fig. 10: period 11 at Ω = 20, α₁ = 0.1" {
    "fig10" Motion, AtLeast(1) => "Fig. 10: a period-11 motion of amplitude 1.18 exists at Ω = 20, α₁ = 0.1";
}
"fig11", 1 s, fast_drive::fig11: "Fig. 11: period 28 at Ω = 20, α₁ = 0.1" {
    "fig11" Motion, AtLeast(1) => "Fig. 11: a period-28 motion of amplitude 1.45 exists at Ω = 20, α₁ = 0.1";
}
"fig12", 1 s, fast_drive::fig12: "Fig. 12: period 21 at Ω = 20, α₁ = 0.1" {
    "fig12" Motion, AtLeast(1) => "Fig. 12: a period-21 motion of amplitude 0.34 exists at Ω = 20, α₁ = 0.1";
}
"fig13", 1 s, fast_drive::fig13: "Fig. 13: another period 21 at Ω = 20, α₁ = 0.1" {
    "fig13" Motion, AtLeast(2) => "Fig. 13: a period-21 motion of amplitude 0.245 exists at Ω = 20, α₁ = 0.1";
}
"fig14", 1 s, fast_drive::fig14: "Fig. 14: a nonperiodic motion at Ω = 20, α₁ = 0.1" {
    "fig14" Motion, AtLeast(1) =>
        "Fig. 14: a nonperiodic motion of amplitude close to those of periods 11 and 28 exists at Ω = 20, α₁ = 0.1";
}
"fig15", 1 s, bare_tip::fig15: "Fig. 15: two period-1 motions with α₁ = 0" {
    "fig15" Motion, AtLeast(2) => "Fig. 15: two period-1 motions coexist with α₁ = 0";
    "fig15-omega" Print, Open => "Figs. 15–17: Ω = 20 in the captions, Ω = 2.6 in the text";
    "fig15-alpha1" Print, Open =>
        "section 4: α₁ = 0.1 in Figs. 5–15 and 0 in Figs. 16, 17; later α₁ = 0 in Figs. 15–17, as the captions say";
}
"fig16", 1 s, bare_tip::fig16: "Fig. 16: period 2 with α₁ = 0" {
    "fig16" Motion, AtLeast(1) => "Fig. 16: a period-2 motion exists with α₁ = 0";
    "fig16-no-period-3" Motion, AtMost(0) => "section 4: no period-3 motion was found for α₁ = 0 at Ω = 2.6";
}
"fig17", 1 s, bare_tip::fig17: "Fig. 17: two period-4 motions with α₁ = 0" {
    "fig17" Motion, AtLeast(2) => "Fig. 17: two period-4 motions coexist with α₁ = 0";
    "fig17-no-tip-mass" Motion, AtMost(0) => "section 4: period-4 motion is not found for α₁ = 0.1 (at Ω = 2.6)";
}
"impact", 15 s, impact::section: "Fig. 1: rigid and soft stops" {
    "impact-flips" Motion, Holds => "section 1: with K₁ → ∞ the vibro-impact system becomes an impact oscillator";
    "impact-diagram" Motion, Above(0.05) =>
        "section 4: Fig. 5 is very different from the bifurcation diagram of an impact oscillator";
}
"attractors", 15 s, attractors::section: "Evidence: all attractors, N = 1 … 5" {
    "attractors-slow" Motion, AtLeast(1) =>
        "Figs. 6, 7: at Ω = 2.6, α₁ = 0.1 two period-1, a period-2 and a period-3 motion coexist";
    "attractors-fast" Motion, AtLeast(1) =>
        "Figs. 8–14: at Ω = 20, α₁ = 0.1 two period-1, a period-11, a period-28, two period-21 and a \
         nonperiodic motion coexist";
    "attractors-bare-fast" Motion, AtLeast(1) =>
        "captions of Figs. 15–17: at Ω = 20, α₁ = 0 two period-1, a period-2 and two period-4 motions coexist";
    "attractors-bare-slow" Motion, AtLeast(1) =>
        "text on Figs. 15–17: at Ω = 2.6, α₁ = 0 two period-1, a period-2 and two period-4 motions coexist";
}
"time-step", 1 s, time_step::section: "Evidence: artefacts of fixed time steps" {
    "time-step" Motion, AtMost(0) =>
        "section 2: fixed-step Runge–Kutta, switching on the grid; Figs. 8–14 report periods 1, 11, 21, 28 at Ω = 20";
}
}
