//! Counts of passed and failed tests, from the last lines of test runners.

use std::ops::AddAssign;

/// Numbers of tests or checks that passed, failed and were skipped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tally {
    pub(crate) passed: u64,
    pub(crate) failed: u64,
    pub(crate) skipped: u64,
}

impl Tally {
    /// Counts a single check, which passed or failed.
    pub(crate) fn check(passed: bool) -> Self {
        Self {
            passed: u64::from(passed),
            failed: u64::from(!passed),
            skipped: 0,
        }
    }

    /// A test run whose runner printed `lines` and succeeded or not. A run that failed without a
    /// failed test (for example because it did not build) counts one failure.
    pub(crate) fn of_tests(lines: &[String], succeeded: bool) -> Self {
        let mut tally = Self::default();
        for line in lines {
            if let Some(found) = closing_line(line) {
                tally += found;
            }
        }
        if !succeeded && tally.failed == 0 {
            tally.failed = 1;
        }
        tally
    }
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.passed += other.passed;
        self.failed += other.failed;
        self.skipped += other.skipped;
    }
}

/// The counts in the last line of nextest (`… 3 tests run: 2 passed (1 slow), 1 failed, 0
/// skipped`), of cargo test (`test result: ok. 3 passed; 0 failed; …`) or of pytest (`= 3 passed, 1
/// failed in 0.12s =`); `None` for any other line.
fn closing_line(line: &str) -> Option<Tally> {
    let plain = without_colour(line);
    let counts = if let Some((_, rest)) = plain.split_once("test result: ") {
        rest.to_owned()
    } else if let Some((_, rest)) = plain.split_once(" run: ") {
        if !plain.trim_start().starts_with("Summary") {
            return None;
        }
        rest.to_owned()
    } else if plain.starts_with('=') && plain.ends_with('=') && plain.contains(" in ") {
        plain.trim_matches(['=', ' ']).to_owned()
    } else {
        return None;
    };
    let words: Vec<&str> = counts
        .split([' ', ',', ';', '(', ')', '.', ':'])
        .filter(|word| !word.is_empty())
        .collect();
    let mut tally = Tally::default();
    for pair in words.windows(2) {
        let Ok(number) = pair[0].parse::<u64>() else {
            continue;
        };
        match pair[1] {
            "passed" => tally.passed += number,
            "failed" | "timed" | "errors" | "error" => tally.failed += number,
            "skipped" | "ignored" => tally.skipped += number,
            _ => {}
        }
    }
    Some(tally)
}

fn without_colour(line: &str) -> String {
    let mut plain = String::with_capacity(line.len());
    let mut characters = line.chars();
    while let Some(character) = characters.next() {
        if character == '\u{1b}' {
            // An SGR sequence ends at its letter.
            for inner in characters.by_ref() {
                if inner.is_ascii_alphabetic() {
                    break;
                }
            }
        } else {
            plain.push(character);
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tally(line: &str) -> Option<Tally> {
        closing_line(line)
    }

    #[test]
    fn reads_nextest() {
        let line = "     Summary [   0.041s] 5 tests run: 3 passed (1 slow), 1 failed, 1 timed out, 2 skipped";
        assert_eq!(
            tally(line),
            Some(Tally {
                passed: 3,
                failed: 2,
                skipped: 2
            })
        );
        let coloured = "\u{1b}[32;1m     Summary\u{1b}[0m [ 0.04s] \u{1b}[1m7\u{1b}[0m tests run: \u{1b}[1m7\u{1b}[0m \u{1b}[32;1mpassed\u{1b}[0m, 0 skipped";
        assert_eq!(
            tally(coloured),
            Some(Tally {
                passed: 7,
                failed: 0,
                skipped: 0
            })
        );
    }

    #[test]
    fn reads_cargo_test() {
        let line = "test result: FAILED. 8 passed; 2 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.31s";
        assert_eq!(
            tally(line),
            Some(Tally {
                passed: 8,
                failed: 2,
                skipped: 1
            })
        );
    }

    #[test]
    fn reads_pytest() {
        let line = "=========== 1 failed, 12 passed, 3 skipped in 0.52s ===========";
        assert_eq!(
            tally(line),
            Some(Tally {
                passed: 12,
                failed: 1,
                skipped: 3
            })
        );
    }

    #[test]
    fn leaves_other_lines_alone() {
        assert_eq!(
            tally("        PASS [   0.003s] xtask tally::tests::reads_pytest"),
            None
        );
        assert_eq!(tally("3 passed the gate"), None);
        assert_eq!(tally(""), None);
    }

    #[test]
    fn a_run_that_does_not_build_counts_as_a_failure() {
        assert_eq!(
            Tally::of_tests(&["error: could not compile".into()], false).failed,
            1
        );
        assert_eq!(Tally::of_tests(&[], true), Tally::default());
    }
}
