//! A page: its headings, links and formulas, and how it is written for mdBook.

use std::collections::HashMap;
use std::ops::Range;

use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};

use crate::formula::typeset;

/// A link or a picture.
pub(crate) struct Link {
    /// Where it leads, as written.
    pub(crate) target: String,
    /// The text that it stands in, brackets and all.
    range: Range<usize>,
}

/// What stands in a page.
pub(crate) struct Page {
    text: String,
    /// The names of its headings, by which a link finds them.
    pub(crate) anchors: Vec<String>,
    /// Links and pictures, in order.
    pub(crate) links: Vec<Link>,
    formulas: Vec<(Range<usize>, String, bool)>,
    /// Text in which a `$` was left that began no formula.
    strays: Vec<String>,
}

impl Page {
    pub(crate) fn read(text: String) -> Self {
        let options = Options::ENABLE_TABLES | Options::ENABLE_FOOTNOTES | Options::ENABLE_MATH;
        let (mut anchors, mut links) = (Vec::new(), Vec::new());
        let (mut formulas, mut strays) = (Vec::new(), Vec::new());
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
                Event::Start(Tag::CodeBlock(_)) => in_block = true,
                Event::End(TagEnd::CodeBlock) => in_block = false,
                // A sign that was escaped is meant.
                Event::Text(words)
                    if words.contains('$') && !in_block && !text[..range.start].ends_with('\\') =>
                {
                    strays.push(words.into_string());
                }
                Event::Text(words) | Event::Code(words) => {
                    if let Some(heading) = &mut heading {
                        heading.push_str(&words);
                    }
                }
                Event::InlineMath(formula) => formulas.push((range, formula.into_string(), false)),
                Event::DisplayMath(formula) => formulas.push((range, formula.into_string(), true)),
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
            formulas,
            strays,
        }
    }

    /// What cannot be typeset, each with its reason.
    pub(crate) fn unreadable(&self) -> impl Iterator<Item = (&str, String)> {
        let refused = self.formulas.iter().filter_map(|(_, formula, displayed)| {
            let error = typeset(formula, *displayed).err()?;
            Some((formula.as_str(), error))
        });
        let strays = self.strays.iter();
        refused.chain(strays.map(|text| (text.as_str(), "Markdown sees no formula in it".into())))
    }

    /// The page as mdBook gets it: formulas in MathML, and links where `moved` says.
    pub(crate) fn written(&self, moved: impl Fn(&str) -> Option<String>) -> String {
        let mut changes: Vec<(Range<usize>, String)> = Vec::new();
        for (range, formula, displayed) in &self.formulas {
            if let Ok(mathml) = typeset(formula, *displayed) {
                changes.push((range.clone(), mathml));
            }
        }
        for link in &self.links {
            let Some(target) = moved(&link.target) else {
                continue;
            };
            let whole = &self.text[link.range.clone()];
            // The target is the last thing in `[words](target)`; words may hold a picture.
            if let Some(at) = whole.rfind(&format!("({}", link.target)) {
                let start = link.range.start + at + 1;
                changes.push((start..start + link.target.len(), target));
            }
        }
        changes.sort_by_key(|(range, _)| range.start);
        let (mut text, mut done) = (String::with_capacity(self.text.len()), 0);
        for (range, new) in changes {
            text.push_str(&self.text[done..range.start]);
            text.push_str(&new);
            done = range.end;
        }
        text.push_str(&self.text[done..]);
        text
    }
}

/// The name by which a link finds a heading: as mdBook and the usual hosts make it.
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
        let text =
            "# A `b` c!\n\nSee [x](y/README.md#z), $a_1$ and\n\n```\n$ no [l](m)\n```\n\n# A b c\n";
        let page = Page::read(text.to_owned());
        assert_eq!(page.anchors, ["a-b-c", "a-b-c-1"]);
        assert_eq!(page.links.len(), 1);
        let written = page.written(|target| Some(target.replace("README", "index")));
        assert!(written.contains("[x](y/index.md#z), <math"), "{written}");
        assert!(written.contains("$ no [l](m)"), "{written}");
    }

    #[test]
    fn what_cannot_be_typeset_is_told() {
        let page = Page::read("$a$ and $\\nosuchcommand$, \\$5\n\n$$\na\n+ b\n$$\n".to_owned());
        let formulas: Vec<&str> = page.unreadable().map(|(formula, _)| formula).collect();
        // A line that begins with a plus is a list to Markdown, and both ends are strays.
        assert_eq!(formulas[0], "\\nosuchcommand");
        assert!(
            formulas[1..].iter().all(|text| text.contains('$')),
            "{formulas:?}"
        );
        assert!(formulas.len() > 1);
    }
}
