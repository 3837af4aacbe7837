//! Every statement of the paper, with its verdict.

use std::fmt::Write as _;

use nanotap_paper::Report;

use super::{code, head, plain, row};

const INTRODUCTION: &str = "\
# Every statement of the paper

The results of `nanotap paper`: each figure and number of \"Multi-modal analysis on the intermittent
contact dynamics of atomic force microscope\" (Journal of Sound and Vibration, 2011) recomputed, with
a verdict, its evidence, and the command that reproduces it. [The paper's statements,
checked](../paper.md) is a summary.

";

pub(super) fn page(report: &Report) -> String {
    let mut text = INTRODUCTION.to_owned();
    let _ = writeln!(text, "{}.", plain(&report.counts()));
    if report.quick {
        text += "\n*Computed with fewer starts than `nanotap paper` takes.*\n";
    }
    for section in &report.sections {
        let _ = write!(text, "\n## {}\n\n", plain(section.title));
        for picture in &section.pictures {
            let (title, name) = (plain(&picture.title), &picture.name);
            let _ = write!(text, "![{title}](paper/{name}.svg)\n\n");
            let _ = write!(text, "{}\n\n", plain(&picture.caption));
        }
        for paragraph in &section.text {
            let _ = write!(text, "{}\n\n", plain(paragraph));
        }
        text += &head(&["verdict", "the paper", "here", "because"]);
        for check in &section.checks {
            text += &row(&[
                check.verdict.name(),
                &check.paper,
                &check.here,
                &format!("{} {}", check.evidence, code(&check.rerun)),
            ]);
        }
    }
    text
}
