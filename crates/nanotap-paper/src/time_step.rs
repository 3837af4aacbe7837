//! The paper's own method: fourth-order Runge–Kutta with fixed steps that switch on their grid. At
//! Ω = 20 it shows coexisting subharmonics of long periods, different ones for every step; the
//! exact flow leads from all of them to one period-1 orbit.

use nanotap_dynamics::{ClassifyOptions, MotionKind, ShootingOptions, classify, close_orbit};
use nanotap_figures::{Axis, Colour, Figure, Legend, Markers, Panel, Rule, Shape};
use nanotap_flow::fixed_step::{FixedStep, Switching};
use rayon::prelude::*;

use super::check::digits;
use super::runs::Runs;
use super::section::{Picture, Section, Table};
use super::{PaperError, rerun};
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::model_map::ModelMap;
use nanotap::model::parameter::Parameter;

/// Longest period that is searched for.
pub(super) const MAX_PERIOD: usize = 64;
/// A grid motion has period n if each of its last strobe states recurs after n periods to within
/// this fraction of the motion's size.
const CLOSURE: f64 = 1e-9;
/// Two motions of the same period are identical if their extrema agree to this relative difference.
const EXTREMA_TOLERANCE: f64 = 1e-5;
/// Periods that the paper reports at Ω = 20, α1 = 0.1.
pub(super) const PAPER_PERIODS: [usize; 3] = [11, 21, 28];

/// Parameters of a fixed-step run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    pub(super) modes: usize,
    /// Steps per drive period in flight and in contact.
    pub(super) steps: [u32; 2],
    pub(super) switching: Switching,
    /// Discarded periods: enough for the decay to the true orbit to fall below [`CLOSURE`].
    transient: usize,
    starts: usize,
}

/// A motion to which fixed steps lead.
#[derive(Clone, Debug)]
pub(super) struct GridMotion {
    pub(super) grid: Grid,
    /// Apparent period; `None`: no period up to [`MAX_PERIOD`].
    pub(super) period: Option<usize>,
    pub(super) amplitude: f64,
    tip_range: (f64, f64),
    /// State at drive phase 0.
    pub(super) state: Vec<f64>,
    /// ModelMap states of one repetition (or of [`MAX_PERIOD`] drive periods).
    strobes: Vec<Vec<f64>>,
    /// Number of initial states that lead to it.
    pub(super) count: usize,
}

/// All motions that the grids show, and the motions to which the exact flow leads from them.
pub(super) struct Scan {
    pub(super) motions: Vec<GridMotion>,
    grids: usize,
    /// Amplitude of the only attractor of the exact flow, by number of modes.
    pub(super) exact: Vec<(usize, f64)>,
    /// Number of motions that are not of period 1.
    subharmonics: usize,
    /// Of these, the number from which the exact flow leads to its period-1 attractor.
    vanished: usize,
    /// Of these, the number with an exact orbit of their period nearby.
    closed: usize,
}

/// The case of Figs. 8–14.
pub(super) fn fast_case(modes: usize) -> Cantilever {
    Cantilever::paper()
        .with_modes(modes)
        .with(Parameter::Omega, 20.0)
}

/// The grids that are tried. The paper uses different steps in flight and in contact and states no
/// numbers. Equal steps and half the step in contact are tried, from barely stable to fine.
fn grids(quick: bool) -> Vec<Grid> {
    let grid = |modes, free: u32, ratio: u32, switching, transient, starts| Grid {
        modes,
        steps: [free, ratio * free],
        switching,
        transient,
        starts,
    };
    let (step, stage) = (Switching::EveryStep, Switching::EveryStage);
    if quick {
        return vec![
            grid(1, 20, 1, step, 700, 6),
            grid(1, 19, 2, step, 700, 6),
            grid(3, 25, 1, step, 1200, 3),
        ];
    }
    let mut grids: Vec<Grid> = (10..=64).map(|n| grid(1, n, 1, step, 700, 8)).collect();
    grids.extend((10..=24).map(|n| grid(1, n, 2, step, 700, 12)));
    grids.extend([20, 32, 40, 64].map(|n| grid(1, n, 1, stage, 700, 8)));
    for (n, starts) in [
        (80, 6),
        (100, 6),
        (128, 5),
        (200, 5),
        (400, 4),
        (1000, 3),
        (2000, 2),
    ] {
        grids.push(grid(1, n, 1, step, 700, starts));
        if n <= 400 {
            grids.push(grid(1, n, 1, stage, 700, starts));
        }
    }
    // The decay in larger systems is slower.
    for modes in [2, 3] {
        grids.extend(
            (8..=32)
                .chain([40, 50, 64, 80, 100])
                .map(|n| grid(modes, n, 1, step, 1500, 4)),
        );
        grids.extend((8..=16).map(|n| grid(modes, n, 2, step, 1500, 4)));
    }
    grids
}

impl Scan {
    pub(super) fn new(runs: &Runs<'_>) -> Result<Self, PaperError> {
        let grids = grids(runs.quick());
        let mut counted = Vec::new();
        for modes in [1, 2, 3] {
            counted.push(runs.count(&fast_case(modes))?);
        }
        let mut exact = Vec::new();
        for c in &counted {
            if let Some((orbit, _)) = c.all_stable().first() {
                exact.push((c.case.modes, c.look(orbit)?.observables.amplitude));
            }
        }
        let models: Vec<Model> = counted.iter().map(|c| c.model.clone()).collect();
        let seeds: Vec<Vec<Vec<f64>>> = counted
            .iter()
            .map(|c| Runs::starts(c, 16))
            .collect::<Result<_, _>>()?;
        let motions: Vec<GridMotion> = runs.controlled(|control| {
            let done = std::sync::atomic::AtomicUsize::new(0);
            let total = grids.len();
            grids
                .par_iter()
                .flat_map_iter(|grid| {
                    let found = if control.is_cancelled() {
                        Vec::new()
                    } else {
                        grid.motions(&models[grid.modes - 1], &seeds[grid.modes - 1])
                    };
                    let count = 1 + done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    if let Some(progress) = control.progress {
                        progress(count, total);
                    }
                    found
                })
                .collect()
        });
        let outcomes_by_start: Vec<(bool, bool)> = motions
            .par_iter()
            .filter(|m| m.period != Some(1))
            .map(|m| m.exactly(&models[m.grid.modes - 1]))
            .collect();
        Ok(Self {
            grids: grids.len(),
            exact,
            subharmonics: outcomes_by_start.len(),
            vanished: outcomes_by_start.iter().filter(|f| f.0).count(),
            closed: outcomes_by_start.iter().filter(|f| f.1).count(),
            motions,
        })
    }

    /// The motion of `period` whose amplitude is nearest to `amplitude`, or the one after `skipped`
    /// nearer ones, if there are enough.
    pub(super) fn nearest(
        &self,
        period: Option<usize>,
        amplitude: f64,
        skipped: usize,
    ) -> Option<&GridMotion> {
        let mut found: Vec<&GridMotion> =
            self.motions.iter().filter(|m| m.period == period).collect();
        let distance = |m: &GridMotion| (m.amplitude - amplitude).abs();
        found.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        let last = found.len().checked_sub(1)?;
        found.get(skipped.min(last)).copied()
    }

    /// Number of different motions of `period`.
    pub(super) fn of_period(&self, period: usize) -> usize {
        self.motions
            .iter()
            .filter(|m| m.period == Some(period))
            .count()
    }

    /// Amplitudes of the motions of `period`, as text.
    pub(super) fn amplitudes(&self, period: usize) -> String {
        let of = |m: &GridMotion| format!("{} with N = {}", digits(m.amplitude, 3), m.grid.modes);
        let all: Vec<String> = self
            .motions
            .iter()
            .filter(|m| m.period == Some(period))
            .map(of)
            .collect();
        if all.is_empty() {
            "none".to_owned()
        } else {
            all.join(", ")
        }
    }

    /// The subharmonic whose amplitude is nearest to `amplitude`.
    pub(super) fn subharmonic(&self, amplitude: f64) -> Option<&GridMotion> {
        self.motions
            .iter()
            .filter(|m| m.period.is_some_and(|n| n > 1))
            .min_by(|a, b| {
                (a.amplitude - amplitude)
                    .abs()
                    .total_cmp(&(b.amplitude - amplitude).abs())
            })
    }
}

impl Grid {
    /// The same step in flight and in contact, switched at every step.
    pub(super) const fn equal_steps(modes: usize, steps: u32, starts: usize) -> Self {
        Self {
            modes,
            steps: [steps, steps],
            switching: Switching::EveryStep,
            transient: 1500,
            starts,
        }
    }

    /// The different motions to which initial states lead.
    pub(super) fn motions(&self, model: &Model, starts: &[Vec<f64>]) -> Vec<GridMotion> {
        let mut found: Vec<GridMotion> = Vec::new();
        for start in starts.iter().take(self.starts) {
            let Some(motion) = self.classify(model, start) else {
                continue;
            };
            let near = |a: f64, b: f64| (a - b).abs() <= EXTREMA_TOLERANCE * motion.amplitude;
            let same = |m: &&mut GridMotion| {
                m.period == motion.period
                    && (m.period.is_none()
                        || near(m.tip_range.0, motion.tip_range.0)
                            && near(m.tip_range.1, motion.tip_range.1))
            };
            match found.iter_mut().find(same) {
                Some(known) => known.count += 1,
                None => found.push(motion),
            }
        }
        found
    }

    /// The motion to which one initial state leads; `None` if the numbers overflow or no regime
    /// contains it.
    fn classify(&self, model: &Model, start: &[f64]) -> Option<GridMotion> {
        let mut run = FixedStep::new(&model.system, start, &self.steps, self.switching).ok()?;
        for _ in 0..self.transient {
            run.run_period(|_, _| {});
        }
        let state = run.state().to_vec();
        let drive = model.system.drive();
        let tip = |phase: f64, x: &[f64]| model.tip.at(drive, x, phase);
        let mut range = (tip(0.0, &state), tip(0.0, &state));
        let mut strobes = vec![state.clone()];
        for _ in 0..2 * MAX_PERIOD {
            run.run_period(|phase, x| {
                let w = tip(phase, x);
                range = (range.0.min(w), range.1.max(w));
            });
            strobes.push(run.state().to_vec());
        }
        let scale = strobes
            .iter()
            .flatten()
            .fold(0.0, |m: f64, v| m.max(v.abs()));
        if !scale.is_finite() || scale > 1e6 {
            return None;
        }
        let period = apparent_period(&strobes, CLOSURE * scale);
        strobes.truncate(period.unwrap_or(MAX_PERIOD));
        Some(GridMotion {
            grid: *self,
            period,
            amplitude: 0.5 * (range.1 - range.0),
            tip_range: range,
            state,
            strobes,
            count: 1,
        })
    }

    /// Short description of the grid, for a title.
    pub(super) fn short(&self) -> String {
        let [free, contact] = self.steps;
        if free == contact {
            format!("N = {}, {free} per period", self.modes)
        } else {
            format!("N = {}, {free}/{contact} per period", self.modes)
        }
    }

    /// Describes the grid: its steps per drive period.
    pub(super) fn words(&self) -> String {
        let [free, contact] = self.steps;
        let steps = if free == contact {
            format!("{free} steps per period")
        } else {
            format!("{free} steps per period in flight, {contact} in contact")
        };
        match self.switching {
            Switching::EveryStep => format!("N = {}, {steps}", self.modes),
            Switching::EveryStage => {
                format!("N = {}, {steps}, switching at every stage", self.modes)
            }
        }
    }
}

/// The smallest n for which every one of the first half of the states recurs after n.
fn apparent_period(strobes: &[Vec<f64>], tolerance: f64) -> Option<usize> {
    let half = strobes.len() / 2;
    let distance = |a: &[f64], b: &[f64]| {
        a.iter()
            .zip(b)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max)
    };
    (1..=half).find(|&n| (0..half).all(|k| distance(&strobes[k], &strobes[k + n]) <= tolerance))
}

impl GridMotion {
    /// Whether the exact flow leads to a period-1 orbit, and whether Newton's method finds an exact
    /// orbit of the same period from the strobe states.
    fn exactly(&self, model: &Model) -> (bool, bool) {
        let mut map = ModelMap::new(model);
        let classified = classify(&mut map, &self.state, &ClassifyOptions::default());
        let vanishes = matches!(&classified.kind, MotionKind::Periodic(orbit) if orbit.period == 1);
        let closes = self.period.is_some_and(|period| {
            close_orbit(
                &mut map,
                &self.strobes[0],
                period,
                &ShootingOptions::default(),
            )
            .is_ok_and(|orbit| orbit.period == period)
        });
        (vanishes, closes)
    }

    /// (τ/T, W, dW/dτ) over `periods` drive periods, from its own state.
    pub(super) fn curve(&self, model: &Model, periods: usize) -> Vec<[f64; 3]> {
        let (drive, rate) = (model.system.drive(), model.tip_rate());
        let at = |tau: f64, phase: f64, x: &[f64]| {
            [tau, model.tip.at(drive, x, phase), rate.at(drive, x, phase)]
        };
        let mut curve = vec![at(0.0, 0.0, &self.state)];
        let Ok(mut run) = FixedStep::new(
            &model.system,
            &self.state,
            &self.grid.steps,
            self.grid.switching,
        ) else {
            return curve;
        };
        for period in 0..periods {
            run.run_period(|phase, x| {
                curve.push(at(period as f64 + phase / model.period(), phase, x));
            });
        }
        curve
    }

    /// A command line that repeats the run at Ω = 20.
    pub(super) fn rerun(&self) -> String {
        self.rerun_on(&fast_case(self.grid.modes))
    }

    /// A command line that repeats the run on its `case`.
    pub(super) fn rerun_on(&self, case: &Cantilever) -> String {
        let [free, contact] = self.grid.steps;
        let switching = match self.grid.switching {
            Switching::EveryStep => "step",
            Switching::EveryStage => "stage",
        };
        let options = format!(
            "--method rk4 --steps {free},{contact} --switching {switching} --transient 0 --periods 256 {}",
            rerun::state(&self.state)
        );
        rerun::on_case("simulate", case, &options)
    }

    /// Describes the motion: its period in drive periods, if it has one.
    pub(super) fn words(&self) -> String {
        match self.period {
            Some(period) => format!("period {period}"),
            None => format!("no period up to {MAX_PERIOD}"),
        }
    }
}

/// The evidence that long periods at Ω = 20 can come from the time step.
pub(super) fn section(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let scan = runs.shared(Scan::new)?;
    let mut periods: Vec<usize> = scan
        .motions
        .iter()
        .filter_map(|m| m.period)
        .filter(|n| *n > 1)
        .collect();
    periods.sort_unstable();
    periods.dedup();
    let claimed: Vec<String> = PAPER_PERIODS
        .iter()
        .map(|&n| {
            format!(
                "period {n} {}",
                match scan.of_period(n) {
                    0 => "not at all".to_owned(),
                    1 => "once".to_owned(),
                    2 => "twice".to_owned(),
                    k => format!("{k} times"),
                }
            )
        })
        .collect();
    let mut table = Table::new(
        "Motions of fixed-step runs at Ω = 20, α₁ = 0.1; the exact flow has one, of period 1",
        [
            "N",
            "steps in flight",
            "in contact",
            "switching",
            "period",
            "amplitude",
            "exact amplitude",
            "starts",
        ],
    );
    for m in &scan.motions {
        table.row([
            m.grid.modes.to_string(),
            m.grid.steps[0].to_string(),
            m.grid.steps[1].to_string(),
            if m.grid.switching == Switching::EveryStep {
                "step".into()
            } else {
                "stage".to_owned()
            },
            m.period
                .map_or_else(|| format!("none to {MAX_PERIOD}"), |n| n.to_string()),
            format!("{:.5}", m.amplitude),
            scan.exact_amplitude(m.grid.modes)
                .map_or_else(String::new, |a| format!("{a:.5}")),
            format!("{} of {}", m.count, m.grid.starts),
        ]);
    }
    let example = scan.subharmonic(0.148);
    let listed: Vec<String> = periods.iter().map(ToString::to_string).collect();
    Ok(section
        .text(
            "The paper integrates with fourth-order Runge–Kutta and fixed steps that differ between flight and \
             contact; it does not state the steps, and warns of overshooting the contact. A switch that is detected at the next grid \
             point occurs up to one step late. This delay makes the map of the method piecewise constant in its \
             switching indices. Where the true orbit is only weakly stable, the method locks into subharmonics that \
             the equations do not have: several at once, and different ones for every step.",
        )
        .picture(picture(&scan))
        .check(
            "time-step",
            scan.subharmonics,
            format!(
                "{} grids give {} motions that are not of period 1 (periods {}); under the exact flow {} of them converge to \
                 the only period-1 orbit",
                scan.grids,
                scan.subharmonics,
                listed.join(", "),
                if scan.vanished == scan.subharmonics { "all".to_owned() } else { scan.vanished.to_string() }
            ),
            format!(
                "each repeats 64 times to {CLOSURE:.0e} of its size; Newton on the exact map finds an orbit of the same \
                 period near {} of them; the periods that the paper reports appear as artefacts of the step: {}",
                if scan.closed == 0 { "none".to_owned() } else { scan.closed.to_string() },
                claimed.join(", ")
            ),
            example.map_or_else(|| rerun::section("time-step"), GridMotion::rerun),
        )
        .table(table))
}

impl Scan {
    pub(super) fn exact_amplitude(&self, modes: usize) -> Option<f64> {
        self.exact
            .iter()
            .find(|(n, _)| *n == modes)
            .map(|(_, a)| *a)
    }
}

fn picture(scan: &Scan) -> Picture {
    let steps = || Axis::log("Runge–Kutta steps per drive period (in flight)");
    let of = |modes: usize| scan.motions.iter().filter(move |m| m.grid.modes == modes);
    let point = |m: &GridMotion, y: f64| (f64::from(m.grid.steps[0]), y);
    let class = |m: &GridMotion| match m.period {
        Some(1) => 0,
        Some(n) if PAPER_PERIODS.contains(&n) => 2,
        Some(_) => 1,
        None => 3,
    };
    let looks = [
        ("period 1", Colour::BLUE, Shape::Circle),
        ("other periods", Colour::GREY, Shape::Circle),
        ("periods 11, 21, 28", Colour::VERMILLION, Shape::Diamond),
        ("none up to 64", Colour::BLACK, Shape::Cross),
    ];
    let layers = |panel: Panel, modes: usize, y: &dyn Fn(&GridMotion) -> f64| {
        looks
            .iter()
            .enumerate()
            .fold(panel, |panel, (k, (label, colour, shape))| {
                let points = of(modes).filter(|m| class(m) == k).map(|m| point(m, y(m)));
                panel.with(
                    Markers::new(points)
                        .shape(*shape)
                        .colour(*colour)
                        .size(1.2)
                        .label(*label),
                )
            })
    };
    let period = |m: &GridMotion| m.period.map_or(MAX_PERIOD as f64 + 3.0, |n| n as f64);
    let mut periods = Panel::new(
        steps(),
        Axis::linear("period (drive periods)").range(0.0, MAX_PERIOD as f64 + 6.0),
    )
    .title("N = 1: periods found")
    .legend(Legend::Above);
    for claimed in PAPER_PERIODS {
        periods = periods.with(
            Rule::horizontal(claimed as f64)
                .colour(Colour::VERMILLION)
                .width(0.4),
        );
    }
    let amplitude = |modes: usize| {
        let mut panel = Panel::new(steps(), Axis::linear("amplitude of $W$"))
            .title(format!("N = {modes}: amplitudes; line: exact flow"))
            .legend(Legend::Hidden);
        if let Some(exact) = scan.exact_amplitude(modes) {
            panel = panel.with(Rule::horizontal(exact));
        }
        layers(panel, modes, &|m| m.amplitude)
    };
    Picture::new(
        "time-step",
        "Motions of fixed-step runs near the only period-1 orbit at Ω = 20, α₁ = 0.1",
        format!(
            "Each mark is a motion that fixed-step Runge–Kutta, switching on its grid as in the \
             paper, reaches from some initial state. (a) Periods; orange-red lines: the periods 11, 21 and 28 of the paper; marks at the \
             top: no period up to {MAX_PERIOD}. (b)–(d) Amplitudes with 1, 2 and 3 modes. The exact flow has one \
             attractor, of period 1 (line): all other marks are artefacts of the step."
        ),
        Figure::new(2, 2)
            .with(layers(periods, 1, &period))
            .with(amplitude(1))
            .with(amplitude(2))
            .with(amplitude(3)),
        130.0,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn states(values: &[f64]) -> Vec<Vec<f64>> {
        values.iter().map(|v| vec![*v]).collect()
    }

    #[test]
    fn the_apparent_period_is_the_smallest_that_repeats_throughout() {
        let period_three: Vec<f64> = (0..13).map(|k| f64::from(k % 3)).collect();
        assert_eq!(apparent_period(&states(&period_three), 1e-9), Some(3));
        // A slow decay is not a period before it has ended.
        let decay: Vec<f64> = (0..13).map(|k| 1.0 + 1e-6 * 0.99f64.powi(k)).collect();
        assert_eq!(apparent_period(&states(&decay), 1e-9), None);
        assert_eq!(apparent_period(&states(&[1.0; 13]), 1e-9), Some(1));
    }

    /// The exact flow at Ω = 20 with one mode has a period-1 attractor and no other ((W_max −
    /// W_min)/2 = 0.1447, closed by Newton's method); 20 steps per period also show a period 4.
    #[test]
    fn a_coarse_grid_shows_a_subharmonic_that_the_exact_flow_does_not_have() {
        let model = Model::cantilever(&fast_case(1)).unwrap();
        let grid = Grid {
            modes: 1,
            steps: [20, 20],
            switching: Switching::EveryStep,
            transient: 700,
            starts: 1,
        };
        let starts: Vec<Vec<f64>> = (0..12)
            .map(f64::from)
            .map(|k| vec![0.05 * k - 0.3, 2.0 - 0.31 * k])
            .collect();
        let found = Grid { starts: 12, ..grid }.motions(&model, &starts);
        let subharmonic = found
            .iter()
            .find(|m| m.period == Some(4))
            .expect("a period 4");
        assert_eq!(subharmonic.exactly(&model), (true, false));
        let true_one = found
            .iter()
            .find(|m| m.period == Some(1))
            .expect("a period 1");
        assert!((true_one.amplitude - 0.1447).abs() < 1e-3);
    }
}
