//! A force curve: the lever approaches the sample, turns and retracts, with the static branches
//! that it would follow without inertia.
//!
//! The sample moves towards the lever as a triangle (a ramp and back) or as one period of a cosine.
//! The motion is exact within every drive period: a cosine is one more tone of the flow; a ramp is
//! the middle of a slow sine, which differs from it by 2·10⁻¹¹ of the way of one period and starts
//! anew at the exact distance in each. The lever begins at rest at the first distance, in its
//! steady motion there if it is driven.
//!
//! The distance `z` is that between tip and undeformed surface with the lever at deflection 0, the
//! separation `d` that of the tip as it is: `d = z + deflection`. Forces are positive where the
//! sample pushes the tip away.
//!
//! Static branches are the solutions of `d − z = c F(d)` with the lever's static compliance
//! `c = 1/k`, followed in `d`; they end in folds where `c F′(d) = 1`, and where the law's branch ends.
//!
//! Limits: the moving lever has the modes of the case, and no spring for those that are left out. A
//! slow curve is therefore off the static branches by `(1/k − Σ 1/kᵢ) F` in the distance: 3 % of the
//! deflection with one mode, 0.5 % with two, 0.14 % with three. The sample moves, not the base, so that the inertia of the lever under the motion of its
//! base is left out. It adds `(f / f0)²` of the amplitude at the frequency `f` of a cosine.

mod fits;
mod path;
mod report;
mod rest;
mod run;
mod statics;
mod stretches;

use nanotap_case::physical::Remark;
use nanotap_dynamics::Control;

pub use fits::{ContactFit, ContactModel};
pub use report::{
    CurvePoint, ForceCurveReport, ForceCurveSummary, StaticBranch, StaticJump, StaticPoint,
    Statics, Waveform,
};

pub use path::physical;
pub use rest::{Chain, RestLever, StableRest};

use crate::figure::force_curve::force_curve_figure;
use nanotap_case::Case;
use nanotap_error::Error;
use nanotap_figures::Figure;
use nanotap_motions::approach::Way;
use nanotap_observe::frame::Frame;
use nanotap_study::Study;
use nanotap_study::limits::{MAX_DISTANCES, MAX_PERIODS};
use nanotap_study::request::options;
use nanotap_study::value::Amount;

options! {
    /// Options of a force curve.
    pub struct ForceCurveOptions {
        /// First distance, as in "30 nm"; default: the distance of the case
        #[schemars(extend("x-value" = "DISTANCE"))]
        pub from: Option<Amount> = None,
        /// Distance at which the approach turns; default: as far behind the surface as a tenth of
        /// {from}
        #[schemars(extend("x-value" = "DISTANCE"))]
        pub to: Option<Amount> = None,
        /// Force at which the approach turns in place of {to}, as in "5 nN": the distance at which
        /// the lever at rest exerts it
        #[schemars(extend("x-value" = "FORCE"))]
        pub peak_force: Option<Amount> = None,
        /// Speed of a ramp, as in "2 um/s"; default: 1 um/s
        #[schemars(extend("x-value" = "SPEED"))]
        pub speed: Option<Amount> = None,
        /// Frequency of a cosine in place of a ramp, as in "2 kHz"
        #[schemars(extend("x-value" = "FREQUENCY"))]
        pub frequency: Option<Amount> = None,
        /// Number of points in each direction
        #[schemars(range(min = 2, max = MAX_DISTANCES), extend("x-value" = "P"))]
        pub points: usize = 500,
        /// Drive periods at the first distance before the curve, of a driven lever; default: 20
        /// time constants of the lever
        #[schemars(range(min = 0, max = MAX_PERIODS), extend("x-value" = "N"))]
        pub settle: Option<usize> = None,
        /// Lowest force of the fits, as a part of the span from the lowest force of the retract to
        /// the peak
        #[schemars(range(min = 0, max = 1), extend("x-value" = "PART"))]
        pub fit_from: f64 = 0.2,
        /// Highest force of the fits, likewise
        #[schemars(range(min = 0, max = 1), extend("x-value" = "PART"))]
        pub fit_to: f64 = 0.9,
    }
}

/// Study of force curves: approach and retract at a finite speed.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::case::physical::Catalogue;
/// use nanotap::control::Control;
/// use nanotap::study::Study as _;
/// use nanotap::study::force_curve::{ForceCurveOptions, ForceCurveStudy};
/// use std::path::Path;
///
/// let file = Path::new("../../docs/cases/force-curve.toml");
/// let case = Case::load(Some(file), &[], &Catalogue::shared())?;
/// let options = ForceCurveOptions {
///     to: Some("-2 nm".into()),
///     speed: Some("10 um/s".into()),
///     ..ForceCurveOptions::default()
/// };
/// let curve = ForceCurveStudy::run(&case, &options, &Control::default())?;
/// // The pull-off force of the law, HR/(6 a₀²) (docs/cases/force-curve.md).
/// assert!((curve.summary.adhesion_force - 4.2852770e-9).abs() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ForceCurveStudy;

impl Study for ForceCurveStudy {
    const NAME: &'static str = "force-curve";
    const ABOUT: &'static str = "Force curve of approach and retract at a finite speed, with the \
                                 static branches, adhesion, work and fitted moduli";
    type Options = ForceCurveOptions;
    type Report = ForceCurveReport;

    const COUNTED: &'static str = "points";
    const ANY_DISTANCE: bool = true;

    fn frames<'a>(_: &Case, report: &'a ForceCurveReport) -> Vec<Frame<'a>> {
        vec![
            report.point_table(),
            report.result_table(),
            report.fit_table(),
        ]
    }

    fn figure(_: &Case, report: &ForceCurveReport) -> Option<Figure> {
        Some(force_curve_figure(report))
    }

    fn remarks(_: &Case, report: &ForceCurveReport) -> Vec<Remark> {
        Remark::warnings(&report.warnings)
    }

    fn compute(
        case: &Case,
        options: &ForceCurveOptions,
        control: &Control<'_>,
    ) -> Result<ForceCurveReport, Error> {
        let plan = path::Plan::new(case, options)?;
        let statics = statics::statics(&plan);
        let run = run::run(&plan, control)?;
        Ok(report::report(&plan, &statics, &run))
    }
}
