//! What a case with a nonlinear law may not say.

use nanotap::case::Case;

use crate::common::DMT;

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
fn adhesion_is_said_once() {
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
fn what_a_law_does_not_take_is_refused() {
    let said = refused(&[
        "sample.law=hertz",
        "sample.modulus=1 GPa",
        "sample.indentation=1 nm",
    ]);
    assert!(
        said.contains("sample.indentation") && said.contains("no part of"),
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
fn the_three_ways_to_say_adhesion_agree() {
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
