//! `nanotap paper`: report, files and errors.

use crate::util::Folder;

#[test]
fn a_quick_part_of_the_report_is_written() {
    let folder = Folder::new();
    let run = folder.run(&[
        "paper", "--quick", "--json", "--out", "report", "--only", "eq25", "fig2e", "fig15",
    ]);
    let json = run.json();
    let checks = json["checks"].as_array().unwrap();
    assert!(checks.len() >= 6);
    for check in checks {
        let verdict = check["verdict"].as_str().unwrap();
        assert!(
            ["reproduced", "differs", "ambiguous"].contains(&verdict),
            "{check}"
        );
        for key in ["id", "paper", "here", "evidence", "rerun"] {
            assert!(!check[key].as_str().unwrap().is_empty(), "{key} of {check}");
        }
    }
    let read =
        |name: &str| std::fs::read_to_string(folder.path().join("report").join(name)).unwrap();
    let html = read("report.html");
    assert!(
        html.contains("<svg") && html.contains("fig15"),
        "the page contains the figures"
    );
    assert!(read("report.md").contains("| eq25 |"));
    for picture in json["pictures"].as_array().unwrap() {
        assert!(
            folder
                .path()
                .join(picture.as_str().unwrap())
                .metadata()
                .unwrap()
                .len()
                > 1000
        );
    }
    let saved: serde_json::Value = serde_json::from_str(&read("checks.json")).unwrap();
    assert_eq!(saved, json["checks"]);
}

#[test]
fn unknown_sections_and_folders_are_refused() {
    let folder = Folder::new();
    folder
        .run(&["paper", "--only", "fgi4"])
        .refused(&["fgi4", "did you mean `fig4`?"]);
    folder.write("taken", "a file");
    let run = folder.run(&["paper", "--quick", "--only", "eq23", "--out", "taken"]);
    assert_eq!(run.code, 1);
    assert!(run.stderr.contains("taken"), "{}", run.stderr);
}
