//! The report as a self-contained HTML page: pictures are embedded.

use std::fmt::Write as _;

use super::check::Check;
use super::section::{Section, Table};
use super::{PaperError, Report};

const STYLE: &str = "\
:root{color-scheme:light}
body{font:16px/1.5 system-ui,sans-serif;color:#1a1a1a;background:#fff;max-width:62rem;margin:2rem auto;padding:0 1rem}
h1{font-size:1.7rem;line-height:1.25}h2{font-size:1.3rem;margin-top:3rem;border-top:1px solid #ddd;padding-top:1rem}
table{border-collapse:collapse;font-size:.85rem;margin:1rem 0;width:100%}
th,td{text-align:left;vertical-align:top;padding:.3rem .6rem .3rem 0;border-bottom:1px solid #e4e4e4}
caption{text-align:left;font-weight:600;padding:.3rem 0}
figure{margin:1.5rem 0}figure svg{width:100%;height:auto}figcaption{font-size:.9rem;color:#333}
code{font:.8rem/1.4 ui-monospace,monospace;background:#f4f4f2;padding:.15rem .3rem;overflow-wrap:anywhere}
dl{margin:1rem 0;padding:.6rem 1rem;border-left:4px solid #bbb;background:#fafaf8}
dt{font-weight:600;font-size:.85rem;margin-top:.4rem}dd{margin:0}
.reproduced{border-color:#009e73}.differs{border-color:#d55e00}.ambiguous{border-color:#e69f00}
.verdict{font-weight:600;white-space:nowrap}.verdict.reproduced{color:#00714f}.verdict.differs{color:#a84800}.verdict.ambiguous{color:#8a5f00}
details summary{cursor:pointer;font-size:.9rem}nav a{margin-right:.8rem}
@media print{h2{break-after:avoid}figure,dl{break-inside:avoid}}
";

/// Formats the report as one HTML page.
pub(super) fn page(report: &Report) -> Result<String, PaperError> {
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>The intermittent contact of an AFM, computed again</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n"
    );
    page.push_str(&introduction(report));
    page.push_str(&overview(report));
    for section in &report.sections {
        page.push_str(&part(section)?);
    }
    page.push_str("</body>\n</html>\n");
    Ok(page)
}

fn introduction(report: &Report) -> String {
    let hurry = if report.quick {
        "<p><strong>Made with --quick: fewer initial states and parameter values, wider bounds.</strong></p>\n"
    } else {
        ""
    };
    format!(
        "<h1>“Multi-modal analysis on the intermittent contact dynamics of atomic force microscope”, reproduced</h1>\n\
         <p>J. Sound Vib. (2011). Figures 2e–17 and all numbers in the text: the statement of the paper, the result of \
         nanotap, the verdict, the evidence, and a command line that reproduces the result. The motion between contacts is \
         computed in closed form, and no contact can be missed, so the results do not depend on a time step. A \
         motion is called periodic only if Newton has found its orbit. No parameter was adjusted.</p>\n\
         <p><strong>{} statements: {}.</strong> Made by nanotap {}.</p>\n{hurry}",
        report.checks().count(),
        report.counts(),
        env!("CARGO_PKG_VERSION"),
    )
}

fn overview(report: &Report) -> String {
    let mut html = String::from(
        "<table>\n<caption>Every statement</caption>\n<tr><th>id</th><th>the paper</th><th>here</th><th>verdict</th></tr>\n",
    );
    for section in &report.sections {
        for check in &section.checks {
            let _ = writeln!(
                html,
                "<tr><td><a href=\"#check-{}\">{}</a></td><td>{}</td><td>{}</td><td class=\"verdict {v}\">{v}</td></tr>",
                escaped(&check.id),
                escaped(&check.id),
                escaped(&check.paper),
                escaped(&check.here),
                v = check.verdict.name(),
            );
        }
    }
    html.push_str("</table>\n");
    html
}

fn part(section: &Section) -> Result<String, PaperError> {
    let mut html = format!(
        "<section id=\"{}\">\n<h2>{}</h2>\n",
        section.id,
        escaped(section.title)
    );
    for text in &section.text {
        let _ = writeln!(html, "<p>{}</p>", escaped(text));
    }
    for picture in &section.pictures {
        let svg = picture
            .bare()
            .to_svg()
            .map_err(PaperError::failed(picture.name.clone()))?;
        // An XML declaration is not allowed inside a page.
        let svg = svg.find("<svg").map_or(svg.as_str(), |start| &svg[start..]);
        let _ = writeln!(
            html,
            "<figure>\n{svg}\n<figcaption><strong>{}.</strong> {} (<a href=\"{name}.svg\">SVG</a>, \
             <a href=\"{name}.png\">PNG</a>)</figcaption>\n</figure>",
            escaped(&picture.title),
            escaped(&picture.caption),
            name = picture.name,
        );
    }
    for check in &section.checks {
        html.push_str(&statement(check));
    }
    for table in &section.tables {
        html.push_str(&tabulated(table));
    }
    html.push_str("</section>\n");
    Ok(html)
}

fn statement(check: &Check) -> String {
    format!(
        "<dl class=\"{v}\" id=\"check-{id}\"><dt>The paper</dt><dd>{}</dd><dt>Here: <span class=\"verdict {v}\">{v}</span></dt>\
         <dd>{}</dd><dt>Evidence</dt><dd>{}</dd><dt>Run it again</dt><dd><code>{}</code></dd></dl>\n",
        escaped(&check.paper),
        escaped(&check.here),
        escaped(&check.evidence),
        escaped(&check.rerun),
        v = check.verdict.name(),
        id = escaped(&check.id),
    )
}

/// Tables with more rows than this are collapsed.
const MAX_OPEN_ROWS: usize = 24;

fn tabulated(table: &Table) -> String {
    let mut html = format!(
        "<table>\n<caption>{}</caption>\n<tr>",
        escaped(&table.caption)
    );
    for column in &table.columns {
        let _ = write!(html, "<th>{}</th>", escaped(column));
    }
    html.push_str("</tr>\n");
    for row in &table.rows {
        html.push_str("<tr>");
        for cell in row {
            let _ = write!(html, "<td>{}</td>", escaped(cell));
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</table>\n");
    if table.rows.len() > MAX_OPEN_ROWS {
        format!(
            "<details><summary>{} ({} rows)</summary>\n{html}</details>\n",
            escaped(&table.caption),
            table.rows.len()
        )
    } else {
        html
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::super::{About, Verdict};
    use super::*;

    #[test]
    fn what_is_written_cannot_break_the_page() {
        let check = Check {
            id: "a\"b".into(),
            paper: "x < y & z".into(),
            here: "|μ| > 1".into(),
            about: About::Motion,
            verdict: Verdict::Differs,
            evidence: String::new(),
            rerun: "nanotap --set a=<b>".into(),
        };
        let html = statement(&check);
        assert!(html.contains("x &lt; y &amp; z") && html.contains("|μ| &gt; 1"));
        assert!(html.contains("id=\"check-a&quot;b\"") && html.contains("--set a=&lt;b&gt;"));
    }
}
