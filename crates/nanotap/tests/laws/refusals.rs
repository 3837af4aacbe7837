//! Invalid cases with a nonlinear law.

use nanotap::case::Case;

use crate::common::{DMT, HERTZ};

fn refused(words: &[&str]) -> String {
    let lever = [
        "cantilever.k=1 N/m",
        "cantilever.f0=100 kHz",
        "cantilever.Q=200",
        "tip.radius=5 nm",
        "drive.frequency=100 kHz",
        "drive.free_amplitude=20 nm",
        "gap.tip=18 nm",
    ];
    let words: Vec<String> = lever.iter().chain(words).map(|&w| w.to_owned()).collect();
    Case::parse(None, &words).unwrap_err().to_string()
}

#[test]
fn adhesion_is_stated_once() {
    let twice: Vec<&str> = DMT
        .into_iter()
        .chain(["sample.adhesion_force=1 nN"])
        .collect();
    let said = refused(&twice);
    assert!(said.contains("cannot both be given"), "{said}");
    let summed = refused(&[
        "sample.law=dmt + van-der-waals",
        "sample.modulus=1 GPa",
        "sample.hamaker=3e-20 J",
    ]);
    assert!(
        summed.contains("adhesion would be counted twice"),
        "{summed}"
    );
}

#[test]
fn keys_that_a_law_does_not_use_are_refused() {
    let said = refused(&[
        "sample.law=hertz",
        "sample.modulus=1 GPa",
        "sample.indentation=1 nm",
    ]);
    assert!(
        said.contains("sample.indentation") && said.contains("is not a parameter of"),
        "{said}"
    );
    let said = refused(&["sample.stiffness=1 N/m", "sample.hamaker=1e-20 J"]);
    assert!(said.contains("nonlinear"), "{said}");
    let said = refused(&["sample.law=dtm"]);
    assert!(said.contains("dtm") && said.contains("dmt"), "{said}");
    let said = refused(&["sample.law=jkr", "sample.modulus=1 GPa"]);
    assert!(said.contains("work_of_adhesion is missing"), "{said}");
}

/// F = HR/(6a0²) = 2πRw of DMT, 3/2 πRw of JKR.
#[test]
fn the_three_ways_to_state_adhesion_agree() {
    let lever = crate::common::air;
    let of = |words: &[&str]| {
        let case = lever(20.0, 18.0, words);
        let law = case.cantilever().unwrap().law.clone().unwrap();
        law.values().to_vec()
    };
    let hamaker = of(&DMT);
    let mut by_force = DMT;
    by_force[5] = "sample.adhesion_force=0.875319491613739 nN";
    for (a, b) in hamaker.iter().zip(of(&by_force)) {
        assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
    }
    let jkr = |adhesion: &'static str| {
        let mut words = DMT;
        words[0] = "sample.law=jkr";
        words[5] = adhesion;
        of(&words)
    };
    let work = jkr("sample.work_of_adhesion=30 mJ/m^2");
    let force = jkr("sample.adhesion_force=0.7068583470577 nN");
    for (a, b) in work.iter().zip(force) {
        assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
    }
}

/// On soft rubber the indentation exceeds the tip radius; on a thin film χ = √(Rδ)/h exceeds 1: the
/// motion reports this, with the number.
#[test]
fn a_motion_reports_that_it_leaves_the_range_of_its_law() {
    use nanotap::study::orbit::{OrbitOptions, orbit};
    let beyond = |words: &[&str]| {
        let case = crate::common::air(15.0, 7.5, words);
        let found = orbit(&case.model().unwrap(), &OrbitOptions::default()).unwrap();
        let depth = found.observables.indentation * case.physical().unwrap().scales.length;
        (found.out_of_range, depth)
    };
    let mut soft = HERTZ;
    soft[1] = "sample.modulus=1 MPa";
    let (found, depth) = beyond(&soft);
    assert_eq!(
        (found.len(), found[0].ratio, found[0].limit),
        (1, "δ/R", 1.0)
    );
    assert!((found[0].value / (depth / 5e-9) - 1.0).abs() < 1e-9);
    assert!(
        found[0]
            .to_string()
            .contains(&format!("δ/R reaches {:.3}", found[0].value))
    );
    assert!(beyond(&HERTZ).0.is_empty());
    let film: Vec<&str> = ["sample.law=thin-sphere", "sample.thickness=1 nm"]
        .into_iter()
        .chain([HERTZ[1], HERTZ[5]])
        .collect();
    let (found, depth) = beyond(&film);
    let ratio = (5e-9 * depth).sqrt() / 1e-9;
    assert!(
        found
            .iter()
            .any(|r| r.ratio == "χ" && (r.value / ratio - 1.0).abs() < 1e-9)
    );
}

#[test]
fn a_tip_below_atomic_size_has_a_warning() {
    let mut words = DMT.to_vec();
    words.push("tip.radius=0.16 nm");
    let case = crate::common::air(20.0, 18.0, &words);
    let said = case.remarks().into_iter().map(|remark| remark.text);
    let said: Vec<String> = said
        .filter(|text| text.contains("intermolecular"))
        .collect();
    assert!(
        said.iter()
            .any(|text| text.contains("160 pm") && text.contains("169 pm")),
        "{said:?}"
    );
}

/// A lever softer than the attraction at rest snaps in: the gradient of H R/(6d²) exceeds the
/// lever's stiffness at d³ = HR/(3k). Outside there are two stable rest positions and an unstable
/// one between them; near the sample there is only contact.
#[test]
fn the_static_snap_in_is_found() {
    use nanotap::case::document::equilibria;
    let (hamaker, radius, k) = (3e-20_f64, 5e-9_f64, 0.02_f64);
    let snap = (hamaker * radius / (3.0 * k)).cbrt();
    let at = |gap: f64| {
        equilibria(&crate::common::lever(
            (k, 200.0, "20 kHz"),
            (1.0, gap),
            &DMT,
        ))
    };
    let far = at(3.0);
    let stable: Vec<(bool, bool)> = far.iter().map(|e| (e.stable, e.contact)).collect();
    assert_eq!(stable, [(true, false), (false, false), (true, true)]);
    let scale = {
        let case = crate::common::lever((k, 200.0, "20 kHz"), (1.0, 3.0), &DMT);
        case.physical().unwrap().scales.length
    };
    // The unstable rest position is nearer than the distance where the gradient equals the lever's
    // stiffness.
    assert!(far[0].gap * scale > snap && far[1].gap * scale < snap);
    // k (d − rest) = F(d).
    for state in &far[..2] {
        let d = state.gap * scale;
        let balance = k * (3e-9 - d) - hamaker * radius / (6.0 * d * d);
        assert!(balance.abs() < 1e-9 * k * 3e-9, "{balance}");
    }
    let near = at(1.0);
    assert!(
        near.iter().all(|e| e.contact) && near.iter().any(|e| e.stable),
        "{near:?}"
    );
}

/// What an ac voltage excludes says so.
#[test]
fn studies_of_a_steady_force_refuse_an_ac_voltage() {
    let source = nanotap::case::file::Source {
        name: "kelvin-probe.toml".into(),
        text: include_str!("../../../../docs/cases/kelvin-probe.toml").into(),
    };
    let case = Case::parse(Some(source), &[]).unwrap();
    for name in ["noise", "bimodal", "force-curve"] {
        let study = nanotap::study::registry::study(name).unwrap();
        let request = serde_json::json!({});
        let refused = study.document(&case, request, &nanotap::control::Control::default());
        let said = refused.unwrap_err().to_string();
        assert!(said.contains("ac voltage"), "{name}: {said}");
    }
    // At rest the force is its mean over the voltage's period, (U − U_c)² + V²/2 in place of the square.
    let rest = case.model().unwrap().equilibria()[0];
    let [radius, distance] = [20e-9, 15e-9];
    let strength = -std::f64::consts::PI * 8.854_187_812_8e-12 * radius * radius;
    let expected = strength * (0.16 + 0.5) / (distance * (distance + radius));
    let attraction = -1e-19 * radius / (6.0 * distance * distance);
    let found = rest.force * case.physical().unwrap().scales.force;
    assert!(
        (found / (expected + attraction) - 1.0).abs() < 1e-2,
        "{found} {expected} {attraction}"
    );
}
