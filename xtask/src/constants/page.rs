//! The page `docs/constants.md`.

use std::fmt::Write as _;

use super::left_out::CRATES;
use super::source::Constant;
use super::trials::{NOT_COMPILED, Trial, Trials};

/// Markdown of the page.
pub(super) fn page(constants: &[Constant], trials: &Trials) -> String {
    let mut packages: Vec<&str> = constants.iter().map(|c| c.package.as_str()).collect();
    packages.dedup();
    let tried: Vec<&Trial> = constants.iter().filter_map(|c| trials.of(c)).collect();
    let noticed = tried.iter().filter(|trial| trial.is_noticed()).count();
    let mut text = format!(
        "{HEAD}\nLeft out are {}, all folders `figure`, and the facts that `xtask/src/constants/left_out.rs` lists:\n\
         constants of nature, digits of mathematical constants, coefficients of series, numbers that follow from\n\
         others. {} constants of {} crates remain. {} of them were tried; for {noticed} of these a test fails\n\
         if the value is doubled, and if it is halved.\n",
        CRATES.map(|name| format!("`{name}`")).join(", "),
        constants.len(),
        packages.len(),
        tried.len(),
    );
    for package in packages {
        let of_package = constants.iter().filter(|c| c.package == package);
        let is_tried = of_package.clone().any(|c| trials.of(c).is_some());
        let _ = write!(
            text,
            "\n## {package}\n\n| file | constant | value | meaning |"
        );
        text += if is_tried {
            " fails if doubled | fails if halved |\n|---|---|---|---|---|---|\n"
        } else {
            "\n|---|---|---|---|\n"
        };
        for constant in of_package {
            let file = constant
                .file
                .split_once("/src/")
                .map_or("", |(_, file)| file);
            let name = constant.name.split('#').next().unwrap_or_default();
            let value = constant.value.replace('|', "\\|");
            let meaning = in_cell(&constant.meaning);
            let _ = write!(text, "| `{file}` | `{name}` | `{value}` | {meaning} |");
            if is_tried {
                let cells = trials
                    .of(constant)
                    .map_or([String::new(), String::new()], cells);
                let _ = write!(text, " {} | {} |", cells[0], cells[1]);
            }
            text.push('\n');
        }
    }
    text
}

/// What a trial found, for the last two columns.
fn cells(trial: &Trial) -> [String; 2] {
    [&trial.doubled, &trial.halved].map(|test| match test.as_str() {
        "" => "no test".to_owned(),
        NOT_COMPILED => NOT_COMPILED.to_owned(),
        test => format!("`{test}`"),
    })
}

/// A comment of the source as Markdown in a cell: links of rustdoc become code, and signs outside
/// code have no meaning.
fn in_cell(text: &str) -> String {
    let mut cell = String::with_capacity(text.len());
    let mut code = false;
    let mut rest = text;
    while let Some(sign) = rest.chars().next() {
        rest = &rest[sign.len_utf8()..];
        match sign {
            '`' => {
                code = !code;
                cell.push(sign);
                if !code && let Some(after) = rest.strip_prefix(']') {
                    let target = after.strip_prefix('(').and_then(|a| a.split_once(')'));
                    rest = target.map_or(after, |(_, after)| after);
                }
            }
            '[' if !code && rest.starts_with('`') => {}
            '*' | '_' | '$' | '<' | '[' | ']' if !code => cell.extend(['\\', sign]),
            '|' => cell += "\\|",
            sign => cell.push(sign),
        }
    }
    cell
}

const HEAD: &str = "\
# Numerical constants

<!-- Written by `cargo xtask constants`. -->

The named numbers in the sources that steer a computation: tolerances, limits, counts of steps, and the
thresholds at which a verdict changes. Each is declared where it is used, with a comment that says what it
means, and for which values it is valid where that is known. `cargo xtask constants --try CRATE` doubles and halves
each constant of a crate in a copy of the sources and runs the tests of this crate; the last two columns
name the first test that fails. Both elements of a range are scaled together. Where they say \"no test\",
the tests of the crate accept the value; those of crates that use it may not. Empty cells were not tried.
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_become_code_and_signs_lose_their_meaning() {
        let comment = "As [`BRIEF`], or [`A`](Self::A), of `a|b`, |c| < 2 [m_1].";
        let cell = r"As `BRIEF`, or `A`, of `a\|b`, \|c\| \< 2 \[m\_1\].";
        assert_eq!(in_cell(comment), cell);
    }
}
