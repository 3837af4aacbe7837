//! The worked cases, tutorials, theory and gallery of the documentation: every command in
//! `docs/cases/*.md`, `docs/tutorials/*.md`, `docs/theory/*.md` and `docs/gallery.md` is run as
//! written, and every number is compared.
//!
//! A `console` block contains commands, one per line that begins with `$ nanotap`. The following
//! table contains values of the JSON document of the last command: a JSON pointer, the value, and
//! its tolerance, relative (`1 %`) or absolute (`0.5`); `exactly` compares texts, whole numbers, true
//! and false. Lines below a command in its block are what it prints, as in the README.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::util::Folder;

/// All documents that are checked.
fn documents() -> Vec<PathBuf> {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    let files = ["cases", "tutorials", "theory"]
        .map(|folder| std::fs::read_dir(docs.join(folder)).unwrap());
    let files = files.into_iter().flatten();
    let files = files.map(|entry| entry.unwrap().path());
    files.chain([docs.join("gallery.md")]).collect()
}

/// A folder with the case files and data of the documentation.
fn with_cases() -> Folder {
    let folder = Folder::new();
    for path in documents() {
        if path.extension().is_some_and(|e| e == "toml" || e == "csv") {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            folder.write(&name, std::fs::read(&path).unwrap());
        }
    }
    for (name, case) in crate::front_page::cases(&crate::front_page::text()) {
        folder.write(name, case);
    }
    folder
}

/// The words of a command line; quotes group words.
pub(crate) fn words(line: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut quoted = false;
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ' ' if !quoted => words.push(String::new()),
            _ => words.last_mut().unwrap().push(c),
        }
    }
    words.retain(|w| !w.is_empty());
    words
}

/// True if `found` agrees with the value in the document.
fn holds(found: &Value, value: &str, within: &str) -> bool {
    if within == "exactly" {
        return match found {
            Value::String(text) => text == value,
            Value::Bool(is) => is.to_string() == value,
            number => number.as_i64().is_some() && number.as_i64() == value.parse().ok(),
        };
    }
    let (Some(found), Ok(value)) = (found.as_f64(), value.parse::<f64>()) else {
        return false;
    };
    let limit = match within.strip_suffix('%') {
        Some(percent) => 0.01 * percent.trim().parse::<f64>().unwrap() * value.abs(),
        None => within.parse().unwrap(),
    };
    (found - value).abs() <= limit
}

/// Text of a document.
fn text_of(name: &str) -> String {
    let path = documents().into_iter().find(|path| path.ends_with(name));
    std::fs::read_to_string(path.unwrap()).unwrap()
}

/// Commands of a document, without the name of the program.
fn commands(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter_map(|l| l.strip_prefix("$ nanotap "))
}

/// Runs one document; returns the numbers of commands and values in it.
fn follow(name: &str) -> (usize, usize) {
    follow_in(&with_cases(), name)
}

/// The same with the files of a folder.
pub(crate) fn follow_in(folder: &Folder, name: &str) -> (usize, usize) {
    let text = text_of(name);
    let (mut commands, mut numbers) = (0, 0);
    let mut said = Value::Null;
    let mut last = String::new();
    let examples = crate::front_page::examples(&text);
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if let Some(command) = line.strip_prefix("$ nanotap ") {
            let mut arguments = words(command);
            // After the commands before it, whose files it may read.
            let shown = examples.iter().filter(|(of, _)| *of == command);
            let shown: Vec<_> = shown.map(|(_, shown)| shown).collect();
            for shown in &shown {
                crate::front_page::prints(folder, command, shown);
            }
            let until_next = lines
                .clone()
                .take_while(|line| !line.starts_with("$ nanotap "));
            // What it prints is all that is compared.
            if shown.is_empty() || until_next.into_iter().find_map(compared).is_some() {
                if !arguments.iter().any(|a| a == "--json") {
                    arguments.push("--json".into());
                }
                let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
                said = folder.run(&arguments).json();
            }
            command.clone_into(&mut last);
            commands += 1;
            // Figures that the document mentions are drawn.
            if let Some(k) = arguments.iter().position(|a| *a == "--plot") {
                assert!(folder.path().join(&arguments[k + 1]).exists(), "{last}");
            }
        }
        if let Some((pointer, value, within)) = compared(line) {
            let found = said.pointer(pointer);
            let found = found.unwrap_or_else(|| panic!("{name}: {last}: no {pointer}"));
            assert!(
                holds(found, value, within),
                "{name}: {last}: {pointer} is {found}, not {value} within {within}"
            );
            numbers += 1;
        }
    }
    (commands, numbers)
}

/// Pointer, value and tolerance of a line of a table of values.
fn compared(line: &str) -> Option<(&str, &str, &str)> {
    let cells: Vec<&str> = line.split('|').map(str::trim).collect();
    let &[_, _, pointer, value, within, _] = cells.as_slice() else {
        return None;
    };
    let pointer = pointer.strip_prefix('`')?.strip_suffix('`')?;
    pointer.starts_with('/').then_some((pointer, value, within))
}

/// Every document has a test here: a new one needs a line.
#[test]
fn every_document_has_a_test() {
    let mut names: Vec<String> = documents()
        .into_iter()
        .filter(|path| path.extension().is_some_and(|e| e == "md"))
        .map(|path| path.file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            "README.md",
            "README.md",
            "approach-curve.md",
            "beam.md",
            "bimodal.md",
            "bistable.md",
            "calibrate.md",
            "capillary.md",
            "contact.md",
            "dforce.md",
            "dynamicist.md",
            "fit-adhesion.md",
            "fit-frequency-modulation.md",
            "fit.md",
            "flow.md",
            "fm-lever-on-polystyrene.md",
            "force-curve.md",
            "force-limit.md",
            "formula.md",
            "frequency-modulation.md",
            "frequency-sweep.md",
            "gallery.md",
            "image-states.md",
            "kelvin-probe.md",
            "liquid.md",
            "measured-modes.md",
            "microscopist.md",
            "moving-surface.md",
            "noise.md",
            "nonlinear.md",
            "observables.md",
            "one-shot.md",
            "orbits.md",
            "period-doubling.md",
            "polymer.md",
            "q-control.md",
            "qi-map.md",
            "reconstruct.md",
            "samples.md",
            "scan.md",
            "scan.md",
            "stiff-lever.md",
            "table.md",
            "tip-mass.md",
        ]
    );
}

/// A command with few values in its ranges and few points: the same figure, drawn in less time.
fn coarse(words: Vec<String>) -> Vec<String> {
    const FEW: usize = 4;
    let is_many = |count: &str| count.parse().is_ok_and(|count: usize| count > FEW);
    let mut after_points = false;
    let mut coarsened = |word: String| {
        let is_points = std::mem::replace(&mut after_points, word == "--points");
        match word.rsplit_once(':') {
            Some((ends, count)) if ends.contains(':') && is_many(count) => format!("{ends}:{FEW}"),
            None if is_points && is_many(&word) => FEW.to_string(),
            _ => word,
        }
    };
    words.into_iter().map(&mut coarsened).collect()
}

/// The gallery shows commands of other pages, which are run there, and further ones. `cargo xtask
/// figures` draws them all at their full size.
#[test]
fn the_gallery() {
    let pages = documents();
    let pages = pages.iter().filter(|path| {
        path.extension().is_some_and(|e| e == "md") && !path.ends_with("gallery.md")
    });
    let others: Vec<String> = pages
        .map(|path| std::fs::read_to_string(path).unwrap())
        .chain([crate::front_page::text()])
        .collect();
    let others: Vec<&str> = others.iter().flat_map(|page| commands(page)).collect();
    let gallery = text_of("gallery.md");
    let folder = with_cases();
    let mut count = 0;
    for command in commands(&gallery) {
        count += 1;
        let words = words(command);
        let figure = &words[words.iter().position(|w| w == "--plot").unwrap() + 1];
        assert!(gallery.contains(&format!("/{figure})")), "{figure}");
        if !others.contains(&command) {
            let words = coarse(words.clone());
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            let outcome = folder.run(&words);
            assert_eq!(outcome.code, 0, "{command}: {}", outcome.stderr);
            assert!(folder.path().join(figure).exists(), "{command}");
        }
    }
    assert_eq!(count, 32);
}

/// One test per document, so that they run in parallel.
macro_rules! follows {
    ($($test:ident: $name:literal, $commands:literal commands, $numbers:literal numbers;)*) => {
        $(#[test]
        fn $test() {
            assert_eq!(follow($name), ($commands, $numbers));
        })*
    };
}

follows! {
    fit: "fit.md", 10 commands, 61 numbers;
    fit_of_sticky_and_wet_samples: "fit-adhesion.md", 2 commands, 10 numbers;
    fit_of_frequency_shifts: "fit-frequency-modulation.md", 1 commands, 7 numbers;
    frequency_modulation: "frequency-modulation.md", 3 commands, 23 numbers;
    the_theory_of_the_beam: "beam.md", 3 commands, 6 numbers;
    the_theory_of_the_observables: "observables.md", 1 commands, 3 numbers;
    the_approach_curve: "approach-curve.md", 2 commands, 12 numbers;
    the_bistable_lever: "bistable.md", 4 commands, 17 numbers;
    the_thermal_calibration: "calibrate.md", 2 commands, 10 numbers;
    the_capillary_bridge: "capillary.md", 1 commands, 4 numbers;
    the_examples_of_dforce: "dforce.md", 4 commands, 13 numbers;
    the_fm_lever: "fm-lever-on-polystyrene.md", 3 commands, 9 numbers;
    the_frequency_sweep: "frequency-sweep.md", 2 commands, 6 numbers;
    the_kelvin_probe: "kelvin-probe.md", 2 commands, 8 numbers;
    the_liquid: "liquid.md", 6 commands, 27 numbers;
    the_measured_modes: "measured-modes.md", 4 commands, 14 numbers;
    the_moving_surface: "moving-surface.md", 7 commands, 26 numbers;
    the_period_doubling: "period-doubling.md", 2 commands, 6 numbers;
    the_polymer: "polymer.md", 9 commands, 25 numbers;
    the_samples: "samples.md", 5 commands, 30 numbers;
    the_reconstruction: "reconstruct.md", 1 commands, 0 numbers;
    the_force_curve: "force-curve.md", 4 commands, 27 numbers;
    the_limit_of_the_force: "force-limit.md", 6 commands, 29 numbers;
    the_thermal_noise: "noise.md", 3 commands, 13 numbers;
    bimodal_operation: "bimodal.md", 5 commands, 18 numbers;
    the_signals_of_one_shot: "one-shot.md", 2 commands, 11 numbers;
    q_control: "q-control.md", 3 commands, 7 numbers;
    the_scan: "scan.md", 3 commands, 25 numbers;
    the_formulas: "formula.md", 13 commands, 25 numbers;
    the_states_of_an_image: "image-states.md", 2 commands, 12 numbers;
    the_force_table: "table.md", 3 commands, 8 numbers;
    the_stiff_lever: "stiff-lever.md", 3 commands, 4 numbers;
    the_tip_mass: "tip-mass.md", 3 commands, 6 numbers;
    the_tutorial_of_the_dynamicist: "dynamicist.md", 7 commands, 32 numbers;
    the_tutorial_of_the_microscopist: "microscopist.md", 6 commands, 22 numbers;
}
