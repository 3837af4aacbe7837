//! Approach and retract curves under frequency modulation.

use nanotap_dynamics::Control;
use nanotap_quantity::number::significant;

use super::average::sader_jarvis;
use super::walk::{HeldWalk, Stepped};
use super::{
    Averages, Driven, Ended, FreeOscillation, FrequencyModulationOptions, Held, HeldOrbit, Jump,
    Modulated, ModulationReport, OPEN_LOOP,
};
use crate::approach::{ApproachPoint, ApproachReport, Distances, Way, beam_clearance, hysteresis};
use crate::simulate::Classification;
use nanotap_case::{Case, Key};
use nanotap_error::Error;
use nanotap_error::ErrorKind;
use nanotap_model::cantilever::Cantilever;
use nanotap_observe::{ObservableSet, measure};
use nanotap_study::FreeMotion;
use nanotap_study::value::implied;

/// How far beyond the first distance the free oscillation is put, if Newton needs a way there.
const BEYOND: f64 = 8.0;

/// Computes the curve of frequency shifts of `case`, both ways.
///
/// # Errors
/// When the options are not valid for the case, or there is no orbit where the curve begins.
pub fn frequency_modulation(
    case: &Case,
    options: &FrequencyModulationOptions,
    control: &Control<'_>,
) -> Result<ApproachReport, Error> {
    curve(case, options, control).map_err(|error| match error.kind {
        ErrorKind::Numerics => error.remedy("begin farther away, with {from}"),
        _ => error,
    })
}

fn curve(
    case: &Case,
    options: &FrequencyModulationOptions,
    control: &Control<'_>,
) -> Result<ApproachReport, Error> {
    let distance =
        |option, given: &Option<_>| implied(case, case.gap_key(), option, given.as_ref());
    let phase = options.phase;
    let closest = distance("closest", &options.closest)?;
    let shift = implied(case, case.drive_keys()[0], "shift", options.shift.as_ref())?;
    let (from, to) = (
        distance("from", &options.from)?,
        distance("to", &options.to)?,
    );
    let model = case.model()?;
    let held = Held {
        amplitude: FreeMotion::of(&model).amplitude,
        phase,
    }
    .check()?;
    let free = FreeOscillation::of(case, held)?;
    let far = FreeMotion {
        amplitude: held.amplitude,
        phase,
        reach: free.reach,
    };
    let points = options.points;
    let distances = Distances {
        from,
        to,
        points,
        closest,
    };
    let distances = distances.values(case, &far)?;
    let (from, to) = (distances[0], distances[distances.len() - 1]);
    let reach = free.reach / free.amplitude;
    // Where the least distance is kept, the amplitude of the first distance is held up to there.
    let free = closest.map_or(free.clone(), |closest| {
        free.with_amplitude((from - closest) / reach)
    });
    let held = Held {
        amplitude: free.amplitude,
        phase,
    };
    let curve = Curve {
        case,
        free: &free,
        model,
        closest,
    };
    let beyond = from + BEYOND * from.abs().max(held.amplitude);
    let mut walk = HeldWalk::new(case, held, free.driven(), beyond);
    let mut table: Vec<ApproachPoint> = Vec::new();
    let (mut jumps, mut ended): (Vec<Jump>, Vec<Ended>) = (Vec::new(), Vec::new());
    let total = 2 * distances.len();
    let mut done = 0;
    for way in [Way::Approach, Way::Retract] {
        let reached = table.last().map_or(f64::NEG_INFINITY, |p| p.gap);
        let mut gaps: Vec<f64> = distances.clone();
        if way == Way::Retract {
            gaps.reverse();
            gaps.retain(|gap| *gap >= reached);
            if let Some((gap, driven)) = table.last().and_then(driven) {
                walk.turn(gap, driven);
            }
        }
        let mut failed: Option<Ended> = None;
        let mut missed = 0;
        for gap in gaps {
            if control.is_cancelled() {
                break;
            }
            let stepped = match walk.step(gap, control) {
                Err(error) if table.is_empty() => return Err(error),
                stepped => stepped,
            };
            let orbit = match stepped {
                Ok(Stepped { orbit, breaks }) => {
                    missed = 0;
                    let before = failed.take().filter(|_| breaks.is_empty());
                    jumps.extend(before.map(|before| Jump {
                        way,
                        from: before.gap,
                        to: gap,
                    }));
                    let breaks = breaks.into_iter();
                    jumps.extend(breaks.map(|[from, to]| Jump { way, from, to }));
                    orbit
                }
                // The map may have ended the step.
                Err(_) if control.is_cancelled() => break,
                Err(error) => {
                    failed.get_or_insert_with(|| Ended {
                        way,
                        gap: walk.gap(),
                        reason: error.message(),
                    });
                    missed += 1;
                    if missed > MISSED {
                        break;
                    }
                    continue;
                }
            };
            let amplitude = walk.held(gap).amplitude;
            let point = match curve.point(way, gap, orbit, amplitude) {
                Err(_) if control.is_cancelled() => break,
                point => point?,
            };
            table.push(point);
            walk.keep(closest, reach);
            done += 1;
            if let Some(report) = control.progress {
                report(done, total);
            }
        }
        ended.extend(failed);
    }
    if let Some(report) = control.progress {
        report(total, total);
    }
    // Of one least distance there is nothing to invert.
    let limits = match closest {
        None => invert(&mut table, &free),
        Some(_) => None,
    };
    for point in &mut table {
        curve.add_si(point);
    }
    let setpoints = shift.map(|shift| curve.setpoints(held, shift, &table, control));
    let report = ApproachReport {
        jumps: Vec::new(),
        parameter: case.gap_key().path(),
        from,
        to,
        free_amplitude: free.amplitude,
        free_phase: free.phase,
        free_reach: free.reach,
        beam_clearance: beam_clearance(case, &table),
        hysteresis: hysteresis(&table, difference),
        compared: ended.is_empty() && !control.is_cancelled(),
        returned: returned(&table),
        table,
        coexisting: Vec::new(),
        branches: None,
        cancelled: control.is_cancelled(),
        limits: limits.into_iter().collect(),
        parameter_unit: case.parameter_unit(case.gap_key()),
        physical: None,
        modulation: Some(ModulationReport {
            amplitude: free.amplitude,
            phase,
            free_frequency: free.frequency,
            free_frequency_hz: case
                .physical()
                .map(|view| free.frequency * view.scales.frequency),
            free_strength: free.strength,
            stiffness: free.stiffness,
            free_loss: free.loss,
            closest,
            multipliers: OPEN_LOOP,
            setpoints,
            jumps,
            ended,
        }),
    };
    Ok(report.in_si(&case.units()))
}

/// Largest number of successive distances without an orbit; more of them end a direction.
const MISSED: usize = 3;

struct Curve<'a> {
    case: &'a Case,
    /// Free lever at the amplitude of the first distance.
    free: &'a FreeOscillation,
    model: nanotap_model::Model,
    /// Least distance that is kept, model units; None if the amplitude is kept.
    closest: Option<f64>,
}

/// Largest number of steps of regula falsi.
const STEPS: usize = 60;
/// Distances per reach of the tip at which a requested shift is looked for.
const PER_REACH: i32 = 50;
/// Steps by which the turn of a curve is looked for.
const TURNS: usize = 40;
/// Part of the longer side at which the golden section looks next.
const GOLDEN: f64 = 0.381_966;

impl Curve<'_> {
    /// A curve with further points where the tip may touch, at distances that do not depend on its own.
    fn refined(
        &self,
        held: Held,
        table: &[ApproachPoint],
        control: &Control<'_>,
    ) -> Vec<ApproachPoint> {
        let step = self.free.reach / f64::from(PER_REACH);
        let near = |gap: f64| {
            let number = gap / step;
            let (least, most) = (f64::from(-4 * PER_REACH), f64::from(2 * PER_REACH));
            number.clamp(least, most)
        };
        let mut all = Vec::new();
        for (k, point) in table.iter().enumerate() {
            let before = k.checked_sub(1).map(|k| &table[k]);
            let before = before.filter(|before| before.way == point.way);
            if let Some((before, (gap, start))) = before.zip(before.and_then(driven)) {
                let [from, to] = [near(before.gap), near(point.gap)];
                let (low, high) = (from.min(to).floor() as i64 + 1, from.max(to).ceil() as i64);
                let mut between: Vec<i64> = (low..high).collect();
                if to < from {
                    between.reverse();
                }
                let mut walk = self.walk(held, gap, start);
                let found = between.into_iter().map_while(|number| {
                    self.point_at(&mut walk, point.way, step * number as f64, control)
                });
                all.extend(found);
            }
            all.push(point.clone());
        }
        all
    }

    /// A walk over distances from a driven motion on the curve.
    fn walk(&self, held: Held, gap: f64, start: Driven) -> HeldWalk<'_> {
        let mut walk = HeldWalk::new(self.case, held, start, gap);
        walk.keep(self.closest, self.free.reach / self.free.amplitude);
        walk
    }

    /// The point at a distance to which a walk leads.
    fn point_at(
        &self,
        walk: &mut HeldWalk<'_>,
        way: Way,
        gap: f64,
        control: &Control<'_>,
    ) -> Option<ApproachPoint> {
        let orbit = walk.step(gap, control).ok()?.orbit;
        let amplitude = walk.held(gap).amplitude;
        self.point(way, gap, orbit, amplitude).ok()
    }

    /// The point beyond the requested shift near the middle of three points whose shifts lie on one side of
    /// it, if the curve turns there.
    fn turn(
        &self,
        held: Held,
        shift: f64,
        [before, here, after]: [&ApproachPoint; 3],
        control: &Control<'_>,
    ) -> Option<ApproachPoint> {
        let side = excess(here, shift).signum();
        let off = |point: &ApproachPoint| side * excess(point, shift);
        if !(off(here) <= off(before) && off(here) <= off(after)) {
            return None;
        }
        let (gap, start) = driven(before)?;
        let mut walk = self.walk(held, gap, start);
        let (mut low, mut middle, mut high) = (before.gap, (here.gap, off(here)), after.gap);
        for _ in 0..TURNS {
            // Into the longer of both parts.
            let is_high = (high - middle.0).abs() > (middle.0 - low).abs();
            let longer = if is_high { high } else { low };
            let gap = middle.0 + GOLDEN * (longer - middle.0);
            let point = self.point_at(&mut walk, before.way, gap, control)?;
            let found = off(&point);
            if found < 0.0 {
                return Some(point);
            }
            // The end that lies behind the worse of both moves up to it.
            let is_better = found < middle.1;
            let end = if is_better == is_high {
                &mut low
            } else {
                &mut high
            };
            *end = if is_better { middle.0 } else { gap };
            if is_better {
                middle = (gap, found);
            }
        }
        None
    }

    /// Finds the distances at which the shift has a value, between the points of each direction.
    fn setpoints(
        &self,
        held: Held,
        shift: f64,
        table: &[ApproachPoint],
        control: &Control<'_>,
    ) -> Vec<ApproachPoint> {
        let mut table = self.refined(held, table, control);
        let turns = table.windows(3).enumerate().filter_map(|(k, of)| {
            let is_one_way = of[0].way == of[2].way;
            let turn =
                is_one_way.then(|| self.turn(held, shift, [&of[0], &of[1], &of[2]], control));
            let point = turn.flatten()?;
            let is_before = (point.gap - of[0].gap) * (point.gap - of[1].gap) < 0.0;
            Some((k + if is_before { 1 } else { 2 }, point))
        });
        let turns: Vec<(usize, ApproachPoint)> = turns.collect();
        for (place, point) in turns.into_iter().rev() {
            table.insert(place, point);
        }
        let pairs = table.windows(2).filter(|pair| pair[0].way == pair[1].way);
        let crossed =
            pairs.filter(|pair| (excess(&pair[0], shift) > 0.0) != (excess(&pair[1], shift) > 0.0));
        let found = crossed.filter_map(|pair| {
            let way = pair[0].way;
            let (gap, held, orbit) = self.crossing(held, shift, [&pair[0], &pair[1]], control)?;
            let mut point = self.point(way, gap, orbit, held.amplitude).ok()?;
            self.add_si(&mut point);
            Some(point)
        });
        found.collect()
    }

    /// Finds the orbit with the shift between two points of a direction.
    fn crossing(
        &self,
        held: Held,
        shift: f64,
        points: [&ApproachPoint; 2],
        control: &Control<'_>,
    ) -> Option<(f64, Held, HeldOrbit)> {
        let [a, b] = points;
        let mut low = (a.gap, excess(a, shift));
        let mut high = (b.gap, excess(b, shift));
        let (gap, start) = driven(a)?;
        let mut walk = self.walk(held, gap, start);
        let mut closed = None;
        for step in 0..STEPS {
            let straight = low.0 - low.1 * (high.0 - low.0) / (high.1 - low.1);
            // Now and then a halving, where the curve bends.
            let gap = if step % 3 == 2 {
                0.5 * (low.0 + high.0)
            } else {
                straight
            };
            let orbit = walk.step(gap, control).ok()?.orbit;
            let off = orbit.frequency - self.free.frequency - shift;
            let near =
                off.abs() <= 1e-11 * shift.abs() || (high.0 - low.0).abs() <= 1e-13 * gap.abs();
            closed = Some((gap, off, orbit));
            if near {
                break;
            }
            if (off > 0.0) == (low.1 > 0.0) {
                low = (gap, off);
            } else {
                high = (gap, off);
            }
        }
        let (gap, off, orbit) = closed?;
        // Where the curve jumps past the value, none has it.
        (off.abs() <= 1e-6 * shift.abs()).then(|| (gap, walk.held(gap), orbit))
    }

    /// Returns the quantities of frequency modulation for an orbit of this amplitude.
    fn modulated(&self, orbit: &HeldOrbit, amplitude: f64, gap: f64) -> Modulated {
        // A rigid stop has no static force; that of a surface that attracts depends on where it is.
        let cantilever = self.case.cantilever();
        let attracts = cantilever.is_some_and(Cantilever::has_attractive_surface);
        let known = !self.case.has_rigid_stop() && !attracts;
        let averages = known.then(|| self.averages(amplitude));
        let free = self.free.with_amplitude(amplitude);
        Modulated::of(orbit, &free, averages.as_ref(), gap)
    }

    fn averages(&self, amplitude: f64) -> Averages<'_> {
        let spring = match self.case.oscillator() {
            Some(_) => self.case.get(Key::StopStiffness),
            None => self.case.get(Key::Alpha4),
        };
        // The tip feels its own motion, a driven base's included.
        let swing = self.free.with_amplitude(amplitude).swing;
        Averages::new(&self.model, spring, swing, self.free.stiffness)
    }

    /// Adds the quantities of frequency modulation in SI.
    fn add_si(&self, point: &mut ApproachPoint) {
        if let Some(view) = self.case.physical() {
            point.modulation_si = point.modulation.map(|m| m.in_si(view));
        }
    }

    fn point(
        &self,
        way: Way,
        gap: f64,
        orbit: HeldOrbit,
        amplitude: f64,
    ) -> Result<ApproachPoint, Error> {
        let observables = measure(
            &orbit.model,
            &orbit.orbit.states[0],
            1,
            ObservableSet::COMMON,
        )?;
        let modulation = self.modulated(&orbit, amplitude, gap);
        let kind = Classification::Periodic;
        let (seen, orbit) = (Some(&observables), Some(orbit.orbit));
        Ok(ApproachPoint {
            modulation: Some(modulation),
            ..ApproachPoint::new(self.case, (way, gap), kind, seen, orbit)
        })
    }
}

/// Returns the distance of a point with its drive and state.
fn driven(point: &ApproachPoint) -> Option<(f64, Driven)> {
    let modulation = point.modulation?;
    let driven = Driven {
        frequency: modulation.drive_frequency,
        strength: modulation.drive_strength,
        state: point.orbit.as_ref()?.states.first()?.clone(),
    };
    Some((point.gap, driven))
}

/// Returns the frequency shift of a point minus the requested one, model units.
fn excess(point: &ApproachPoint, shift: f64) -> f64 {
    point.modulation.map_or(f64::NAN, |m| m.frequency_shift) - shift
}

/// Part of the largest force from which on the forces found from every second row differ notably.
const DIFFERS: f64 = 0.03;
/// Least number of rows of which every second one makes a curve.
const FEWEST: usize = 5;

/// Adds the force that follows from the shifts of each direction by the formula of Sader and
/// Jarvis, and says so if more rows would give another one.
fn invert(table: &mut [ApproachPoint], free: &FreeOscillation) -> Option<String> {
    let (mut apart, mut few) = (0.0_f64, false);
    for way in [Way::Approach, Way::Retract] {
        let of_way = |p: &&mut ApproachPoint| p.way == way;
        let curve: Vec<(f64, f64)> = table
            .iter_mut()
            .filter(of_way)
            .filter_map(|p| p.modulation.map(|m| (m.closest, m.relative_shift)))
            .collect();
        if curve.len() < 3 {
            continue;
        }
        let forces = sader_jarvis(&curve, free.swing, free.stiffness);
        few |= curve.len() < FEWEST;
        apart = apart.max(from_every_second(&curve, &forces, free));
        for (point, force) in table.iter_mut().filter(of_way).zip(forces) {
            if let Some(modulation) = &mut point.modulation {
                modulation.sader_jarvis_force = Some(force);
            }
        }
    }
    let how = if few {
        "with fewer than five rows each way it is not known by how much".to_owned()
    } else if apart > DIFFERS {
        format!(
            "from every second row it differs by up to {} % of the largest force",
            significant(100.0 * apart, 1)
        )
    } else {
        return None;
    };
    Some(format!(
        "the force by the formula of Sader and Jarvis depends on the number of rows: {how}"
    ))
}

/// By what part of the largest force the forces found from every second row differ.
fn from_every_second(curve: &[(f64, f64)], forces: &[f64], free: &FreeOscillation) -> f64 {
    let half: Vec<(f64, f64)> = curve.iter().copied().step_by(2).collect();
    let coarser = sader_jarvis(&half, free.swing, free.stiffness);
    let pairs = coarser.iter().zip(forces.iter().step_by(2));
    let apart = pairs.fold(0.0_f64, |apart, (a, b)| apart.max((a - b).abs()));
    let largest = forces
        .iter()
        .fold(0.0_f64, |most, force| most.max(force.abs()));
    if largest > 0.0 { apart / largest } else { 0.0 }
}

/// Difference of relative shifts above which they differ; below it is rounding.
const DIFFERENT: f64 = 1e-9;

/// Returns the difference of two relative shifts at one distance, if they differ.
fn difference(a: &ApproachPoint, b: &ApproachPoint) -> Option<f64> {
    let shift = |p: &ApproachPoint| Some(p.modulation?.relative_shift);
    let difference = (shift(a)? - shift(b)?).abs();
    (difference > DIFFERENT).then_some(difference)
}

fn returned(table: &[ApproachPoint]) -> bool {
    table
        .first()
        .zip(table.last())
        .is_some_and(|(first, last)| {
            first.gap.to_bits() == last.gap.to_bits() && difference(first, last).is_none()
        })
}
