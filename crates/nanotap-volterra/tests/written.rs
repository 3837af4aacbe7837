//! Laws of the table, written as formulas: the same forces, derivatives and motions.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod common;

use common::{beam, table_law, value};
use nalgebra::DMatrix;
use nanotap_quantity::Dimension;
use nanotap_volterra::laws::entry::Part;
use nanotap_volterra::laws::{self, TABLE, TableLaw, written};
use nanotap_volterra::{Flow, ForceLaw, Parameter};
use std::f64::consts::TAU;
use std::sync::Arc;

const PLANE: &str =
    "K = 1/((1 - poisson^2)/modulus + (1 - tip_poisson^2)/tip_modulus); x = max(a0 - d, 0); ";

/// Laws of the table that elementary functions state, as a user would write them, with the names of their
/// parameters.
fn texts() -> Vec<(&'static str, String)> {
    let elastic = |text: &str| format!("{PLANE}{text}");
    vec![
        ("hertz", elastic("4/3*K*sqrt(radius)*x^1.5")),
        ("cone", elastic("2/pi*K*tan(half_angle)*x^2")),
        ("punch", elastic("2*K*radius*x")),
        ("dmt", elastic("4/3*K*sqrt(radius)*x*sqrt(x) - hamaker*radius/(6*max(d, a0)^2)")),
        ("van-der-waals", "-hamaker*radius/(6*max(d, a0)^2)".into()),
        ("van-der-waals-cone", "-hamaker*tan(half_angle)^2/(6*max(d, a0))".into()),
        ("van-der-waals-punch", "if d > a0 then -hamaker*radius^2/(6*d^3) else -hamaker*radius^2/(6*a0^3)".into()),
        ("lennard-jones", "repulsion*radius/(180*d^8) - attraction*radius/(6*d^2)".into()),
        ("viscous-contact", "-viscosity*sqrt(radius*max(a0 - d, 0))*v".into()),
        ("exponential-damping", "-damping*exp(-d/decay_length)*v".into()),
        (
            "power-damping",
            "-damping*(damping_distance/(max(d - a0, 0) + damping_distance))^damping_exponent*v".into(),
        ),
        (
            "solvation",
            "x = max(d - a0, 0); solvation_force*cos(2*pi*x/solvation_period)*exp(-x/solvation_decay)".into(),
        ),
        ("spring-damper", "if d < a0 then stiffness*(a0 - d) - damping*v else 0".into()),
        (
            "adhesion-hysteresis",
            "w = if turned then work_of_retraction else work_of_adhesion; if d < a0 then -2*pi*radius*w else 0".into(),
        ),
        ("electrostatic", "x = max(d, a0); -pi*permittivity*voltage^2*radius^2/(x*(x + radius))".into()),
        (
            "dlvo",
            "x = max(d, a0); 4*pi*radius/permittivity*tip_charge*sample_charge*debye_length*exp(-x/debye_length) \
             - hamaker*radius/(6*x^2)"
                .into(),
        ),
        (
            "voigt-sphere-pulling",
            "x = max(a0 - d, 0); 4/3*sqrt(radius*x)/(1 - poisson^2)*(modulus*x - 1.5*viscosity*v)".into(),
        ),
        // Released where the force vanishes; the force itself or its bracket is the condition.
        (
            "voigt-sphere",
            "x = max(a0 - d, 0); \
             if modulus*x > 1.5*viscosity*v then 4/3*sqrt(radius*x)/(1 - poisson^2)*(modulus*x - 1.5*viscosity*v) \
             else 0"
                .into(),
        ),
        (
            "voigt-cone",
            "x = max(a0 - d, 0); max(2/pi*tan(half_angle)/(1 - poisson^2)*(modulus*x^2 - 2*viscosity*x*v), 0)".into(),
        ),
        (
            "voigt-punch",
            "x = a0 - d; if x < 0 then 0 else max(2*radius/(1 - poisson^2)*(modulus*x - viscosity*v), 0)".into(),
        ),
    ]
}

/// The law of the table and the written one, with the number of its parameter for each of the former.
struct Pair {
    table: &'static TableLaw,
    index: usize,
    own: Arc<dyn ForceLaw>,
    written: Arc<dyn ForceLaw>,
    /// The written law, with the elastic contact that [`table_law`] adds.
    sum: Arc<dyn ForceLaw>,
    places: Vec<usize>,
}

fn pair(name: &str, text: &str) -> Pair {
    let index = TABLE.iter().position(|law| law.entry.name == name).unwrap();
    let table = &TABLE[index];
    let parameters = table.entry.parameters;
    let others = parameters.iter().filter(|p| p.name != "contact_distance");
    let dimensions: Vec<(&str, Dimension)> = others.map(|p| (p.name, p.kind.dimension())).collect();
    let law = written::law(text, &dimensions).unwrap();
    let plain = |name: &'static str| name.strip_prefix(written::PARAMETERS).unwrap_or(name);
    let names: Vec<&str> = law.entry.parameters.iter().map(|p| plain(p.name)).collect();
    // A law without a contact distance begins at 0.
    let has_contact = parameters.iter().any(|p| p.name == "contact_distance");
    let of = |name: &&str| {
        if *name == "contact_distance" && !has_contact {
            0.0
        } else {
            value(name)
        }
    };
    let values: Vec<f64> = names.iter().map(of).collect();
    let written = law.with(&values).unwrap();
    let own: Vec<f64> = parameters.iter().map(|p| value(p.name)).collect();
    let hertz = laws::law("hertz").unwrap();
    let of_hertz: Vec<f64> = hertz
        .entry
        .parameters
        .iter()
        .map(|p| value(p.name))
        .collect();
    let sum = if table.entry.parts.contains(&Part::Elasticity) {
        Arc::clone(&written)
    } else {
        let elastic = hertz.with(&of_hertz).unwrap();
        laws::build_sum(&[(law.entry, Arc::clone(&written)), (hertz.entry, elastic)]).unwrap()
    };
    Pair {
        table,
        index,
        own: table.with(&own).unwrap(),
        written,
        sum,
        places: parameters
            .iter()
            .map(|p| names.iter().position(|name| *name == p.name).unwrap())
            .collect(),
    }
}

/// Differences of the energy between gaps on all pieces, at 1e-12 of their size.
#[test]
fn stored_energies_are_those_of_the_table() {
    let mut compared = Vec::new();
    for (name, text) in texts() {
        let Pair { own, written, .. } = pair(name, &text);
        let energy = |law: &dyn ForceLaw, gap: f64| law.energy(law.branch_at(gap, 0.0), gap);
        let low = own.wall().map_or(-0.4, |wall| (wall + 0.05).max(-0.4));
        let gaps = [low, 0.09, 0.2, 0.29, 0.31, 0.5, 1.0, 3.0, 30.0];
        let gaps = gaps.into_iter().filter(|gap| *gap >= low);
        let pairs: Vec<[Option<f64>; 2]> = gaps
            .map(|gap| [energy(&*own, gap), energy(&*written, gap)])
            .collect();
        if written.depends_on_rate() || written.remembers() {
            assert!(pairs.iter().all(|[_, own]| own.is_none()), "{name}");
            continue;
        }
        if pairs.iter().any(|[own, _]| own.is_none()) {
            continue;
        }
        assert!(
            pairs.iter().all(|[_, own]| own.is_some()),
            "{name}: {pairs:?}"
        );
        let pairs: Vec<[f64; 2]> = pairs.iter().map(|pair| pair.map(Option::unwrap)).collect();
        let size = pairs
            .iter()
            .fold(0.0_f64, |size, [own, _]| size.max(own.abs()));
        for two in pairs.windows(2) {
            let [own, written] = [0, 1].map(|k| two[1][k] - two[0][k]);
            assert!(
                (own - written).abs() < 1e-12 * size,
                "{name}: {own} {written}"
            );
        }
        compared.push(name);
    }
    for name in ["hertz", "dmt", "lennard-jones", "electrostatic", "dlvo"] {
        assert!(compared.contains(&name), "{compared:?}");
    }
}

/// A law, and its energy in closed form.
type Closed<'a> = (&'a Arc<dyn ForceLaw>, &'a dyn Fn(f64) -> f64);

/// E_b (e^(−2κ(d−σ)) − 2e^(−κ(d−σ))), and the power of a distance: F0 d0/(n − 1) (d0/d)^(n − 1).
#[test]
fn stored_energies_are_closed_forms() {
    let morse = laws::build(
        "morse",
        &[
            ("bond_energy", 0.7),
            ("bond_length", 0.4),
            ("bond_decay", 5.0),
        ],
    )
    .unwrap();
    let of_morse = |d: f64| {
        let x = (-5.0 * (d - 0.4)).exp();
        0.7 * (x * x - 2.0 * x)
    };
    let power = laws::build(
        "inverse-power",
        &[
            ("power_force", 0.3),
            ("power_distance", 2.0),
            ("power", 3.5),
            ("contact_distance", 0.1),
        ],
    )
    .unwrap();
    let of_power = |d: f64| -0.3 * 2.0 / 2.5 * (2.0 / d).powf(2.5);
    let closed: [Closed<'_>; 2] = [(&morse, &of_morse), (&power, &of_power)];
    for (law, closed) in closed {
        let at = |d: f64| law.energy(law.branch_at(d, 0.0), d).unwrap();
        for (a, b) in [(0.11, 0.2), (0.2, 0.9), (0.4, 1.2), (1.0, 2.0), (3.0, 10.0)] {
            let (found, expected) = (at(b) - at(a), closed(b) - closed(a));
            let size = closed(a).abs().max(closed(b).abs()).max(1e-3);
            assert!(
                (found - expected).abs() < 1e-12 * size.max(closed(0.1).abs()),
                "{a} {b}"
            );
        }
    }
}

#[test]
fn forces_and_derivatives_are_those_of_the_table() {
    for (name, text) in texts() {
        let pair = pair(name, &text);
        let (own, written) = (&pair.own, &pair.written);
        let same = |a: f64, b: f64, scale: f64, what: &str| {
            assert!(
                (a - b).abs() <= 1e-12 * a.abs().max(scale),
                "{name}, {what}: {a} {b}"
            );
        };
        assert_eq!(own.depends_on_rate(), written.depends_on_rate(), "{name}");
        assert_eq!(own.conservative(), written.conservative(), "{name}");
        assert_eq!(own.remembers(), written.remembers(), "{name}");
        assert_eq!(own.wall(), written.wall(), "{name}");
        for k in 0..60 {
            let gap = -2.0 + 0.0831 * f64::from(k);
            if own.wall().is_some_and(|wall| gap <= wall) {
                continue;
            }
            for rate in [-0.7, 0.3] {
                let branches = [own, written].map(|law| law.branch_at(gap, rate));
                let what = format!("gap {gap}, rate {rate}");
                let force = own.force(branches[0], gap, rate);
                let [mut values, mut by_gap, mut by_rate] = [[0.0; 11]; 3];
                let out = [&mut values[..], &mut by_gap[..], &mut by_rate[..]];
                written.forces(branches[1], &[gap; 11], &[rate; 11], out);
                let one = written.force(branches[1], gap, rate);
                assert_eq!(
                    one.value,
                    written.value(branches[1], gap, rate),
                    "{name}, {what}"
                );
                for (found, expected) in [
                    (one.value, force.value),
                    (values[10], force.value),
                    (one.by_gap, force.by_gap),
                    (by_gap[10], force.by_gap),
                    (one.by_rate, force.by_rate),
                    (by_rate[10], force.by_rate),
                ] {
                    same(expected, found, 1e-10, &what);
                }
                let mut expected = vec![0.0; pair.places.len()];
                let mut found = vec![0.0; written.parameters().len()];
                own.by_parameters(branches[0], gap, rate, &mut expected);
                written.by_parameters(branches[1], gap, rate, &mut found);
                for (k, expected) in expected.into_iter().enumerate() {
                    let what = format!("{what}, {}", pair.table.entry.parameters[k].name);
                    same(expected, found[pair.places[k]], 1e-10, &what);
                }
            }
        }
    }
}

/// The end of a period from a state in which the tip goes into contact, with its derivatives by the state
/// and by the law's own parameters.
fn period(
    law: Arc<dyn ForceLaw>,
    parameters: &[usize],
) -> (Vec<f64>, DMatrix<f64>, DMatrix<f64>, u64) {
    let system = Arc::new(beam(law, 2, 4.0, 25.0, 7.0, 5.0, 12));
    let mut flow = Flow::new(Arc::clone(&system));
    flow.start(&[6.5, 0.02, 3.0, 0.1], 0.0).unwrap();
    let wanted: Vec<_> = parameters
        .iter()
        .map(|&k| Parameter::of_law(&system, k))
        .collect();
    let mut jacobian = DMatrix::zeros(4, 4);
    let mut derivatives = DMatrix::zeros(4, wanted.len());
    flow.run_with_derivatives(TAU, &wanted, &mut jacobian, &mut derivatives)
        .unwrap();
    let mut end = vec![0.0; 4];
    flow.state(&mut end);
    (end, jacobian, derivatives, flow.statistics().switches)
}

#[test]
fn motions_and_their_derivatives_are_those_of_the_table() {
    for (name, text) in texts() {
        let pair = pair(name, &text);
        let count = pair.places.len();
        let of_own: Vec<usize> = (0..count).collect();
        let (own, jacobian, by_own, _) = period(table_law(pair.index, None), &of_own);
        let (end, other, by_written, switches) = period(Arc::clone(&pair.sum), &pair.places);
        assert!(
            switches >= 2 || name == "lennard-jones",
            "{name} never switched"
        );
        let close = |a: &DMatrix<f64>, b: &DMatrix<f64>, most: f64, what: &str| {
            let error = (a - b).amax() / a.amax().max(1e-3);
            assert!(error < most, "{name}, {what}: {error:e}");
        };
        let column = |x: &[f64]| DMatrix::from_column_slice(4, 1, x);
        close(&column(&own), &column(&end), 1e-12, "end");
        close(&jacobian, &other, 1e-10, "by the state");
        close(&by_own, &by_written, 1e-9, "by parameters");
    }
}
