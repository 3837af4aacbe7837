//! The map of a case in a user's algorithm: Newton finds an unstable period-1 orbit, and small
//! displacements of the sample stabilise it.
//!
//! ```text
//! cargo run --release --example map -p nanotap
//! ```
//!
//! At Ω = 2.6 the paper's cantilever moves chaotically around a period-1 orbit with one multiplier
//! below −1. Near the orbit the map of one period is z* + A (z − z*) + b u, with A = ∂P/∂z and b =
//! ∂P/∂α5 for a displacement u of the sample. The displacement that removes the unstable component,
//! u = −μ f·(z − z*)/(f·b) with f A = μ f, is computed from the state at each strobe (Ott, Grebogi
//! and Yorke, Phys. Rev. Lett. 64, 1196, 1990).

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

use nalgebra::DVector;
use nanotap::Map;
use nanotap::case::{Case, Key};
use nanotap::control::Control;

/// The largest displacement of the sample, in units of the beam's gap. The chaos comes no nearer
/// than 0.024 to the orbit; such displacements reach that far.
const MAX_DISPLACEMENT: f64 = 0.02;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words = [
        "alpha1=0.1",
        "alpha2=0.1",
        "alpha3=0.1",
        "alpha4=20",
        "alpha6=0.2",
        "omega=2.6",
    ];
    let case = Case::parse(None, &words.map(str::to_owned))?;
    let map = Map::new(&case)?;
    let n = map.dimension();

    // A long run, and its nearest return, from which Newton closes the orbit.
    let run = map.iterate(&vec![0.0; n], 2000, 1, &Control::default())?;
    let states: Vec<DVector<f64>> = run.chunks(n).map(DVector::from_column_slice).collect();
    let nearest = states
        .windows(2)
        .skip(100)
        .min_by(|a, b| (&a[1] - &a[0]).norm().total_cmp(&(&b[1] - &b[0]).norm()))
        .ok_or("nothing ran")?;
    let orbit = map.orbit(nearest[0].as_slice(), 1)?;
    let fixed = DVector::from_column_slice(&orbit.states[0]);
    println!(
        "period {}, {}, multipliers {:.4} {:.4} …",
        orbit.period,
        orbit.stability.name(),
        orbit.multipliers[0],
        orbit.multipliers[1]
    );

    // The left eigenvector of its unstable multiplier, by iteration.
    let at = map.linearised(fixed.as_slice(), 1, &[Key::Alpha5])?;
    let b = at.derivatives.column(0).into_owned();
    let mut f = DVector::from_element(n, 1.0);
    for _ in 0..200 {
        f = at.jacobian.tr_mul(&f).normalize();
    }
    let multiplier = at.jacobian.tr_mul(&f).dot(&f);

    // The run continues; the sample is displaced once the motion is close to the orbit.
    let mut z = states.last().ok_or("nothing ran")?.clone();
    let mut caught = None;
    for k in 0..5000 {
        let away = &z - &fixed;
        let wanted = -multiplier * f.dot(&away) / f.dot(&b);
        let moved = if wanted.abs() <= MAX_DISPLACEMENT {
            wanted
        } else {
            0.0
        };
        if moved != 0.0 && away.norm() < 1e-9 {
            caught = Some(k);
            break;
        }
        let here = Map::new(&case.with(Key::Alpha5, moved))?;
        z = DVector::from_vec(here.apply(z.as_slice(), 1)?);
    }
    match caught {
        Some(k) => println!("held on the unstable orbit to 1e-9 after {k} periods"),
        None => println!("not caught within 5000 periods"),
    }
    Ok(())
}
