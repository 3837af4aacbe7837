//! Published real files against the values that an independent reader gets from them.
//!
//! The files are not part of this repository. Each test downloads the source package in which its
//! files are published, once, and is skipped with a message where that fails. Files that no package
//! has are looked for in the folder that `AFM_FILES_SAMPLES` names.

mod published;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use afm_files::{Curve, Document, Error, Image, recognise};
use published::package;
use serde_json::Value;

/// Relative agreement; the reference has 12 digits.
const TOLERANCE: f64 = 1e-9;

fn reference() -> BTreeMap<String, Value> {
    let text = include_str!("reference/files.json");
    let all: Value = serde_json::from_str(text).expect("the reference is JSON");
    serde_json::from_value(all["files"].clone()).expect("files by their names")
}

#[expect(clippy::disallowed_methods, reason = "files of a package end")]
fn bytes_of(path: &Path) -> std::io::Result<Vec<u8>> {
    fs::read(path)
}

/// Compares all files of a package.
fn compare(name: &str, version: &str) {
    let Some(folder) = package(name, version) else {
        println!("skipped: the package {name} {version} cannot be downloaded");
        return;
    };
    let of_package = |of: &Value| of["from"][0][0] == name;
    let mut failures = Vec::new();
    let mut count = 0;
    for (file, expected) in reference().iter().filter(|(_, of)| of_package(of)) {
        let path = folder.join(expected["from"][0][2].as_str().expect("a path"));
        count += 1;
        match bytes_of(&path) {
            Ok(bytes) => check(file, &bytes, expected, &mut failures),
            Err(error) => failures.push(format!("{file}: {error}")),
        }
    }
    assert!(count > 0, "no file of {name}");
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

fn check(file: &str, bytes: &[u8], expected: &Value, failures: &mut Vec<String>) {
    let mut report = |problem: String| failures.push(format!("{file}: {problem}"));
    let format = recognise(bytes).map(|of| serde_json::to_value(of).expect("a name"));
    let known = match expected["format"].as_str() {
        Some("bruker") => Some("nanoscope"),
        Some("nid") => Some("nanosurf"),
        Some("ibw") => Some("igor"),
        Some("gwy") => Some("gwyddion"),
        Some("jpk-tiff") => Some("jpk-image"),
        Some("workshop-map") => Some("zip"),
        Some("ntmdt-text") => Some("nt-mdt-text"),
        Some("tnd") => Some("jpk-thermal"),
        other => other,
    };
    if known.is_some() && format != known.map(Value::from) {
        return report(format!("recognised as {format:?}, expected {known:?}"));
    }
    let has = |key: &str| expected[key].as_array().is_some_and(|of| !of.is_empty());
    let is_afm = (has("curves") || has("images") || has("spectra")) && known != Some("asd");
    let document = match afm_files::read(bytes.to_vec()) {
        Ok(document) if is_afm => document,
        Ok(_) => return report("read, but it is not a recording that is read".to_owned()),
        Err(error) if is_afm => return report(error.to_string()),
        Err(error @ Error::Unsupported { .. }) => return println!("{file}: not read: {error}"),
        Err(error) => return report(format!("its content is not named: {error}")),
    };
    let mut all = Comparison { file, failures };
    all.document(&document, expected);
    println!(
        "{file}: {}, {} curves, {} images, {} spectra",
        document.format,
        document.curve_count(),
        document.images.len(),
        document.spectra.len()
    );
}

/// Collects what differs.
struct Comparison<'a> {
    file: &'a str,
    failures: &'a mut Vec<String>,
}

impl Comparison<'_> {
    #[expect(
        clippy::needless_pass_by_value,
        reason = "most of what is compared is made for it"
    )]
    fn equal<T: PartialEq + std::fmt::Debug>(&mut self, what: &str, found: T, expected: T) {
        if found != expected {
            let line = format!("{}: {what} is {found:?}, expected {expected:?}", self.file);
            self.failures.push(line);
        }
    }

    fn close(&mut self, what: &str, found: Option<f64>, expected: &Value) {
        self.close_to(what, found, expected.as_f64(), 0.0);
    }

    /// Numbers agree relative to the larger of themselves and `scale`.
    fn close_to(&mut self, what: &str, found: Option<f64>, expected: Option<f64>, scale: f64) {
        let agrees = match (found, expected) {
            (Some(a), Some(b)) => (a - b).abs() <= TOLERANCE * a.abs().max(b.abs()).max(scale),
            (None, None) => true,
            _ => false,
        };
        if !agrees {
            let line = format!("{}: {what} is {found:?}, expected {expected:?}", self.file);
            self.failures.push(line);
        }
    }

    fn document(&mut self, document: &Document, expected: &Value) {
        let count = expected["curve_count"].as_u64().unwrap_or(0) as usize;
        self.equal("number of curves", document.curve_count(), count);
        let mut channels = BTreeMap::new();
        let mut curves = Vec::new();
        for (number, curve) in document.curves().enumerate() {
            match curve {
                Ok(curve) => curves.push(curve),
                Err(error) => self
                    .failures
                    .push(format!("{}: curve {number}: {error}", self.file)),
            }
        }
        for curve in &curves {
            for channel in curve.segments.iter().flat_map(|of| &of.channels) {
                channels.insert(channel.name.clone(), channel.unit.clone());
            }
        }
        let known: BTreeMap<String, String> =
            serde_json::from_value(expected["channels"].clone()).unwrap_or_default();
        // Deflections are converted where the sensitivity is known, the reference leaves some in V.
        let is_same = |name: &str, unit: &str| {
            channels.get(name).is_some_and(|of| {
                of == unit || of == "m" && unit == "V" || of == "A" && unit == "nA"
            })
        };
        let differ =
            channels.len() != known.len() || !known.iter().all(|(name, unit)| is_same(name, unit));
        if differ {
            self.equal("channels", &channels, &known);
        }
        for expected in expected["curves"].as_array().into_iter().flatten() {
            let number = expected["number"].as_u64().expect("a number") as usize;
            if let Some(curve) = curves.get(number) {
                self.curve(number, curve, expected);
            }
        }
        if let Some(curve) = curves.first() {
            self.close("k", curve.spring_constant, &expected["k_N_per_m"]);
            self.close("InvOLS", curve.sensitivity, &expected["invols_m_per_V"]);
        }
        let images = expected["images"].as_array().map_or(&[][..], Vec::as_slice);
        self.equal("number of images", document.images.len(), images.len());
        let is_flipped = ["jpk", "jpk-tiff", "ibw"]
            .iter()
            .any(|of| expected["format"] == *of);
        for (image, expected) in document.images.iter().zip(images) {
            self.image(image, expected, is_flipped);
        }
        let spectra = expected["spectra"]
            .as_array()
            .map_or(&[][..], Vec::as_slice);
        self.equal("number of spectra", document.spectra.len(), spectra.len());
        for (spectrum, expected) in document.spectra.iter().zip(spectra) {
            self.equal(
                "unit of a spectrum",
                Some(spectrum.unit.as_str()),
                expected["unit"].as_str(),
            );
            self.equal(
                "points of a spectrum",
                Some(spectrum.values.len() as u64),
                expected["points"].as_u64(),
            );
            let ends = [spectrum.frequency.first(), spectrum.frequency.last()];
            for (k, end) in ends.into_iter().enumerate() {
                self.close(
                    "frequency",
                    end.copied(),
                    &expected["frequency_Hz_first_last"][k],
                );
            }
            self.three(
                "spectrum",
                &spectrum.values,
                &expected["values_first_middle_last"],
                1.0,
                false,
            );
        }
    }

    fn three(
        &mut self,
        what: &str,
        values: &[f64],
        expected: &Value,
        factor: f64,
        with_scale: bool,
    ) {
        let scale = values.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        // Sums of a large offset and a small number are exact to the offset only.
        let scale = if with_scale { scale.max(1e-10) } else { 0.0 };
        let found = [values.first(), values.get(values.len() / 2), values.last()];
        for (k, found) in found.into_iter().enumerate() {
            let expected = expected[k].as_f64().map(|of| of * factor);
            self.close_to(what, found.copied(), expected, scale);
        }
    }

    fn curve(&mut self, number: usize, curve: &Curve, expected: &Value) {
        let segments = expected["segments"].as_array().expect("segments");
        self.equal("number of segments", curve.segments.len(), segments.len());
        for k in 0..2 {
            if let Some(position) = expected["position_m"][k].as_f64() {
                let found = curve.position.map(|of| of[k]);
                self.close_to("position", found, Some(position), 1e-6);
            }
        }
        if let Some(pixel) = expected["position_index"].as_u64() {
            self.equal("pixel", curve.pixel, Some(pixel as usize));
        }
        for (k, (segment, expected)) in curve.segments.iter().zip(segments).enumerate() {
            let name = |of: &str| format!("curve {number}, segment {k}: {of}");
            self.equal(
                &name("style"),
                Some(segment.style.to_string().as_str()),
                expected["style"].as_str(),
            );
            self.equal(
                &name("points"),
                Some(segment.points() as u64),
                expected["points"].as_u64(),
            );
            self.close(&name("duration"), segment.duration, &expected["duration_s"]);
            let distance = curve.distance.as_ref();
            let channel = distance.map(|of| of.channel.as_str());
            self.equal(
                &name("distance"),
                channel,
                expected["distance_channel"].as_str(),
            );
            let direction = distance.map(|of| if of.grows_toward_surface { 1 } else { -1 });
            if let Some(known) = expected["toward_surface"].as_i64() {
                self.equal(&name("direction"), direction, Some(known));
            }
            if let Some(channel) = curve.distance_in(segment) {
                self.three(
                    &name("distance"),
                    &channel.values,
                    &expected["distance_first_middle_last"],
                    1.0,
                    true,
                );
            }
            if let Some(commanded) = expected["commanded_channel"].as_str() {
                let found = segment
                    .channel(commanded)
                    .map_or(&[][..], |of| of.values.as_slice());
                self.three(
                    &name("commanded"),
                    found,
                    &expected["commanded_first_middle_last"],
                    1.0,
                    true,
                );
            }
            self.equal(
                &name("deflection"),
                curve.deflection.as_deref(),
                expected["deflection_channel"].as_str(),
            );
            if let Some(channel) = curve.deflection_in(segment) {
                let factor = match (expected["deflection_unit"].as_str(), channel.unit.as_str()) {
                    (Some("V"), "m") => curve.sensitivity.expect("a sensitivity"),
                    (Some("nA"), "A") => 1e-9,
                    (unit, found) => {
                        self.equal(&name("unit of the deflection"), Some(found), unit);
                        1.0
                    }
                };
                self.three(
                    &name("deflection"),
                    &channel.values,
                    &expected["deflection_first_middle_last"],
                    factor,
                    true,
                );
            }
        }
    }

    fn image(&mut self, image: &Image, expected: &Value, is_flipped: bool) {
        let name = expected["name"].as_str().unwrap_or("");
        let is_same = name.ends_with(&image.name);
        self.equal(
            &format!("the name `{}` of the image `{name}`", image.name),
            is_same,
            true,
        );
        let unit = expected["unit"]
            .as_str()
            .map(|of| if of == "Â°" { "deg" } else { of });
        self.equal(
            &format!("unit of `{name}`"),
            Some(image.unit.as_str()),
            unit,
        );
        let shape = [
            expected["lines_points"][1].as_u64(),
            expected["lines_points"][0].as_u64(),
        ];
        self.equal(name, image.shape.map(|of| Some(of as u64)), shape);
        for k in 0..2 {
            if let Some(size) = image.size {
                self.close(
                    &format!("size of `{name}`"),
                    Some(size[k]),
                    &expected["size_m"][k],
                );
            }
        }
        let finite = || image.values.iter().copied().filter(|of| of.is_finite());
        let (low, high) = (
            finite().fold(f64::INFINITY, f64::min),
            finite().fold(f64::NEG_INFINITY, f64::max),
        );
        let scale = low.abs().max(high.abs());
        let first = if is_flipped {
            image.shape[0] * (image.shape[1] - 1)
        } else {
            0
        };
        for (key, found) in [
            ("min", low),
            ("max", high),
            ("top_left", image.values[first]),
        ] {
            self.close_to(
                &format!("{key} of `{name}`"),
                Some(found),
                expected[key].as_f64(),
                scale,
            );
        }
    }
}

#[test]
fn files_of_afmformats() {
    compare("afmformats", "0.18.7");
}

#[test]
fn files_of_nanite() {
    compare("nanite", "4.2.3");
}

#[test]
fn files_of_nsfopen() {
    compare("nsfopen", "2.2.4");
}

#[test]
fn files_of_afmreader() {
    compare("afmreader", "0.0.7");
}

#[test]
fn files_of_igor2() {
    compare("igor2", "0.5.15");
}

#[test]
fn files_of_gwyfile() {
    compare("gwyfile", "0.3.0");
}

#[test]
fn files_of_no_package() {
    let Some(folder) = std::env::var_os("AFM_FILES_SAMPLES").map(PathBuf::from) else {
        println!("skipped: AFM_FILES_SAMPLES names no folder");
        return;
    };
    let mut failures = Vec::new();
    let reference = reference();
    let of_repository = |of: &Value| of["from"][0][0].as_str().is_some_and(|of| of.contains('/'));
    for (file, expected) in reference.iter().filter(|(_, of)| of_repository(of)) {
        match bytes_of(&folder.join(file)) {
            Ok(bytes) => check(file, &bytes, expected, &mut failures),
            Err(error) => println!("{file}: {error}"),
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
