//! The documents of this repository: every page is in the summary, every link and anchor has a
//! target, every formula can be typeset.

#![expect(clippy::disallowed_methods, reason = "a folder of a test")]

use std::path::Path;

use nanotap::control::Control;
use nanotap_book::{Site, outdated_reference};
use nanotap_explorer::link::link;
use nanotap_paper::{Options, report};

#[test]
fn nothing_is_wrong_with_the_documents() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    // One fast section of the report represents all.
    let options = Options {
        only: vec!["eq14".into()],
        quick: true,
    };
    let report = report(&options, &Control::default()).unwrap();
    let site = Site::read(&root, &report).unwrap();
    let troubles = site.troubles();
    let lines: Vec<String> = troubles.iter().map(ToString::to_string).collect();
    assert!(troubles.is_empty(), "{}", lines.join("\n"));
    assert!(site.len() > 30, "only {} pages were found", site.len());
}

/// Every step of a tutorial opens in the page, with what its command changes.
#[test]
fn steps_of_tutorials_open_in_the_page() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let options = Options {
        only: vec!["eq14".into()],
        quick: true,
    };
    let report = report(&options, &Control::default()).unwrap();
    let folder = std::env::temp_dir().join(format!("nanotap-steps-{}", std::process::id()));
    Site::read(&root, &report).unwrap().write(&folder).unwrap();
    let page = |name: &str| std::fs::read_to_string(folder.join("docs").join(name)).unwrap();
    let case = |path: &str| {
        let text = std::fs::read_to_string(root.join("docs").join(path)).unwrap();
        link("../../../", &text)
    };
    for (name, file, changes) in [
        (
            "dynamicist",
            "cases/paper.toml",
            "&set.alpha3=0.02&set.omega=15.8",
        ),
        (
            "microscopist",
            "tutorials/polymer.toml",
            "&set.gap.tip=9.138%20nm",
        ),
    ] {
        let page = page(&format!("tutorials/{name}.md"));
        let opens = format!("```\n\n[Open this case]({}", case(file));
        let steps = page.matches("```console").count();
        assert_eq!(page.matches(&opens).count(), steps, "{name}");
        assert!(page.contains(&format!("{opens}{changes})")), "{name}");
    }
    assert!(!page("cases/noise.md").contains("[Open this case]"));
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn the_reference_says_what_the_program_s_tables_say() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let outdated = outdated_reference(&root, false).unwrap();
    assert!(
        outdated.is_empty(),
        "run `cargo xtask reference` for {}",
        outdated.join(", ")
    );
}

#[test]
fn what_is_wrong_is_told() {
    let root = std::env::temp_dir().join(format!("nanotap-book-{}", std::process::id()));
    let docs = root.join("docs");
    std::fs::create_dir_all(&docs).unwrap();
    for name in ["README", "ARCHITECTURE", "CONTRIBUTING", "CHANGELOG"] {
        std::fs::write(root.join(name).with_extension("md"), "# A title\n").unwrap();
    }
    let summary = "[a](../README.md)\n- [b](../ARCHITECTURE.md)\n- [c](../CONTRIBUTING.md)\n\
                   - [d](../CHANGELOG.md)\n- [e](gone.md)\n- [f](page.md)\n";
    std::fs::write(docs.join("SUMMARY.md"), summary).unwrap();
    let page =
        "[ok](../README.md#a-title) [no](../README.md#another) [gone](x.svg) $\\nosuchcommand$\n";
    std::fs::write(docs.join("page.md"), page).unwrap();
    std::fs::write(docs.join("forgotten.md"), "forgotten\n").unwrap();
    let options = Options {
        only: vec!["eq14".into()],
        quick: true,
    };
    let report = report(&options, &Control::default()).unwrap();
    let site = Site::read(&root, &report).unwrap();
    let troubles: Vec<String> = site
        .troubles()
        .iter()
        .map(ToString::to_string)
        .filter(|trouble| !trouble.starts_with("docs/reference/"))
        .collect();
    std::fs::remove_dir_all(&root).unwrap();
    let all = troubles.join("\n");
    assert_eq!(troubles.len(), 5, "{all}");
    for words in [
        "docs/SUMMARY.md: there is no page docs/gone.md",
        "docs/forgotten.md: is not in docs/SUMMARY.md",
        "docs/page.md: ../README.md#another names no heading",
        "docs/page.md: x.svg leads nowhere",
        "cannot be typeset",
    ] {
        assert!(all.contains(words), "{words} is not in\n{all}");
    }
}
