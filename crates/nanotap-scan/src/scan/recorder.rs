//! The record of a line: its statistics, its pixels, its listed periods.

use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_flow::Complex;

use super::instrument::{Interaction, Period, lag};
use super::options::Mode;
use super::plan::Plan;
use super::report::{Direction, LineStatistics, ListedPeriod, OffSetpoint, Parachuting, PixelRow};
use super::state_tracker::StateTracker;

/// Sums over the periods of a pixel.
#[derive(Clone, Copy, Debug, Default)]
struct PixelSums {
    count: u32,
    surface: f64,
    z: f64,
    error: f64,
    lock_in: Complex,
    peak: f64,
    largest_peak: f64,
    dissipation: f64,
    contact: f64,
    mean_deflection: f64,
    attractive: u32,
    repulsive: u32,
    irregular: u32,
}

/// A line in one direction.
#[derive(Clone, Debug)]
pub(super) struct LineRecord {
    pub(super) statistics: LineStatistics,
    pub(super) pixels: PixelRow,
    /// Number of periods whose command was limited by the range of z.
    pub(super) at_range: usize,
}

/// Mean and sum of squared deviations.
#[derive(Clone, Copy, Debug, Default)]
struct Deviation {
    count: f64,
    mean: f64,
    squares: f64,
}

impl Deviation {
    fn add(&mut self, value: f64) {
        self.count += 1.0;
        let difference = value - self.mean;
        self.mean += difference / self.count;
        self.squares += difference * (value - self.mean);
    }

    fn rms(&self) -> f64 {
        (self.squares / self.count.max(1.0)).sqrt()
    }
}

/// Part of the free amplitude by which the deflection turns back and forth from period to period
/// in an irregular motion.
const IRREGULAR: f64 = 0.01;

/// Number of stays at the setpoint (see [`StateTracker`]) for which a motion of the surface acts on the
/// amplitude.
const AFTER_MOTION: usize = 10;

/// Most stretches of each kind that a line keeps in each direction, where their number is limited.
pub(super) const KEPT: usize = 8;

impl OffSetpoint {
    /// Deviation of the height, m, by which stretches are compared: that of the amplitude where the
    /// height's is not known.
    pub(super) fn size(&self) -> f64 {
        self.height.map_or(self.error, |height| height).abs()
    }
}

/// Records a line in one direction.
#[derive(Debug)]
pub(super) struct LineRecorder<'a> {
    plan: &'a Plan,
    line: usize,
    direction: Direction,
    first_period: usize,
    /// Whether the sample attracts a tip that does not touch it.
    attracts: bool,
    pixels: Vec<PixelSums>,
    height: Deviation,
    height_range: [f64; 2],
    tracking: Deviation,
    surface: Deviation,
    /// Height less that of the surface where the error is small.
    level: Deviation,
    highest_surface: f64,
    error_squares: f64,
    error_range: [f64; 2],
    peak: (f64, usize, f64),
    peak_sum: f64,
    dissipation: f64,
    count: usize,
    flight: Option<(usize, usize, bool)>,
    parachuting: Vec<Parachuting>,
    off: Option<OffSetpoint>,
    /// Surface and material of the period before, and number of the period in which they changed last.
    under_tip: Option<(f64, usize)>,
    moved_at: Option<usize>,
    off_setpoint: Vec<OffSetpoint>,
    before: [Complex; 2],
}

impl<'a> LineRecorder<'a> {
    pub(super) fn new(
        plan: &'a Plan,
        line: usize,
        direction: Direction,
        first_period: usize,
    ) -> Self {
        let attracts = plan
            .materials
            .iter()
            .any(|case| case.cantilever().is_some_and(|case| case.law.is_some()));
        Self {
            plan,
            line,
            direction,
            first_period,
            attracts,
            pixels: vec![PixelSums::default(); plan.pixels],
            height: Deviation::default(),
            height_range: [f64::INFINITY, f64::NEG_INFINITY],
            tracking: Deviation::default(),
            surface: Deviation::default(),
            level: Deviation::default(),
            highest_surface: f64::NEG_INFINITY,
            error_squares: 0.0,
            error_range: [f64::INFINITY, f64::NEG_INFINITY],
            peak: (f64::NEG_INFINITY, 0, 0.0),
            peak_sum: 0.0,
            dissipation: 0.0,
            count: 0,
            flight: None,
            parachuting: Vec::new(),
            off: None,
            under_tip: None,
            moved_at: None,
            off_setpoint: Vec::new(),
            before: [Complex::new(0.0, 0.0); 2],
        }
    }

    /// Takes in the period of this index within the line, after the tracker has.
    pub(super) fn add(&mut self, index: usize, period: &Period, tracker: &StateTracker<'_>) {
        let plan = self.plan;
        let k = self.first_period + index;
        let error = period.error;
        self.count += 1;
        self.height.add(period.z);
        extend(&mut self.height_range, period.z);
        self.tracking.add(period.z - period.surface);
        self.surface.add(period.surface);
        self.highest_surface = self.highest_surface.max(period.surface);
        self.error_squares += error * error;
        extend(&mut self.error_range, error);
        if period.peak_force > self.peak.0 {
            self.peak = (period.peak_force, k, period.x);
        }
        self.peak_sum += period.peak_force;
        self.dissipation += period.dissipation;
        let limit = 0.5 * (1.0 - plan.setpoint) * plan.free_amplitude;
        if error.abs() < 0.1 * limit {
            self.level.add(period.z - period.surface);
        }
        let flies = if self.attracts {
            error > limit
        } else {
            period.contact == 0.0
        };
        self.follow_flight(flies, k, error > limit);
        self.follow_error(k, period, tracker);
        self.add_to_pixel(index, period);
    }

    fn follow_flight(&mut self, flies: bool, k: usize, passes: bool) {
        match (&mut self.flight, flies) {
            (Some((_, periods, passed)), true) => {
                *periods += 1;
                *passed |= passes;
            }
            (None, true) => self.flight = Some((k, 1, passes)),
            (_, false) => self.end_flight(),
        }
    }

    fn end_flight(&mut self) {
        let Some((first_period, periods, true)) = self.flight.take() else {
            return;
        };
        let time = periods as f64 * self.plan.period;
        self.parachuting.push(Parachuting {
            first_period,
            periods,
            time,
            length: time * self.plan.speed(),
        });
    }

    /// Extends the stretch on which the amplitude is off the setpoint, or starts or ends one.
    fn follow_error(&mut self, k: usize, period: &Period, tracker: &StateTracker<'_>) {
        let plan = self.plan;
        let under_tip = (period.surface, period.material);
        // A line starts where the one before ends, or after settling there.
        if self
            .under_tip
            .replace(under_tip)
            .is_some_and(|before| before != under_tip)
        {
            self.moved_at = Some(k);
        }
        let error = period.error;
        let is_off = plan.mode == Mode::ConstantAmplitude && error.abs() > plan.off_setpoint();
        let goes_on =
            |off: &OffSetpoint| is_off && off.error.is_sign_positive() == error.is_sign_positive();
        if !self.off.as_ref().is_some_and(goes_on) {
            self.end_error();
        }
        if !is_off {
            return;
        }
        let height = tracker
            .distance(period.material)
            .map(|distance| period.z - period.surface - distance);
        let off = self.off.get_or_insert(OffSetpoint {
            first_period: k,
            periods: 0,
            x: period.x,
            until_x: period.x,
            error,
            height,
            material: period.material,
            moved: false,
        });
        off.periods += 1;
        let shortly_before = off
            .first_period
            .saturating_sub(AFTER_MOTION * tracker.stay());
        off.moved |= self
            .moved_at
            .is_some_and(|moved_at| moved_at >= shortly_before);
        off.until_x = period.x;
        off.material = period.material;
        if error.abs() > off.error.abs() {
            off.error = error;
        }
        // The deviation on the side of the error: above the setpoint the height is too large.
        let side = |height: &f64| height * error.signum();
        off.height = off
            .height
            .into_iter()
            .chain(height)
            .max_by(|a, b| side(a).total_cmp(&side(b)));
    }

    fn end_error(&mut self) {
        let Some(off) = self.off.take() else {
            return;
        };
        self.off_setpoint.push(off);
        if self.off_setpoint.len() > KEPT {
            let mut order: Vec<usize> = (0..self.off_setpoint.len()).collect();
            order.sort_by(|a, b| {
                let [a, b] = [a, b].map(|index| self.off_setpoint[*index].size());
                b.total_cmp(&a)
            });
            self.off_setpoint.remove(order[KEPT]);
        }
    }

    fn add_to_pixel(&mut self, index: usize, period: &Period) {
        let plan = self.plan;
        let [before, last] = self.before;
        let turn = (period.deflection - last * 2.0 + before).modulus();
        let irregular = index >= 2 && turn > 4.0 * IRREGULAR * plan.free_amplitude;
        self.before = [last, period.deflection];
        let pixel = &mut self.pixels[plan.pixel(index, self.direction == Direction::Retrace)];
        pixel.count += 1;
        pixel.surface += period.surface;
        pixel.z += period.z;
        pixel.error += period.error;
        pixel.lock_in += period.lock_in;
        pixel.peak += period.peak_force;
        pixel.largest_peak = pixel.largest_peak.max(period.peak_force);
        pixel.dissipation += period.dissipation;
        pixel.contact += period.contact;
        pixel.mean_deflection += period.mean_deflection;
        pixel.attractive += u32::from(period.interaction == Interaction::Attractive);
        pixel.repulsive += u32::from(period.interaction == Interaction::Repulsive);
        pixel.irregular += u32::from(irregular);
    }

    /// Returns statistics and pixels of the line.
    pub(super) fn finish(mut self) -> (LineStatistics, PixelRow) {
        self.end_flight();
        self.end_error();
        let plan = self.plan;
        let count = self.count.max(1) as f64;
        let level = if self.level.count > 0.0 {
            self.level.mean
        } else {
            self.tracking.mean
        };
        let statistics = LineStatistics {
            line: self.line,
            direction: self.direction,
            y: plan.line_position(self.line),
            first_period: self.first_period,
            height_mean: self.height.mean,
            height_rms: self.height.rms(),
            height_max: self.height_range[1],
            height_min: self.height_range[0],
            error_rms: (self.error_squares / count).sqrt(),
            error_max: self.error_range[1],
            error_min: self.error_range[0],
            peak_force_max: self.peak.0,
            peak_force_max_period: self.peak.1,
            peak_force_max_x: self.peak.2,
            peak_force_mean: self.peak_sum / count,
            dissipation_mean: self.dissipation / count,
            tracking_rms: self.tracking.rms(),
            surface_rms: self.surface.rms(),
            overshoot: (self.height_range[1] - self.highest_surface - level).max(0.0),
            parachuting: std::mem::take(&mut self.parachuting),
            off_setpoint: std::mem::take(&mut self.off_setpoint),
        };
        (statistics, self.pixel_row())
    }

    fn pixel_row(&self) -> PixelRow {
        let of = |value: fn(&PixelSums) -> f64| -> Vec<f64> {
            let mean = |pixel: &PixelSums| match pixel.count {
                0 => f64::NAN,
                count => value(pixel) / f64::from(count),
            };
            self.pixels.iter().map(mean).collect()
        };
        let mut row = PixelRow {
            surface: of(|p| p.surface),
            height: of(|p| p.z),
            amplitude_error: of(|p| p.error),
            phase: self.pixels.iter().map(|p| lag(p.lock_in)).collect(),
            peak_force: of(|p| p.peak),
            peak_force_max: of(|p| p.largest_peak * f64::from(p.count)),
            dissipation: of(|p| p.dissipation),
            contact_fraction: of(|p| p.contact),
            mean_deflection: of(|p| p.mean_deflection),
            state: self.pixels.iter().map(PixelSums::state).collect(),
        };
        for (phase, pixel) in row.phase.iter_mut().zip(&self.pixels) {
            if pixel.count == 0 {
                *phase = f64::NAN;
            }
        }
        row
    }
}

impl PixelSums {
    fn state(&self) -> Option<Interaction> {
        if self.count == 0 {
            return None;
        }
        let half = self.count / 2;
        Some(if self.irregular > half {
            Interaction::Irregular
        } else if self.attractive + self.repulsive <= half {
            Interaction::Free
        } else if self.attractive > self.repulsive {
            Interaction::Attractive
        } else {
            Interaction::Repulsive
        })
    }
}

fn extend(range: &mut [f64; 2], value: f64) {
    range[0] = range[0].min(value);
    range[1] = range[1].max(value);
}

/// Converts a period to an entry of the list.
pub(super) fn listed(k: usize, period: &Period) -> ListedPeriod {
    ListedPeriod {
        k,
        x: period.x,
        surface: period.surface,
        z: period.z,
        amplitude: period.deflection.modulus(),
        phase: lag(period.deflection),
        amplitude_lockin: period.lock_in.modulus(),
        phase_lockin: lag(period.lock_in),
        error: period.error,
        peak_force: period.peak_force,
        mean_deflection: period.mean_deflection,
        contact_fraction: period.contact,
        dissipation: period.dissipation,
        state: period.interaction,
    }
}
