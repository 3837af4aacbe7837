//! `nanotap fit` of instruments' files without a case: the lever of the header, the tip of an option.
//!
//! Published real files are compared with independent fits of the same rows. They are not part of this
//! repository: each source package is downloaded once, and its files are skipped with a message where
//! that fails.

#[path = "../../../afm-files/tests/published/mod.rs"]
mod published;

use std::f64::consts::FRAC_PI_2;
use std::fmt::Write as _;

use published::package;
use serde_json::Value;

use crate::instrument_files::samples;
use crate::util::Folder;

fn number(of: &Value) -> f64 {
    of.as_f64().unwrap_or_else(|| panic!("{of} is a number"))
}

#[test]
fn moduli_and_contact_points_of_real_curves_are_those_of_independent_fits() {
    let all: Value = serde_json::from_str(include_str!("reference/fits.json")).unwrap();
    let folder = Folder::new();
    let mut failures = String::new();
    for known in all["fits"].as_array().unwrap() {
        let [name, version, path] =
            ["package", "version", "path"].map(|key| known[key].as_str().unwrap());
        let Some(package) = package(name, version) else {
            println!("skipped: the package {name} {version} cannot be downloaded");
            continue;
        };
        let path = package.join(path).display().to_string();
        let curve = known["curve"].to_string();
        let (option, size) = match known["model"].as_str().unwrap() {
            "hertz_para" => ("--tip-radius", format!("{} m", known["tip_radius_m"])),
            model => {
                let mut slope = number(&known["angle_degrees"]).to_radians().tan();
                if model == "hertz_pyr3s" {
                    // The cone with the same force as this three-sided pyramid.
                    slope *= 0.8887 * FRAC_PI_2;
                }
                ("--half-angle", format!("{} deg", slope.atan().to_degrees()))
            }
        };
        let mut arguments = vec!["fit", &path, option, &size, "--json"];
        if option == "--half-angle" {
            arguments.extend(["--laws", "cone"]);
        }
        if path.contains("map") || curve != "0" {
            arguments.extend(["--curve", &curve]);
        }
        let outcome = folder.run(&arguments);
        let document: Value = serde_json::from_str(&outcome.stdout)
            .unwrap_or_else(|error| panic!("{path}: {error}: {}", outcome.stderr));
        let found = &document["force_curves"][0];
        let k = number(&known["k_N_per_m"]);
        let modulus = number(&found["modulus"]["value"]) / number(&known["E_Pa"]);
        // The reference counts the tip's position with the deflection at the baseline.
        let contact = number(&known["contact_point_m"]) - number(&known["baseline_N"]) / k;
        let missed = number(&found["contact_point"]["value"]) - contact;
        let model = &known["model"];
        println!(
            "{path}, curve {curve}, {model}: modulus {modulus:.4}, contact point {missed:.2e} m"
        );
        if (modulus - 1.0).abs() > 0.03 || missed.abs() > 20e-9 {
            writeln!(
                failures,
                "{path}: {modulus} times the modulus, {missed} m off"
            )
            .unwrap();
        }
        assert_eq!(found["distance"], known["distance"], "{path}");
        assert_eq!(found["rows"], known["points"], "{path}");
        assert_eq!(found["segment"], "approach", "{path}");
        assert_eq!(found["spring_constant_from"], "header", "{path}");
        assert!((number(&found["spring_constant"]) / k - 1.0).abs() < 1e-9);
    }
    assert!(failures.is_empty(), "{failures}");
}

#[test]
fn the_worked_case_of_a_map_is_that_of_its_real_file() {
    let Some(package) = package("afmformats", "0.18.7") else {
        println!("skipped: the package afmformats 0.18.7 cannot be downloaded");
        return;
    };
    let folder = Folder::new();
    let file = "tests/data/fmt-jpk-fd_2020.02.07-16.29.05.036.jpk-qi-data";
    let copy = folder.path().join("cells.jpk-qi-data");
    std::fs::copy(package.join(file), copy).unwrap();
    let done = crate::worked_cases::follow_in(&folder, "qi-map.md");
    assert_eq!(done, (3, 16));
}

/// Force curve of a sphere on an elastic half-space, in SI: the lever's base goes down by `travel` from
/// `start` above the contact point and back; height and deflection are counted from `zero` and `offset`.
struct Hertz {
    modulus: f64,
    radius: f64,
    k: f64,
    start: f64,
    travel: f64,
    zero: f64,
    offset: f64,
}

const SOFT: Hertz = Hertz {
    modulus: 5e3,
    radius: 5e-6,
    k: 0.05,
    start: 2e-6,
    travel: 3e-6,
    zero: 147e-6,
    offset: -40e-9,
};

impl Hertz {
    /// The deflection with the base at a height over the contact point: k d = 4/3 E/(1−ν²) √R δ^{3/2},
    /// δ = −height − d, by bisection.
    fn deflection(&self, height: f64) -> f64 {
        let stiffness = 4.0 / 3.0 * self.modulus / 0.75 * self.radius.sqrt();
        let (mut low, mut high) = (0.0, (-height).max(0.0));
        for _ in 0..200 {
            let d = 0.5 * (low + high);
            if self.k * d < stiffness * (-height - d).max(0.0).powf(1.5) {
                low = d;
            } else {
                high = d;
            }
        }
        0.5 * (low + high)
    }

    /// Rows of a table in nm, each way with `count` of them, with noise of 0.2 nm.
    fn rows(&self, count: usize, towards: f64, both: bool) -> Vec<[f64; 2]> {
        let step = self.travel / (count - 1) as f64;
        let down = (0..count).map(|k| self.start - step * k as f64);
        let mut heights: Vec<f64> = down.collect();
        if both {
            let back: Vec<f64> = heights.iter().rev().copied().collect();
            heights.extend(back);
        }
        let noise = |k: usize| 0.35 * (12.9898 * k as f64).sin() * (78.233 * k as f64).cos();
        let row = |(k, height): (usize, f64)| {
            let deflection = self.offset + self.deflection(height);
            [
                1e9 * (self.zero + towards * height),
                1e9 * deflection + noise(k),
            ]
        };
        heights.into_iter().enumerate().map(row).collect()
    }
}

fn csv(header: &str, rows: &[[f64; 2]]) -> String {
    let mut text = format!("{header}\n");
    for [z, d] in rows {
        writeln!(text, "{z:.4},{d:.4}").unwrap();
    }
    text
}

fn fitted(folder: &Folder, arguments: &[&str]) -> Value {
    let all = [&["fit"], arguments, &["--json"]].concat();
    let outcome = folder.run(&all);
    serde_json::from_str(&outcome.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", outcome.stderr))
}

/// The modulus relative to the true one, and how far the contact point is off, in nm.
fn errors(found: &Value, of: &Hertz) -> [f64; 2] {
    let curve = &found["force_curves"][0];
    [
        number(&curve["modulus"]["value"]) / of.modulus - 1.0,
        1e9 * (number(&curve["contact_point"]["value"]) - of.zero),
    ]
}

#[test]
fn an_export_of_a_german_excel_is_fitted() {
    let folder = Folder::new();
    let mut text = "sep=;\r\nGerät: XY;3;5\r\n\r\nHöhe (nm);Biegung (nm)\r\n".to_owned();
    for [z, d] in SOFT.rows(300, 1.0, false) {
        let line = format!("{z:.4};{d:.4}\r\n").replace('.', ",");
        text.push_str(&line);
    }
    text.push_str("1471");
    std::fs::write(folder.path().join("kurve.csv"), text).unwrap();
    let mut arguments = vec!["kurve.csv", "--tip-radius", "5 um"];
    arguments.extend(["--spring-constant", "0.05 N/m"]);
    arguments.extend(["--convert", "Höhe=distance"]);
    arguments.extend(["--convert", "Biegung=deflection"]);
    let found = fitted(&folder, &arguments);
    let [modulus, contact] = errors(&found, &SOFT);
    assert!(modulus.abs() < 0.01 && contact.abs() < 5.0, "{found}");
    assert!(
        found["preparation"].to_string().contains("cut off"),
        "{found}"
    );
}

#[test]
fn any_height_direction_and_baseline_gives_the_modulus() {
    let folder = Folder::new();
    let lever = ["--spring-constant", "0.05 N/m", "--tip-radius", "5 um"];
    // The distance shrinks or grows towards the sample; without a column `direction` the ways are known
    // by the turning point, and the approach is fitted.
    for (name, towards, header) in [
        ("down.csv", 1.0, "height (nm),defl (nm)"),
        ("up.csv", -1.0, "Z (nm),Deflection (nm)"),
    ] {
        folder.write(name, csv(header, &SOFT.rows(800, towards, true)));
        let found = fitted(&folder, &[&[name], &lever[..]].concat());
        let [modulus, contact] = errors(&found, &SOFT);
        assert!(
            modulus.abs() < 0.01 && contact.abs() < 5.0,
            "{name} {modulus} {contact}"
        );
        let curve = &found["force_curves"][0];
        assert_eq!(curve["segment"], "approach");
        assert_eq!(curve["rows"], 800);
        assert!((number(&curve["baseline"]["value"]) + 40e-9).abs() < 1e-10);
        assert_eq!(curve["spring_constant_from"], "case");
    }
    // 100 µm of travel.
    let far = Hertz {
        start: 99e-6,
        travel: 100e-6,
        ..SOFT
    };
    folder.write(
        "far.csv",
        csv("z (nm),defl (nm)", &far.rows(20_000, 1.0, false)),
    );
    let [modulus, contact] = errors(&fitted(&folder, &[&["far.csv"], &lever[..]].concat()), &far);
    assert!(
        modulus.abs() < 0.02 && contact.abs() < 10.0,
        "{modulus} {contact}"
    );
}

#[test]
fn segment_and_range_select_rows() {
    let folder = Folder::new();
    let mut rows = SOFT.rows(800, 1.0, true);
    // A softer way back: only the selected segment gives its modulus.
    let soft = Hertz {
        modulus: 2.5e3,
        ..SOFT
    };
    rows.truncate(800);
    rows.extend(soft.rows(800, 1.0, true).split_off(800));
    folder.write("both.csv", csv("z (nm),defl (nm)", &rows));
    let lever = [
        "both.csv",
        "--spring-constant",
        "0.05 N/m",
        "--tip-radius",
        "5 um",
    ];
    let run = |more: &[&str]| fitted(&folder, &[&lever[..], more].concat());
    for (segment, of) in [("approach", &SOFT), ("retract", &soft)] {
        let found = run(&["--segment", segment]);
        let [modulus, contact] = errors(&found, of);
        assert!(
            modulus.abs() < 0.01 && contact.abs() < 5.0,
            "{segment} {modulus} {contact}"
        );
    }
    let between = number(&run(&["--segment", "both"])["force_curves"][0]["modulus"]["value"]);
    assert!((2.6e3..4.9e3).contains(&between), "{between}");

    // Beyond an indentation of 300 nm the sample is three times as stiff.
    let depth = |row: &[f64; 2]| -(row[0] - 147e3) - (row[1] + 40.0);
    let mut rows = SOFT.rows(1500, 1.0, false);
    let knee = rows.iter().position(|row| depth(row) > 300.0).unwrap();
    let [z, d] = rows[knee];
    for row in &mut rows[knee..] {
        row[1] = d + 0.9 * (z - row[0]);
    }
    folder.write("layer.csv", csv("z (nm),defl (nm)", &rows));
    let lever = [
        "layer.csv",
        "--spring-constant",
        "0.05 N/m",
        "--tip-radius",
        "5 um",
    ];
    let run = |more: &[&str]| errors(&fitted(&folder, &[&lever[..], more].concat()), &SOFT);
    assert!(run(&[])[0].abs() > 0.2);
    for range in [
        "indentation=-2 um:290 nm",
        "rows=1:1180",
        "force=-1 nN:3 nN",
    ] {
        let [modulus, contact] = run(&["--range", range]);
        assert!(
            modulus.abs() < 0.03 && contact.abs() < 10.0,
            "{range} {modulus} {contact}"
        );
    }
    let wrong = [
        "fit",
        "layer.csv",
        "--spring-constant",
        "0.05 N/m",
        "--tip-radius",
        "5 um",
        "--range",
    ];
    for (range, words) in [
        ("depth=1 nm:2 nm", "`depth` has no range"),
        ("force=2 nN:1 nN", "ascending"),
        ("rows=5000:6000", "none of"),
    ] {
        folder
            .run(&[&wrong[..], &[range]].concat())
            .refused(&[words]);
    }
    let segment = ["--segment", "retract"];
    folder
        .run(&[&wrong[..6], &segment[..]].concat())
        .refused(&["--segment", "direction"]);
}

#[test]
fn what_a_file_lacks_is_asked_for() {
    let folder = Folder::new();
    folder.write(
        "a.csv",
        csv("z (nm),defl (nm)", &SOFT.rows(200, 1.0, false)),
    );
    folder
        .run(&["fit", "a.csv", "--tip-radius", "5 um"])
        .refused(&["a.csv", "spring constant", "--spring-constant"]);
    folder
        .run(&["fit", "a.csv", "--spring-constant", "0.05 N/m"])
        .refused(&["a.csv", "radius", "--tip-radius \"40 nm\""]);
    let cone = [
        "fit",
        "a.csv",
        "--spring-constant",
        "0.05 N/m",
        "--laws",
        "cone",
    ];
    folder.run(&cone).refused(&["half angle", "--half-angle"]);
    folder.write("map.jpk-force-map", samples::zip(&samples::jpk_map()));
    folder
        .run(&[
            "fit",
            "map.jpk-force-map",
            "--curve",
            "9",
            "--tip-radius",
            "1 um",
        ])
        .refused(&["map.jpk-force-map", "9"]);
}

#[test]
fn the_header_is_the_lever_unless_the_case_states_another() {
    let folder = Folder::new();
    folder.write("curve.jpk-force", samples::zip(&jpk(&SOFT, 0.05)));
    let found = fitted(&folder, &["curve.jpk-force", "--tip-radius", "5 um"]);
    let curve = &found["force_curves"][0];
    assert_eq!(curve["spring_constant"], 0.05);
    assert_eq!(curve["spring_constant_from"], "header");
    assert_eq!(curve["sensitivity_in_header"], 5e-8);
    assert_eq!(curve["poisson"], 0.5);
    assert_eq!(curve["law"], "hertz");
    let [modulus, contact] = errors(&found, &SOFT);
    assert!(
        modulus.abs() < 0.01 && contact.abs() < 5.0,
        "{modulus} {contact}"
    );
    let assumed = found["preparation"].to_string();
    assert!(
        assumed.contains("Hertz") && assumed.contains("Poisson's ratio"),
        "{assumed}"
    );

    // Twice the stiffness is twice the modulus, and both are shown.
    let arguments = [
        "curve.jpk-force",
        "--tip-radius",
        "5 um",
        "--spring-constant",
        "0.1 N/m",
    ];
    let other = fitted(&folder, &arguments);
    let ratio =
        number(&other["force_curves"][0]["modulus"]["value"]) / number(&curve["modulus"]["value"]);
    assert!((ratio - 2.0).abs() < 0.02, "{ratio}");
    let cautions = other["force_curves"][0]["cautions"].to_string();
    assert!(cautions.contains("50 mN/m"), "{cautions}");

    let text = folder.run(&[
        "fit",
        "curve.jpk-force",
        "--tip-radius",
        "5 um",
        "--plot",
        "a.svg",
    ]);
    for words in [
        "Young's modulus",
        "contact point",
        "measuredHeight",
        "hertz, tip radius 5 µm, Poisson's ratio 0.5",
        "approach, 800 rows",
        "k = 50 mN/m from the file's header; InvOLS 50 nm/V",
    ] {
        assert!(text.stdout.contains(words), "{words} in {}", text.stdout);
    }
    assert!(folder.read("a.svg").contains("residual"));
}

/// Files of a JPK curve with approach and retract: a measured height, which shrinks towards the sample,
/// and a commanded one that spans half as much more.
fn jpk(of: &Hertz, k: f64) -> Vec<(String, Vec<u8>)> {
    let shared = format!(
        "lcd-info.0.encoder.type=signedinteger\nlcd-info.0.encoder.scaling.multiplier=1.0E-6\n\
         lcd-info.0.encoder.scaling.offset=0.0\nlcd-info.0.encoder.scaling.unit.unit=V\n\
         lcd-info.0.conversion-set.conversions.list=distance force\n\
         lcd-info.0.conversion-set.conversions.base=volts\n\
         lcd-info.0.conversion-set.conversion.distance.defined=true\n\
         lcd-info.0.conversion-set.conversion.distance.base-calibration-slot=volts\n\
         lcd-info.0.conversion-set.conversion.distance.scaling.multiplier=5.0E-8\n\
         lcd-info.0.conversion-set.conversion.distance.scaling.unit.unit=m\n\
         lcd-info.0.conversion-set.conversion.force.base-calibration-slot=distance\n\
         lcd-info.0.conversion-set.conversion.force.scaling.multiplier={k}\n\
         lcd-info.0.conversion-set.conversion.force.scaling.unit.unit=N\n\
         lcd-info.1.encoder.type=signedinteger\nlcd-info.1.encoder.scaling.multiplier=1.0E-11\n\
         lcd-info.1.encoder.scaling.unit.unit=m\n\
         lcd-info.1.conversion-set.conversions.list=nominal calibrated\n\
         lcd-info.1.conversion-set.conversions.base=absolute\n\
         lcd-info.1.conversion-set.conversion.nominal.base-calibration-slot=absolute\n\
         lcd-info.1.conversion-set.conversion.nominal.scaling.multiplier=1.0\n\
         lcd-info.1.conversion-set.conversion.nominal.scaling.unit.unit=m\n\
         lcd-info.1.conversion-set.conversion.calibrated.base-calibration-slot=nominal\n\
         lcd-info.1.conversion-set.conversion.calibrated.scaling.multiplier=1.5\n\
         lcd-info.1.conversion-set.conversion.calibrated.scaling.unit.unit=m\n"
    );
    let top = "jpk-data-file=spm-forcefile\ntype=force-scan-series\n";
    let mut files = vec![
        ("header.properties".to_owned(), top.as_bytes().to_vec()),
        (
            "shared-data/header.properties".to_owned(),
            shared.into_bytes(),
        ),
    ];
    let rows = of.rows(800, 1.0, true);
    for (segment, (style, rows)) in ["extend", "retract"]
        .into_iter()
        .zip(rows.chunks(800))
        .enumerate()
    {
        let folder = format!("segments/{segment}/");
        let header = format!(
            "force-segment-header.num-points=800\nforce-segment-header.duration=0.5\n\
             force-segment-header.settings.segment-settings.style={style}\n\
             force-segment-header.settings.segment-settings.num-points=800\n\
             channels.list=vDeflection measuredHeight height\n\
             channel.vDeflection.lcd-info.*=0\nchannel.measuredHeight.lcd-info.*=1\nchannel.height.lcd-info.*=1\n"
        );
        let column = |k: usize, unit: f64| -> Vec<u8> {
            let numbers = rows.iter().map(|row| (row[k] / unit).round() as i32);
            numbers.flat_map(i32::to_be_bytes).collect()
        };
        files.push((
            format!("{folder}segment-header.properties"),
            header.into_bytes(),
        ));
        // 1 µV is 50 fm.
        files.push((format!("{folder}channels/vDeflection.dat"), column(1, 5e-5)));
        for name in ["measuredHeight", "height"] {
            files.push((format!("{folder}channels/{name}.dat"), column(0, 1e-2)));
        }
    }
    files
}
