//! The numeric constants in the crates' sources.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::left_out::is_left_out;

/// A numeric constant that steers a computation.
pub(super) struct Constant {
    /// Name of its crate.
    pub(super) package: String,
    /// Path of its file from the repository's root, with `/`.
    pub(super) file: String,
    /// Its name; from the second constant of this name in a file on with `#2`, `#3`, …
    pub(super) name: String,
    /// Its type.
    pub(super) kind: String,
    /// Its value as written in the source.
    pub(super) value: String,
    /// The first paragraph of its comment; empty if it has none.
    pub(super) meaning: String,
    /// Place of its value in the file, in bytes.
    pub(super) place: Range<usize>,
}

impl Constant {
    /// Returns a source expression for the value times two, or half of it. An array or a tuple is scaled
    /// as a whole.
    pub(super) fn scaled(&self, double: bool) -> String {
        let is_float = self.kind.contains("f64") || self.kind.contains("f32");
        let scale = |number: &str| match (is_float, double) {
            (true, true) => format!("2.0 * ({number})"),
            (true, false) => format!("0.5 * ({number})"),
            (false, true) => format!("2 * ({number})"),
            (false, false) => format!("({number}) / 2"),
        };
        let value = self.value.trim();
        let bracket = |c: char| self.kind.starts_with(c) && value.starts_with(c);
        if bracket('[') || bracket('(') {
            let numbers = value[1..value.len() - 1].split(',').map(str::trim);
            let scaled: Vec<String> = numbers.filter(|n| !n.is_empty()).map(scale).collect();
            let (open, close) = value.split_at(1);
            return format!("{open}{}{}", scaled.join(", "), &close[close.len() - 1..]);
        }
        scale(value)
    }
}

/// Reads the constants of all crates, in the order of crates, files and lines.
///
/// # Errors
/// If a folder or file cannot be read.
pub(super) fn constants(root: &Path) -> Result<Vec<Constant>, String> {
    let mut found = Vec::new();
    for package in sorted(&root.join("crates"))? {
        let mut folders = vec![package.join("src")];
        let mut files = Vec::new();
        while let Some(folder) = folders.pop() {
            for path in sorted(&folder)? {
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("tests.rs")
                {
                    files.push(path);
                }
            }
        }
        files.sort();
        for path in files {
            let text = fs::read_to_string(&path)
                .map_err(|error| format!("cannot read {}: {error}", path.display()))?;
            let file = path.strip_prefix(root).unwrap_or(&path);
            let file = file.to_string_lossy().replace('\\', "/");
            found.extend(of_file(&file, &text));
        }
    }
    Ok(found)
}

fn sorted(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let trouble = |error: std::io::Error| format!("cannot read {}: {error}", folder.display());
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(trouble)? {
        paths.push(entry.map_err(trouble)?.path());
    }
    paths.sort();
    Ok(paths)
}

/// The constants of one file, without those of its tests, which come last.
fn of_file(file: &str, text: &str) -> Vec<Constant> {
    let text = text
        .find("#[cfg(test)]\nmod ")
        .map_or(text, |end| &text[..end]);
    let package = file.split('/').nth(1).unwrap_or_default();
    let mut constants: Vec<Constant> = Vec::new();
    let mut comment: Vec<&str> = Vec::new();
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        let next = start + line.len();
        let trimmed = line.trim();
        if let Some(words) = trimmed.strip_prefix("//") {
            comment.push(words.trim_start_matches(['/', '!']).trim());
        } else if !trimmed.starts_with("#[") {
            if let Some((name, kind)) = declaration(trimmed)
                && let Some(place) = value(text, start + line.find(" =").unwrap_or(0) + 2)
                && !is_left_out(file, name)
            {
                let same = |c: &&Constant| c.name.split('#').next() == Some(name);
                let count = constants.iter().filter(same).count();
                constants.push(Constant {
                    package: package.to_owned(),
                    file: file.to_owned(),
                    name: if count == 0 {
                        name.to_owned()
                    } else {
                        format!("{name}#{}", count + 1)
                    },
                    kind: kind.to_owned(),
                    value: words(&text[place.clone()]),
                    meaning: first_paragraph(&comment),
                    place,
                });
            }
            comment.clear();
        }
        start = next;
    }
    constants
}

/// The name and type of a numeric constant whose declaration begins on this line.
fn declaration(line: &str) -> Option<(&str, &str)> {
    let public = line.strip_prefix("pub").map(|rest| {
        let scope = rest.strip_prefix('(').and_then(|r| r.split_once(')'));
        scope.map_or(rest, |(_, rest)| rest).trim_start()
    });
    let rest = public.unwrap_or(line).strip_prefix("const ")?;
    let (name, rest) = rest.split_once(": ")?;
    let (kind, _) = rest.split_once(" =")?;
    let is_name = name
        .chars()
        .all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_');
    (is_name && is_numeric(kind)).then_some((name, kind))
}

/// Whether this is a type of numbers, or of an array or a tuple of them.
fn is_numeric(kind: &str) -> bool {
    const NUMBERS: [&str; 11] = [
        "f64", "f32", "usize", "isize", "u8", "u16", "u32", "u64", "i32", "i64", "u128",
    ];
    if let Some(inner) = kind.strip_prefix('(').and_then(|k| k.strip_suffix(')')) {
        return inner.split(", ").all(|kind| NUMBERS.contains(&kind));
    }
    let array = kind.strip_prefix('[').and_then(|k| k.split_once("; "));
    NUMBERS.contains(&array.map_or(kind, |(inner, _)| inner))
}

/// The place of the value that begins at byte `start`, without spaces at its ends.
fn value(text: &str, start: usize) -> Option<Range<usize>> {
    let mut depth = 0;
    let length = text[start..].find(|c| {
        match c {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth -= 1,
            _ => {}
        }
        c == ';' && depth == 0
    })?;
    let value = &text[start..start + length];
    let begin = start + value.len() - value.trim_start().len();
    Some(begin..begin + value.trim().len())
}

/// `text` on one line, without comments.
fn words(text: &str) -> String {
    let lines = text.lines().map(|l| l.split("//").next().unwrap_or(l));
    let words: Vec<&str> = lines.flat_map(str::split_whitespace).collect();
    let line = words.join(" ");
    line.replace("[ ", "[").replace(", ]", "]")
}

fn first_paragraph(comment: &[&str]) -> String {
    let lines: Vec<&str> = comment
        .iter()
        .copied()
        .take_while(|l| !l.is_empty())
        .collect();
    lines.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: &str = "\
/// Largest number of steps.
///
/// More is not said.
#[cfg(unix)]
pub(crate) const MAX_STEPS: usize = 1 << 4;
fn search() {
    // Ends of the range.
    const RANGE: [f64; 2] = [
        0.5, // lower
        1.0,
    ];
    const NAME: &str = \"no number\";
    const RANGE: (u32, u32) = (1, 3);
}

#[cfg(test)]
mod tests {
    const TOLERANCE: f64 = 1e-9;
}
";

    fn found() -> Vec<Constant> {
        of_file("crates/a/src/b.rs", SOURCE)
    }

    #[test]
    fn constants_are_read_with_the_first_paragraph_of_their_comment() {
        let lines: Vec<String> = found()
            .iter()
            .map(|c| format!("{} {} = {}: {}", c.package, c.name, c.value, c.meaning))
            .collect();
        let expected = [
            "a MAX_STEPS = 1 << 4: Largest number of steps.",
            "a RANGE = [0.5, 1.0]: Ends of the range.",
            "a RANGE#2 = (1, 3): ",
        ];
        assert_eq!(lines, expected);
        assert_eq!(&SOURCE[found()[0].place.clone()], "1 << 4");
    }

    #[test]
    fn values_are_scaled_as_a_whole() {
        let scaled: Vec<String> = found().iter().map(|c| c.scaled(false)).collect();
        let expected = [
            "(1 << 4) / 2",
            "[0.5 * (0.5), 0.5 * (1.0)]",
            "((1) / 2, (3) / 2)",
        ];
        assert_eq!(scaled, expected);
        assert_eq!(found()[0].scaled(true), "2 * (1 << 4)");
    }
}
