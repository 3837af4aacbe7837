//! `nanotap attractors`: coexisting attractors by sampling initial states.

use std::fmt::Write as _;

use clap::Args;
use nanotap::study::Study as _;
use nanotap::study::attractors::{
    Attractors, AttractorsStudy, CheckReport, EndReport, UnseenReport,
};
use nanotap::study::proof::ProofReport;

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::text_table::{Align, Table};
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// Find coexisting attractors by sampling initial states.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    study: StudyArguments<AttractorsStudy>,
    #[command(flatten)]
    threads: ThreadsArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (request, case) = arguments.study.read(output)?;
    case.model()?;
    let found = progress::study::<AttractorsStudy>(&case, &request, &arguments.threads)?;
    arguments.study.write(&case, &found)?;
    if found.cancelled {
        output.warning("stopped before all starts were done: the fractions are of what was done");
    }
    output.remarks(&AttractorsStudy::remarks(&case, &found));
    output.study(&case, &found, |found| text(&case, found))
}

fn text(case: &GivenCase, found: &Attractors) -> String {
    let units = case.units();
    let heading = format!(
        "{}: {}, {} from seed {}",
        case.title(),
        case.summary(),
        number::counted(found.starts, "start", "starts"),
        found.seed
    );
    let mut text = format!("{}\n\n", style::bold(&heading));
    if found.attractors.is_empty() {
        text.push_str("  no attractor was shown\n");
    } else {
        text.push_str(&Table::all(&found.attractor_table(units)).render());
        text.push('\n');
    }
    for (k, attractor) in found.attractors.iter().enumerate() {
        text.push_str(&motion::paragraph(&format!(
            "{}: {}",
            k + 1,
            attractor.evidence
        )));
        let proof = attractor.orbit.as_ref().and_then(|o| o.proof.as_ref());
        if let Some(proof) = proof {
            text.push_str(&motion::paragraph(&statement(proof)));
        }
        if attractor.orbit.is_none() {
            text.push_str(&motion::paragraph(&format!(
                "Lyapunov exponents per drive period: {}",
                motion::exponents(&attractor.lyapunov, attractor.lyapunov_errors.as_deref())
            )));
        }
    }
    if let Some(chaos) = &found.transient_chaos {
        let to: Vec<String> = chaos
            .destinations
            .iter()
            .map(|(k, count)| format!("{count} to attractor {}", k + 1))
            .collect();
        let _ = writeln!(
            text,
            "\n  {}",
            style::bold("transient chaos, not an attractor")
        );
        text.push_str(&motion::paragraph(&format!(
            "mean lifetime {:.0} drive periods (95 %: {:.0} … {:.0}) from {} escapes ({}); {} still wander \
             ({} % of the starts); {}",
            chaos.lifetime,
            chaos.lifetime_interval[0],
            chaos.lifetime_interval[1],
            chaos.escapes,
            to.join(", "),
            number::counted(chaos.unescaped.count, "start", "starts"),
            number::significant(100.0 * chaos.unescaped.fraction, 3),
            if chaos.lyapunov.is_empty() {
                "exponents were not measured on the exact flow".to_owned()
            } else {
                let errors = Some(chaos.lyapunov_errors.as_slice());
                format!("exponents {}", motion::exponents(&chaos.lyapunov, errors))
            },
        )));
    }
    if found.unbounded.count > 0 {
        text.push_str(&motion::paragraph(&format!(
            "{} left every bound",
            number::counted(found.unbounded.count, "start", "starts")
        )));
    }
    undecided(&mut text, found);
    if let Some(orbits) = &found.unstable {
        let orbits: Vec<_> = orbits.iter().map(|orbit| &orbit.motion).collect();
        let _ = writeln!(
            text,
            "\n  {}",
            style::bold("unstable orbits (a list that is never proved complete)")
        );
        text.push_str(&Table::all(&found.unstable_table(units)).render());
        for (k, orbit) in orbits.iter().enumerate() {
            if let Some(proof) = &orbit.proof {
                text.push_str(&motion::paragraph(&format!(
                    "unstable orbit {}: {}",
                    k + 1,
                    statement(proof)
                )));
            }
        }
    }
    let sides: Vec<String> = found
        .sides
        .iter()
        .map(|s| {
            format!(
                "{} {} … {}",
                s.coordinate,
                units.shown_entry(&s.coordinate, s.lower, 3),
                units.shown_entry(&s.coordinate, s.upper, 3)
            )
        })
        .collect();
    let _ = writeln!(text);
    match &found.unseen {
        None => text.push_str(&motion::paragraph(&format!(
            "fractions are of the box of starts, with 95 % intervals: {}",
            sides.join(", ")
        ))),
        Some(unseen) => text.push_str(&unseen_paragraphs(found, unseen)),
    }
    if let Some(tolerance) = found.followed_at {
        text.push_str(&motion::paragraph(&format!(
            "starts were followed at {tolerance:e}, by an approximate flow: fractions and bounds are of that flow. Every orbit \
             is closed by the exact flow, which also gives multipliers and exponents."
        )));
    }
    if let Some(check) = &found.check {
        text.push_str(&checked(check));
    }
    text
}

/// Starts that were followed again on the exact flow.
fn checked(check: &CheckReport) -> String {
    const SHOWN: usize = 5;
    let undecided = match check.undecided {
        0 => String::new(),
        count => format!(", {count} undecided in one of the two"),
    };
    let other = check.disagreements.len();
    let sensitive = check
        .disagreements
        .iter()
        .filter(|one| one.sensitive)
        .count();
    let mut text = motion::paragraph(&format!(
        "{} followed again on the exact flow: {} to the same motion, {other} to another{undecided}",
        number::counted(check.starts, "start", "starts"),
        check.agreed,
    ));
    if other > 0 {
        text.push_str(&motion::paragraph(&format!(
            "{sensitive} of these {other} lie near a boundary of basins or on a chaotic transient: on the exact flow, \
             too, starts that differ by a few hundred-thousandths go to different motions{}",
            if sensitive == other {
                ""
            } else {
                "; the others are not explained by that, so the fractions may be wrong"
            }
        )));
    }
    for other in check.disagreements.iter().take(SHOWN) {
        text.push_str(&motion::paragraph(&format!(
            "start {}: {} in the census, {} on the exact flow{}",
            other.start,
            other.census,
            other.exact,
            if other.sensitive { ", sensitive" } else { "" }
        )));
    }
    if check.disagreements.len() > SHOWN {
        text.push_str(&motion::paragraph(&format!(
            "and {} more (--json has all)",
            check.disagreements.len() - SHOWN
        )));
    }
    text
}

/// What the fractions are of, and how much may have been missed.
fn unseen_paragraphs(found: &Attractors, unseen: &UnseenReport) -> String {
    let percent = |part: f64| number::significant(100.0 * part, 2);
    let mut text = motion::paragraph(&format!(
        "fractions are of starts drawn at every size from the resonant response (1) down to a thousandth of it, and of \
         no other set; motions that Newton met and no start went to have 0 %. {} came after the last new motion: with \
         95 % confidence less than {} % of such starts lead to motions that are not listed.{}",
        number::counted(unseen.starts, "start", "starts"),
        percent(unseen.fraction),
        match found.end {
            EndReport::AllStarts | EndReport::BoundMet | EndReport::Cancelled => String::new(),
            EndReport::MaxStarts { limit } => format!(
                " The census ended at its limit of {limit} starts, before the requested {} %.",
                percent(unseen.target)
            ),
            EndReport::MaxSteps { limit } => format!(
                " The census ended at its limit of {} million steps of the approximate flow (two evaluations \
                 of the force in the exact flow count as one), before the requested {} %.",
                limit / 1_000_000,
                percent(unseen.target)
            ),
            EndReport::MaxPeriods { limit } => format!(
                " The census ended at its limit of {limit} drive periods, before the requested {} %.",
                percent(unseen.target)
            ),
        }
    ));
    let mut table = Table::new([
        ("size of the starts", Align::Left),
        ("starts (%) to each", Align::Left),
    ]);
    for size in &found.sizes {
        let shares: Vec<String> = size
            .fractions
            .iter()
            .map(|f| number::significant(100.0 * f, 3))
            .collect();
        table.row([number::significant(size.scale, 3), shares.join("  ")]);
    }
    text.push_str(&table.render());
    text
}

/// Starts without a verdict, those with one reason together.
fn undecided(text: &mut String, found: &Attractors) {
    const SHOWN: usize = 5;
    if found.undecided.is_empty() {
        return;
    }
    let _ = writeln!(
        text,
        "\n  {}",
        style::bold(&format!(
            "undecided: {}",
            number::counted(found.undecided.len(), "start", "starts")
        ))
    );
    for start in found.undecided.iter().take(SHOWN) {
        text.push_str(&motion::paragraph(&format!(
            "start {}: {}",
            start.start, start.reason
        )));
    }
    if found.undecided.len() > SHOWN {
        text.push_str(&motion::paragraph(&format!(
            "and {} more (--json has all)",
            found.undecided.len() - SHOWN
        )));
    }
}

/// A theorem, or why there is none.
fn statement(proof: &ProofReport) -> String {
    let word = if proof.proved { "theorem: " } else { "" };
    format!("{word}{}", proof.statement)
}
