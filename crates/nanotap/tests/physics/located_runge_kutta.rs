//! An independent integration of a beam on any of the samples: Runge–Kutta of fourth order in small
//! steps, switches located by bisection of the step, with equations derived from the mechanics of
//! the samples and not from the product's regimes.

use nalgebra::DVector;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::contact::ContactLaw;
use nanotap::model::galerkin::Galerkin;

use crate::contact_laws::parameter;
use crate::moving_surface::MovingSurface;

/// State of the beam and the sample.
#[derive(Clone)]
pub(crate) struct Motion {
    /// Displacements and velocities of the modes.
    pub(crate) beam: DVector<f64>,
    /// Position of the surface's free end, and elongation of the arm's damper.
    pub(crate) surface: f64,
    pub(crate) dampers: Vec<f64>,
    pub(crate) touching: bool,
    /// The energy dissipated in the sample, and the largest and the smallest force.
    pub(crate) dissipated: f64,
    pub(crate) force: [f64; 2],
    pub(crate) contacts: usize,
}

pub(crate) struct Independent {
    case: Cantilever,
    galerkin: Galerkin,
    inverse_mass: nalgebra::DMatrix<f64>,
}

/// Rates of (beam, surface, dissipated energy, dampers).
type Rates = (DVector<f64>, [f64; 2], Vec<f64>);

/// Stiffness and relaxation time of the arms.
fn arms(case: &Cantilever) -> Vec<[f64; 2]> {
    match case.contact {
        ContactLaw::StandardLinearSolid => {
            vec![["relaxation_stiffness", "relaxation_time"].map(|of| case.get(parameter(of)))]
        }
        ContactLaw::GeneralisedMaxwell => case.arms.iter().map(|[t, k]| [*k, *t]).collect(),
        _ => Vec::new(),
    }
}

impl Independent {
    pub(crate) fn new(case: &Cantilever) -> Self {
        let galerkin = Galerkin::new(case).unwrap();
        Self {
            case: case.clone(),
            inverse_mass: galerkin.mass.clone().try_inverse().unwrap(),
            galerkin,
        }
    }

    fn height(&self, t: f64, beam: &DVector<f64>) -> [f64; 2] {
        let (n, omega) = (self.case.modes, self.case.omega);
        let (sin, cos) = (omega * t).sin_cos();
        let p = &self.galerkin.modes.tip;
        [
            p.dot(&beam.rows(0, n)) + self.case.alpha2 * sin + self.case.alpha5,
            p.dot(&beam.rows(n, n)) + self.case.alpha2 * omega * cos,
        ]
    }

    /// Force of the sample in contact on the tip at height `h` and speed `v`.
    fn pressed(&self, h: f64, v: f64, m: &Motion) -> f64 {
        let c = &self.case;
        match c.contact {
            ContactLaw::SpringDamper | ContactLaw::KelvinVoigt => -c.alpha4 * h - c.alpha6 * v,
            ContactLaw::StandardLinearSolid | ContactLaw::GeneralisedMaxwell => {
                let pushes = arms(c).into_iter().zip(&m.dampers);
                let pushes = pushes.map(|([stiffness, _], damper)| stiffness * (-h - damper));
                -c.alpha4 * h + pushes.sum::<f64>()
            }
            ContactLaw::MovingSurface => {
                let rate = v - self.surface_speed(h, v, m);
                -MovingSurface::of(c).adhesion - c.alpha4 * (h - m.surface) - c.alpha6 * rate
            }
        }
    }

    /// Speed of a surface in contact, from the balance of the two dampers and springs.
    fn surface_speed(&self, h: f64, v: f64, m: &Motion) -> f64 {
        let (c, own) = (&self.case, MovingSurface::of(&self.case));
        let springs = -own.stiffness * m.surface;
        if m.touching {
            let held = own.adhesion + c.alpha4 * (h - m.surface) + c.alpha6 * v;
            (springs + held) / (own.damping + c.alpha6)
        } else {
            springs / own.damping
        }
    }

    /// Position of a free surface whose damper has this elongation.
    fn free_surface(&self, m: &Motion) -> f64 {
        let c = &self.case;
        match c.contact {
            ContactLaw::SpringDamper => 0.0,
            ContactLaw::KelvinVoigt | ContactLaw::MovingSurface => m.surface,
            // α4 u + Σ k (u + w) = 0
            ContactLaw::StandardLinearSolid | ContactLaw::GeneralisedMaxwell => {
                let (mut moment, mut all) = (0.0, c.alpha4);
                for ([stiffness, _], damper) in arms(c).into_iter().zip(&m.dampers) {
                    moment += stiffness * damper;
                    all += stiffness;
                }
                -moment / all
            }
        }
    }

    fn rates(&self, t: f64, m: &Motion) -> Rates {
        let c = &self.case;
        let n = c.modes;
        let [h, v] = self.height(t, &m.beam);
        let force = if m.touching {
            self.pressed(h, v, m)
        } else {
            0.0
        };
        let (sin, cos) = (c.omega * t).sin_cos();
        let free = &self.galerkin.forcing[0];
        let (x, speed) = (m.beam.rows(0, n), m.beam.rows(n, n));
        let pull = &free.sine * sin + &free.cosine * cos + &free.constant
            - &self.galerkin.stiffness[0] * x
            - &self.galerkin.damping[0] * speed
            + &self.galerkin.modes.tip * force;
        let mut beam = DVector::zeros(2 * n);
        beam.rows_mut(0, n).copy_from(&speed);
        beam.rows_mut(n, n).copy_from(&(&self.inverse_mass * pull));
        let none = Vec::new;
        let (surface, dampers, lost) = match c.contact {
            ContactLaw::SpringDamper => {
                (0.0, none(), if m.touching { c.alpha6 * v * v } else { 0.0 })
            }
            ContactLaw::KelvinVoigt => {
                let speed = if m.touching {
                    v
                } else {
                    -c.alpha4 / c.alpha6 * m.surface
                };
                (speed, none(), c.alpha6 * speed * speed)
            }
            ContactLaw::StandardLinearSolid | ContactLaw::GeneralisedMaxwell => {
                let at = if m.touching { h } else { self.free_surface(m) };
                let arms = arms(c);
                let speeds = arms.iter().zip(&m.dampers);
                let speeds: Vec<f64> = speeds.map(|([_, time], w)| (-at - w) / time).collect();
                let lost = arms.iter().zip(&speeds);
                let lost = lost.map(|([stiffness, time], speed)| stiffness * time * speed * speed);
                (0.0, speeds.clone(), lost.sum())
            }
            ContactLaw::MovingSurface => {
                let speed = self.surface_speed(h, v, m);
                let rate = if m.touching { v - speed } else { 0.0 };
                let lost = MovingSurface::of(c).damping * speed * speed + c.alpha6 * rate * rate;
                (speed, none(), lost)
            }
        };
        (beam, [surface, lost], dampers)
    }

    fn step(&self, t: f64, m: &Motion, h: f64) -> Motion {
        let along = |k: &Rates, h: f64| {
            let mut next = m.clone();
            next.beam.axpy(h, &k.0, 1.0);
            next.surface += h * k.1[0];
            next.dissipated += h * k.1[1];
            for (damper, speed) in next.dampers.iter_mut().zip(&k.2) {
                *damper += h * speed;
            }
            next
        };
        let a = self.rates(t, m);
        let b = self.rates(t + 0.5 * h, &along(&a, 0.5 * h));
        let c = self.rates(t + 0.5 * h, &along(&b, 0.5 * h));
        let d = self.rates(t + h, &along(&c, h));
        let mean = |of: &dyn Fn(&Rates) -> f64| (of(&a) + 2.0 * (of(&b) + of(&c)) + of(&d)) / 6.0;
        let dampers = (0..a.2.len()).map(|i| mean(&|rates| rates.2[i]));
        along(
            &(
                (&a.0 + (&b.0 + &c.0) * 2.0 + &d.0) / 6.0,
                [0, 1].map(|i| mean(&|rates| rates.1[i])),
                dampers.collect(),
            ),
            h,
        )
    }

    /// Positive while nothing changes.
    fn inside(&self, t: f64, m: &Motion) -> f64 {
        let [h, v] = self.height(t, &m.beam);
        match (m.touching, self.case.contact) {
            (false, _) => h - self.free_surface(m),
            (true, ContactLaw::SpringDamper) => -h,
            (true, ContactLaw::MovingSurface) => m.surface - h,
            (true, _) => self.pressed(h, v, m),
        }
    }

    /// Runs `periods` drive periods from rest with a relaxed sample.
    pub(crate) fn run(&self, beam: &[f64], periods: usize, steps: usize) -> Motion {
        let mut m = Motion {
            beam: DVector::from_column_slice(beam),
            surface: 0.0,
            dampers: vec![0.0; arms(&self.case).len()],
            touching: false,
            dissipated: 0.0,
            force: [0.0; 2],
            contacts: 0,
        };
        assert!(self.inside(0.0, &m) > 0.0, "the run starts in flight");
        let h = self.case.period() / steps as f64;
        for k in 0..periods * steps {
            let (mut t, mut left) = (k as f64 * h, h);
            while left > 0.0 {
                let end = self.step(t, &m, left);
                if self.inside(t + left, &end) > 0.0 {
                    m = end;
                    break;
                }
                let (mut low, mut high) = (0.0, left);
                for _ in 0..52 {
                    let middle = 0.5 * (low + high);
                    if self.inside(t + middle, &self.step(t, &m, middle)) > 0.0 {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                m = self.step(t, &m, high);
                (t, left) = (t + high, left - high);
                m.touching = !m.touching;
                m.contacts += usize::from(m.touching);
                let [height, _] = self.height(t, &m.beam);
                if m.touching && self.case.contact != ContactLaw::MovingSurface {
                    m.surface = height;
                }
                // A small step later the guard that is zero here is positive.
                let on = left.min(1e-4 * h);
                m = self.step(t, &m, on);
                (t, left) = (t + on, left - on);
            }
            if m.touching {
                let [height, speed] = self.height(k as f64 * h + h, &m.beam);
                let force = self.pressed(height, speed, &m);
                m.force = [m.force[0].min(force), m.force[1].max(force)];
            }
        }
        m
    }
}
