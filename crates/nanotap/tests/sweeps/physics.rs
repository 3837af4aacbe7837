//! Results of sweeps, compared with known motions of the model.

use nanotap::case::Case;
use nanotap::dataset::{Share, Store, Values, Work};
use nanotap::figure::sweep::figure;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::oscillator::{Oscillator, Stop};
use nanotap::study::Computation as _;
use nanotap::study::orbit::OrbitOptions;
use nanotap::study::sweep::{Follow, Summary, Sweep, SweepOptions};
use nanotap_dynamics::Control;

use crate::folder::Folder;

/// A finished sweep with its table.
struct Swept {
    _folder: Folder,
    store: Store,
}

impl Swept {
    fn of(subject: &Case, over: &[&str], change: impl FnOnce(&mut SweepOptions)) -> Self {
        let mut options = SweepOptions {
            periods: 20,
            ..SweepOptions::over(over.iter().copied())
        };
        change(&mut options);
        let sweep = Sweep::new(subject, options).unwrap();
        let folder = Folder::new();
        let store = Store::create_or_resume(&folder.join("s"), sweep.schema().clone()).unwrap();
        let control = Control::default();
        sweep
            .compute(
                &store,
                &Work {
                    share: Share::WHOLE,
                    threads: 2,
                    control,
                },
            )
            .unwrap();
        Self {
            _folder: folder,
            store,
        }
    }

    /// Every value of a variable without further dimensions, keyed by its entry.
    fn all(&self, name: &str) -> Vec<(Vec<usize>, f64)> {
        let place = self.store.schema().index_of(name).unwrap();
        let mut all = Vec::new();
        for chunk in 0..self.store.chunks() {
            let block = self.store.schema().grid.block(chunk);
            let values: Vec<f64> = match self.store.read_chunk(&block, place).unwrap() {
                Values::Real(v) => v,
                Values::Whole(v) => v.into_iter().map(f64::from).collect(),
                Values::Code(v) => v.into_iter().map(f64::from).collect(),
                Values::Text(_) => panic!(),
            };
            all.extend(block.entries().zip(values));
        }
        all.sort_by(|a, b| a.0.cmp(&b.0));
        all
    }

    fn column(&self, name: &str) -> Vec<f64> {
        self.all(name).into_iter().map(|(_, v)| v).collect()
    }

    /// The values of a variable with further dimensions at one entry.
    fn row(&self, name: &str, entry: &[usize]) -> Vec<f64> {
        let schema = self.store.schema();
        let place = schema.index_of(name).unwrap();
        let stride = schema.variables[place].stride();
        for chunk in 0..self.store.chunks() {
            let block = schema.grid.block(chunk);
            if let Some(flat) = block.entries().position(|e| e == entry) {
                let Values::Real(all) = self.store.read_chunk(&block, place).unwrap() else {
                    panic!()
                };
                return all[flat * stride..(flat + 1) * stride].to_vec();
            }
        }
        panic!("{entry:?} is in no chunk")
    }

    fn summary(&self) -> Summary {
        Summary::of(&self.store).unwrap()
    }
}

fn paper(omega: f64, alpha1: f64) -> Case {
    Case::from(Cantilever {
        omega,
        alpha1,
        ..Cantilever::paper()
    })
}

/// Period 1 doubles at Ω = 2.9137224181 (reference list, N = 3, Eq. 26): just below it the sweep
/// must show period 2, just above it period 1.
#[test]
fn the_doubling_is_at_the_reference_value() {
    let swept = Swept::of(&paper(3.0, 0.1), &["omega=2.88:2.94:13"], |_| {});
    let omegas: Vec<f64> = (0..13).map(|k| 2.88 + 0.06 * f64::from(k) / 12.0).collect();
    for (omega, period) in omegas.iter().zip(swept.column("period")) {
        let expected = if *omega < 2.913_722_418_1 { 2.0 } else { 1.0 };
        assert_eq!(period, expected, "{omega}");
    }
    // A multiplier leaves the unit circle there: the closer, the weaker the stability.
    let multipliers = swept.column("multiplier");
    assert!(multipliers.iter().all(|m| *m < 1.0));
    // The exponent of an orbit is that of its multipliers.
    for ((m, n), l) in multipliers
        .iter()
        .zip(swept.column("period"))
        .zip(swept.column("lyapunov"))
    {
        assert!((m.ln() / n - l).abs() < 1e-12);
    }
}

/// At Ω = 3 the orbit's |μ| = 0.868606 (reference value); its recording repeats.
#[test]
fn the_orbit_at_three_is_recorded() {
    let swept = Swept::of(&paper(3.0, 0.1), &["omega=3:3:1"], |_| {});
    assert_eq!(swept.summary().periods.get(&1), Some(&1));
    assert!((swept.column("multiplier")[0] - 0.868_606).abs() < 1e-6);
    let orbit =
        nanotap::study::orbit::orbit(&paper(3.0, 0.1).model().unwrap(), &OrbitOptions::default());
    let observables = orbit.unwrap().observables;
    for (name, expected) in [
        ("tip_max", observables.tip_max),
        ("tip_min", observables.tip_min),
        ("contact_fraction", observables.contact_fraction),
        ("peak_force", observables.peak_force),
        ("mean_deflection", observables.mean_deflection),
    ] {
        let found = swept.column(name)[0];
        assert!(
            (found - expected).abs() < 1e-9,
            "{name}: {found} {expected}"
        );
    }
    let highs = swept.row("period_max", &[0, 0]);
    assert!(highs.len() == 20 && highs.iter().all(|h| *h == highs[0]));
    assert_eq!(highs[0], swept.column("tip_max")[0]);
}

/// At Ω = 20, α1 = 0 a period-1 (W up to 0.7357) and a period-4 (W up to 3.0047)
/// coexist; at α1 = 0.1 there is only a period-1 with W in [−0.41706, 1.75832].
#[test]
fn seeded_starts_find_coexisting_motions() {
    let subject = paper(20.0, 0.0);
    let swept = Swept::of(&subject, &["alpha1=0:0.1:2"], |o| o.starts = Some(12));
    let summary = swept.summary();
    assert_eq!(summary.counts["periodic"], 24, "{summary:?}");
    let (periods, tops, bottoms) = (
        swept.all("period"),
        swept.all("tip_max"),
        swept.all("tip_min"),
    );
    let mut seen = std::collections::BTreeSet::new();
    for ((entry, period), ((_, top), (_, bottom))) in periods.iter().zip(tops.iter().zip(&bottoms))
    {
        seen.insert((entry[0], *period as usize));
        let expected = match (entry[0], *period as usize) {
            (0, 1) => 0.7357,
            (0, 4) => 3.0047,
            (1, 1) => 1.75832,
            other => panic!("{other:?}"),
        };
        assert!((top - expected).abs() < 1e-4, "{top} {expected}");
        assert!(entry[0] == 0 || (bottom + 0.41706).abs() < 1e-5);
    }
    assert!(seen.contains(&(0, 1)) && seen.contains(&(0, 4)), "{seen:?}");
}

/// Ω = 2.6: chaos with a largest exponent of about 0.253 ± 0.01 per period.
#[test]
fn chaos_is_reported_with_its_exponent() {
    let swept = Swept::of(&paper(2.6, 0.1), &["omega=2.6:2.6:1"], |o| {
        o.starts = Some(4);
    });
    assert_eq!(swept.summary().counts["chaotic"], 4);
    let (values, errors) = (swept.column("lyapunov"), swept.column("lyapunov_error"));
    for (value, error) in values.iter().zip(&errors) {
        assert!(
            (value - 0.253).abs() < 5.0 * error + 0.01,
            "{value} ± {error}"
        );
        assert!(*error < 0.05);
    }
    assert!(swept.column("multiplier").iter().all(|m| m.is_nan()));
}

/// A fixed transient records the run itself: the result must be that of a plain run.
#[test]
fn a_given_transient_is_run_unchanged() {
    let subject = paper(2.6, 0.1);
    let swept = Swept::of(&subject, &["omega=2.6:2.6:1"], |o| {
        o.transient = Some(7);
        o.state = Some(vec![0.1, 0.0, 0.0, -0.2, 0.0, 0.0].into());
    });
    let model = subject.model().unwrap();
    let run = nanotap::study::simulate::simulate(
        &model,
        &nanotap::study::simulate::SimulateOptions {
            periods: 20,
            transient: Some(7),
            state: Some(vec![0.1, 0.0, 0.0, -0.2, 0.0, 0.0].into()),
            strobe: 20,
            ..Default::default()
        },
    )
    .unwrap();
    let strobe = swept.row("strobe", &[0, 0]);
    for (found, expected) in strobe.iter().zip(run.strobe.concat()) {
        assert!((found - expected).abs() < 1e-9);
    }
    assert_eq!(swept.column("transient"), [7.0]);
    assert!((swept.column("tip_max")[0] - run.observables.tip_max).abs() < 1e-9);
}

/// At Ω = 20, α1 = 0 a run from rest goes to one attractor. Followed from the basin of the other
/// one, the other motion must persist from value to value: sweeps up and down show different
/// motions.
#[test]
fn following_stays_on_its_motion() {
    let subject = paper(20.0, 0.0);
    // A state that leads to the period-4 orbit, from the seeded starts.
    let seeds = Swept::of(&subject, &["alpha1=0:0:1"], |o| {
        o.starts = Some(12);
        o.strobe = Some(1);
    });
    let on_four = seeds
        .column("period")
        .iter()
        .position(|p| *p == 4.0)
        .unwrap();
    let state = seeds.row("strobe", &[0, on_four]);
    let both = Swept::of(&subject, &["alpha2=0.1:0.12:5"], |o| {
        o.follow = Follow::Both;
        o.state = Some(state.into());
    });
    // α5 = 0: the model is homogeneous, so the motion scales with α2 and remains period 4 if the
    // start leads there; upwards it is followed from its own orbit.
    let periods = both.all("period");
    let up: Vec<f64> = periods
        .iter()
        .filter(|(e, _)| e[1] == 0)
        .map(|(_, p)| *p)
        .collect();
    assert_eq!(up, [4.0; 5]);
    let tops: Vec<f64> = both
        .all("tip_max")
        .iter()
        .filter(|(e, _)| e[1] == 0)
        .map(|(_, t)| *t)
        .collect();
    for (k, top) in tops.iter().enumerate() {
        let alpha2 = 0.1 + 0.005 * k as f64;
        assert!((top / alpha2 - 30.047).abs() < 1e-2, "{top} at {alpha2}");
    }
}

/// Modes can be swept, alone or with another parameter; states of fewer modes are padded in their
/// own columns.
#[test]
fn the_number_of_modes_can_vary() {
    let swept = Swept::of(&paper(3.0, 0.1), &["modes=1:3:3", "omega=3:3.1:2"], |_| {});
    assert_eq!(swept.summary().periods.get(&1), Some(&6));
    let strobe = swept.row("strobe", &[0, 0, 0]);
    let first = &strobe[..6];
    assert!(first[0].is_finite() && first[3].is_finite());
    assert!([1, 2, 4, 5].iter().all(|k| first[*k].is_nan()));
    // The reference state of three modes at Ω = 3.
    let last = swept.all("tip_max");
    assert!(last.iter().all(|(_, top)| top.is_finite()));
    assert!(
        figure(&swept.store)
            .unwrap()
            .to_svg()
            .unwrap()
            .contains("period 1")
    );
    // Following converts a state to more modes and back.
    let followed = Swept::of(&paper(3.0, 0.1), &["modes=1:3:3"], |o| {
        o.follow = Follow::Both;
    });
    assert_eq!(followed.summary().periods.get(&1), Some(&6));
}

/// The restitution model (gap 0, r = 0.8, ẍ + x = cos ωt) flips at ω = 2.6533477.
#[test]
fn the_impact_oscillator_flips_at_the_reference_value() {
    let oscillator = Oscillator {
        mass: 1.0,
        stiffness: 1.0,
        damping: 0.0,
        forcing: 1.0,
        omega: 2.6,
        gap: 0.0,
        stop: Stop::Rigid { restitution: 0.8 },
    };
    let swept = Swept::of(&Case::from(oscillator), &["omega=2.64:2.665:6"], |_| {});
    for (k, period) in swept.column("period").iter().enumerate() {
        let omega = 2.64 + 0.005 * k as f64;
        let expected = if omega < 2.653_347_7 { 1.0 } else { 2.0 };
        assert_eq!(*period, expected, "{omega}");
    }
}

#[test]
fn pictures_are_drawn() {
    let swept = Swept::of(&paper(2.6, 0.1), &["omega=2.5:3:40"], |o| {
        o.follow = Follow::Both;
    });
    let svg = figure(&swept.store).unwrap().to_svg().unwrap();
    for word in ["chaotic", "period 1", "following up", "following down"] {
        assert!(svg.contains(word), "{word}");
    }
}

#[test]
fn invalid_sweeps_are_refused_before_any_computation() {
    let subject = paper(2.6, 0.1);
    let refused = |over: &[&str], change: &dyn Fn(&mut SweepOptions)| -> String {
        let mut options = SweepOptions::over(over.iter().copied());
        change(&mut options);
        Sweep::new(&subject, options).unwrap_err().to_string()
    };
    let omega = || &["omega=2:4:10"];
    let keep = |_: &mut SweepOptions| {};
    for (message, word) in [
        (refused(&[], &keep), "one or two"),
        (refused(&["omega=2:3:2", "omega=3:4:2"], &keep), "twice"),
        (
            refused(&["omega=2:3:2", "alpha1=0:1:2", "alpha2=0:1:2"], &keep),
            "one or two",
        ),
        (refused(&["alpha4=-5:5:3"], &keep), "alpha4 = -5"),
        (refused(&["omega=0:4:3"], &keep), "`omega` = 0"),
        (refused(omega(), &|o| o.periods = 0), "0 periods"),
        (refused(omega(), &|o| o.max_period = 0), "longest period"),
        (refused(omega(), &|o| o.starts = Some(0)), "0 starts"),
        (
            refused(omega(), &|o| o.state = Some(vec![0.0; 5].into())),
            "5 numbers where 6",
        ),
        (
            refused(omega(), &|o| o.state = Some(vec![f64::NAN; 6].into())),
            "finite",
        ),
        (
            refused(omega(), &|o| {
                o.starts = Some(2);
                o.sides = [("a4", 0.0, 1.0)].into_iter().collect();
            }),
            "a1, a2, a3",
        ),
        (
            refused(&["modes=1:3:3"], &|o| {
                o.state = Some(vec![0.0; 6].into());
            }),
            "number of modes",
        ),
        (refused(omega(), &|o| o.periods = 1 << 40), "too many"),
        (refused(omega(), &|o| o.periods = 90_000_000), "GiB"),
        (
            refused(&["omega=2:4:100000"], &|o| {
                o.follow = Follow::Up;
                o.periods = 10_000;
            }),
            "followed line",
        ),
    ] {
        assert!(message.contains(word), "{word}: {message}");
    }
    let many = refused(omega(), &|o| o.starts = Some(usize::MAX));
    assert!(many.contains("too many"), "{many}");
}

/// Pressed onto a rigid stop by more than the drive takes off, k·|gap| > F, a mass rests on it, and
/// else it bounces: at each gap of a sweep as alone, at gaps below and above zero.
#[test]
fn a_sweep_passes_from_rest_on_a_stop_to_impacts() {
    let oscillator = |gap: f64| Oscillator {
        mass: 1.0,
        stiffness: 1.0,
        damping: 0.1,
        forcing: 0.6,
        omega: 1.3,
        gap,
        stop: Stop::Rigid { restitution: 0.8 },
    };
    let swept = Swept::of(
        &Case::from(oscillator(-1.0)),
        &["gap=-1:0.5:4"],
        |options| {
            options.periods = 400;
        },
    );
    let amplitudes = swept.column("first_harmonic");
    for (k, found) in amplitudes.into_iter().enumerate() {
        let gap = -1.0 + 0.5 * k as f64;
        let case = Case::from(oscillator(gap));
        let alone = nanotap::study::orbit::orbit(&case.model().unwrap(), &OrbitOptions::default());
        let alone = alone.unwrap().observables.first_harmonic;
        assert!((found - alone).abs() < 1e-9, "{gap}: {found} {alone}");
        assert_eq!(found < 1e-12, gap <= -0.6, "{gap}");
    }
}
