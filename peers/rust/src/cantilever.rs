//! The cantilever with three modes, Eqs. (10)–(18). Regime 0 is free flight, regime 1
//! contact; a state is (a_1, a_2, a_3, and their rates).

pub const MODES: usize = 3;
pub type State = [f64; 2 * MODES];

const BETA: [f64; MODES] = [
    1.875_104_068_711_961_2,
    4.694_091_132_974_175,
    7.854_757_438_237_613,
];
const TIP: [f64; MODES] = [2.0, -2.0, 2.0];
/// α1 … α6: the paper's parameters, Eq. (26), with a tip mass.
const ALPHA: [f64; 6] = [0.1, 0.1, 0.1, 20.0, 0.0, 0.2];
pub const OMEGA: f64 = 2.6;

/// By regime: M⁻¹K, M⁻¹C, and M⁻¹ times the force along sine, cosine and one.
#[derive(Clone, Default)]
struct Regime {
    stiffness: [[f64; MODES]; MODES],
    damping: [[f64; MODES]; MODES],
    sine: [f64; MODES],
    cosine: [f64; MODES],
    constant: [f64; MODES],
}

#[derive(Clone)]
pub struct Cantilever {
    omega: f64,
    regimes: [Regime; 2],
}

impl Cantilever {
    pub fn new(omega: f64) -> Self {
        let mut regimes = [Regime::default(), Regime::default()];
        for (contact, regime) in [0.0, 1.0].into_iter().zip(&mut regimes) {
            regime.fill(omega, contact);
        }
        Self { omega, regimes }
    }

    pub fn period(&self) -> f64 {
        std::f64::consts::TAU / self.omega
    }

    pub fn rates(&self, regime: usize, t: f64, y: &[f64], dy: &mut [f64]) {
        let (s, c) = (self.omega * t).sin_cos();
        let r = &self.regimes[regime];
        for i in 0..MODES {
            let mut a = r.sine[i] * s + r.cosine[i] * c + r.constant[i];
            for j in 0..MODES {
                a -= r.stiffness[i][j] * y[j] + r.damping[i][j] * y[MODES + j];
            }
            dy[i] = y[MODES + i];
            dy[MODES + i] = a;
        }
    }

    /// The Jacobian of [`rates`](Self::rates) times a vector.
    pub fn jacobian_product(&self, regime: usize, v: &[f64], out: &mut [f64]) {
        let r = &self.regimes[regime];
        for i in 0..MODES {
            out[i] = v[MODES + i];
            out[MODES + i] = -(0..MODES)
                .map(|j| r.stiffness[i][j] * v[j] + r.damping[i][j] * v[MODES + j])
                .sum::<f64>();
        }
    }

    /// The gap between tip and sample, Eq. (8).
    pub fn gap(&self, t: f64, y: &[f64]) -> f64 {
        2.0 * (y[0] - y[1] + y[2]) + ALPHA[1] * (self.omega * t).sin() + ALPHA[4]
    }

    pub fn gap_rate(&self, t: f64, y: &[f64]) -> f64 {
        2.0 * (y[3] - y[4] + y[5]) + ALPHA[1] * self.omega * (self.omega * t).cos()
    }

    /// Where a motion starts; on the surface the gap's rate decides (from rest: free).
    pub fn regime_at(&self, t: f64, y: &[f64]) -> usize {
        let gap = self.gap(t, y);
        let contact = if gap == 0.0 {
            self.gap_rate(t, y) <= 0.0
        } else {
            gap < 0.0
        };
        usize::from(contact)
    }
}

impl Regime {
    fn fill(&mut self, omega: f64, contact: f64) {
        let [a1, a2, a3, a4, a5, a6] = ALPHA;
        let squared: f64 = TIP.iter().map(|p| p * p).sum();
        let integral = BETA.map(|b| 2.0 * (b.cosh() + b.cos()) / (b.sinh() + b.sin()) / b);
        for i in 0..MODES {
            for k in 0..MODES {
                let same = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
                // M⁻¹ = 1 − α1 ppᵀ/(1 + α1 p²)
                let inverse = same(i, k) - a1 * TIP[i] * TIP[k] / (1.0 + a1 * squared);
                for j in 0..MODES {
                    let load = contact * TIP[k] * TIP[j];
                    self.stiffness[i][j] += inverse * (same(k, j) * BETA[k].powi(4) + a4 * load);
                    self.damping[i][j] += inverse * (same(k, j) * a3 + a6 * load);
                }
                let drive = a2 * omega * omega * (a1 * TIP[k] + integral[k]);
                self.sine[i] += inverse * (drive - contact * a2 * a4 * TIP[k]);
                self.cosine[i] -= inverse * a2 * omega * (a3 * integral[k] + contact * a6 * TIP[k]);
                self.constant[i] -= inverse * contact * a4 * a5 * TIP[k];
            }
        }
    }
}
