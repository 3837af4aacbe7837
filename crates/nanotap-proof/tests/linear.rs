//! Inverses and eigenbases of interval matrices contain those of the matrices in them.

use nalgebra::Complex;
use nanotap_proof::eigen::Eigenbasis;
use nanotap_proof::{Interval, Matrix, Rectangle};
use proptest::prelude::*;

const SIZE: usize = 4;

fn entries() -> impl Strategy<Value = Vec<f64>> {
    proptest::collection::vec(-4.0..4.0_f64, SIZE * SIZE)
}

fn matrix(entries: &[f64], radius: f64) -> Matrix<Interval> {
    Matrix::from_fn(SIZE, SIZE, |i, j| {
        Interval::around(entries[SIZE * i + j], radius)
    })
}

/// Whether the interval contains zero and nothing far from it.
fn zero(x: Interval, reach: f64) -> bool {
    x.contains(0.0) && x.magnitude() <= reach
}

proptest! {
    /// V⁻¹ V − 1 contains zero in every entry, also for wide matrices, and little else for points;
    /// the inverse of a matrix at the edge lies in that of all.
    #[test]
    fn inverses_undo_their_matrices(all in entries(), imaginary in entries(), e in -30..-8_i32) {
        let radius = 2.0_f64.powi(e);
        let complex = |radius: f64| Matrix::from_fn(SIZE, SIZE, |i, j| {
            let k = SIZE * i + j;
            Rectangle::new(Interval::around(all[k], radius), Interval::around(imaginary[k], radius))
        });
        if let (Some(wide), Some(narrow)) = (complex(radius).inverse(), complex(0.0).inverse()) {
            let product = &wide * &complex(0.0);
            let edge = Matrix::from_fn(SIZE, SIZE, |i, j| {
                let k = SIZE * i + j;
                let turn = if (i + j) % 2 == 0 { radius } else { -radius };
                Rectangle::point(Complex::new(all[k] + 0.99 * turn, imaginary[k] - 0.99 * turn))
            });
            let at_edge = edge.inverse();
            for i in 0..SIZE {
                for j in 0..SIZE {
                    let unit = if i == j { Rectangle::ONE } else { Rectangle::ZERO };
                    let off = product[(i, j)] - unit;
                    prop_assert!(off.re.contains(0.0) && off.im.contains(0.0));
                    prop_assert!(!wide[(i, j)].is_disjoint(narrow[(i, j)]));
                    if let Some(at_edge) = &at_edge {
                        let z = at_edge[(i, j)].middle();
                        let (x, y) = (wide[(i, j)].re, wide[(i, j)].im);
                        prop_assert!(x.contains(z.re) && y.contains(z.im));
                    }
                }
            }
        }
    }

    /// Re(R diag(λ) L) contains A, Re(R L) contains 1, and the sum of the eigenvalues contains the
    /// trace; the basis of a matrix at the edge of a wide one lies in the wide one's.
    #[test]
    fn eigenbases_rebuild_their_matrices(all in entries(), e in -40..-6_i32) {
        let a = matrix(&all, 0.0);
        let radius = 2.0_f64.powi(e);
        if let Some(basis) = Eigenbasis::of(&a) {
            let m = basis.values.len();
            let turned = Matrix::from_fn(SIZE, m, |i, k| basis.right[(i, k)] * basis.values[k]);
            let (rebuilt, unit) = (&turned * &basis.left, &basis.right * &basis.left);
            // Enclosures of ill-conditioned ones are wider.
            let size = basis.right.iter().chain(basis.left.iter());
            let size = size.map(|z| z.magnitude()).fold(1.0, f64::max);
            let reach = 1e-10 * size.powi(4);
            for i in 0..SIZE {
                for j in 0..SIZE {
                    prop_assert!(zero(rebuilt[(i, j)].re - a[(i, j)], reach));
                    let one = if i == j { Interval::ONE } else { Interval::ZERO };
                    prop_assert!(zero(unit[(i, j)].re - one, reach));
                }
            }
            let weight = |z: Rectangle| if z.im == Interval::ZERO { 1.0 } else { 2.0 };
            let sum: Interval = basis.values.iter().map(|z| z.re * Interval::point(weight(*z))).sum();
            let trace: Interval = (0..SIZE).map(|i| a[(i, i)]).sum();
            prop_assert!(zero(sum - trace, reach));
            let edge = Matrix::from_fn(SIZE, SIZE, |i, j| {
                let turn = if (i + j) % 2 == 0 { 0.99 * radius } else { -0.99 * radius };
                Interval::point(all[SIZE * i + j] + turn)
            });
            if let (Some(wide), Some(edge)) = (Eigenbasis::of(&matrix(&all, radius)), Eigenbasis::of(&edge)) {
                for z in &edge.values {
                    let middle = z.middle();
                    let held = |w: &Rectangle| w.re.contains(middle.re) && w.im.contains(middle.im);
                    prop_assert!(wide.values.iter().any(held), "{middle}");
                }
            }
        }
    }
}

/// −1 ± 2i and 3, of a companion matrix of (x − 3)(x² + 2x + 5) = x³ − x² − x − 15.
#[test]
fn eigenvalues_of_a_companion_matrix_are_the_polynomials_roots() {
    let rows = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [15.0, 1.0, 1.0]];
    let matrix = Matrix::from_fn(3, 3, |i, j| Interval::point(rows[i][j]));
    let basis = Eigenbasis::of(&matrix).unwrap();
    assert_eq!(basis.values.len(), 2);
    for (re, im) in [(3.0, 0.0), (-1.0, 2.0)] {
        let held = |z: &&Rectangle| z.re.contains(re) && z.im.contains(im);
        let found = basis.values.iter().find(held).unwrap();
        assert!(found.re.radius() < 1e-13 && found.im.radius() < 1e-13);
    }
}

/// A double eigenvalue has no separate box, with one eigenvector or with two.
#[test]
fn double_eigenvalues_are_refused() {
    for corner in [0.0, 1.0] {
        let rows = [[2.0, corner], [0.0, 2.0]];
        let matrix = Matrix::from_fn(2, 2, |i, j| Interval::point(rows[i][j]));
        assert!(Eigenbasis::of(&matrix).is_none());
    }
}
