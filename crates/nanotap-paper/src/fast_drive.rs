//! Figs. 8–14: the motions at Ω = 20 with a tip mass. One exists; it is compared with the motions
//! that the paper's own method produces.

use nanotap_arithmetic::ComplexFunctions as _;
use std::rc::Rc;

use nanotap_dynamics::PeriodicOrbit;
use nanotap_figures::{Axis, Colour, Figure, Legend, Line, Markers, Panel};

use super::PaperError;
use super::check::{digits, rounds_to};
use super::expected::Computed;
use super::motion_view::{KEY, View, empty_portrait};
use super::rerun;
use super::runs::{Counted, Runs, how_many};
use super::section::{Picture, Section};
use super::time_step::{GridMotion, Scan, fast_case};
use nanotap::model::cantilever::{Cantilever, CantileverError};
use nanotap::model::exact_beam;
use nanotap::model::{Model, ModelError};

/// Colour of motions computed with fixed steps.
const GRID: Colour = Colour::PURPLE;
/// Number of drive periods of a nonperiodic motion that are drawn.
const SHOWN_PERIODS: usize = 40;

/// The case of these figures, three modes, with its only attractor.
struct Fast {
    counted: Rc<Counted>,
    attractor: PeriodicOrbit,
    scan: Rc<Scan>,
}

impl Fast {
    fn new(runs: &Runs<'_>) -> Result<Self, PaperError> {
        let counted = runs.count(&fast_case(3))?;
        let attractor = counted
            .all_stable()
            .first()
            .map(|(orbit, _)| (*orbit).clone());
        let Some(attractor) = attractor else {
            let failed = PaperError::failed("the census at Ω = 20");
            return Err(failed("no periodic attractor was found"));
        };
        Ok(Self {
            counted,
            attractor,
            scan: runs.shared(Scan::new)?,
        })
    }

    /// The exact motion above, the motion of a grid below.
    fn figure(&self, periods: usize, grid: Option<&GridMotion>) -> Result<Figure, PaperError> {
        let view = View::new(&self.counted.model, &self.attractor.states[0], periods)?;
        let loop_view = View::new(
            &self.counted.model,
            &self.attractor.states[0],
            self.attractor.period,
        )?;
        let rows = if grid.is_some() { 2 } else { 1 };
        let figure = Figure::new(rows, 2)
            .column_widths([1.7, 1.0])
            .with(view.time_panel(format!(
                "exact flow, N = 3: period {}",
                self.attractor.period
            )))
            .with(loop_view.portrait_panel("", 0.9));
        Ok(match grid {
            None => figure,
            Some(motion) => {
                let model = Model::cantilever(&fast_case(motion.grid.modes))?;
                let periods = motion.period.unwrap_or(SHOWN_PERIODS).max(4);
                let [time, portrait] = grid_panels(motion, &model, periods);
                figure.with(time).with(portrait)
            }
        })
    }

    /// The evidence of the census against a claim.
    fn evidence(&self) -> String {
        format!(
            "N = 3, {}; {}",
            self.counted.summary(),
            self.counted.missed()
        )
    }

    fn rerun_orbit(&self) -> String {
        rerun::on_case(
            "orbit",
            &self.counted.case,
            &format!(
                "--period {} {} --prove",
                self.attractor.period,
                rerun::state(&self.attractor.states[0])
            ),
        )
    }
}

/// Time series and phase portrait of the motion of a grid.
fn grid_panels(motion: &GridMotion, model: &Model, periods: usize) -> [Panel; 2] {
    let curve = motion.curve(model, periods);
    let time = Panel::new(
        Axis::linear("time $τ / T$ (drive periods)").tight(),
        Axis::linear("tip deflection $W$"),
    )
    .title(format!(
        "fixed steps, {}: {}",
        motion.grid.short(),
        motion.words()
    ))
    .legend(Legend::Hidden)
    .with(Line::new(curve.iter().map(|p| (p[0], p[1]))).colour(GRID));
    let strobes = (0..periods).filter_map(|k| {
        let at = curve
            .iter()
            .min_by(|a, b| (a[0] - k as f64).abs().total_cmp(&(b[0] - k as f64).abs()))?;
        Some((at[1], at[2]))
    });
    let portrait = empty_portrait("")
        .with(
            Line::new(curve.iter().map(|p| (p[1], p[2])))
                .colour(GRID)
                .width(0.3),
        )
        .with(Markers::new(strobes).colour(Colour::BLACK).size(0.9));
    [time, portrait]
}

/// Text on a grid's motion for a caption.
fn below(motion: Option<&GridMotion>) -> String {
    motion.map_or_else(String::new, |m| {
        format!(
            " (c, d) The motion of fixed-step Runge–Kutta ({}): {}, amplitude {}; the exact flow does not have it.",
            m.grid.words(),
            m.words(),
            digits(m.amplitude, 4)
        )
    })
}

/// Computes the section on Fig. 8: a period-1 motion at Ω = 20.
pub(super) fn fig8(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let fast = Fast::new(runs)?;
    let look = fast.counted.look(&fast.attractor)?.observables;
    let single = runs.count(&fast_case(1))?;
    let found = fast.counted.stable(1).len();
    let one_mode = fast.scan.exact_amplitude(1).unwrap_or(f64::NAN);
    let failed = |error: CantileverError| PaperError::from(ModelError::from(error));
    let second = [0.0, fast.counted.case.alpha4]
        .map(|alpha4| exact_beam::frequencies(fast.counted.case.alpha1, alpha4, 2).map(|f| f[1]));
    let [flight, contact] = second;
    let second = [flight.map_err(failed)?, contact.map_err(failed)?];
    let single_orbit = single
        .all_stable()
        .first()
        .map(|(orbit, _)| (*orbit).clone());
    let (mut figure, mut words) = (fast.figure(2, None)?, String::new());
    if let Some(orbit) = &single_orbit {
        let view = View::new(&single.model, &orbit.states[0], 2)?;
        let loop_view = View::new(&single.model, &orbit.states[0], 1)?;
        figure = Figure::new(2, 2).column_widths([1.7, 1.0]);
        let three = View::new(&fast.counted.model, &fast.attractor.states[0], 2)?;
        let three_loop = View::new(&fast.counted.model, &fast.attractor.states[0], 1)?;
        figure = figure
            .with(three.time_panel("N = 3: the only attractor"))
            .with(three_loop.portrait_panel("", 0.9))
            .with(view.time_panel("N = 1: the only attractor"))
            .with(loop_view.portrait_panel("", 0.9));
        words = format!(
            " (c, d) With one mode its amplitude is {}.",
            digits(one_mode, 4)
        );
    }
    let again = single_orbit.map_or_else(
        || single.rerun(),
        |o| {
            rerun::on_case(
                "orbit",
                &single.case,
                &format!("--period 1 {}", rerun::state(&o.states[0])),
            )
        },
    );
    Ok(less_distorted(runs, section, &fast)?
        .picture(Picture::new(
            "fig08",
            "The period-1 motion at Ω = 20, α₁ = 0.1 (Fig. 8)",
            format!(
                "Eq. (26). (a, b) With three modes; W from {} to {}.{words} {KEY}",
                digits(look.tip_min, 4),
                digits(look.tip_max, 4)
            ),
            figure,
            128.0,
        ))
        .check(
            "fig8",
            found,
            format!("{} is stable", how_many(found, "period-1 motion")),
            fast.evidence(),
            fast.rerun_orbit(),
        )
        .check(
            "fig8-amplitude",
            Computed::readings(look.amplitude, one_mode),
            format!(
                "{} with N = 3 (half of peak to peak; W from {} to {}); {} with N = 1",
                digits(look.amplitude, 4),
                digits(look.tip_min, 4),
                digits(look.tip_max, 4),
                digits(one_mode, 4)
            ),
            format!(
                "the paper itself finds a single mode insufficient; the amplitude with three modes \
                 is {} times as large, because the second frequency is {} in flight and {} in contact",
                digits(look.amplitude / one_mode, 2),
                digits(second[0], 4),
                digits(second[1], 4)
            ),
            again,
        ))
}

/// "Compared with Ω = 2.6, the period-1 motions at Ω = 20 are much less distorted."
fn less_distorted(runs: &Runs<'_>, section: Section, fast: &Fast) -> Result<Section, PaperError> {
    let slow = runs.count(&Cantilever::paper())?;
    let orbits = runs.orbits(&slow, 1, 64)?;
    let at_slow = orbits.iter().find(|o| o.period == 1);
    let at_slow = at_slow.map(|o| slow.look(o)).transpose()?;
    let here = fast.counted.look(&fast.attractor)?.spectrum.thd;
    let there = at_slow.map_or(f64::NAN, |o| o.spectrum.thd);
    Ok(section.check(
        "fig8-less-distorted",
        here / there,
        format!(
            "{:.2} % of the power of W is outside the drive's frequency at Ω = 20, {:.0} % in the (unstable) period-1 \
             motion at Ω = 2.6",
            100.0 * here,
            100.0 * there
        ),
        "total harmonic distortion from the exact variance and the exact first harmonic, N = 3",
        fast.rerun_orbit(),
    ))
}

/// Computes the section on Fig. 9: another period-1 motion at Ω = 20.
pub(super) fn fig9(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let fast = Fast::new(runs)?;
    let grid = fast.scan.subharmonic(0.148);
    let found = fast.counted.stable(1).len();
    let from_one = fast
        .attractor
        .multipliers
        .iter()
        .map(|m| (m - 1.0).modulus())
        .fold(f64::INFINITY, f64::min);
    let near = grid.filter(|m| rounds_to(m.amplitude, 0.148, 3));
    let amplitude = match near {
        Some(m) => format!(
            "no attractor has it; fixed steps ({}) give {} of amplitude {}; the exact orbit with the same number of modes has {}",
            m.grid.words(),
            m.words(),
            digits(m.amplitude, 4),
            fast.scan
                .exact_amplitude(m.grid.modes)
                .map_or_else(String::new, |a| digits(a, 4))
        ),
        None => "no attractor has it".to_owned(),
    };
    Ok(section
        .picture(Picture::new(
            "fig09",
            "Is there another period-1 motion at Ω = 20, α₁ = 0.1? (Fig. 9)",
            format!("Eq. (26). (a, b) The only attractor of the exact flow.{} {KEY}", below(grid)),
            fast.figure(4, grid)?,
            128.0,
        ))
        .check(
            "fig9",
            found,
            format!("{} is stable", how_many(found, "period-1 motion")),
            fast.evidence(),
            fast.counted.rerun(),
        )
        .check(
            "fig9-amplitude",
            (),
            amplitude,
            format!(
                "the small difference to Fig. 8 is not the beginning of a bifurcation: the multiplier of the only period-1 \
                 orbit that is nearest to 1 is {} away from 1",
                digits(from_one, 2)
            ),
            grid.map_or_else(|| rerun::section("fig9"), GridMotion::rerun),
        ))
}

/// A figure that reports one long period with its amplitude, after `earlier` figures with the same
/// period.
fn long_period(
    runs: &Runs<'_>,
    section: Section,
    period: usize,
    amplitude: f64,
    earlier: usize,
) -> Result<Section, PaperError> {
    let fast = Fast::new(runs)?;
    let section_id = section.id;
    let number = section_id.trim_start_matches("fig");
    let grid = fast.scan.nearest(Some(period), amplitude, earlier);
    let found = fast.counted.stable(period).len();
    let orbits = runs.orbits(&fast.counted, period, 0)?;
    let unstable = orbits.iter().filter(|o| o.period == period).count();
    let spurious = fast.scan.of_period(period);
    let look = fast.counted.look(&fast.attractor)?.observables;
    Ok(section
        .picture(Picture::new(
            section_id,
            format!("Is there a period-{period} motion at Ω = 20, α₁ = 0.1? (Fig. {number})"),
            format!(
                "Eq. (26). (a, b) The only attractor of the exact flow, over {period} drive periods.{} {KEY}",
                below(grid)
            ),
            fast.figure(period, grid)?,
            128.0,
        ))
        .check(
            section_id,
            found,
            format!(
                "no initial state leads to one; the only attractor has period {} and amplitude {} (N = 3)",
                fast.attractor.period,
                digits(look.amplitude, 4)
            ),
            format!(
                "{}; Newton with period {period} from the initial states finds {}, unstable ones included; fixed-step \
                 Runge–Kutta gives {} of that period (amplitudes {}), none of which persists under the exact flow",
                fast.evidence(),
                how_many(unstable, "such orbit"),
                how_many(spurious, "different motion"),
                fast.scan.amplitudes(period),
            ),
            grid.map_or_else(|| fast.counted.rerun(), GridMotion::rerun),
        ))
}

/// Computes the section on Fig. 10: period 11 at Ω = 20.
pub(super) fn fig10(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    long_period(runs, section, 11, 1.18, 0)
}

/// Computes the section on Fig. 11: period 28 at Ω = 20.
pub(super) fn fig11(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    long_period(runs, section, 28, 1.45, 0)
}

/// Computes the section on Fig. 12: period 21 at Ω = 20.
pub(super) fn fig12(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    long_period(runs, section, 21, 0.34, 0)
}

/// Computes the section on Fig. 13: another period 21 at Ω = 20.
pub(super) fn fig13(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    long_period(runs, section, 21, 0.245, 1)
}

/// Computes the section on Fig. 14: a nonperiodic motion at Ω = 20.
pub(super) fn fig14(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let fast = Fast::new(runs)?;
    let grid = fast.scan.nearest(None, 1.3, 0);
    let rest = vec![0.0; fast.counted.model.dimension()];
    let transient = View::new(&fast.counted.model, &rest, SHOWN_PERIODS)?;
    let radius = fast.attractor.spectral_radius();
    let fading = nanotap_arithmetic::ln(10f64) / -nanotap_arithmetic::ln(radius);
    let mut figure = Figure::new(if grid.is_some() { 2 } else { 1 }, 2)
        .column_widths([1.7, 1.0])
        .with(transient.time_panel("exact flow, N = 3: transient to period 1"))
        .with(transient.tangle_into(empty_portrait(""), Colour::BLUE));
    if let Some(motion) = grid {
        let model = Model::cantilever(&fast_case(motion.grid.modes))?;
        let [time, portrait] = grid_panels(motion, &model, SHOWN_PERIODS);
        figure = figure.with(time).with(portrait);
    }
    Ok(section
        .picture(Picture::new(
            "fig14",
            "Is there a nonperiodic motion at Ω = 20, α₁ = 0.1? (Fig. 14)",
            format!(
                "Eq. (26). (a, b) The exact flow from rest: the irregular motion is the slow transient \
                 to the period-1 orbit, near which disturbances need {fading:.0} drive periods to decay to a tenth.{} {KEY}",
                below(grid)
            ),
            figure,
            128.0,
        ))
        .check(
            "fig14",
            fast.counted.chaos().len(),
            format!(
                "none is stable; transients are long: a disturbance of the period-1 orbit decays by a factor {} \
                 per drive period",
                digits(radius, 4)
            ),
            fast.evidence(),
            rerun::on_case(
                "simulate",
                &fast.counted.case,
                &format!("--transient 0 --periods {SHOWN_PERIODS}"),
            ),
        ))
}
