//! Figs. 6 and 7: the motions at Ω = 2.6 with a tip mass.

use std::rc::Rc;

use nanotap_dynamics::{
    ClassifyOptions, MotionKind, PeriodicOrbit, StroboscopicMap as _, classify,
};
use nanotap_figures::{Axis, Colour, Figure, Legend, Markers, Panel, Points, Shape};

use super::PaperError;
use super::check::digits;
use super::expected::Computed;
use super::followed_branch::{FollowedBranch, OMEGA, in_words};
use super::motion_view::{KEY, View, empty_portrait};
use super::rerun;
use super::runs::{Counted, Runs, SEED, how_many, stability};
use super::section::{Picture, Section, Table};
use super::time_step::Grid;
use nanotap::case::Case;
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::model_map::ModelMap;
use nanotap::model::parameter::Parameter;
use nanotap::study::start_box::default_box;

/// Longest period of the unstable orbits that are searched for.
const MAX_PERIOD: usize = 3;
/// Range of Ω over which the orbits are followed.
const BRANCH_RANGE: (f64, f64) = (2.3, 3.6);
/// Frequencies that are printed as Ω = 2.6.
const ROUNDS_TO_PRINTED: (f64, f64) = (2.55, 2.65);
/// Numbers of drive periods of chaos that are drawn against time and in the phase portrait.
const SHOWN_PERIODS: (usize, usize) = (16, 200);

/// The case of both figures with its census and its orbits, stable or not.
struct Slow {
    counted: Rc<Counted>,
    orbits: Rc<[PeriodicOrbit]>,
}

impl Slow {
    fn new(runs: &Runs<'_>) -> Result<Self, PaperError> {
        Self::with_modes(runs, Cantilever::paper().modes)
    }

    fn with_modes(runs: &Runs<'_>, modes: usize) -> Result<Self, PaperError> {
        let counted = runs.count(&Cantilever::paper().with_modes(modes))?;
        let orbits = runs.orbits(&counted, MAX_PERIOD, runs.either(3000, 600))?;
        Ok(Self { counted, orbits })
    }

    fn of_period(&self, period: usize) -> Vec<&PeriodicOrbit> {
        self.orbits.iter().filter(|o| o.period == period).collect()
    }

    /// Orbits of a period as text: "one period-1 orbit, W from … to …, unstable (μ = −1.392)".
    fn describe(&self, period: usize) -> Result<String, PaperError> {
        let orbits = self.of_period(period);
        let mut parts = Vec::new();
        for orbit in &orbits {
            let o = self.counted.look(orbit)?.observables;
            parts.push(format!(
                "W from {} to {}, {}, μ = {}{}",
                digits(o.tip_min, 4),
                digits(o.tip_max, 4),
                stability(orbit),
                multiplier(orbit),
                self.counted.proved(orbit)
            ));
        }
        Ok(if orbits.is_empty() {
            format!("no period-{period} orbit found")
        } else {
            format!(
                "{} ({})",
                how_many(orbits.len(), &format!("period-{period} orbit")),
                parts.join("; ")
            )
        })
    }

    /// The branch of an orbit that exists at Ω = `omega`.
    fn branch(
        &self,
        runs: &Runs<'_>,
        omega: f64,
        orbit: &PeriodicOrbit,
    ) -> Result<FollowedBranch, PaperError> {
        let subject = Case::from(self.counted.case.clone());
        FollowedBranch::from_orbit(runs, &subject, omega, orbit, BRANCH_RANGE)
    }

    fn rerun_orbit(&self, period: usize) -> String {
        match self.of_period(period).first() {
            Some(orbit) => rerun::on_case(
                "orbit",
                &self.counted.case,
                &format!(
                    "--period {period} {} --prove",
                    rerun::state(&orbit.states[0])
                ),
            ),
            None => self.counted.rerun(),
        }
    }

    /// Intervals in which the first orbit of a period is stable, followed over [`BRANCH_RANGE`].
    fn attracting(&self, runs: &Runs<'_>, period: usize) -> Result<Vec<(f64, f64)>, PaperError> {
        match self.of_period(period).first() {
            Some(orbit) => Ok(self
                .branch(runs, self.counted.case.omega, orbit)?
                .attracting()),
            None => Ok(Vec::new()),
        }
    }

    /// Checks a number of motions of this period. A motion that is stable only at another frequency
    /// that is printed alike leaves the statement open.
    fn check(
        &self,
        runs: &Runs<'_>,
        section: Section,
        id: &'static str,
        period: usize,
        further_evidence: &str,
    ) -> Result<Section, PaperError> {
        let found = self.counted.stable(period).len();
        let mut here = format!(
            "{} is stable; {}",
            how_many(found, &format!("period-{period} motion")),
            self.describe(period)?
        );
        let mut evidence = format!("{}; {}", self.counted.summary(), self.counted.missed());
        let attracting = self.attracting(runs, period)?;
        if !attracting.is_empty() {
            evidence = format!(
                "{evidence}; the orbit is stable at Ω = {}",
                in_words(&attracting)
            );
        }
        let alike = printed_alike(&attracting);
        let mut found_alike = found;
        if found == 0 && !alike.is_empty() {
            found_alike = 1;
            here = format!(
                "{here}; within the rounding of 2.6 it is stable at Ω = {}",
                in_words(&alike)
            );
        }
        Ok(section.check(
            id,
            Computed::readings(found as f64, found_alike as f64),
            here,
            evidence + further_evidence,
            self.rerun_orbit(period),
        ))
    }
}

/// The parts of these intervals whose frequencies round to the printed Ω = 2.6.
fn printed_alike(stretches: &[(f64, f64)]) -> Vec<(f64, f64)> {
    stretches
        .iter()
        .map(|&(from, to)| (from.max(ROUNDS_TO_PRINTED.0), to.min(ROUNDS_TO_PRINTED.1)))
        .filter(|(from, to)| from < to)
        .collect()
}

/// The largest multiplier as text.
fn multiplier(orbit: &PeriodicOrbit) -> String {
    orbit.multipliers.first().map_or_else(String::new, |m| {
        if m.im == 0.0 {
            digits(m.re, 4)
        } else {
            format!("{} ± {}i", digits(m.re, 4), digits(m.im.abs(), 4))
        }
    })
}

/// Computes the section on Fig. 6: two period-1 motions at Ω = 2.6.
pub(super) fn fig6(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let slow = Slow::new(runs)?;
    let model = &slow.counted.model;
    let mut figure = Figure::new(2, 2).column_widths([1.7, 1.0]);
    let mut words = Vec::new();
    if let Some(chaos) = slow.counted.chaos().first() {
        let series = View::new(model, chaos.state, SHOWN_PERIODS.0)?;
        let tangle = View::new(model, chaos.state, runs.either(SHOWN_PERIODS.1, 60))?;
        let dots = View::new(model, chaos.state, runs.either(3000, 300))?.strobe_dots();
        let portrait = tangle
            .tangle_into(empty_portrait("chaos"), Colour::SKY)
            .with(dots.colour(Colour::BLACK));
        figure = figure
            .with(series.time_panel("the attractor: chaos"))
            .with(portrait);
        words.push("(a, b) The only attractor found: chaos; dots are states at drive phase 0.");
    } else if let Some((orbit, _)) = slow.counted.all_stable().first() {
        let view = View::new(model, &orbit.states[0], orbit.period)?;
        figure = figure
            .with(view.time_panel("the attractor"))
            .with(view.portrait_panel("", 0.8));
        words.push("(a, b) The attractor.");
    }
    if let Some(orbit) = slow.of_period(1).first() {
        let series = View::new(model, &orbit.states[0], 2)?;
        let loop_view = View::new(model, &orbit.states[0], 1)?;
        figure = figure
            .with(series.time_panel(format!("period 1, {}", stability(orbit))))
            .with(loop_view.portrait_panel(format!("μ = {}", multiplier(orbit)), 0.9));
        words.push("(c, d) The only period-1 orbit that Newton found.");
    }
    let section = section.picture(Picture::new(
        "fig06",
        "Motions at Ω = 2.6, α₁ = 0.1, in place of two coexisting period-1 motions (Fig. 6)",
        format!("Eq. (26), N = 3. {} {KEY}", words.join(" ")),
        figure,
        128.0,
    ));
    slow.check(runs, section, "fig6", 1, "")
}

/// Computes the section on Fig. 7: period 2 and period 3 at Ω = 2.6.
pub(super) fn fig7(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let slow = Slow::new(runs)?;
    let model = &slow.counted.model;
    let mut figure = Figure::new(2, 2).column_widths([1.7, 1.0]);
    let mut captions = vec!["Eq. (26), N = 3.".to_owned()];
    for (period, letters) in [(2, "(a, b)"), (3, "(c, d)")] {
        let Some(orbit) = slow.of_period(period).first().copied() else {
            continue;
        };
        let view = View::new(model, &orbit.states[0], period)?;
        figure = figure
            .with(view.time_panel(format!("period {period}, {}", stability(orbit))))
            .with(view.portrait_panel(format!("μ = {}", multiplier(orbit)), 0.9));
        captions.push(format!(
            "{letters} The unstable period-{period} orbit, found by Newton."
        ));
    }
    let mut about_three = String::new();
    if slow.of_period(3).is_empty()
        && let Some(chaos) = slow.counted.chaos().first()
    {
        let returns = Returns::of(model, chaos.state, runs.either(4000, 400))?;
        figure = figure.with(returns.panel()).with(returns.pieces(model));
        about_three = format!("; {}", returns.words());
        captions.push(format!(
            "(c) The nearest return of the chaotic motion after n drive periods, observed over {} periods: \
             there are none after an odd number, because (d) the attractor has two pieces that the motion visits in turn. No \
             period-3 orbit lies on it.",
            returns.watched
        ));
    }
    captions.push(KEY.to_owned());
    let section = slow.check(runs, section, "fig7-period-2", 2, "")?;
    let subject = Case::from(slow.counted.case.clone());
    if let Some((omega, orbit)) = period_three(&subject)? {
        let branch = slow.branch(runs, omega, &orbit)?;
        let (from, to) = branch.extent();
        about_three = format!(
            "{about_three}; a period-3 branch exists from Ω = {from:.4} to {to:.4} and is stable at {}",
            in_words(&branch.attracting())
        );
    }
    let section = slow.check(runs, section, "fig7-period-3", 3, &about_three)?;
    Ok(section
        .picture(Picture::new(
            "fig07",
            "The period-2 orbit, and why there is no period 3, at Ω = 2.6, α₁ = 0.1 (Fig. 7)",
            captions.join(" "),
            figure,
            128.0,
        ))
        .text(
            "No single case has all motions of Figs. 6 and 7: two of period 1, one of period 2 and one of period 3. If the tip \
             slightly indents the sample at rest (a small negative α₅), each of these kinds exists, at different gaps. Fixed \
             steps at Ω = 2.6 give several periods that the equations do not have.",
        )
        .table(doubled_by_modes(runs)?)
        .table(pressed_at_rest(runs)?)
        .table(slow_grids(runs)?))
}

/// Intervals in which the period-2 orbit is stable, with one to five modes, compared with Ω = 2.6.
fn doubled_by_modes(runs: &Runs<'_>) -> Result<Table, PaperError> {
    let mut table = Table::new(
        format!(
            "Frequencies at which the period-2 orbit of Ω = 2.6 is stable, for Ω from {} to {}",
            BRANCH_RANGE.0, BRANCH_RANGE.1
        ),
        ["N", "μ at Ω = 2.6", "stable at Ω ="],
    );
    for modes in 1..=runs.either(5, 2) {
        let slow = Slow::with_modes(runs, modes)?;
        for orbit in slow.of_period(2) {
            let branch = slow.branch(runs, slow.counted.case.omega, orbit)?;
            table.row([
                modes.to_string(),
                multiplier(orbit),
                in_words(&branch.attracting()),
            ]);
        }
    }
    Ok(table)
}

/// The attractors at Ω = 2.6 if the tip indents the sample slightly at rest.
fn pressed_at_rest(runs: &Runs<'_>) -> Result<Table, PaperError> {
    let mut table = Table::new(
        "Attractors at Ω = 2.6, α₁ = 0.1, N = 3 with a small negative gap: the kinds of motion in Figs. 6 and 7, \
         but never all at once",
        ["α₅", "motions", "command"],
    );
    for alpha5 in [-0.10, -0.05, -0.045] {
        let case = Cantilever::paper().with(Parameter::Alpha5, alpha5);
        let counted = runs.count(&case)?;
        table.row([
            alpha5.to_string().replace('-', "−"),
            counted.kinds().join(", "),
            counted.rerun(),
        ]);
    }
    Ok(table)
}

/// Steps per drive period of the grids tried at Ω = 2.6, and initial states of each.
const SLOW_GRIDS: ([u32; 2], usize) = ([34, 40], 48);

/// The motions to which fixed steps lead at Ω = 2.6 with two modes.
fn slow_grids(runs: &Runs<'_>) -> Result<Table, PaperError> {
    let counted = runs.count(&Cantilever::paper().with_modes(2))?;
    let (steps, most) = SLOW_GRIDS;
    let starts = Runs::starts(&counted, runs.either(most, most / 4))?;
    let mut table = Table::new(
        format!(
            "Motions of fixed-step runs that switch on their grid at Ω = 2.6, α₁ = 0.1, N = 2; the exact flow has: {}",
            counted.kinds().join(", ")
        ),
        [
            "steps per period",
            "period",
            "amplitude",
            "starts",
            "command",
        ],
    );
    for steps in steps {
        let grid = Grid::equal_steps(2, steps, starts.len());
        for motion in grid.motions(&counted.model, &starts) {
            table.row([
                steps.to_string(),
                motion.words(),
                format!("{:.4}", motion.amplitude),
                format!("{} of {}", motion.count, starts.len()),
                motion.rerun_on(&counted.case),
            ]);
        }
    }
    Ok(table)
}

/// A stable period-3 orbit near the frequency where the bifurcation diagram shows one.
fn period_three(subject: &Case) -> Result<Option<(f64, PeriodicOrbit)>, PaperError> {
    let omega = 3.15;
    let model = subject.with(OMEGA, omega).model()?;
    let area = default_box(&model).map_err(PaperError::failed("the box of initial states"))?;
    let mut map = ModelMap::new(&model);
    let found = area.starts(SEED, 32).into_iter().find_map(|start| {
        match classify(&mut map, &start, &ClassifyOptions::default()).kind {
            MotionKind::Periodic(orbit) if orbit.period == 3 => Some(orbit),
            _ => None,
        }
    });
    Ok(found.map(|orbit| (omega, orbit)))
}

/// Longest return that is examined.
const MAX_RETURN: usize = 12;

/// Distances of the nearest returns of a motion.
struct Returns {
    /// Nearest return after 1, 2, … drive periods, relative to the motion's size.
    nearest: Vec<f64>,
    states: Vec<Vec<f64>>,
    watched: usize,
}

impl Returns {
    fn of(model: &Model, state: &[f64], watched: usize) -> Result<Self, PaperError> {
        let failed = PaperError::failed("a run on the chaotic attractor");
        let mut map = ModelMap::new(model);
        let mut states = vec![state.to_vec()];
        for k in 0..watched {
            let mut next = states[k].clone();
            map.advance(&mut next).map_err(&failed)?;
            states.push(next);
        }
        let norm = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>().sqrt();
        let size = states.iter().map(|x| norm(x)).fold(0.0, f64::max);
        let distance = |a: &[f64], b: &[f64]| {
            a.iter()
                .zip(b)
                .map(|(a, b)| (a - b).powi(2))
                .sum::<f64>()
                .sqrt()
        };
        let nearest = (1..=MAX_RETURN)
            .map(|n| {
                states
                    .iter()
                    .zip(&states[n..])
                    .map(|(a, b)| distance(a, b))
                    .fold(f64::INFINITY, f64::min)
                    / size
            })
            .collect();
        Ok(Self {
            nearest,
            states,
            watched,
        })
    }

    /// Nearest return after odd numbers of periods (`parity` 1) or even ones (0).
    fn best(&self, parity: usize) -> f64 {
        self.nearest
            .iter()
            .enumerate()
            .filter(|(i, _)| (i + 1) % 2 == parity)
            .map(|(_, d)| *d)
            .fold(f64::INFINITY, f64::min)
    }

    fn words(&self) -> String {
        format!(
            "in {} periods on the attractor the nearest return after an odd number of periods is {} of its \
             size (even: {}), so it contains no orbit of period 3",
            self.watched,
            digits(self.best(1), 1),
            digits(self.best(0), 1)
        )
    }

    fn panel(&self) -> Panel {
        let of = |parity: usize| {
            let points = self
                .nearest
                .iter()
                .enumerate()
                .filter(move |(i, _)| (i + 1) % 2 == parity);
            points
                .map(|(i, d)| ((i + 1) as f64, *d))
                .collect::<Vec<_>>()
        };
        Panel::new(
            Axis::linear("drive periods $n$")
                .range(0.0, MAX_RETURN as f64 + 1.0)
                .marks((1..=MAX_RETURN).map(|n| (n as f64, n.to_string()))),
            Axis::log("nearest return / size of motion"),
        )
        .title("no near return after an odd number of periods")
        .legend(Legend::Hidden)
        .with(Markers::new(of(0)).colour(Colour::BLUE))
        .with(
            Markers::new(of(1))
                .colour(Colour::VERMILLION)
                .shape(Shape::Diamond)
                .size(1.9),
        )
    }

    /// The strobe states, those of even and of odd periods separately.
    fn pieces(&self, model: &Model) -> Panel {
        let (drive, rate) = (model.system.drive(), model.tip_rate());
        let of = |parity: usize| {
            let states = self.states.iter().skip(parity).step_by(2);
            states
                .map(|x| (model.tip.at(drive, x, 0.0), rate.at(drive, x, 0.0)))
                .collect::<Vec<_>>()
        };
        empty_portrait("states at drive phase 0")
            .with(Points::new(of(0)).diameter(0.4).colour(Colour::BLUE))
            .with(Points::new(of(1)).diameter(0.4).colour(Colour::VERMILLION))
    }
}
