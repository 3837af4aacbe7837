//! Shared by several tests: a stroboscopic map of the flow, and the reference lever.
// Not every test uses all of it.
#![allow(dead_code)]

use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_dynamics::StroboscopicMap;
use nanotap_volterra::laws;
use nanotap_volterra::laws::entry::{Entry, Part};
use nanotap_volterra::{
    Complex, Drive, Flow, ForceLaw, Kernel, Modes, Options, System, Tone, VolterraError,
};
use std::f64::consts::TAU;
use std::sync::Arc;

/// One eV in nN nm.
pub(crate) const EV: f64 = 0.1602176634;

/// The flow over one period of the drive.
#[derive(Clone)]
pub(crate) struct Strobe {
    pub(crate) flow: Flow,
    pub(crate) period: f64,
}

impl Strobe {
    pub(crate) fn new(system: System, period: f64) -> Self {
        Self {
            flow: Flow::new(Arc::new(system)),
            period,
        }
    }
}

impl nanotap_dynamics::Scheduling for Strobe {}

impl StroboscopicMap for Strobe {
    type Error = VolterraError;

    fn dimension(&self) -> usize {
        self.flow.system().dimension()
    }

    fn period(&self) -> f64 {
        self.period
    }

    fn advance(&mut self, state: &mut [f64]) -> Result<(), VolterraError> {
        self.flow.start(state, 0.0)?;
        self.flow.run_until(self.period)?;
        self.flow.state(state);
        Ok(())
    }

    fn advance_with_jacobian(
        &mut self,
        state: &mut [f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), VolterraError> {
        self.flow.start(state, 0.0)?;
        let mut none = DMatrix::zeros(state.len(), 0);
        self.flow
            .run_with_derivatives(self.period, &[], jacobian, &mut none)?;
        self.flow.state(state);
        Ok(())
    }
}

/// DMT with van der Waals attraction, as for the reference orbits.
pub(crate) fn dmt() -> Arc<dyn ForceLaw> {
    laws::build(
        "dmt",
        &[
            ("modulus", 1.0),
            ("poisson", 0.3),
            ("tip_modulus", 160.0),
            ("tip_poisson", 0.3),
            ("radius", 5.0),
            ("contact_distance", 0.169),
            ("hamaker", 0.03),
        ],
    )
    .unwrap()
}

/// One mode, `z̈ + ż/Q + z = (A₀/Q) cos t + F/k`, gap `z + zc`; lengths in nm, forces in nN,
/// times in units of `1/ω₀`.
pub(crate) struct Lever {
    pub(crate) k: f64,
    pub(crate) q: f64,
    pub(crate) amplitude: f64,
    pub(crate) zc: f64,
}

impl Lever {
    pub(crate) fn system(&self, law: Arc<dyn ForceLaw>, nodes: usize) -> System {
        self.system_at(law, nodes, 1e-13)
    }

    pub(crate) fn system_at(&self, law: Arc<dyn ForceLaw>, nodes: usize, tolerance: f64) -> System {
        let modes = Modes::from_oscillators(&[(1.0, 1.0 / self.q)]).unwrap();
        let kernel = Kernel::new(
            modes,
            RowDVector::from_row_slice(&[1.0, 0.0]),
            DVector::from_row_slice(&[0.0, 1.0 / self.k]),
            TAU / 4.0,
            nodes,
        )
        .unwrap();
        let tones = if self.amplitude == 0.0 {
            Vec::new()
        } else {
            vec![Tone {
                frequency: 1.0,
                forcing: DVector::from_row_slice(&[
                    Complex::new(0.0, 0.0),
                    Complex::new(self.amplitude / self.q, 0.0),
                ]),
                gap: Complex::new(0.0, 0.0),
            }]
        };
        let drive = Drive {
            constant: DVector::zeros(2),
            offset: self.zc,
            tones,
        };
        System::new(kernel, law, drive, Options::new(tolerance)).unwrap()
    }
}

/// A chain of `count` modes like those of a beam whose first mode has unit frequency, driven at the
/// tip, with the gap at the free end.
pub(crate) fn beam(
    law: Arc<dyn ForceLaw>,
    count: usize,
    k: f64,
    q: f64,
    amplitude: f64,
    zc: f64,
    nodes: usize,
) -> System {
    beam_at(law, count, k, q, amplitude, zc, nodes, 1e-13)
}

pub(crate) fn beam_at(
    law: Arc<dyn ForceLaw>,
    count: usize,
    k: f64,
    q: f64,
    amplitude: f64,
    zc: f64,
    nodes: usize,
    tolerance: f64,
) -> System {
    let oscillators: Vec<(f64, f64)> = beam_modes(count, q)
        .into_iter()
        .map(|(stiffness, damping, _)| (stiffness, damping))
        .collect();
    let modes = Modes::from_oscillators(&oscillators).unwrap();
    let mut row = RowDVector::zeros(2 * count);
    let mut column = DVector::zeros(2 * count);
    let mut forcing = DVector::from_element(2 * count, Complex::new(0.0, 0.0));
    for n in 0..count {
        let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
        row[n] = sign;
        column[count + n] = sign / k;
        forcing[count + n] = Complex::new(sign * amplitude / q, 0.0);
    }
    let kernel = Kernel::new(modes, row, column, TAU / 4.0, nodes).unwrap();
    let drive = Drive {
        constant: DVector::zeros(2 * count),
        offset: zc,
        tones: vec![Tone {
            frequency: 1.0,
            forcing,
            gap: Complex::new(0.0, 0.0),
        }],
    };
    System::new(kernel, law, drive, Options::new(tolerance)).unwrap()
}

/// Values in nm, nN and 1/ω0 for the parameters of the table of laws.
const VALUES: [(&str, f64); 30] = [
    ("modulus", 0.4),
    ("poisson", 0.3),
    ("tip_modulus", 160.0),
    ("tip_poisson", 0.3),
    ("radius", 6.0),
    ("half_angle", 0.5),
    ("contact_distance", 0.2),
    ("hamaker", 0.03),
    ("attraction", 0.03),
    ("repulsion", 2e-5),
    ("work_of_adhesion", 0.02),
    ("work_of_retraction", 0.03),
    ("viscosity", 0.02),
    ("thickness", 8.0),
    ("damping", 0.3),
    ("decay_length", 1.5),
    ("surface_tension", 0.02),
    ("film_thickness", 0.5),
    ("surface_energy", 0.05),
    ("voltage", 1.3),
    ("ac_voltage", 0.7),
    ("contact_potential", 0.2),
    ("permittivity", 0.01),
    ("debye_length", 2.0),
    ("stiffness", 3.0),
    ("solvation_force", 0.1),
    ("solvation_period", 2.5),
    ("solvation_decay", 1.5),
    ("damping_distance", 1.2),
    ("damping_exponent", 2.5),
];

/// See [`VALUES`]; charges are 0.01.
pub(crate) fn value(name: &str) -> f64 {
    VALUES
        .iter()
        .find(|(key, _)| *key == name)
        .map_or(0.01, |(_, value)| *value)
}

/// A law of the table with [`value`]s, one of them changed. Attraction or dissipation alone would
/// pull the tip into the sample, so an elastic contact is added.
pub(crate) fn table_law(index: usize, change: Option<(usize, f64)>) -> Arc<dyn ForceLaw> {
    let of =
        |entry: &Entry| -> Vec<f64> { entry.parameters.iter().map(|p| value(p.name)).collect() };
    let table = &laws::TABLE[index];
    let mut parameters = of(table.entry);
    if let Some((k, h)) = change {
        parameters[k] += h;
    }
    let law = table.with(&parameters).unwrap();
    if table.entry.parts.contains(&Part::Elasticity) {
        return law;
    }
    let hertz = laws::law("hertz").unwrap();
    let elastic = hertz.with(&of(hertz.entry)).unwrap();
    laws::build_sum(&[(table.entry, law), (hertz.entry, elastic)]).unwrap()
}

/// Stiffness and damping over mass, and sign at the tip, of the modes of [`beam`].
pub(crate) fn beam_modes(count: usize, q: f64) -> Vec<(f64, f64, f64)> {
    // Roots of cos β cosh β = −1; beyond the fourth (n − ½)π to rounding.
    let root = |n: usize| -> f64 {
        const FIRST: [f64; 4] = [
            1.875_104_068_711_961,
            4.694_091_132_974_175,
            7.854_757_438_237_613,
            10.995_540_734_875_467,
        ];
        FIRST
            .get(n)
            .copied()
            .unwrap_or((n as f64 + 0.5) * std::f64::consts::PI)
    };
    (0..count)
        .map(|n| {
            let ratio = (root(n) / root(0)).powi(2);
            // All modes have the same modal mass at the tip, a quarter of the beam's mass.
            let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
            (ratio * ratio, ratio / q, sign)
        })
        .collect()
}
