//! How an error is shown at the terminal: its options as flags, its places in the case file drawn.

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use nanotap::ErrorKind;
use nanotap::error::{ErrorPlace, ErrorProblem, SourceText};

use crate::{progress, style};

pub(crate) use nanotap::Error as Failure;

/// Says on standard error what went wrong; returns the exit code: 130 once Ctrl-C stopped the
/// program, 2 for bad input, else 1.
pub(crate) fn report(mut error: Failure) -> u8 {
    let code = match error.kind {
        _ if progress::is_stopped() => progress::INTERRUPTED,
        ErrorKind::BadInput => 2,
        _ => 1,
    };
    // What was stopped did not fail for the reason that it ended with.
    if progress::is_stopped() && error.kind == ErrorKind::Numerics {
        error = Failure::stopped();
    }
    let error = error.written(flag);
    // A snippet of the case file, or a key of --set, is drawn with its help.
    let of_case = |problem: &ErrorProblem| {
        matches!(problem.place, ErrorPlace::Span(_) | ErrorPlace::Override(_))
    };
    let text = if error.source.is_some() || error.problems.iter().any(of_case) {
        drawn(&error)
    } else {
        error.problems.iter().map(plain).collect()
    };
    anstream::eprint!("{}", style::safe(&text));
    code
}

/// The flag of an option; measured data are an argument without a flag.
pub(crate) fn flag(option: &str) -> String {
    match option {
        "data" => "DATA".to_owned(),
        _ => format!("--{}", option.replace('_', "-")),
    }
}

/// A problem without a text that it points into.
fn plain(problem: &ErrorProblem) -> String {
    let what = match &problem.place {
        // A message that begins with the value goes on where the flag was typed.
        ErrorPlace::Option(name) if !problem.message.starts_with(char::is_alphabetic) => {
            format!("{} {}", flag(name), problem.message)
        }
        ErrorPlace::Option(name) => format!("{}: {}", flag(name), problem.message),
        _ => problem.message.clone(),
    };
    match &problem.remedy {
        Some(remedy) => format!("{}\n  {}\n", style::error(&what), style::help(remedy)),
        None => format!("{}\n", style::error(&what)),
    }
}

/// All problems of a case, each with its line of the file.
fn drawn(error: &Failure) -> String {
    let renderer = Renderer::styled();
    let drawn: Vec<String> = error
        .problems
        .iter()
        .map(|problem| {
            let title = Level::ERROR.primary_title(title(problem, error.source.as_ref()));
            let group = match (&problem.place, &error.source) {
                (ErrorPlace::Span(span), Some(source)) => {
                    let label = (!problem.label.is_empty()).then_some(problem.label.as_str());
                    let annotation = AnnotationKind::Primary.span(span.clone()).label(label);
                    let snippet = Snippet::source(&source.text)
                        .path(&source.name)
                        .annotation(annotation);
                    title.element(snippet)
                }
                _ => Group::with_title(title),
            };
            // What stands under the place in the file already need not be said again.
            let shown = matches!(problem.place, ErrorPlace::Span(_)) && error.source.is_some();
            let help = problem
                .remedy
                .as_ref()
                .filter(|help| !shown || **help != problem.label);
            let group = match help {
                Some(help) => group.element(Level::HELP.message(help.as_str())),
                None => group,
            };
            renderer.render(&[group])
        })
        .collect();
    format!("{}\n", drawn.join("\n\n"))
}

fn title(problem: &ErrorProblem, source: Option<&SourceText>) -> String {
    match (&problem.place, source) {
        (ErrorPlace::Override(written), _) => format!("--set {written}: {}", problem.message),
        (ErrorPlace::Whole, Some(source)) => format!("{}: {}", source.name, problem.message),
        _ => problem.message.clone(),
    }
}
