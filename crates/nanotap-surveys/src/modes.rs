//! The frequencies of the lever, in free flight and with the tip in contact: those of the
//! Galerkin equations, those of the beam without truncation, and what damping makes of them.

use std::collections::BTreeMap;

use nalgebra::Complex;
use nanotap_figures::Figure;
use schemars::JsonSchema;
use serde::Serialize;

use crate::figure::modes::shapes_figure;
use nanotap_case::Case;
use nanotap_case::physical::Kind;
use nanotap_case::units::Units;
use nanotap_dynamics::control::Control;
use nanotap_error::Error;
use nanotap_model::beam::Modes;
use nanotap_model::cantilever::{Cantilever, CantileverError};
use nanotap_model::exact_beam;
use nanotap_model::galerkin::{Galerkin, Regime};
use nanotap_model::spectrum::{self, Spectrum, TipLoad};
use nanotap_observe::frame::{Form, Frame, Rows, frame};
use nanotap_quantity::number::percent;
use nanotap_study::Study;
use nanotap_study::cantilever;
use nanotap_study::limits::MAX_POINTS;
use nanotap_study::request::options;

/// The modes of a case. Frequencies are Ω of the undamped equations, ascending, N of each.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ModeTable {
    /// Number of modes N, the length of the lists of frequencies.
    pub modes: usize,
    /// Excess stiffness of these modes together over the beam against a constant force at the tip,
    /// as a fraction of its static stiffness k = 3EI/L³.
    pub static_excess: f64,
    /// Frequencies Ω of the Galerkin equations in free flight, dimensionless.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Frequency.model_unit()))]
    pub free: Vec<f64>,
    /// Frequencies Ω of the Galerkin equations in contact, dimensionless.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Frequency.model_unit()))]
    pub contact: Vec<f64>,
    /// Frequencies Ω of the exact beam in free flight, dimensionless; empty for a lever whose modes
    /// were measured, which is not a uniform beam.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Frequency.model_unit()))]
    pub exact_free: Vec<f64>,
    /// Frequencies Ω of the exact beam in contact, dimensionless; empty as those in free flight.
    #[schemars(extend("x-unit" = nanotap_observe::Dimension::Frequency.model_unit()))]
    pub exact_contact: Vec<f64>,
    /// Quality factors of the free modes, |λ|/(2 |Re λ|); infinite (`null`) without damping,
    /// `None` where not every mode oscillates.
    pub quality: Option<Vec<f64>>,
    /// Eigenvalues [Re, Im ≥ 0] of the damped Galerkin equations in free flight, by
    /// ascending size; `None` where they are too nearly defective to be separated.
    pub free_eigenvalues: Option<Vec<[f64; 2]>>,
    /// Eigenvalues (Re, Im ≥ 0) of the damped Galerkin equations in contact, by ascending size;
    /// `None` where they are too nearly defective to be separated.
    pub contact_eigenvalues: Option<Vec<[f64; 2]>>,
    /// The frequencies in Hz, for a physical case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physical: Option<BTreeMap<&'static str, Vec<f64>>>,
}

impl ModeTable {
    /// The modes of `case`.
    ///
    /// ```
    /// use nanotap::model::cantilever::Cantilever;
    /// use nanotap::study::modes::ModeTable;
    ///
    /// let table = ModeTable::new(&Cantilever { alpha1: 0.0, ..Cantilever::paper() })?;
    /// // The first frequency of a beam without a tip is 1.8751².
    /// assert!((table.exact_free[0] - 3.516015).abs() < 1e-6);
    /// # Ok::<(), nanotap::Error>(())
    /// ```
    ///
    /// # Errors
    /// When the case is not valid.
    pub fn new(case: &Cantilever) -> Result<Self, Error> {
        case.validate()?;
        let beam = Modes::of(case).map_err(CantileverError::from)?;
        // Nothing tells of more modes of a lever than were measured.
        let exact = |stiffness| {
            if case.lever_modes.is_empty() {
                exact_beam::frequencies(case.alpha1, stiffness, case.modes)
            } else {
                Ok(Vec::new())
            }
        };
        // Measured modes and Q control fill the matrices.
        let dense = if case.is_corrected() {
            Some(Galerkin::new(case)?)
        } else {
            None
        };
        let galerkin = |regime| match &dense {
            Some(equations) => Ok(spectrum::dense_frequencies(equations, regime)),
            None => spectrum::frequencies(&beam, TipLoad::of(case, regime)),
        };
        let eigenvalues = |regime| -> Option<Vec<[f64; 2]>> {
            let values = if let Some(equations) = &dense {
                spectrum::dense_eigenvalues(equations, regime)
            } else {
                let load = TipLoad::of(case, regime);
                Spectrum::of_beam(&beam, case.alpha3, load)
                    .ok()?
                    .eigenvalues
            };
            Some(values.into_iter().map(pair).collect())
        };
        let free_eigenvalues = eigenvalues(Regime::Free);
        let quality = free_eigenvalues.as_ref().and_then(|values| {
            let quality = |value: &[f64; 2]| 0.5 / damping_ratio(*value);
            (values.len() == case.modes).then(|| values.iter().map(quality).collect())
        });
        Ok(Self {
            modes: case.modes,
            static_excess: beam.static_excess(),
            quality,
            free: galerkin(Regime::Free)?,
            contact: galerkin(Regime::Contact)?,
            exact_free: exact(0.0)?,
            exact_contact: exact(case.alpha4)?,
            free_eigenvalues,
            contact_eigenvalues: eigenvalues(Regime::Contact),
            physical: None,
        })
    }
}

/// The shapes φ_j(ξ) of modes at so many points along the beam, as a table.
pub fn shape_table<'a>(modes: &'a Modes, points: usize) -> Frame<'a> {
    let xi = move |point| point as f64 / (points - 1) as f64;
    let rows = Rows::new("shapes", 0..points, None).column("xi", "ξ", Form::Digits(5), xi);
    let with = |rows: Rows<'a, usize>, (k, number)| {
        let shape = move |point| modes.shapes(xi(point))[k];
        let [name, head] = [format!("phi{number}"), format!("φ{number}")];
        rows.column(name, head, Form::Digits(5), shape)
    };
    let numbers = modes.iter().map(|mode| mode.number).enumerate();
    numbers.fold(rows, with).frame()
}

impl ModeTable {
    /// The frequencies in free flight or in contact: of the equations, of the exact beam, and with
    /// damping where every mode oscillates.
    pub fn frequency_table(&self, in_contact: bool, units: Units) -> Frame<'_> {
        let (galerkin, exact, eigenvalues) = if in_contact {
            (
                &self.contact,
                &self.exact_contact,
                &self.contact_eigenvalues,
            )
        } else {
            (&self.free, &self.exact_free, &self.free_eigenvalues)
        };
        let symbol = if matches!(units, Units::Si(_)) {
            "f"
        } else {
            "Ω"
        };
        let paired = eigenvalues.as_ref();
        let paired = paired.filter(|list| list.len() == galerkin.len());
        let damped = move |k: usize| Some(paired?[k]);
        let difference = |k: usize| Some(percent(galerkin[k] / exact.get(k)? - 1.0));
        frame! { Rows::new("frequencies", 0..galerkin.len(), Some(units));
            "mode", "mode", Plain => |k| k + 1;
            "galerkin", format!("{symbol} Galerkin"), (Frequency, Quantity([7, 7])) =>
                |k| galerkin[k];
            "exact", format!("{symbol} exact"), (Frequency, Quantity([7, 7])) =>
                |k| exact.get(k).copied();
            "difference", "difference", Plain => difference;
            .align(Point);
            "damped", format!("{symbol} damped"), (Frequency, Quantity([7, 7])) =>
                move |k| Some(damped(k)?[1]);
            "damping", "damping ζ", Digits(4) => move |k| damped(k).map(damping_ratio);
            .aligned(Point, Point);
        }
    }
}

fn pair(eigenvalue: Complex<f64>) -> [f64; 2] {
    [eigenvalue.re, eigenvalue.im]
}

/// The damping ratio ζ = −Re λ/|λ| of an eigenvalue [Re, Im].
pub fn damping_ratio([re, im]: [f64; 2]) -> f64 {
    let size = nanotap_arithmetic::hypot(re, im);
    // An eigenvalue zero belongs to no beam; it would damp nothing.
    if size == 0.0 { 0.0 } else { -re / size }
}

options! {
    /// Options of the mode table.
    pub struct ModesOptions {
        /// Points along the beam in the table of mode shapes
        #[schemars(range(min = 2, max = MAX_POINTS), extend("x-value" = "P"))]
        pub points: usize = 201,
    }
}

/// Study of the mode shapes and frequencies of a cantilever.
#[derive(Clone, Copy, Debug)]
pub struct ModesStudy;

impl Study for ModesStudy {
    const NAME: &'static str = "modes";
    const ABOUT: &'static str =
        "Compute mode shapes and frequencies, in free flight and in contact";
    const ANY_RATIO: bool = true;
    type Options = ModesOptions;
    type Report = ModeTable;

    // The frequencies do not depend on it.
    const ANY_DISTANCE: bool = true;
    const WITHOUT_DISTANCE: bool = true;

    fn frames<'a>(case: &Case, report: &'a ModeTable) -> Vec<Frame<'a>> {
        let tables =
            [false, true].map(|in_contact| report.frequency_table(in_contact, case.units()));
        tables.into()
    }

    fn figure(_: &Case, report: &ModeTable) -> Option<Figure> {
        Some(shapes_figure(&Modes::new(report.modes).ok()?))
    }

    fn compute(case: &Case, _: &ModesOptions, _: &Control<'_>) -> Result<ModeTable, Error> {
        let mut table = ModeTable::new(cantilever(case, Self::NAME)?)?;
        table.physical = case.units().si(Kind::Frequency).map(|unit| {
            let frequencies = [
                ("free", &table.free),
                ("contact", &table.contact),
                ("exact_free", &table.exact_free),
                ("exact_contact", &table.exact_contact),
            ];
            let in_hertz = |all: &Vec<f64>| all.iter().map(|value| unit * value).collect();
            frequencies.map(|(name, all)| (name, in_hertz(all))).into()
        });
        Ok(table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nanotap_model::parameter::Parameter;

    #[test]
    fn equation_25_and_the_exact_beam() {
        // Eq. (25) of the paper prints 7.79, 20.33, 55.81 for the contact frequencies at
        // α1 = 0.1, α4 = 20: its digits are those of five modes. The exact ones are roots
        // of the transcendental equation.
        let table = ModeTable::new(&Cantilever::paper().with_modes(5)).unwrap();
        for (computed, printed) in table.contact.iter().zip([7.79, 20.33, 55.81]) {
            assert!(
                (computed - printed).abs() <= 0.005 + 1e-9,
                "{computed} {printed}"
            );
        }
        for (computed, exact) in table
            .exact_contact
            .iter()
            .zip([7.790952, 20.324970, 55.718523])
        {
            assert!((computed - exact).abs() < 1e-6, "{computed} {exact}");
        }
    }

    #[test]
    fn galerkin_lies_above_the_exact_beam_and_contact_above_free() {
        // Rayleigh–Ritz: a truncated basis can only stiffen; so can a spring.
        let table = ModeTable::new(&Cantilever::paper().with_modes(8)).unwrap();
        for k in 0..8 {
            assert!(table.free[k] >= table.exact_free[k] * (1.0 - 1e-12));
            assert!(table.contact[k] >= table.exact_contact[k] * (1.0 - 1e-12));
            assert!(table.contact[k] >= table.free[k]);
        }
    }

    #[test]
    fn without_tip_and_spring_every_frequency_is_the_bare_beams() {
        let bare = Cantilever::paper()
            .with(Parameter::Alpha1, 0.0)
            .with(Parameter::Alpha4, 0.0)
            .with_modes(4);
        let table = ModeTable::new(&bare).unwrap();
        // β² of cos β cosh β = −1: 3.51602, 22.0345, 61.6972, 120.902 (any table of modes).
        for (column, expected) in [3.51602, 22.0345, 61.6972, 120.902].into_iter().enumerate() {
            for row in [
                &table.free,
                &table.contact,
                &table.exact_free,
                &table.exact_contact,
            ] {
                assert!((row[column] / expected - 1.0).abs() < 5e-6);
            }
        }
        // λ² + α3 λ + β⁴ = 0 for each mode by itself: ζ = α3/(2ω).
        let free = table.free_eigenvalues.unwrap();
        for (eigenvalue, frequency) in free.into_iter().zip(&table.free) {
            assert!((damping_ratio(eigenvalue) - 0.1 / (2.0 * frequency)).abs() < 1e-12);
        }
    }

    #[test]
    fn bad_cases_are_refused() {
        let bad = Cantilever::paper().with(Parameter::Alpha1, -1.0);
        let error = ModeTable::new(&bad).unwrap_err();
        assert_eq!(error.kind, nanotap_error::ErrorKind::BadInput);
    }
}
