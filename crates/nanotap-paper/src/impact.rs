//! The paper's claim that soft contact behaves differently from an impact oscillator, tested
//! numerically: the oscillators of Fig. 1 with a rigid stop (coefficient of restitution) and with a
//! soft one, and the transition from one to the other as the stop becomes stiffer.

use nanotap_dynamics::{
    BifurcationKind, ClassifyOptions, ContinuationOptions, Direction, MotionKind as Settled,
    PeriodicOrbit, ShootingOptions, classify, close_orbit, continue_orbit,
};
use nanotap_figures::{Axis, Colour, Dash, Figure, Legend, Line, Markers, Panel, Rule, Shape};
use rayon::prelude::*;

use super::check::digits;
use super::frequency_sweep::{Column, Kind, draw, spaced, sweep};
use super::runs::{Runs, SEED};
use super::section::{Picture, Section, Table};
use super::{PaperError, rerun};
use nanotap::case::{Case, Key};
use nanotap::model::Model;
use nanotap::model::model_map::ModelMap;
use nanotap::model::oscillator::{Oscillator, OscillatorParameter, Stop};
use nanotap::observe::{ObservableSet, measure};
use nanotap::study::start_box::default_box;

/// Coefficient of restitution of every stop, dimensionless.
const RESTITUTION: f64 = 0.8;
/// Range of the drive frequency; at 1 the undamped oscillator itself resonates.
const RANGE: (f64, f64) = (1.05, 5.0);
/// Frequency at which the period-1 branch with one impact is started: between its flips for every
/// stop.
const ENTRY: f64 = 2.0;
/// Frequency at which the distance between the orbits of the soft and the rigid stop is measured:
/// above the resonances of all stops (2ω₁ω₂/(ω₁ + ω₂) < 2).
const MEASURED_AT: f64 = 2.3;
/// Stiffness of the soft stop that represents the paper's soft sample: in the paper α₄/3 = K₁/K_c
/// is 6.7.
const SOFT: f64 = 20.0 / 3.0;
/// Range of stiffnesses between the soft and the rigid stop.
const STIFFNESSES: (f64, f64) = (1.0, 1e8);
/// The key of the drive frequency.
const OMEGA: Key = Key::OscillatorOmega;

/// ẍ + x = cos ωt with a stop at x = 0.
const fn oscillator(stop: Stop) -> Oscillator {
    Oscillator {
        mass: 1.0,
        stiffness: 1.0,
        damping: 0.0,
        forcing: 1.0,
        omega: ENTRY,
        gap: 0.0,
        stop,
    }
}

/// A soft stop of this stiffness with the same coefficient of restitution: an impact on a spring κ
/// and a damper 2ζ√κ alone ends with −exp(−πζ/√(1 − ζ²)) times its speed.
fn soft(stiffness: f64) -> Oscillator {
    let loss = -nanotap_arithmetic::ln(RESTITUTION);
    let ratio = loss / nanotap_arithmetic::hypot(std::f64::consts::PI, loss);
    oscillator(Stop::Soft {
        stiffness,
        damping: 2.0 * ratio * stiffness.sqrt(),
    })
}

const fn rigid() -> Oscillator {
    oscillator(Stop::Rigid {
        restitution: RESTITUTION,
    })
}

/// Flips of the rigid oscillator's period-1 branch, accurate to the digits given (ẍ + x = cos ωt,
/// gap 0, r = 0.8).
const KNOWN_FLIPS: [f64; 2] = [1.260_676_6, 2.653_347_7];

/// The impact oscillator compared with the soft sample.
pub(super) fn section(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let (count, starts) = (runs.either(400, 30), runs.either(8, 2));
    let values = spaced(RANGE.0, RANGE.1, count);
    let columns = |o: Oscillator| sweep(runs, &Case::from(o), OMEGA, &values, starts);
    let (hard, soft_columns) = (columns(rigid())?, columns(soft(SOFT))?);
    let limit = Orbit::find(rigid())?;
    let flips = runs.controlled(|control| limit.flips(control))?;
    let way = soft_stop_series(runs, &limit)?;
    let fits = KNOWN_FLIPS
        .iter()
        .all(|known| flips.iter().any(|f| (f - known).abs() < 5e-8));
    let last = way.last();
    let slope = convergence_rate(&way);
    let soft_flips = way
        .iter()
        .find(|w| w.stiffness >= SOFT)
        .map(|w| w.flips.clone())
        .unwrap_or_default();
    let sweep_rerun = |o: &Oscillator| {
        rerun::on_oscillator(
            "sweep",
            o,
            &format!(
                "--over omega={}:{}:{count} --starts {starts} --seed {SEED}",
                RANGE.0, RANGE.1
            ),
        )
    };
    let branch_rerun = |o: &Oscillator| {
        rerun::on_oscillator(
            "branch",
            o,
            &format!(
                "--parameter omega --from {ENTRY} --to {} --period 1",
                RANGE.1
            ),
        )
    };
    let contact = Orbit::find(soft(SOFT))?.contact;
    Ok(section
        .text(
            "The oscillators of the paper's Fig. 1, ẍ + x = cos ωt with a stop at x = 0: a rigid one with coefficient of restitution \
             0.8, and a spring and damper with the same coefficient in a free impact. The stiffness of the soft stop is 20/3 \
             times the oscillator's stiffness, as α₄ = 20 is for the cantilever.",
        )
        .picture(diagrams(&hard, &soft_columns, starts))
        .picture(limit_picture(&way, &flips))
        .table(series_table(&way, &flips))
        .check(
            "impact-flips",
            fits && last.is_some_and(|w| nearest(&w.flips, &flips) < 1e-2),
            format!(
                "the rigid oscillator's period-1 branch flips at ω = {}; the flips of the soft one converge to them as its stop \
                 becomes stiffer (κ = {}: {})",
                list(&flips),
                last.map_or_else(String::new, |w| digits(w.stiffness, 1)),
                last.map_or_else(String::new, |w| list(&w.flips))
            ),
            format!(
                "the difference of the period-1 orbit at ω = {MEASURED_AT} from that of the rigid stop scales as κ^{} over the last \
                 decade, like the duration of contact, π/√κ",
                digits(slope, 2)
            ),
            branch_rerun(&rigid()),
        )
        .check(
            "impact-diagram",
            nearest(&soft_flips, &flips),
            format!(
                "true for these oscillators: with κ = {} the period-1 branch flips at ω = {}, with the rigid stop at \
                 {}; chaos at {} and at {} of {count} frequencies",
                digits(SOFT, 3),
                list(&soft_flips),
                list(&flips),
                chaotic(&soft_columns),
                chaotic(&hard),
            ),
            format!(
                "at ω = {ENTRY} the contact with the soft stop lasts {:.0} % of the time, that with the rigid one is instantaneous",
                100.0 * contact
            ),
            sweep_rerun(&soft(SOFT)),
        ))
}

/// Number of frequencies with chaos.
fn chaotic(columns: &[Column]) -> usize {
    columns.iter().filter(|c| c.has(Kind::Chaos)).count()
}

fn list(values: &[f64]) -> String {
    if values.is_empty() {
        return "nowhere".to_owned();
    }
    values
        .iter()
        .map(|v| format!("{v:.7}"))
        .collect::<Vec<_>>()
        .join(", ")
}

/// The largest distance of a member of `b` to the nearest of `a`.
fn nearest(a: &[f64], b: &[f64]) -> f64 {
    b.iter()
        .map(|b| {
            a.iter()
                .map(|a| (a - b).abs())
                .fold(f64::INFINITY, f64::min)
        })
        .fold(0.0, f64::max)
}

/// The period-1 orbit with one impact at [`ENTRY`].
struct Orbit {
    oscillator: Oscillator,
    closed: PeriodicOrbit,
    /// Largest distance from the stop.
    reach: f64,
    contact: f64,
}

impl Orbit {
    /// The orbit to which runs lead.
    fn find(oscillator: Oscillator) -> Result<Self, PaperError> {
        let what = format!("a period-1 orbit at ω = {ENTRY}");
        let model = oscillator.model()?;
        let mut map = ModelMap::new(&model);
        let area = default_box(&model).map_err(PaperError::failed(&what))?;
        let found = area.starts(SEED, 32).into_iter().find_map(|start| {
            match classify(&mut map, &start, &ClassifyOptions::default()).kind {
                Settled::Periodic(orbit) if orbit.period == 1 => Some(orbit),
                _ => None,
            }
        });
        Self::look(
            oscillator,
            &model,
            found.ok_or_else(|| PaperError::failed(what)("no run converges to one"))?,
        )
    }

    /// The orbit found by Newton's method from that of a similar oscillator.
    fn near(oscillator: Oscillator, guess: &Self) -> Result<Self, PaperError> {
        let model = oscillator.model()?;
        let orbit = close_orbit(
            &mut ModelMap::new(&model),
            &guess.closed.states[0],
            1,
            &ShootingOptions::default(),
        )
        .map_err(PaperError::failed(format!("the orbit of {oscillator:?}")))?;
        Self::look(oscillator, &model, orbit)
    }

    fn look(
        oscillator: Oscillator,
        model: &Model,
        orbit: PeriodicOrbit,
    ) -> Result<Self, PaperError> {
        let o = measure(model, &orbit.states[0], 1, ObservableSet::ALL)
            .map_err(PaperError::failed("the orbit's extrema"))?;
        Ok(Self {
            oscillator,
            closed: orbit,
            reach: o.gap_range[1],
            contact: o.contact_fraction,
        })
    }

    /// Flips of the branch through the orbit, over [`RANGE`].
    fn flips(&self, control: &nanotap_dynamics::Control<'_>) -> Result<Vec<f64>, PaperError> {
        let family = Case::from(self.oscillator).family(OMEGA);
        let options = ContinuationOptions::over(RANGE.0, RANGE.1);
        let mut flips = Vec::new();
        for direction in [Direction::Decreasing, Direction::Increasing] {
            let branch = continue_orbit(&family, ENTRY, &self.closed, direction, &options, control)
                .map_err(PaperError::failed("a period-1 branch"))?;
            // Beyond its first flip a branch may lead anywhere.
            flips.extend(
                branch
                    .bifurcations
                    .iter()
                    .find(|b| matches!(b.kind, BifurcationKind::Flip))
                    .map(|b| b.parameter),
            );
        }
        flips.sort_by(f64::total_cmp);
        Ok(flips)
    }
}

/// One soft stop of the series.
struct StopSeries {
    stiffness: f64,
    /// Relative distance of the reach of its period-1 orbit from that of the rigid stop.
    distance: f64,
    contact: f64,
    flips: Vec<f64>,
}

/// Orbits of increasingly soft stops at one frequency, starting from the rigid one, each by
/// Newton's method from the previous one.
fn softened(limit: &Orbit, omega: f64, stiffnesses: &[f64]) -> Result<Vec<Orbit>, PaperError> {
    let at = |o: Oscillator| o.with(OscillatorParameter::Omega, omega);
    let mut orbits = vec![Orbit::near(at(limit.oscillator), limit)?];
    for stiffness in stiffnesses {
        orbits.push(Orbit::near(
            at(soft(*stiffness)),
            &orbits[orbits.len() - 1],
        )?);
    }
    Ok(orbits)
}

/// All stops of the series, softest first.
fn soft_stop_series(runs: &Runs<'_>, limit: &Orbit) -> Result<Vec<StopSeries>, PaperError> {
    let per_decade = runs.either(2, 1);
    let decades = nanotap_arithmetic::log10(STIFFNESSES.1 / STIFFNESSES.0).round() as usize;
    let stiffnesses: Vec<f64> = (0..=decades * per_decade)
        .rev()
        .map(|k| STIFFNESSES.0 * nanotap_arithmetic::powf(10f64, k as f64 / per_decade as f64))
        .collect();
    let entries = softened(limit, ENTRY, &stiffnesses)?;
    let measured = softened(limit, MEASURED_AT, &stiffnesses)?;
    let reach = measured[0].reach;
    let mut way: Vec<StopSeries> = runs.controlled(|control| {
        stiffnesses
            .par_iter()
            .zip(&entries[1..])
            .zip(&measured[1..])
            .map(|((stiffness, entry), measured)| {
                Ok(StopSeries {
                    stiffness: *stiffness,
                    distance: (measured.reach / reach - 1.0).abs(),
                    contact: measured.contact,
                    flips: entry.flips(control)?,
                })
            })
            .collect::<Result<_, PaperError>>()
    })?;
    way.reverse();
    Ok(way)
}

/// The power of κ with which the distance falls over the last decade.
fn convergence_rate(way: &[StopSeries]) -> f64 {
    let Some(last) = way.last() else {
        return f64::NAN;
    };
    let before = way
        .iter()
        .rev()
        .find(|w| w.stiffness <= 0.11 * last.stiffness);
    before.map_or(f64::NAN, |w| {
        nanotap_arithmetic::ln(last.distance / w.distance)
            / nanotap_arithmetic::ln(last.stiffness / w.stiffness)
    })
}

fn series_table(way: &[StopSeries], flips: &[f64]) -> Table {
    let mut table = Table::new(
        "The period-1 orbit with one impact for increasing stiffness of the stop",
        [
            "stiffness κ",
            "relative difference of the largest distance from the stop",
            "time in contact",
            "first flips of its branch (ω)",
        ],
    );
    for w in way {
        table.row([
            digits(w.stiffness, 2),
            digits(w.distance, 2),
            format!("{:.2} %", 100.0 * w.contact),
            list(&w.flips),
        ]);
    }
    table.row(["rigid".into(), "0".into(), "0 %".into(), list(flips)]);
    table
}

fn diagrams(hard: &[Column], soft: &[Column], starts: usize) -> Picture {
    let panel = |title: &str, columns: &[Column], legend| {
        let axis = Axis::linear("drive frequency $ω$").range(RANGE.0, RANGE.1);
        let empty = Panel::new(axis, Axis::log("largest distance from the stop"))
            .title(title)
            .legend(legend);
        draw(empty, columns, 0.5)
    };
    Picture::new(
        "impact-oscillator",
        "The oscillators of Fig. 1: a rigid and a soft stop",
        format!(
            "ẍ + x = cos ωt with a stop at x = 0; largest distance from the stop in each drive period, {starts} \
             initial states at each ω. (a) Rigid stop, restitution 0.8, with chatter and sticking (Fig. 1b). (b) Spring of stiffness 20/3 \
             and damper with the same coefficient of restitution (Fig. 1a)."
        ),
        Figure::new(2, 1)
            .with(panel("rigid stop, r = 0.8", hard, Legend::Above))
            .with(panel("soft stop, κ = 20/3", soft, Legend::Above)),
        140.0,
    )
}

fn limit_picture(way: &[StopSeries], flips: &[f64]) -> Picture {
    let stiffness = || Axis::log("stiffness of the stop $κ$");
    let distance: Vec<(f64, f64)> = way.iter().map(|w| (w.stiffness, w.distance)).collect();
    let contact: Vec<(f64, f64)> = way.iter().map(|w| (w.stiffness, w.contact)).collect();
    let slope = way.last().map(|last| {
        let at = |k: f64| (k, 3.0 * last.distance * (last.stiffness / k).sqrt());
        vec![at(1e4), at(last.stiffness)]
    });
    let left = Panel::new(stiffness(), Axis::log("fraction"))
        .legend(Legend::Above)
        .with(Line::new(distance.clone()).colour(Colour::BLUE).width(0.5))
        .with(
            Markers::new(distance)
                .colour(Colour::BLUE)
                .label("relative difference of the largest distance"),
        )
        .with(Line::new(contact.clone()).colour(Colour::GREEN).width(0.5))
        .with(
            Markers::new(contact)
                .colour(Colour::GREEN)
                .shape(Shape::Square)
                .label("time in contact"),
        )
        .with(
            Line::new(slope.unwrap_or_default())
                .colour(Colour::BLACK)
                .dash(Dash::Dashed)
                .width(0.5)
                .label("$κ^{−1/2}$"),
        );
    let mut right = Panel::new(
        stiffness(),
        Axis::linear("first flips of period 1, $ω$").range(RANGE.0, RANGE.1),
    );
    for flip in flips {
        right = right.with(Rule::horizontal(*flip));
    }
    let points = way
        .iter()
        .flat_map(|w| w.flips.iter().map(|f| (w.stiffness, *f)));
    right = right.with(
        Markers::new(points)
            .colour(Colour::VERMILLION)
            .shape(Shape::Diamond)
            .size(1.8),
    );
    Picture::new(
        "impact-limit",
        "From the soft stop to the rigid one",
        format!(
            "The period-1 orbit with one impact at ω = {MEASURED_AT} and its branch, for increasing stiffness of the stop and the \
             same coefficient of restitution 0.8 in a free impact. (a) Difference from the orbit of the rigid stop. (b) First \
             flips of the branch; lines: rigid stop."
        ),
        Figure::new(1, 2).with(left).with(right),
        72.0,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A free impact on the soft stop (no spring of the oscillator, no drive) has the coefficient
    /// of restitution of the rigid one.
    #[test]
    fn the_soft_stop_gives_back_what_the_rigid_one_does() {
        let Stop::Soft { stiffness, damping } = soft(50.0).stop else {
            panic!("soft")
        };
        // ẍ = −κx − cẋ from x = 0, ẋ = 1, until x = 0 again: closed form.
        let decay = 0.5 * damping;
        let frequency = (stiffness - decay * decay).sqrt();
        let back = (-decay * std::f64::consts::PI / frequency).exp();
        assert!((back - RESTITUTION).abs() < 1e-14);
    }

    #[test]
    fn the_distance_of_lists_is_that_of_the_loneliest() {
        assert!((nearest(&[1.0, 2.0], &[1.1, 2.5]) - 0.5).abs() < 1e-12);
        assert!(nearest(&[], &[1.0]).is_infinite());
    }
}
