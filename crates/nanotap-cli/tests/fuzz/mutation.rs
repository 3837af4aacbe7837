//! Hostile changes of texts, bytes and JSON, the same for the same seed.

use serde_json::{Value, json};

pub(crate) struct Random(nanotap_dynamics::random::Random);

impl Random {
    pub(crate) const fn new(seed: u64) -> Self {
        Self(nanotap_dynamics::random::Random::new(seed))
    }

    /// A whole number below `bound`, which is above zero.
    pub(crate) fn below(&mut self, bound: usize) -> usize {
        (self.0.uniform() * bound as f64) as usize
    }

    pub(crate) fn one<'a, T: ?Sized>(&mut self, list: &[&'a T]) -> &'a T {
        list[self.below(list.len())]
    }

    /// True in one of `count` cases.
    pub(crate) fn rarely(&mut self, count: usize) -> bool {
        self.below(count) == 0
    }
}

/// Values that a key, a field or an option may get.
pub(crate) const VALUES: &[&str] = &[
    "0",
    "-1",
    "1",
    "1e-300",
    "1e300",
    "-1e300",
    "nan",
    "inf",
    "-inf",
    "9223372036854775807",
    "99999999999999999999999",
    "0.1",
    "2.6",
    "50",
    "1e9",
    "true",
    "\"\"",
    "\"x\"",
    "[]",
    "[[\"gap (nm)\", \"force (nN)\"], [0, 0]]",
    "{}",
    "\"/dev/zero\"",
    "\"..\"",
    "\"0 nm\"",
    "\"1e300 nm\"",
    "\"-5 N/m\"",
    "\"1e30 GPa\"",
    "\"20 kHz\"",
    "\"1 nm nm nm\"",
    "\"dmt\"",
    "\"table\"",
    "\"\u{1b}[31m\"",
];

/// Changes one or two lines of a case file.
pub(crate) fn case(random: &mut Random, text: &str) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..=random.below(2) {
        if lines.is_empty() {
            break;
        }
        let at = random.below(lines.len());
        match random.below(8) {
            0 => drop(lines.remove(at)),
            1 => lines.insert(at, lines[at].clone()),
            2 => VALUES[random.below(VALUES.len())].clone_into(&mut lines[at]),
            _ => {
                let values: Vec<usize> = (0..lines.len())
                    .filter(|k| lines[*k].contains('='))
                    .collect();
                let Some(at) = values.get(random.below(values.len().max(1))) else {
                    continue;
                };
                let key = lines[*at].split('=').next().unwrap_or_default().to_owned();
                lines[*at] = format!("{key}= {}", random.one(VALUES));
            }
        }
    }
    lines.join("\n")
}

/// Changes fields of a table.
pub(crate) fn table(random: &mut Random, text: &str) -> Vec<u8> {
    let mut rows: Vec<Vec<String>> = text
        .lines()
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect();
    for _ in 0..=random.below(3) {
        let at = random.below(rows.len());
        match random.below(8) {
            0 => rows[at].push("1".to_owned()),
            1 => drop(rows[at].pop()),
            2 => rows.insert(at, rows[at].clone()),
            3 => "x (y)".clone_into(&mut rows[0][0]),
            _ if rows[at].is_empty() => {}
            _ => {
                let field = random.below(rows[at].len());
                random.one(VALUES).clone_into(&mut rows[at][field]);
            }
        }
    }
    let lines: Vec<String> = rows.iter().map(|row| row.join(",")).collect();
    let mut file = lines.join("\n").into_bytes();
    if random.rarely(3) {
        bytes(random, &mut file);
    }
    file
}

/// Changes, removes or inserts some bytes.
pub(crate) fn bytes(random: &mut Random, file: &mut Vec<u8>) {
    for _ in 0..=random.below(4) {
        if file.is_empty() {
            return;
        }
        let at = random.below(file.len());
        let byte = [0, 0xff, 0x7f, 0x80, random.below(256) as u8][random.below(5)];
        match random.below(6) {
            0 => file.truncate(at),
            1 => file.insert(at, byte),
            2 => {
                let end = (at + 4).min(file.len());
                file[at..end].fill(byte);
            }
            _ => file[at] = byte,
        }
    }
}

/// Replaces, removes or adds a value somewhere in a JSON document.
pub(crate) fn json(random: &mut Random, value: &mut Value) {
    let hostile = [
        json!(null),
        json!(true),
        json!(0),
        json!(-1),
        json!(u64::MAX),
        json!(1e308),
        json!(""),
        json!("x"),
        json!("\u{0}"),
        json!("1e300 nm"),
        json!([]),
        json!([[]]),
        json!({}),
        json!({"": 1}),
        json!("y".repeat(5000)),
    ];
    match value {
        Value::Object(entries) if !entries.is_empty() && !random.rarely(6) => {
            let at = random.below(entries.len());
            let key = entries.keys().nth(at).cloned().unwrap_or_default();
            match random.below(12) {
                0 => drop(entries.remove(&key)),
                1 => drop(entries.insert("more".to_owned(), json!(1))),
                _ => entries
                    .values_mut()
                    .skip(at)
                    .take(1)
                    .for_each(|entry| self::json(random, entry)),
            }
        }
        Value::Array(entries) if !entries.is_empty() && !random.rarely(6) => {
            let at = random.below(entries.len());
            self::json(random, &mut entries[at]);
        }
        _ => *value = hostile[random.below(hostile.len())].clone(),
    }
}
