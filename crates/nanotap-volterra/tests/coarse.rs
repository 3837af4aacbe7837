//! The approximate flow against the exact one.

mod common;

use common::{beam, table_law};
use nalgebra::DMatrix;
use nanotap_volterra::laws::TABLE;
use nanotap_volterra::{Coarse, Flow};
use std::f64::consts::TAU;
use std::sync::Arc;
use std::time::Instant;

struct Random(u64);
impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        2.0 * (self.0 >> 11) as f64 / (1_u64 << 53) as f64 - 1.0
    }
}

fn exact(flow: &mut Flow, x: &mut [f64], branch: &mut usize) -> bool {
    flow.start_on(x, 0.0, *branch).unwrap();
    let ok = flow.run_until(TAU).is_ok();
    flow.state(x);
    *branch = flow.branch();
    ok
}

#[test]
fn survey() {
    for count in [1, 3, 10] {
        for index in 0..TABLE.len() {
            let name = TABLE[index].entry.name;
            let system = Arc::new(beam(table_law(index, None), count, 1.0, 20.0, 10.0, 8.0, 20));
            let mut flow = Flow::new(system.clone());
            let mut coarse = Coarse::new(&system, TAU).unwrap();
            let mut random = Random(88172645463325252);
            let mut errors = Vec::new();
            let (mut te, mut tc) = (0.0, 0.0);
            let (mut ee, mut ec) = (0, 0);
            let mut wrong = 0; let mut fails = 0;
            let runs = 40;
            for _ in 0..runs {
                let mut x: Vec<f64> = (0..2 * count)
                    .map(|i| 10.0 * random.next() / ((1 + i % count) as f64).powi(if i < count { 4 } else { 2 }))
                    .collect();
                let (gap, rate) = system.gap(0.0, &x);
                let mut branch = system.law().branch_at(gap, rate);
                let mut y = x.clone();
                let mut b = branch;
                let t = Instant::now();
                let e0 = flow.statistics().evaluations;
                if !exact(&mut flow, &mut x, &mut branch) { fails += 1; errors.push(0.0); continue; }
                te += t.elapsed().as_secs_f64();
                ee += flow.statistics().evaluations - e0;
                let t = Instant::now();
                let e0 = coarse.statistics().evaluations;
                match coarse.run_periods(&mut y, Some(b), 1) {Err(e) => {println!("{name}: {e}"); fails += 100; }, Ok(c) => b=c}
                tc += t.elapsed().as_secs_f64();
                ec += coarse.statistics().evaluations - e0;
                wrong += usize::from(b != branch);
                let e = (0..2*count).map(|i| {
                    let w = if i < count {1.0} else {((i-count) as f64*2.0+1.0).powi(2)};
                    (x[i]-y[i]).abs()/w}).fold(0.0, f64::max) / 10.0;
                errors.push(e);
            }
            errors.sort_by(f64::total_cmp);
            // jacobian
            let mut x: Vec<f64> = vec![0.0; 2*count];
            x[0] = -7.0; x[count] = -7.0;
            let (gap, rate) = system.gap(0.0, &x);
            let branch = system.law().branch_at(gap, rate);
            let n = 2*count;
            let (mut je, mut jc, mut none) = (DMatrix::zeros(n,n), DMatrix::zeros(n,n), DMatrix::zeros(n,0));
            flow.start_on(&x, 0.0, branch).unwrap();
            flow.run_with_derivatives(TAU, &[], &mut je, &mut none).unwrap();
            let t = Instant::now();
            coarse.run_with_jacobian(&mut x.clone(), Some(branch), &mut jc).unwrap();
            let tj = t.elapsed().as_secs_f64();
            println!("{count:2} {name:24} median {:.1e} 90% {:.1e} max {:.1e} wrong {wrong} fails {fails} exact {:6.1} us {:5} ev, coarse {:5.2} us {:4} ev; jac {:.1e} {:.1} us",
                errors[runs/2], errors[runs*9/10], errors[runs-1], 1e6*te/runs as f64, ee/runs as u64, 1e6*tc/runs as f64, ec/runs as u64,
                (&je-&jc).amax()/je.amax(), 1e6*tj);
        }
    }
}
