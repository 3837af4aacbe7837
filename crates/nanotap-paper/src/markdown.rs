//! The report as Markdown: the table of all statements, and the pictures.

use std::fmt::Write as _;

use super::Report;

/// Formats the report as a Markdown document.
pub(super) fn document(report: &Report) -> String {
    let mut text = format!(
        "# The paper's statements, reproduced\n\n{} statements: {}. The page `report.html` in the same folder contains the figures \
         and tables.\n\n| id | the paper | here | verdict | evidence | command |\n|---|---|---|---|---|---|\n",
        report.checks().count(),
        report.counts()
    );
    for check in report.checks() {
        let _ = writeln!(
            text,
            "| {} | {} | {} | **{}** | {} | `{}` |",
            cell(&check.id),
            cell(&check.paper),
            cell(&check.here),
            check.verdict.name(),
            cell(&check.evidence),
            // A vertical bar ends a cell even within a code span.
            check.rerun.replace('|', "\\|"),
        );
    }
    for picture in report.sections.iter().flat_map(|s| &s.pictures) {
        let _ = write!(
            text,
            "\n![{}]({}.png)\n\n{}\n",
            picture.title, picture.name, picture.caption
        );
    }
    text
}

/// Text escaped for a table cell.
fn cell(text: &str) -> String {
    text.replace('\\', "\\\\")
        .replace('|', "\\|")
        .replace('*', "\\*")
        .replace('\n', " ")
}

#[cfg(test)]
mod tests {
    use super::super::{About, Check, Report, Section, Verdict};
    use super::*;

    #[test]
    fn every_row_has_six_cells() {
        let check = Check {
            id: "x".into(),
            paper: "|μ| = 1".into(),
            here: "a | b".into(),
            about: About::Motion,
            verdict: Verdict::Ambiguous,
            evidence: "E*".into(),
            rerun: "nanotap".into(),
        };
        let mut section = Section::new("x", "X");
        section.checks.push(check);
        let report = Report {
            sections: vec![section],
            quick: true,
        };
        let text = document(&report);
        let row = text.lines().find(|l| l.starts_with("| x ")).unwrap();
        let bars = row.replace("\\|", "").matches('|').count();
        assert_eq!(bars, 7);
    }
}
