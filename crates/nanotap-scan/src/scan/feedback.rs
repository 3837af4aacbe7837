//! Lock-in amplifier, controller and z scanner of an instrument, updated once a drive period.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use nanotap_flow::Complex;

/// Most stages of the lock-in amplifier.
pub(super) const MAX_ORDER: usize = 4;

/// A lock-in amplifier: stages of a low-pass filter in series.
#[derive(Clone, Debug)]
pub(super) struct LockIn {
    /// Part of the difference that a stage follows in a period.
    part: f64,
    stages: Vec<Complex>,
}

impl LockIn {
    /// Creates an amplifier with `order` stages that follow `part` of the difference in a period,
    /// settled at `signal`.
    pub(super) fn new(part: f64, order: usize, signal: Complex) -> Self {
        Self {
            part,
            stages: vec![signal; order],
        }
    }

    /// Takes in the signal of a period and returns the output.
    pub(super) fn update(&mut self, signal: Complex) -> Complex {
        let mut input = signal;
        for stage in &mut self.stages {
            *stage += (input - *stage) * self.part;
            input = *stage;
        }
        input
    }
}

/// Returns the time constant of a stage, s, for a bandwidth at −3 dB of `order` stages, Hz.
pub(super) fn time_constant(bandwidth: f64, order: usize) -> f64 {
    let stretch = nanotap_arithmetic::powf(2.0, 1.0 / order as f64) - 1.0;
    stretch.sqrt() / (TAU * bandwidth)
}

/// Gains and limits of the controller, lengths in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gains {
    /// Proportional gain Kp, dimensionless: the command falls by Kp times the error.
    pub(super) proportional: f64,
    /// Integral gain times the drive period, Ki T, dimensionless.
    pub(super) integral: f64,
    /// Largest change of the command in a period, m.
    pub(super) slew: f64,
    /// Lowest and highest command, m; infinite where there is no limit.
    pub(super) range: [f64; 2],
    /// Number of drive periods by which the controller is late.
    pub(super) delay: usize,
}

/// A proportional–integral controller of the height.
#[derive(Clone, Debug)]
pub(super) struct Controller {
    gains: Gains,
    start: f64,
    /// Command of the present period, m.
    command: f64,
    sum: f64,
    late: VecDeque<f64>,
    /// Number of periods whose command was limited by the range.
    pub(super) at_range: usize,
}

impl Controller {
    pub(super) fn new(gains: Gains, start: f64) -> Self {
        Self {
            gains,
            start,
            command: start,
            sum: 0.0,
            late: std::iter::repeat_n(0.0, gains.delay).collect(),
            at_range: 0,
        }
    }

    /// Returns the command of the present period, m.
    pub(super) const fn command(&self) -> f64 {
        self.command
    }

    /// Takes in the error of a period and sets the command of the next. The sum stays where the
    /// command was limited.
    pub(super) fn update(&mut self, error: f64) {
        self.late.push_back(error);
        let error = self.late.pop_front().unwrap_or(error);
        let gains = &self.gains;
        let sum = self.sum + gains.integral * error;
        let wanted = self.start - (gains.proportional * error + sum);
        let slewed = wanted.clamp(self.command - gains.slew, self.command + gains.slew);
        let command = slewed.clamp(gains.range[0], gains.range[1]);
        if command.to_bits() == wanted.to_bits() {
            self.sum = sum;
        }
        self.at_range += usize::from(command.to_bits() != slewed.to_bits());
        self.command = command;
    }
}

/// A z scanner: a damped oscillator that follows the command exactly over a period.
#[derive(Clone, Debug)]
pub(super) struct Scanner {
    /// The map of (distance from the command, speed) over a period; `None` of a rigid scanner.
    map: Option<[[f64; 2]; 2]>,
    position: f64,
    speed: f64,
}

impl Scanner {
    /// At rest at `position`; `resonance` is the frequency in Hz and the quality factor.
    pub(super) fn new(resonance: Option<[f64; 2]>, period: f64, position: f64) -> Self {
        Self {
            map: resonance.map(|resonance| oscillator_map(resonance, period)),
            position,
            speed: 0.0,
        }
    }

    /// The position after a period under `command`.
    pub(super) fn follow(&mut self, command: f64) -> f64 {
        match self.map {
            None => self.position = command,
            Some([[a, b], [c, d]]) => {
                let (x, v) = (self.position - command, self.speed);
                self.position = command + a * x + b * v;
                self.speed = c * x + d * v;
            }
        }
        self.position
    }
}

/// The map over time `t` of `ẍ + (ω/Q) ẋ + ω² x = 0` on (x, ẋ).
pub(super) fn oscillator_map([frequency, quality]: [f64; 2], t: f64) -> [[f64; 2]; 2] {
    let omega = TAU * frequency;
    let decay = 0.5 * omega / quality;
    // The square of the rate of oscillation, negative where it is overdamped.
    let square = (omega - decay) * (omega + decay);
    let turn = square.abs().sqrt() * t;
    // cos and sin(x)/x of the turn, or cosh and sinh(x)/x, with the decay.
    let (even, odd) = if square > 0.0 && turn > 1e-8 {
        let fade = nanotap_arithmetic::exp(-decay * t);
        let (sin, cos) = nanotap_arithmetic::sin_cos(turn);
        (fade * cos, fade * t * sin / turn)
    } else if turn > 1e-8 {
        // Both exponents are negative.
        let slow = nanotap_arithmetic::exp(turn - decay * t);
        let fast = nanotap_arithmetic::exp(-turn - decay * t);
        (0.5 * (slow + fast), 0.5 * t * (slow - fast) / turn)
    } else {
        let fade = nanotap_arithmetic::exp(-decay * t);
        (fade, fade * t)
    };
    [
        [even + decay * odd, odd],
        [-omega * omega * odd, even - decay * odd],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Over-, under- and critically damped: against the matrix exponential.
    #[test]
    fn the_scanner_s_map_is_a_matrix_exponential() {
        for quality in [0.1, 0.499_999_999, 0.5, 0.500_000_001, 3.0, 200.0] {
            let (frequency, t) = (1.3, 0.4);
            let omega = TAU * frequency;
            let matrix = nalgebra::DMatrix::from_row_slice(
                2,
                2,
                &[0.0, t, -omega * omega * t, -omega * t / quality],
            );
            let expected = nanotap_arithmetic::matrix_exp(&matrix);
            let map = oscillator_map([frequency, quality], t);
            for i in 0..2 {
                for j in 0..2 {
                    assert!((map[i][j] - expected[(i, j)]).abs() < 1e-11, "{quality}");
                }
            }
        }
    }

    #[test]
    fn a_stiff_scanner_is_at_the_command() {
        let mut scanner = Scanner::new(Some([1e9, 0.5]), 1e-5, 1e-9);
        assert!((scanner.follow(3e-9) - 3e-9).abs() < 1e-24);
        assert_eq!(Scanner::new(None, 1e-5, 1e-9).follow(3e-9), 3e-9);
    }

    #[test]
    fn a_limited_command_keeps_the_sum() {
        let gains = Gains {
            proportional: 0.0,
            integral: 1.0,
            slew: 0.5,
            range: [-1.0, 1.0],
            delay: 0,
        };
        let mut controller = Controller::new(gains, 0.0);
        controller.update(0.25);
        assert_eq!((controller.command(), controller.sum), (-0.25, 0.25));
        controller.update(10.0);
        assert_eq!((controller.command(), controller.sum), (-0.75, 0.25));
        controller.update(10.0);
        assert_eq!((controller.command(), controller.at_range), (-1.0, 1));
    }
}
