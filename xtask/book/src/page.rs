//! A page: its headings, links and formulas, and its output for mdBook.

use std::collections::HashMap;
use std::ops::Range;

use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};

use crate::formula::typeset;

/// A link or a picture.
pub(crate) struct Link {
    /// Target of the link as written in the page.
    pub(crate) target: String,
    /// Byte range of the link in the text, brackets included.
    range: Range<usize>,
}

/// A parsed page with its links, anchors and formulas.
pub(crate) struct Page {
    text: String,
    /// Anchors of the headings, in order.
    pub(crate) anchors: Vec<String>,
    /// Links and pictures, in order.
    pub(crate) links: Vec<Link>,
    /// The byte range of each block of commands, fences included.
    consoles: Vec<Range<usize>>,
    /// The MathML of each formula and the byte range that it replaces.
    formulas: Vec<(Range<usize>, String)>,
    /// Formulas that cannot be typeset and texts with an unmatched `$`, each with the reason.
    pub(crate) unreadable: Vec<(String, String)>,
}

impl Page {
    pub(crate) fn read(text: String) -> Self {
        let options = Options::ENABLE_TABLES | Options::ENABLE_FOOTNOTES | Options::ENABLE_MATH;
        let (mut anchors, mut links) = (Vec::new(), Vec::new());
        let (mut formulas, mut unreadable) = (Vec::new(), Vec::new());
        let mut consoles = Vec::new();
        let mut in_block = false;
        let mut heading: Option<String> = None;
        let mut times: HashMap<String, usize> = HashMap::new();
        for (event, range) in Parser::new_ext(&text, options).into_offset_iter() {
            match event {
                Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
                Event::End(TagEnd::Heading(_)) => {
                    let name = anchor(&heading.take().unwrap_or_default());
                    let before = times.entry(name.clone()).or_default();
                    anchors.push(match *before {
                        0 => name,
                        again => format!("{name}-{again}"),
                    });
                    *before += 1;
                }
                Event::Start(Tag::CodeBlock(kind)) => {
                    in_block = true;
                    if matches!(kind, CodeBlockKind::Fenced(of) if &*of == "console") {
                        consoles.push(range);
                    }
                }
                Event::End(TagEnd::CodeBlock) => in_block = false,
                // An escaped character is literal.
                Event::Text(words)
                    if words.contains('$') && !in_block && !text[..range.start].ends_with('\\') =>
                {
                    let reason = "Markdown sees no formula in it".to_owned();
                    unreadable.push((words.into_string(), reason));
                }
                Event::Text(words) | Event::Code(words) => {
                    if let Some(heading) = &mut heading {
                        heading.push_str(&words);
                    }
                }
                Event::InlineMath(ref formula) | Event::DisplayMath(ref formula) => {
                    match typeset(formula, matches!(event, Event::DisplayMath(_))) {
                        Ok(mathml) => formulas.push((range, mathml)),
                        Err(error) => unreadable.push((formula.to_string(), error)),
                    }
                }
                Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                    links.push(Link {
                        target: dest_url.into_string(),
                        range,
                    });
                }
                _ => {}
            }
        }
        Self {
            text,
            anchors,
            links,
            consoles,
            formulas,
            unreadable,
        }
    }

    /// The page for mdBook: formulas in MathML, link targets replaced by `moved`, what `further` gives
    /// after a link, and what `done` gives, as a paragraph of its own, after a block of commands.
    pub(crate) fn written(
        &self,
        moved: impl Fn(&str) -> Option<String>,
        further: impl Fn(&str) -> Option<String>,
        done: impl Fn(&str) -> Option<String>,
    ) -> String {
        let mut changes = self.formulas.clone();
        for block in &self.consoles {
            if let Some(words) = done(&self.text[block.clone()]) {
                changes.push((block.end..block.end, format!("\n\n{words}")));
            }
        }
        for link in &self.links {
            if let Some(words) = further(&link.target) {
                changes.push((link.range.end..link.range.end, words));
            }
            let Some(target) = moved(&link.target) else {
                continue;
            };
            let whole = &self.text[link.range.clone()];
            // The target is the last part of `[words](target)`; words may contain a picture.
            if let Some(at) = whole.rfind(&format!("({}", link.target)) {
                let start = link.range.start + at + 1;
                changes.push((start..start + link.target.len(), target));
            }
        }
        changes.sort_by_key(|(range, _)| range.start);
        let (mut text, mut at) = (String::with_capacity(self.text.len()), 0);
        for (range, new) in changes {
            text.push_str(&self.text[at..range.start]);
            text.push_str(&new);
            at = range.end;
        }
        text.push_str(&self.text[at..]);
        text
    }
}

/// The anchor of a heading, as generated by mdBook and the usual hosts.
fn anchor(heading: &str) -> String {
    heading
        .trim()
        .chars()
        .filter_map(|sign| match sign {
            _ if sign.is_alphanumeric() || sign == '_' || sign == '-' => {
                Some(sign.to_lowercase().collect::<String>())
            }
            _ if sign.is_whitespace() => Some("-".to_owned()),
            _ => None,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::Page;

    #[test]
    fn formulas_and_links_are_found_and_changed_where_they_stand() {
        let text = "# A `b` c!\n\nSee [x](y/README.md#z), $a_1$ and\n\n```\n$ no [l](m)\n```\n\n# A b c\n\n\
             ```console\n$ do\ndone\n```\n\nend\n";
        let page = Page::read(text.to_owned());
        assert_eq!(page.anchors, ["a-b-c", "a-b-c-1"]);
        assert_eq!(page.links.len(), 1);
        let further = |target: &str| target.ends_with("#z").then(|| " (more)".to_owned());
        let done = |block: &str| block.contains("$ do\n").then(|| "next".to_owned());
        let written = page.written(
            |target| Some(target.replace("README", "index")),
            further,
            done,
        );
        assert!(
            written.contains("[x](y/index.md#z) (more), <math"),
            "{written}"
        );
        assert!(written.contains("$ no [l](m)"), "{written}");
        assert!(written.ends_with("done\n```\n\nnext\n\nend\n"), "{written}");
    }

    #[test]
    fn what_cannot_be_typeset_is_told() {
        let page = Page::read("$a$ and $\\nosuchcommand$, \\$5\n\n$$\na\n+ b\n$$\n".to_owned());
        let formulas: Vec<&str> = page
            .unreadable
            .iter()
            .map(|(formula, _)| formula.as_str())
            .collect();
        // In Markdown a line that begins with a plus is a list item, and both `$` remain unmatched.
        assert_eq!(formulas[0], "\\nosuchcommand");
        assert!(
            formulas[1..].iter().all(|text| text.contains('$')),
            "{formulas:?}"
        );
        assert!(formulas.len() > 1);
    }
}
