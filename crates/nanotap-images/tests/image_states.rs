//! States of images that scans computed, with noise, and of a published image.

#[path = "../../afm-files/tests/published/mod.rs"]
mod published;

use std::sync::LazyLock;

use nanotap_arithmetic::{cos, ln};
use nanotap_case::Case;
use nanotap_case::file::Source;
use nanotap_dynamics::Control;
use nanotap_images::image_states::{
    Direction, ImageChannel, ImageData, ImageStatesOptions, ImageStatesReport, ImageStatesStudy,
    Sense,
};
use nanotap_scan::scan::{Interaction, ScanOptions, ScanReport, ScanStudy};
use nanotap_study::Study as _;

/// A lever above two plateaus: at their edges it changes between its two states, and behind the higher one
/// it flies.
const PLATEAUS: &str = include_str!("../../../docs/cases/scan-plateaus.toml");

/// Difference of the distances of the repulsive and the attractive state at this setpoint: docs/cases/scan.md.
const STEP: f64 = -0.305e-9;
/// Lines of the noisy images.
const LINES: usize = 40;

fn case(text: &str) -> Case {
    let source = Source {
        name: "lever.toml".into(),
        text: text.into(),
    };
    Case::parse(Some(source), &[]).unwrap()
}

static SCAN: LazyLock<(Case, ScanReport)> = LazyLock::new(|| {
    let case = case(PLATEAUS);
    let line = ScanOptions {
        lines: Some(1),
        ..ScanOptions::default()
    };
    let scan = ScanStudy::run(&case, &line, &Control::default()).unwrap();
    (case, scan)
});

/// Normal random numbers by Box and Muller, from a linear congruential generator (Knuth's MMIX).
struct Normal(u64);

impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    fn next(&mut self, deviation: f64) -> f64 {
        let radius = (-2.0 * ln(self.uniform())).sqrt();
        deviation * radius * cos(std::f64::consts::TAU * self.uniform())
    }
}

/// The line of the scan, many times, each with noise of height and amplitude (m) and phase (degrees); the
/// phase is measured as `offset` + `sense` · lag.
fn image(scan: &ScanReport, noise: [f64; 3], offset: f64, sense: f64) -> ImageData {
    let mut random = Normal(7);
    let mut channel = |name: &str, unit: &str, row: &[f64], noise: f64| ImageChannel {
        name: name.into(),
        unit: unit.into(),
        size: Some(scan.size),
        rows: (0..LINES)
            .map(|_| row.iter().map(|value| value + random.next(noise)).collect())
            .collect(),
    };
    let trace = &scan.trace;
    let phase: Vec<f64> = trace.phase[0]
        .iter()
        .map(|lag| offset + sense * lag)
        .collect();
    ImageData {
        name: "image".into(),
        channels: vec![
            channel("Height", "m", &trace.height[0], noise[0]),
            channel("Amplitude error", "m", &trace.amplitude_error[0], noise[1]),
            channel("Phase", "deg", &phase, noise[2]),
        ],
        computed: false,
    }
}

fn states(case: &Case, options: &ImageStatesOptions) -> ImageStatesReport {
    ImageStatesStudy::run(case, options, &Control::default()).unwrap()
}

fn given(data: ImageData) -> ImageStatesOptions {
    ImageStatesOptions {
        data,
        phase_offset: Some(0.0),
        sense: Some(Sense::Lag),
        ..ImageStatesOptions::default()
    }
}

/// Whether the lever is steady in a pixel: without noise its phase changes little from and to its neighbours.
fn is_steady(scan: &ScanReport, pixel: usize) -> bool {
    let phase = &scan.trace.phase[0];
    let pixels = pixel.saturating_sub(1)..(pixel + 2).min(phase.len());
    pixels
        .into_iter()
        .all(|near| (phase[near] - phase[pixel]).abs() < 2.0)
}

/// Fractions of all pixels that are right, wrong and undecided, and of the pixels with a steady lever those
/// that are wrong.
fn score(scan: &ScanReport, report: &ImageStatesReport) -> [f64; 4] {
    let mut counts = [[0.0; 3]; 2];
    for line in &report.images.state {
        for (pixel, (found, truth)) in line.iter().zip(&scan.trace.state[0]).enumerate() {
            let truth = match truth {
                Some(Interaction::Attractive) => "attractive",
                Some(Interaction::Repulsive) => "repulsive",
                _ => "free",
            };
            let which = match found.map(|state| report.states[state].name.as_str()) {
                None => 2,
                Some(name) => usize::from(name != truth),
            };
            counts[usize::from(is_steady(scan, pixel))][which] += 1.0;
        }
    }
    let [unsteady, steady] = counts.map(|of| of.iter().sum::<f64>());
    let all = [0, 1, 2].map(|k| (counts[0][k] + counts[1][k]) / (unsteady + steady));
    [all[0], all[1], all[2], counts[1][1] / steady]
}

/// Root mean square of a height against the surface, in the pixels that are decided and have contact.
fn deviation(scan: &ScanReport, report: &ImageStatesReport, height: &[Vec<f64>]) -> f64 {
    let mut apart = Vec::new();
    for (line, states) in height.iter().zip(&report.images.state) {
        for ((z, state), h) in line.iter().zip(states).zip(&scan.trace.surface[0]) {
            if state.is_some_and(|state| report.states[state].distance.is_some()) {
                apart.push(z - h);
            }
        }
    }
    let mean = apart.iter().sum::<f64>() / apart.len() as f64;
    let squares = apart.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    (squares / apart.len() as f64).sqrt()
}

#[test]
fn pixels_of_a_scan_get_the_states_that_it_had() {
    let (case, scan) = &*SCAN;
    for (phase_noise, least) in [
        (0.0, 0.85),
        (1.0, 0.85),
        (3.0, 0.85),
        (6.0, 0.8),
        (12.0, 0.2),
    ] {
        let noise = [20e-12, 20e-12, phase_noise];
        let report = states(case, &given(image(scan, noise, 0.0, 1.0)));
        assert!(report.decided);
        let [right, wrong, undecided, wrong_steady] = score(scan, &report);
        println!(
            "{phase_noise}° of noise: {right} right, {wrong} wrong ({wrong_steady}), {undecided} undecided"
        );
        assert!(
            right > least,
            "{phase_noise}°: {right} right, {undecided} undecided"
        );
        // The confidence where the lever is steady; a pixel in passing may have the phase of another state.
        assert!(wrong_steady < 0.01, "{phase_noise}°: {wrong_steady} wrong");
        assert!(wrong < 0.05, "{phase_noise}°: {wrong} wrong");
        assert!((0.9 * phase_noise..1.3 * phase_noise + 0.3).contains(&report.phase_noise));
        // More than the noise where amplitude and phase change at the edges.
        assert!((18e-12..28e-12).contains(&report.amplitude_noise));
    }
}

#[test]
fn corrected_heights_are_those_of_the_surface() {
    let (case, scan) = &*SCAN;
    let report = states(case, &given(image(scan, [0.0; 3], 0.0, 1.0)));
    assert_eq!(report.step_count, 2 * LINES);
    for step in &report.steps {
        let sign = if step.to == "repulsive" { 1.0 } else { -1.0 };
        assert!((step.height - sign * STEP).abs() < 1e-12, "{step:?}");
    }
    let images = &report.images;
    let [height, corrected] = [&images.height, &images.corrected].map(|of| of.as_ref().unwrap());
    let [before, after] = [height, corrected].map(|of| deviation(scan, &report, of));
    // The surface, without noise, but for pixels over which the lever is not steady.
    assert!(
        after < 0.25 * before,
        "{before:e} m as measured, {after:e} m corrected"
    );

    let only_states = ImageStatesOptions {
        amplitude_error: false,
        ..given(image(scan, [0.0; 3], 0.0, 1.0))
    };
    let report = states(case, &only_states);
    let corrected = report.images.corrected.as_ref().unwrap();
    let reference = report
        .states
        .iter()
        .position(|of| Some(&of.name) == report.reference.as_ref());
    for ((states, heights), own) in report.images.state.iter().zip(height).zip(corrected) {
        for ((state, height), own) in states.iter().zip(heights).zip(own) {
            let is_same =
                *state == reference || state.is_none_or(|of| report.states[of].distance.is_none());
            assert!(
                is_same == (own == height),
                "{state:?}: {height:e} m, {own:e} m"
            );
        }
    }
}

#[test]
fn an_offset_of_the_phase_is_found_where_two_states_are_seen() {
    let (case, scan) = &*SCAN;
    let noise = [20e-12, 20e-12, 1.0];
    for (offset, sense) in [(37.0, Sense::Lag), (-130.0, Sense::Lead)] {
        let sign = if sense == Sense::Lag { 1.0 } else { -1.0 };
        let options = ImageStatesOptions {
            phase_offset: None,
            sense: Some(sense),
            ..given(image(scan, noise, offset, sign))
        };
        let report = states(case, &options);
        assert!(report.decided, "{}", report.verdict);
        let [right, wrong, ..] = score(scan, &report);
        assert!(right > 0.85 && wrong < 0.01, "{right} right, {wrong} wrong");
        let (found, error) = (
            report.phase_offset.unwrap(),
            report.phase_offset_error.unwrap(),
        );
        assert!(
            (found - offset).abs() < 3.0 * error && error < 1.0,
            "{found} ± {error}"
        );
        // Without the sense the two states, at phases symmetric about 90°, may be exchanged.
        let open = ImageStatesOptions {
            sense: None,
            ..options
        };
        let report = states(case, &open);
        assert!(
            !report.decided && report.possible.len() == 2,
            "{}",
            report.verdict
        );
        assert!(report.images.state.iter().flatten().all(Option::is_none));
        let is_true = |of: &nanotap_images::image_states::PossibleAssignment| {
            of.sense == sense && (of.phase_offset - offset).abs() < 3.0
        };
        assert!(report.possible.iter().any(is_true));
    }
}

#[test]
fn one_phase_level_is_undecided_without_its_offset() {
    let (case, scan) = &*SCAN;
    let mut data = image(scan, [20e-12, 20e-12, 0.5], 37.0, 1.0);
    // The lever is attractive in front of the first plateau.
    for row in data.channels.iter_mut().flat_map(|of| &mut of.rows) {
        row.truncate(17);
    }
    let options = ImageStatesOptions {
        phase_offset: None,
        ..given(data)
    };
    let report = states(case, &options);
    assert!(
        !report.decided && report.possible.len() == 2,
        "{}",
        report.verdict
    );
    assert_eq!(report.undecided, 17 * LINES);
    assert_eq!(report.images.corrected, report.images.height);
    let known = ImageStatesOptions {
        phase_offset: Some(37.0),
        ..options
    };
    let report = states(case, &known);
    assert!(report.states[0].name == "attractive" && report.states[0].share > 0.99);
}

#[test]
fn channels_may_be_missing() {
    let (case, scan) = &*SCAN;
    let all = given(image(scan, [20e-12, 20e-12, 0.5], 0.0, 1.0));
    let without = |k: usize| {
        let mut options = all.clone();
        options.data.channels.remove(k);
        states(case, &options)
    };
    let report = without(0);
    assert!(report.images.corrected.is_none() && report.step_count >= 2 * LINES);
    assert!(report.steps.iter().all(|of| of.measured.is_none()));
    let report = without(1);
    let [right, wrong, ..] = score(scan, &report);
    // A phase in passing at an edge may be that of a state: only the amplitude tells.
    assert!(
        report.decided && right > 0.7 && wrong < 0.02,
        "{right} right, {wrong} wrong"
    );
    assert!(report.states.iter().all(|state| state.name != "free"));
    let report = without(2);
    assert!(
        report
            .reason
            .is_some_and(|reason| reason.contains("no phase"))
    );
    assert_eq!(report.undecided, 128 * LINES);
}

#[test]
fn pixels_without_a_number_are_undecided() {
    let (case, scan) = &*SCAN;
    let mut options = given(image(scan, [20e-12, 20e-12, 0.5], 0.0, 1.0));
    let whole = states(case, &options);
    for channel in &mut options.data.channels {
        channel.rows[3][5] = f64::NAN;
    }
    options.data.channels[2].rows[4][6] = f64::NAN;
    let report = states(case, &options);
    let [with, of_whole] = [&report, &whole].map(|of| of.images.state.concat());
    assert!(
        [3 * 128 + 5, 4 * 128 + 6]
            .iter()
            .all(|place| with[*place].is_none())
    );
    assert!(
        [3 * 128 + 5, 4 * 128 + 6]
            .iter()
            .all(|place| of_whole[*place].is_some())
    );
    // The others keep their states, but for pixels at the limit of the confidence.
    let other = with.iter().zip(&of_whole).filter(|(a, b)| a != b);
    assert!(other.count() < 8);
}

#[test]
fn unsuitable_images_are_refused_in_a_sentence() {
    let (case, scan) = &*SCAN;
    let good = given(image(scan, [20e-12, 20e-12, 0.5], 0.0, 1.0));
    let refused = |change: &dyn Fn(&mut ImageStatesOptions)| {
        let mut options = good.clone();
        change(&mut options);
        let error = ImageStatesStudy::run(case, &options, &Control::default()).unwrap_err();
        error.message()
    };
    let message = refused(&|of| of.data.channels[1].unit = "V".into());
    assert_eq!(message, "`Amplitude error` is in V, and a length is needed");
    let message = refused(&|of| of.data.channels[2].unit = "m".into());
    assert_eq!(message, "`Phase` is in m, and an angle is needed");
    let message = refused(&|of| of.data.channels[2].rows.truncate(3));
    assert_eq!(message, "`Height` has 128 by 40 pixels, `Phase` 128 by 3");
    let message = refused(&|of| of.data.channels[2].rows[1].truncate(3));
    assert_eq!(message, "image: `Phase` has lines of different lengths");
    let message = refused(&|of| {
        for row in &mut of.data.channels[2].rows {
            row.fill(90.0);
        }
    });
    assert_eq!(
        message,
        "`Phase` is the same in all pixels: it was not measured"
    );
    let message = refused(&|of| {
        for row in &mut of.data.channels[0].rows {
            row.fill(f64::NAN);
        }
    });
    assert_eq!(message, "`Height` has no numbers");
    let message = refused(&|of| of.phase = Some("depth".into()));
    assert_eq!(message, "image: there is no channel `depth`");
    let message = refused(&|of| of.data.channels.clear());
    assert_eq!(message, "there is no image");
    let message = refused(&|of| of.setpoint = Some("1 nN".into()));
    assert_eq!(message, "the setpoint is not an amplitude");
    // With its factor a voltage is an amplitude.
    let mut volts = good.clone();
    volts.data.channels[1].unit = "V".into();
    for value in volts.data.channels[1].rows.iter_mut().flatten() {
        *value /= 50e-9;
    }
    volts.convert = vec!["Amplitude error=50 nm/V".into()];
    let [found, of_good] = [&volts, &good].map(|of| states(case, of));
    assert_eq!(found.images.state, of_good.images.state);
}

/// An image of DNA, published with AFMReader, whose lever is not known. The case is one with two states at
/// its amplitudes: either explains the whole image, with another zero of the phase.
#[test]
fn a_published_image_with_one_phase_level_is_undecided() {
    let Some(package) = published::package("afmreader", "0.0.7") else {
        println!("skipped: the package cannot be downloaded");
        return;
    };
    let path = package.join("tests/resources/sample_0.jpk");
    let data = ImageData::read(&[&path]).unwrap();
    let lever = PLATEAUS.replace("\"10 nm\"\n\n[tip]", "\"27 nm\"\n\n[tip]");
    let case = case(&lever.replace("radius = \"20 nm\"", "radius = \"40 nm\""));
    let options = ImageStatesOptions {
        data,
        setpoint: Some("25.85 nm".into()),
        ..ImageStatesOptions::default()
    };
    for direction in [Direction::Trace, Direction::Retrace] {
        let options = ImageStatesOptions {
            direction,
            ..options.clone()
        };
        let report = states(&case, &options);
        assert_eq!(report.shape, [256; 2]);
        let name = if direction == Direction::Trace {
            "phase trace"
        } else {
            "phase retrace"
        };
        assert_eq!(report.phase_channel.as_deref(), Some(name));
        assert!(
            !report.decided && report.possible.len() >= 2,
            "{}",
            report.verdict
        );
        assert!(report.possible.iter().all(|of| of.explained > 0.95));
        assert_eq!(report.undecided, 256 * 256);
    }
}

/// A flat line above the sample of the plateaus, with another material between 300 nm and 700 nm.
fn two_materials(keys: &str) -> (Case, ScanReport) {
    let (flat, _) = PLATEAUS.split_once("surface = [").unwrap();
    let material = format!("[[scan.material]]\nfrom = \"300 nm\"\nto = \"700 nm\"\n{keys}\n");
    let case = case(&format!("{flat}{material}"));
    let line = ScanOptions {
        lines: Some(1),
        ..ScanOptions::default()
    };
    let scan = ScanStudy::run(&case, &line, &Control::default()).unwrap();
    (case, scan)
}

/// Fractions of the pixels with a steady lever that have the material and the state which the scan had
/// there, another one, and none.
fn materials_score(scan: &ScanReport, report: &ImageStatesReport) -> [f64; 3] {
    let mut counts = [0.0; 3];
    for line in &report.images.state {
        let points = line.len();
        for (pixel, found) in line.iter().enumerate().filter(|(k, _)| is_steady(scan, *k)) {
            let x = (pixel as f64 + 0.5) * scan.size[0] / points as f64;
            let material = if (300e-9..700e-9).contains(&x) { 2 } else { 1 };
            let state = match scan.trace.state[0][pixel] {
                Some(Interaction::Attractive) => "attractive",
                _ => "repulsive",
            };
            counts[match found.map(|state| &report.states[state]) {
                None => 2,
                Some(of) => {
                    usize::from(of.material != Some(material) || !of.name.starts_with(state))
                }
            }] += 1.0;
        }
    }
    let all: f64 = counts.iter().sum();
    counts.map(|count| count / all)
}

/// A material that dissipates has another phase: each pixel gets its material and its state.
#[test]
fn pixels_get_the_material_that_the_tip_was_above() {
    let lossy = "law = \"dmt + exponential-damping\"\ndamping = \"4e-6 N s/m\"\n\
                 decay_length = \"0.3 nm\"";
    let (case, scan) = two_materials(lossy);
    let options = ImageStatesOptions {
        materials: true,
        ..given(image(&scan, [20e-12, 20e-12, 1.0], 0.0, 1.0))
    };
    let report = states(&case, &options);
    let [right, wrong, undecided] = materials_score(&scan, &report);
    println!("{right} right, {wrong} wrong, {undecided} undecided");
    assert!(right > 0.9 && wrong < 0.01, "{right} {wrong} {undecided}");
    // Without its states the pixels above the second material fit nothing.
    let alone = ImageStatesOptions {
        materials: false,
        ..options
    };
    assert!(states(&case, &alone).undecided > 2 * report.undecided);
}

/// Without loss the phase follows from the amplitude alone, sin φ = A/A0, whatever the material: two
/// states explain a pixel, and it is undecided.
#[test]
fn materials_without_loss_cannot_be_told_apart() {
    let (case, scan) = two_materials("modulus = \"20 GPa\"");
    let options = ImageStatesOptions {
        materials: true,
        ..given(image(&scan, [20e-12, 20e-12, 0.3], 0.0, 1.0))
    };
    let [right, wrong, undecided] = materials_score(&scan, &states(&case, &options));
    assert!(undecided > 0.99, "{right} {wrong} {undecided}");
}
