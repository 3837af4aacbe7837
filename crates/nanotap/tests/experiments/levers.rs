//! Levers of the catalogue compared at a setpoint.

use std::f64::consts::{PI, TAU};

use nanotap::case::Case;
use nanotap::case::physical::Catalogue;
use nanotap::control::Control;
use nanotap::study::Study as _;
use nanotap::study::lever::{
    LeverOptions, LeverReport, LeverStudy, QualityFactor, QualityFactorSource,
};
use nanotap::study::target::Targets;

/// Q of a PPP-FM (225 × 28 µm, 2.8 N/m, 75 kHz in vacuum) in air of 1.204 kg/m³ and 18.2 µPa s: Sader
/// (1998), equations 14 and 16, with SciPy's Bessel functions.
const SADER_IN_AIR: f64 = 240.448;

/// A lever of one mode over a soft sample, with these changes.
fn soft(changes: &[&str]) -> Case {
    let file = std::path::Path::new("../../docs/cases/force-limit-soft.toml");
    let changes: Vec<String> = changes.iter().map(|change| (*change).to_owned()).collect();
    Case::load(Some(file), &changes, &Catalogue::shared()).unwrap()
}

fn compared(case: &Case, options: &LeverOptions) -> LeverReport {
    LeverStudy::run(case, options, &Control::default()).unwrap()
}

/// These levers with the quality factor of the case.
fn named(levers: &[&str]) -> LeverOptions {
    LeverOptions {
        quality_factor: QualityFactor::Case,
        levers: levers.iter().map(|name| (*name).to_owned()).collect(),
        ..LeverOptions::default()
    }
}

/// First harmonic, phase lag in degrees and largest force of a point mass over a Hertzian sample at
/// `distance` after 1500 periods from rest, by Runge and Kutta's method with 400 steps a period.
fn point_mass(stiffness: f64, quality: f64, radius: f64, distance: f64) -> [f64; 3] {
    const STEPS: usize = 400;
    const PERIODS: usize = 1500;
    let free = 20e-9;
    // The sample and the tip of force-limit-soft.toml, silicon with 130 GPa and 0.27.
    let compliance = (1.0 - 0.49 * 0.49) / 20e6 + (1.0 - 0.27 * 0.27) / 130e9;
    let force = |x: f64| {
        let depth = (-distance - x).max(0.0);
        4.0 / 3.0 / compliance * (radius * depth * depth * depth).sqrt()
    };
    let rate = |t: f64, [x, v]: [f64; 2]| {
        let drive = free / quality * t.cos();
        [v, -x - v / quality + drive + force(x) / stiffness]
    };
    let h = TAU / STEPS as f64;
    let moved = |[x, v]: [f64; 2], [dx, dv]: [f64; 2], h: f64| [x + h * dx, v + h * dv];
    let mut state = [0.0; 2];
    let (mut cosine, mut sine, mut largest) = (0.0, 0.0, 0.0_f64);
    for step in 0..PERIODS * STEPS {
        let t = h * (step % STEPS) as f64;
        let a = rate(t, state);
        let b = rate(t + h / 2.0, moved(state, a, h / 2.0));
        let c = rate(t + h / 2.0, moved(state, b, h / 2.0));
        let d = rate(t + h, moved(state, c, h));
        let mean = [0, 1].map(|k| (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]) / 6.0);
        state = moved(state, mean, h);
        if step >= (PERIODS - 1) * STEPS {
            cosine += 2.0 / STEPS as f64 * state[0] * (t + h).cos();
            sine += 2.0 / STEPS as f64 * state[0] * (t + h).sin();
            largest = largest.max(force(state[0]));
        }
    }
    let phase = sine.atan2(cosine).to_degrees();
    [cosine.hypot(sine), phase, largest]
}

/// A point mass with the stiffness of the first mode, 12/1.875104⁴ of which is the static one,
/// moves alike at the distance that was found. Without dissipation in the sample the drive's work
/// is that of the damping: sin φ = A/A0 at resonance.
#[test]
fn each_lever_moves_as_a_point_mass_of_its_own() {
    let first_mode = 1.875_104_069_f64.powi(4) / 12.0;
    let report = compared(&soft(&[]), &named(&["PPP-FM", "AC240TS"]));
    assert!((report.free_amplitude - 20e-9).abs() < 1e-20);
    assert_eq!(report.quality_factor_source, QualityFactorSource::Case);
    // Nominal values of the makers.
    let levers = [("AC240TS", 2.0, 70e3, 7e-9), ("PPP-FM", 2.8, 75e3, 8e-9)];
    assert_eq!(report.levers.len(), levers.len());
    for (row, (name, k, f0, radius)) in report.levers.iter().zip(levers) {
        assert_eq!((row.lever.as_str(), row.holds), (name, None));
        assert_eq!((row.k, row.f0, row.quality_factor), (k, f0, 200.0));
        assert_eq!(row.tip_radius, Some(radius));
        assert!((row.time_constant * PI * f0 / 200.0 - 1.0).abs() < 1e-12);
        let motion = row.motion.as_ref().unwrap();
        assert_eq!((motion.states, motion.regime), (1, "repulsive"));
        let seen = &motion.physical.observables;
        let [amplitude, phase, force] = point_mass(first_mode * k, 200.0, radius, motion.distance);
        assert!((amplitude / 16e-9 - 1.0).abs() < 1e-5, "{amplitude}");
        assert!((seen.first_harmonic / 16e-9 - 1.0).abs() < 1e-9);
        // The largest force is between two steps.
        assert!((force / seen.peak_force - 1.0).abs() < 1e-3, "{force}");
        assert!((phase - 0.8_f64.asin().to_degrees()).abs() < 1e-2);
        assert!((seen.phase - 0.8_f64.asin().to_degrees()).abs() < 1e-2);
    }
}

/// Levers for which the conditions hold come first, the softest touch first; a lever that does not
/// reach the setpoint holds none and has the reason.
#[test]
fn conditions_choose_levers() {
    let options = LeverOptions {
        targets: Targets(vec!["F_max < 1 nN".to_owned(), "states = 1".to_owned()]),
        ..named(&["PPP-NCHR", "SSS-NCHR", "PPP-CONT", "fm"])
    };
    let report = compared(&soft(&[]), &options);
    let found: Vec<(&str, Option<bool>)> = report
        .levers
        .iter()
        .map(|row| (row.lever.as_str(), row.holds))
        .collect();
    let expected = [
        ("PPP-CONT", Some(true)),
        ("PPP-FM", Some(true)),
        ("PPP-NCHR", Some(false)),
        ("SSS-NCHR", Some(false)),
    ];
    assert_eq!(found, expected);
    let reason = report.levers[3].reason.as_ref().unwrap();
    assert!(reason.contains("is not reached"), "{reason}");
    let force = |row: usize| {
        let motion = report.levers[row].motion.as_ref().unwrap();
        motion.physical.observables.peak_force
    };
    assert!(force(0) < force(1) && force(1) < 1e-9 && force(2) > 1e-9);
    // The whole catalogue when none is named, the case's own lever among them.
    let all = Catalogue::shared().levers().count();
    let options = LeverOptions {
        targets: options.targets,
        ..named(&[])
    };
    let report = compared(&soft(&["drive.setpoint=0.95"]), &options);
    assert_eq!(report.levers.len(), all);
}

/// Q of the PPP-FM (225 × 28 × 3 µm, 2.8 N/m, 75 kHz) in air and Q in water; its tip when the
/// tip is kept.
#[test]
fn quality_factors_follow_the_medium() {
    // The Q of the case, 200, is about that in air.
    let auto = LeverOptions {
        quality_factor: QualityFactor::Auto,
        ..named(&["PPP-FM", "AC240TS"])
    };
    let report = compared(&soft(&[]), &auto);
    assert_eq!(report.quality_factor_source, QualityFactorSource::Air);
    let row = report
        .levers
        .iter()
        .find(|row| row.lever == "PPP-FM")
        .unwrap();
    assert!(
        (row.quality_factor / SADER_IN_AIR - 1.0).abs() < 1e-4,
        "{}",
        row.quality_factor
    );
    // Its dimensions are not in the catalogue.
    let row = report
        .levers
        .iter()
        .find(|row| row.lever == "AC240TS")
        .unwrap();
    let reason = row.reason.as_ref().unwrap();
    assert!(
        row.motion.is_none() && reason.contains("dimensions"),
        "{reason}"
    );

    // Neither a lever in water nor one in vacuum is like one in air.
    for quality in ["cantilever.Q=5", "cantilever.Q=5000"] {
        let report = compared(&soft(&[quality, "drive.setpoint=0.99"]), &auto);
        assert_eq!(report.quality_factor_source, QualityFactorSource::Case);
    }

    let water = [
        "cantilever.Q=",
        "cantilever.fluid_density=998 kg/m^3",
        "cantilever.fluid_viscosity=1 mPa s",
        "tip.radius=20 nm",
    ];
    let options = LeverOptions {
        keep_tip: true,
        ..named(&["PPP-FM"])
    };
    let report = compared(&soft(&water), &options);
    assert_eq!(report.quality_factor_source, QualityFactorSource::Fluid);
    let row = &report.levers[0];
    assert!(row.quality_factor < 10.0 && row.f0 < 40e3, "{row:?}");
    assert_eq!(row.tip_radius, Some(20e-9));
    assert!((row.quality_factor_in_air.unwrap() / SADER_IN_AIR - 1.0).abs() < 1e-4);
}

/// A stated adhesion force is that of the case's own tip: DMT's and JKR's grow with the radius.
#[test]
fn adhesion_grows_with_the_radius() {
    let sample = |radius: &str, force: &str| {
        soft(&[
            "sample.law=dmt",
            &format!("sample.adhesion_force={force}"),
            &format!("tip.radius={radius}"),
            "drive.setpoint=0.9",
        ])
    };
    let force = |case: &Case| {
        let report = compared(case, &named(&["PPP-FM"]));
        let motion = report.levers[0].motion.as_ref().unwrap();
        motion.physical.observables.peak_force
    };
    let own = force(&sample("8 nm", "0.1 nN"));
    let other = force(&sample("16 nm", "0.2 nN"));
    assert!((other / own - 1.0).abs() < 1e-6, "{own} {other}");
}

#[test]
fn cases_that_cannot_be_compared_are_refused() {
    let refused = |case: &Case, options: &LeverOptions| {
        let result = LeverStudy::run(case, options, &Control::default());
        result.unwrap_err().to_string()
    };
    let unknown = refused(&soft(&[]), &named(&["PPP-XYZ"]));
    assert!(unknown.contains("PPP-XYZ"), "{unknown}");
    let far = soft(&["drive.setpoint=", "gap.tip=20 nm"]);
    let message = refused(&far, &LeverOptions::default());
    assert!(message.contains("setpoint"), "{message}");
    let two = soft(&["drive.second_ratio=6", "drive.second_free_amplitude=1 nm"]);
    let message = refused(&two, &LeverOptions::default());
    assert!(message.contains("one tone"), "{message}");
}
