//! Published thermal spectra of two makers.
//!
//! The files are not part of this repository. One test downloads the source package in which its file is
//! published, once, and is skipped with a message where that fails. The file that no package has is
//! looked for in the folder that `AFM_FILES_SAMPLES` names.

#[path = "../../afm-files/tests/published/mod.rs"]
mod published;

use std::fs;
use std::path::{Path, PathBuf};

use afm_thermal::{
    Average, Calibration, Density, Fluid, ModeFactor, Options, Plan, Sensitivity, Spectrum, Unit,
    Warning, calibrate,
};
use published::package;

#[expect(clippy::disallowed_methods, reason = "files of a package end")]
fn spectra(path: &Path) -> Option<Vec<afm_files::Spectrum>> {
    let bytes = fs::read(path).ok()?;
    Some(afm_files::read(bytes).expect("a readable file").spectra)
}

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found / expected - 1.0).abs() < tolerance,
        "{found}, expected {expected}"
    );
}

fn report(name: &str, calibration: &Calibration) {
    let [k, q] = [calibration.stiffness.unwrap(), calibration.quality].map(|of| of.interval);
    println!("{name}: k {k:?} N/m, Q {q:?}");
    for warning in &calibration.warnings {
        println!("    {warning}");
    }
}

/// Nanosurf's example: 1000 averages of amplitudes. An independent fit in Python by the same
/// likelihood gave f0 = 179.716 kHz, Q = 385.7 and m = 3.99e-22 m² from 150 to 210 kHz, and found that
/// the resonance drifted.
#[test]
fn a_lever_in_air_of_nanosurf() {
    let path = package("nsfopen", "2.2.4");
    let path = path.map(|of| of.join("NSFopen/example/Spring_Constant/thermal.nid"));
    let Some(spectra) = path.and_then(|of| spectra(&of)) else {
        println!("skipped: the package nsfopen 2.2.4 cannot be downloaded");
        return;
    };
    let of = |average| {
        let file = &spectra[0];
        assert_eq!(file.unit, "m/sqrt(Hz)");
        Spectrum::new(
            &file.frequency,
            &file.values,
            Density::Amplitude,
            Unit::Metre,
        )
        .and_then(|of| of.with_averages(1000.0, average))
        .unwrap()
    };
    let options = Options {
        temperature: 313.15,
        range: Some([150e3, 210e3]),
        ..Options::default()
    };
    let powers = calibrate(&of(Average::Powers), &options).unwrap();
    report("Nanosurf, as powers", &powers);
    close(powers.frequency.value, 179.716e3, 1e-5);
    close(powers.quality.value, 385.7, 2e-3);
    close(powers.mean_square.value, 3.99e-22, 3e-3);
    let amplitudes = calibrate(&of(Average::Amplitudes), &options).unwrap();
    report("Nanosurf, as amplitudes", &amplitudes);
    // π/4, and the smaller part of it that 1000 averages restore.
    let quarter = std::f64::consts::FRAC_PI_4;
    let deficit = quarter + (1.0 - quarter) / 1000.0;
    close(
        powers.mean_square.value / amplitudes.mean_square.value,
        deficit,
        1e-6,
    );
    close(amplitudes.stiffness.unwrap().value, 6.96, 3e-3);
    let warns = |calibration: &Calibration, about: fn(&Warning) -> bool| {
        calibration.warnings.iter().any(about)
    };
    let looks_like_amplitudes = |of: &Warning| matches!(of, Warning::LooksLikeAmplitudes { .. });
    assert!(warns(&powers, looks_like_amplitudes));
    assert!(!warns(&amplitudes, looks_like_amplitudes));
    assert!(warns(&amplitudes, |of| matches!(of, Warning::Drift { .. })));
    // The drift makes the maker's 442 from a fit of amplitudes as good as 386.
    assert!(amplitudes.scatter.is_misfit && amplitudes.quality.relative_error > 0.02);
}

/// JPK's average in water. Independent fits in Python by the same likelihood gave, from 8 to 60 kHz,
/// f0 = 25.14 kHz, Q = 1.870 and k_B T/m = 48.66 mN/m with a spread over ranges of 1.4 %; of the last
/// periodogram 0.9 k_B T/m = 42.4 ± 0.9 mN/m.
#[test]
fn a_lever_in_water_of_jpk() {
    const FILE: &str = "PFQNM-H2O-thermal-noise-data_vDeflection_2022.01.12-11.37.51.tnd";
    let folder = std::env::var_os("AFM_FILES_SAMPLES").map(PathBuf::from);
    let Some(spectra) = folder.and_then(|of| spectra(&of.join(FILE))) else {
        println!("skipped: AFM_FILES_SAMPLES names no folder with {FILE}");
        return;
    };
    let of = |name: &str| {
        let file = spectra.iter().find(|of| of.name == name).unwrap();
        Spectrum::new(&file.frequency, &file.values, Density::Power, Unit::Volt).unwrap()
    };
    let options = Options {
        range: Some([8e3, 60e3]),
        factor: ModeFactor::of_product(0.9).unwrap(),
        sensitivity: Some(Sensitivity {
            value: 11.0399e-9,
            relative_error: 0.0,
        }),
        plan: Some(Plan {
            length: 54e-6,
            width: 4.5e-6,
        }),
        fluid: Some(Fluid::water(298.15).unwrap()),
        ..Options::default()
    };
    let average = calibrate(&of("average"), &options).unwrap();
    report("JPK, average", &average);
    close(average.frequency.value, 25.14e3, 4e-4);
    close(average.quality.value, 1.870, 1e-3);
    close(average.stiffness.unwrap().value, 0.9 * 48.66e-3, 1e-3);
    assert!(average.scatter.is_misfit);
    let [low, high] = average.stiffness.unwrap().interval;
    assert!(
        low < 42.4e-3 && 45.8785e-3 < high,
        "{low} to {high}: the maker's k, and that of one periodogram"
    );
    let last = of("Vertical Deflection")
        .with_averages(1.0, Average::Powers)
        .unwrap();
    let last = calibrate(&last, &options).unwrap();
    report("JPK, one periodogram", &last);
    close(last.stiffness.unwrap().value, 42.4e-3, 2e-3);
    close(last.stiffness.unwrap().relative_error, 0.9 / 42.4, 0.03);
    assert!(!last.scatter.is_misfit && last.warnings.is_empty());
    // Without a range.
    let open = Options {
        range: None,
        ..options
    };
    let open = calibrate(&of("average"), &open).unwrap();
    report("JPK, average, default range", &open);
    close(open.stiffness.unwrap().value, 44e-3, 0.02);
}
